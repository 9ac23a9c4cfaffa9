use std::f64::consts::PI;

use proptest::prelude::*;
use world::geometry::{OrientedBox, Point, Pose};
use world::vehicle::{BicycleModel, VehicleState};

use super::*;
use crate::constants::{HAND_TUNED, Term};
use crate::{Controls, Evaluation, Inputs, Settings, Vehicle};

/// A vehicle, a bicycle or a pedestrian somewhere: pose, length, width.
fn any_box() -> impl Strategy<Value = (Pose, f64, f64)> {
    (-9.0..9.0, -9.0..9.0, -PI..PI, 0.4..13.0, 0.4..2.7)
        .prop_map(|(x, y, heading, length, width)| (Pose::new(x, y, heading), length, width))
}

fn point_segment(p: Point, (a, b): (Point, Point)) -> f64 {
    let along = b - a;
    let share = ((p - a).dot(along) / along.dot(along)).clamp(0.0, 1.0);
    p.distance(a + along * share)
}

/// Distance between two boxes (m): 0 where they overlap, else that of a corner of one to a side of the other.
fn exact(a: &OrientedBox, b: &OrientedBox) -> f64 {
    if world::geometry::boxes_overlap(a, b) {
        return 0.0;
    }
    let (a, b) = (a.corners(), b.corners());
    let mut least = f64::INFINITY;
    for (corners, sides) in [(&a, &b), (&b, &a)] {
        for corner in corners {
            for i in 0..4 {
                least = least.min(point_segment(*corner, (sides[i], sides[(i + 1) % 4])));
            }
        }
    }
    least
}

/// Distance between the discs of two boxes at their nearest (m); negative where they overlap.
fn of_discs(a: &(Pose, f64, f64), b: &(Pose, f64, f64)) -> f64 {
    let [(own, u), (other, v)] = [a, b].map(|(pose, length, width)| {
        let disc = Disc::of(*length, *width);
        (disc, disc.axis((libm::cos(pose.heading), libm::sin(pose.heading))))
    });
    let offset = (a.0.x - b.0.x, a.0.y - b.0.y);
    let (p, q) = nearest_pair(offset, u, v, 1e-12);
    let apart = (offset.0 + p * u.0 - q * v.0, offset.1 + p * u.1 - q * v.1);
    libm::hypot(apart.0, apart.1) - own.radius - other.radius
}

proptest! {
    #[test]
    fn discs_are_an_eighth_of_both_widths_off_the_boxes_at_most(a in any_box(), b in any_box()) {
        let boxes = [a, b].map(|(pose, length, width)| OrientedBox::new(pose, length, width));
        let (exact, discs) = (exact(&boxes[0], &boxes[1]), of_discs(&a, &b));
        let bound = (a.1.min(a.2) + b.1.min(b.2)) / 8.0 + 1e-6;
        prop_assert!(discs <= exact + bound, "{discs} {exact} {bound}");
        prop_assert!(exact == 0.0 || exact - bound <= discs, "{discs} {exact} {bound}");
    }

    #[test]
    fn no_other_pair_of_discs_is_nearer(
        offset in (-3.0..3.0, -3.0..3.0), u in (-2.0..2.0, -2.0..2.0), v in (-2.0..2.0, -2.0..2.0), slide in 0.001..0.5,
        other in prop::collection::vec((-1.0..1.0, -1.0..1.0), 50),
    ) {
        let squared = |(p, q): (f64, f64)| {
            let (x, y): (f64, f64) = (offset.0 + p * u.0 - q * v.0, offset.1 + p * u.1 - q * v.1);
            x * x + y * y + slide * (p * p + q * q)
        };
        let nearest: (f64, f64) = nearest_pair(offset, u, v, slide);
        prop_assert!(nearest.0.abs() <= 1.0 && nearest.1.abs() <= 1.0);
        for (p, q) in other {
            let (p, q): (f64, f64) = (p, q);
            // Near, and far.
            let beside = ((nearest.0 + 0.01 * p).clamp(-1.0, 1.0), (nearest.1 + 0.01 * q).clamp(-1.0, 1.0));
            prop_assert!(squared(nearest) <= squared((p, q)) + 1e-12 && squared(nearest) <= squared(beside) + 1e-12);
        }
    }

    #[test]
    fn boxes_that_overlap_by_more_than_0_3_m_cost_something(a in any_box(), b in any_box()) {
        // Brought together until they do. Less may cost nothing where corners of two buses meet: the discs leave out an eighth of both widths.
        const OVERLAP: f64 = 0.3;
        let at = |share: f64| (Pose::new(share * a.0.x, share * a.0.y, a.0.heading), a.1, a.2);
        let other = (Pose::new(0.0, 0.0, b.0.heading), b.1, b.2);
        let overlap = |share: &f64| {
            let [a, b] = [at(*share), other].map(|(pose, length, width)| OrientedBox::new(pose, length - OVERLAP, width - OVERLAP));
            world::geometry::boxes_overlap(&a, &b)
        };
        let (pose, length, width) = at((0..=100).rev().map(|k| 0.01 * f64::from(k)).find(overlap).unwrap());
        let state = VehicleState { x: pose.x, y: pose.y, heading: pose.heading, speed: 0.0 };
        // But for who stands in the AV's back.
        prop_assert!(pose.x > 0.0 || rows_of_a_meeting((state, length, width), other).is_some());
    }
}

/// The first row between an AV that stands at a pose and a neighbor that stands at another, on a line along x.
fn rows_of_a_meeting(av: (VehicleState, f64, f64), neighbor: (Pose, f64, f64)) -> Option<(SafetyRow, f64)> {
    let positions = [(neighbor.0.x, neighbor.0.y); STEPS];
    let headings = [neighbor.0.heading; STEPS];
    let at = evaluate(
        av,
        &[Neighbor {
            length: neighbor.1,
            width: neighbor.2,
            positions: &positions,
            headings: &headings,
            deviations: &[],
        }],
    );
    at.safety().first().map(|row| (*row, at.rows.safety[0]))
}

/// The AV drives straight on at its speed.
fn evaluate((state, length, width): (VehicleState, f64, f64), neighbors: &[Neighbor<'_>]) -> Evaluation {
    let line: Vec<f64> = (0..1200).map(|k| 0.1 * f64::from(k) - 30.0).collect();
    let zero = vec![0.0; line.len()];
    let neighbors: Vec<_> = neighbors.iter().copied().map(Some).collect();
    let problem = Problem::new(&Inputs {
        line_x: &line,
        line_y: &zero,
        line_heading: &zero,
        speed_target: 10.0,
        speed_targets: None,
        stop_distance: None,
        av: Vehicle { state, length, width },
        present: None,
        neighbors: &neighbors,
        weights: HAND_TUNED,
    });
    let mut at = Evaluation::default();
    at.evaluate(&problem.unwrap(), &Settings::contingency(BicycleModel::default()).costing, &Controls::ZERO);
    at
}

const CAR: (f64, f64) = (5.0, 2.0);

fn driving(speed: f64) -> (VehicleState, f64, f64) {
    (VehicleState { x: 0.0, y: 0.0, heading: 0.0, speed }, CAR.0, CAR.1)
}

/// Rows of an AV at this speed and a car that begins there and has this velocity: (look, value).
fn rows_of(speed: f64, (x, y): (f64, f64), velocity: (f64, f64), deviations: &[(f64, f64)]) -> Vec<(usize, f64)> {
    let place = |t: usize| 0.1 * (t + 1) as f64;
    let positions: [_; STEPS] = std::array::from_fn(|t| (x + velocity.0 * place(t), y + velocity.1 * place(t)));
    let car = Neighbor { length: CAR.0, width: CAR.1, positions: &positions, headings: &[], deviations };
    let at = evaluate(driving(speed), &[car]);
    at.safety().iter().map(|row| row.key).zip(at.rows.safety).collect()
}

#[test]
fn behind_another_car_the_row_is_about_what_lacks_to_the_gap() {
    for (gap, wanted) in [(5.5, 0.0), (4.0, 1.0), (2.0, 3.0), (0.0, 5.0)] {
        let (_, value) = rows_of(8.0, (5.0 + gap, 0.0), (8.0, 0.0), &[]).first().copied().unwrap_or_default();
        assert!((value - wanted).abs() < 0.7, "{gap} m: {value}");
    }
}

#[test]
fn beside_another_car_the_gap_across_counts() {
    assert_eq!(rows_of(8.0, (0.0, 2.6), (8.0, 0.0), &[]), []);
    assert!(rows_of(8.0, (0.0, 2.3), (8.0, 0.0), &[]).len() == LANE_STEPS);
    // Parked, and passed with less room than wanted: while it is beside.
    let parked = rows_of(8.0, (20.0, 2.3), (0.0, 0.0), &[]);
    assert!(parked.iter().all(|(_, value)| *value < 1.0), "{parked:?}");
    assert!(parked.len() < 10 && parked[0].0 > 6, "{parked:?}");
}

#[test]
fn who_comes_from_behind_in_the_lane_does_not_count_and_who_merges_does() {
    assert_eq!(rows_of(2.0, (-15.0, 0.0), (10.0, 0.0), &[]), []);
    let merges = rows_of(5.0, (-3.0, 3.5), (7.0, -1.0), &[]);
    assert!(!merges.is_empty());
}

#[test]
fn driving_through_a_car_costs_more_the_further() {
    let through = rows_of(5.0, (12.0, 0.2), (0.0, 0.0), &[]);
    let values: Vec<f64> = through.iter().map(|(_, value)| *value).collect();
    assert!(values.windows(2).all(|pair| pair[0] < pair[1]), "{values:?}");
    assert!(values[0] < 1.0 && values[values.len() - 1] > 15.0, "{values:?}");
}

#[test]
fn who_is_uncertain_counts_from_further_off() {
    let uncertain = [(0.0, 0.4); STEPS];
    assert_eq!(rows_of(8.0, (0.0, 2.6), (8.0, 0.0), &[]), []);
    assert_eq!(rows_of(8.0, (0.0, 2.6), (8.0, 0.0), &uncertain).len(), LANE_STEPS);
    // That of a car that crosses is across its own way: along the AV's.
    let crossing = [(0.0, 3.0); STEPS];
    let (certain, uncertain) =
        (rows_of(0.0, (10.0, -10.0), (0.0, 5.0), &[]), rows_of(0.0, (10.0, -10.0), (0.0, 5.0), &crossing));
    assert!(uncertain.len() > certain.len(), "{uncertain:?} {certain:?}");
}

#[test]
fn turning_away_from_a_car_beside_lowers_its_row() {
    let beside = |heading: f64| {
        let (mut state, length, width) = driving(0.0);
        state.heading = heading;
        rows_of_a_meeting((state, length, width), (Pose::new(4.0, 2.3, 0.0), CAR.0, CAR.1)).unwrap()
    };
    let (row, value) = beside(0.0);
    // Its front is beside the other's rear: to the right is away.
    assert!(row.turn < 0.0 && beside(-0.05).1 < value && value < beside(0.05).1);
    let slope = (beside(1e-6).1 - beside(-1e-6).1) / 2e-6;
    assert!((slope + row.turn).abs() < 1e-6, "{slope} {}", row.turn);
}

#[test]
fn without_boxes_the_headings_and_deviations_do_not_matter() {
    let positions = [(12.0, 0.0); STEPS];
    let plain = Neighbor { length: 4.0, width: 2.0, positions: &positions, headings: &[], deviations: &[] };
    let told = Neighbor { headings: &[1.0; STEPS], deviations: &[(1.0, 1.0); STEPS], ..plain };
    let strict = Settings::strict(BicycleModel::default()).costing;
    let objective = |neighbor: Neighbor<'_>| {
        let (state, length, width) = driving(8.0);
        let problem = Problem::new(&Inputs {
            line_x: &[0.0, 100.0],
            line_y: &[0.0; 2],
            line_heading: &[0.0; 2],
            speed_target: 10.0,
            speed_targets: None,
            stop_distance: None,
            av: Vehicle { state, length, width },
            present: None,
            neighbors: &[Some(neighbor)],
            weights: HAND_TUNED,
        });
        let mut at = Evaluation::default();
        at.evaluate(&problem.unwrap(), &strict, &Controls::ZERO);
        (at.objective.to_bits(), at.terms[Term::Safety as usize])
    };
    assert!(objective(plain).1 > 0.0 || objective(plain) == objective(told));
    assert_eq!(objective(plain), objective(told));
}
