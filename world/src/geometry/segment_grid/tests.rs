use proptest::prelude::*;

use super::*;

fn grid(chains: &[&[(f64, f64)]], cell: f64) -> SegmentGrid {
    let points = |chain: &&[(f64, f64)]| chain.iter().map(|(x, y)| Point::new(*x, *y)).collect::<Vec<_>>();
    SegmentGrid::new(chains.iter().enumerate().map(|(index, chain)| (index as u32, points(chain))), cell)
}

#[test]
fn left_of_a_road_edge_is_positive() {
    let edge = grid(&[&[(0.0, 0.0), (10.0, 0.0), (10.0, 10.0)]], 2.0);
    let at = |x, y| edge.nearest(Point::new(x, y), 100.0).unwrap();
    assert_eq!(at(5.0, 2.0).signed_distance, 2.0);
    assert_eq!(at(5.0, -2.0).signed_distance, -2.0);
    assert_eq!(at(13.0, -4.0).signed_distance, -5.0);
    assert_eq!(at(12.0, 5.0).signed_distance, -2.0);
}

#[test]
fn chains_that_meet_exactly_are_judged_as_one() {
    let one = grid(&[&[(0.0, 0.0), (10.0, 0.0), (0.0, 1.0)]], 2.0);
    let two = grid(&[&[(10.0, 0.0), (0.0, 1.0)], &[(0.0, 0.0), (10.0, 0.0)]], 2.0);
    let tip = Point::new(11.0, 0.05);
    assert_eq!(one.nearest(tip, 5.0).unwrap().signed_distance, two.nearest(tip, 5.0).unwrap().signed_distance);
    assert!(one.nearest(tip, 5.0).unwrap().signed_distance < 0.0);
}

#[test]
fn a_closed_chain_has_no_free_end() {
    let island = grid(&[&[(0.0, 0.0), (0.0, 2.0), (2.0, 2.0), (2.0, 0.0), (0.0, 0.0)]], 1.0);
    let corner = island.nearest(Point::new(-1.0, -1.0), 5.0).unwrap();
    assert!(corner.signed_distance > 0.0 && !corner.beyond_end);
}

#[test]
fn beyond_the_end_of_an_open_chain_is_said() {
    let edge = grid(&[&[(0.0, 0.0), (10.0, 0.0)]], 2.0);
    assert!(edge.nearest(Point::new(11.0, 0.5), 5.0).unwrap().beyond_end);
    assert!(edge.nearest(Point::new(-1.0, 0.5), 5.0).unwrap().beyond_end);
    assert!(!edge.nearest(Point::new(9.0, 0.5), 5.0).unwrap().beyond_end);
}

#[test]
fn nothing_is_near_in_an_empty_grid() {
    let empty = grid(&[], 1.0);
    assert!(empty.is_empty() && empty.nearest(Point::new(0.0, 0.0), 1e9).is_none());
    empty.for_each_near(Point::new(0.0, 0.0), 10.0, |_| unreachable!());
}

#[test]
fn coordinates_that_are_no_numbers_find_nothing_and_end() {
    let edge = grid(&[&[(0.0, 0.0), (10.0, 0.0)]], 2.0);
    assert!(edge.nearest(Point::new(f64::NAN, 0.0), 1e3).is_none());
    assert!(edge.nearest(Point::new(f64::INFINITY, 0.0), 1e3).is_none());
}

#[test]
fn a_far_outlier_makes_cells_larger_instead_of_more() {
    let wide = grid(&[&[(0.0, 0.0), (1.0, 0.0)], &[(1e7, 1e7), (1e7, 1e7 - 1.0)], &[(0.0, 0.0), (1e7, 1e7)]], 1.0);
    assert!(wide.cells.count() <= 513 * 513);
    assert_eq!(wide.nearest(Point::new(1e7 + 2.0, 1e7), 5.0).unwrap().payload, 1);
}

#[test]
fn long_segments_across_each_other_make_cells_larger_instead_of_fuller() {
    let zigzag: Vec<(f64, f64)> =
        (0..2_001).map(|k| if k % 2 == 0 { (0.0, f64::from(k)) } else { (1e7, 1e7) }).collect();
    let dense = grid(&[&zigzag], 1.0);
    assert!(dense.cells.member_count() <= 16 * 2_000 + 65_536, "{}", dense.cells.member_count());
    assert_eq!(dense.nearest(Point::new(-2.0, 1_000.0), 5.0).unwrap().distance(), 2.0);
}

fn chains() -> impl Strategy<Value = Vec<Vec<(f64, f64)>>> {
    prop::collection::vec(prop::collection::vec((-40.0..40.0, -40.0..40.0), 1..6), 1..12)
}

proptest! {
    #[test]
    fn the_grid_finds_what_a_search_of_all_segments_finds(
        chains in chains(), (x, y) in (-60.0..60.0, -60.0..60.0), cell in 0.5..30.0, radius in 0.0..80.0,
    ) {
        let slices: Vec<&[(f64, f64)]> = chains.iter().map(Vec::as_slice).collect();
        let grid = grid(&slices, cell);
        let point = Point::new(x, y);
        let distance = |index: usize| grid.segment(index).nearest_to(point).distance_squared;
        let mut brute: Option<usize> = None;
        for index in 0..grid.len() {
            if distance(index) <= radius * radius && brute.is_none_or(|best| distance(index) < distance(best)) {
                brute = Some(index);
            }
        }
        prop_assert_eq!(grid.nearest(point, radius).map(|nearest| nearest.segment), brute);
        let mut near = Vec::new();
        grid.for_each_near(point, radius, |index| near.push(index));
        near.sort_unstable();
        let all: Vec<usize> = (0..grid.len()).filter(|index| distance(*index) <= radius * radius).collect();
        prop_assert_eq!(near, all);
    }
}
