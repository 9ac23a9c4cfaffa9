//! Road edges, which are where the union of the drivable areas ends, but not where the map does.
//!
//! Areas are cut into tiles that meet in the middle of roads, and off at the rim of the map. A stretch of an outline is an edge of the road unless
//! another area lies just beyond it, or a lane leads across.

use world::geometry::{Bounds, Point, Point3, SegmentGrid, polygon_contains};
use world::map::Lane;

use crate::budget::{Budget, TooLarge};

/// Outlines are looked at in pieces of this length (m) at most.
const PIECE: f64 = 2.0;

/// So far beyond an outline (m) it is looked for another area.
const BEYOND: f64 = 0.1;

/// A lane that ends this near (m) leads across: cuts are where lanes end.
const TOUCH: f64 = 0.3;

/// Pieces whose directions differ by less than this (sine; 2 degrees) are of one straight line.
const STRAIGHT: f64 = 0.035;

/// A lane leads across a line at more than 45 degrees (sine); at less it cuts a corner.
const ACROSS: f64 = 0.7;

/// So many corners are looked at for all pieces: 500 times what a real map needs.
const MOST_LOOKS: usize = 500_000_000;

/// An outline as it is gone round, the area on its left.
struct Ring {
    corners: Vec<Point>,
    bounds: Bounds,
}

impl Ring {
    fn of(outline: &[Point3]) -> Self {
        let mut corners: Vec<Point> = outline.iter().map(|point| point.xy()).collect();
        corners.dedup();
        if corners.len() > 1 && corners.first() == corners.last() {
            corners.pop();
        }
        let twice_area: f64 = edges(&corners).map(|(from, to)| from.cross(to)).sum();
        if twice_area < 0.0 {
            corners.reverse();
        }
        Self { bounds: Bounds::of(corners.iter().copied()), corners }
    }

    fn holds(&self, point: Point) -> bool {
        self.bounds.hold(point) && polygon_contains(self.corners.iter().copied(), point)
    }
}

fn edges(corners: &[Point]) -> impl Iterator<Item = (Point, Point)> {
    corners.iter().zip(corners.iter().cycle().skip(1)).map(|(from, to)| (*from, *to))
}

/// A piece of an outline.
#[derive(Clone, Copy)]
struct Piece {
    from: Point,
    to: Point,
    is_edge: bool,
}

/// The road edges, as lines with the road on their left.
pub(super) fn road_edges(areas: &[Vec<Point3>], lanes: &[Lane], budget: &Budget) -> Result<Vec<Vec<Point3>>, TooLarge> {
    let usable = |point: &Point3| world::scene::is_in_range(point.x) && world::scene::is_in_range(point.y);
    let rings: Vec<Ring> = areas
        .iter()
        .filter(|area| area.iter().all(usable))
        .map(|area| Ring::of(area))
        .filter(|ring| ring.corners.len() > 2)
        .collect();
    let sound = lanes.iter().enumerate().filter(|(_, lane)| lane.centerline.iter().all(usable));
    let chains = sound.map(|(place, lane)| (place as u32, lane.centerline.iter().map(|point| point.xy())));
    let grid = SegmentGrid::new(chains, 5.0);
    let looks = Budget::new(MOST_LOOKS);
    let mut lines = Vec::new();
    for (place, ring) in rings.iter().enumerate() {
        let mut pieces = pieces(ring, budget)?;
        for piece in &mut pieces {
            let beyond = piece.beyond();
            for (other, area) in rings.iter().enumerate().filter(|(other, _)| *other != place) {
                looks.spend(1 + if area.bounds.hold(beyond) { area.corners.len() } else { 0 })?;
                piece.is_edge &= other == place || !area.holds(beyond);
            }
        }
        cut_across(&mut pieces, lanes, &grid, &looks)?;
        lines.extend(joined(&pieces));
    }
    Ok(lines)
}

impl Piece {
    fn direction(&self) -> Point {
        let (step, length) = (self.to - self.from, self.from.distance(self.to));
        Point::new(step.x / length, step.y / length)
    }

    fn middle(&self) -> Point {
        Point::new(0.5 * (self.from.x + self.to.x), 0.5 * (self.from.y + self.to.y))
    }

    /// A point just outside: to the right.
    fn beyond(&self) -> Point {
        let (middle, direction) = (self.middle(), self.direction());
        Point::new(middle.x + BEYOND * direction.y, middle.y - BEYOND * direction.x)
    }

    /// Whether a step of a lane's centre line, which may be its last or first, leads across.
    fn is_crossed(&self, from: Point, to: Point, is_end: bool) -> bool {
        let (along, step) = (self.to - self.from, to - from);
        if along.cross(step).abs() < ACROSS * along.norm() * step.norm() {
            return false;
        }
        let sides =
            |one: Point, vector: Point, a: Point, b: Point| vector.cross(a - one) * vector.cross(b - one) <= 0.0;
        let touches = |point: Point| {
            world::geometry::Segment { start: self.from, end: self.to }.nearest_to(point).distance_squared
                <= TOUCH * TOUCH
        };
        (sides(self.from, along, from, to) && sides(from, step, self.from, self.to))
            || (is_end && (touches(from) || touches(to)))
    }
}

fn pieces(ring: &Ring, budget: &Budget) -> Result<Vec<Piece>, TooLarge> {
    let mut pieces = Vec::with_capacity(ring.corners.len());
    for (from, to) in edges(&ring.corners) {
        let parts = (from.distance(to) / PIECE).ceil().max(1.0);
        budget.spend(parts as usize)?;
        let at =
            |part: f64| Point::new(from.x + (to.x - from.x) * part / parts, from.y + (to.y - from.y) * part / parts);
        pieces.extend((0..parts as usize).map(|part| {
            let end = if part + 1 == parts as usize { to } else { at(part as f64 + 1.0) };
            Piece { from: at(part as f64), to: end, is_edge: true }
        }));
    }
    Ok(pieces)
}

/// Takes away straight lines that a lane leads across, as a whole: a cut goes from curb to curb.
fn cut_across(pieces: &mut [Piece], lanes: &[Lane], grid: &SegmentGrid, looks: &Budget) -> Result<(), TooLarge> {
    let straight_on = |one: &Piece, next: &Piece| {
        let (one, next) = (one.direction(), next.direction());
        one.cross(next).abs() < STRAIGHT && one.dot(next) > 0.0
    };
    for run in pieces.chunk_by_mut(straight_on) {
        let (mut is_crossed, mut looked) = (false, 0);
        for piece in run.iter().filter(|piece| piece.is_edge) {
            let reach = 0.5 * piece.from.distance(piece.to) + TOUCH;
            grid.for_each_about(piece.middle(), reach, |about| {
                looked += 1;
                let step = grid.segment(about.segment);
                let line = &lanes[grid.payload(about.segment) as usize].centerline;
                let is_end = |point: Option<&Point3>, end: Point| point.is_some_and(|point| point.xy() == end);
                let is_end = is_end(line.first(), step.start) || is_end(line.last(), step.end);
                is_crossed |= piece.is_crossed(step.start, step.end, is_end);
            });
            looks.spend(std::mem::take(&mut looked))?;
        }
        if is_crossed {
            run.iter_mut().for_each(|piece| piece.is_edge = false);
        }
    }
    Ok(())
}

/// The edges among the pieces of a ring, as lines.
fn joined(pieces: &[Piece]) -> Vec<Vec<Point3>> {
    // Begin behind a gap, so that no line is cut where the ring begins.
    let begin = pieces.iter().position(|piece| !piece.is_edge).map_or(0, |gap| gap + 1);
    let mut lines: Vec<Vec<Point3>> = Vec::new();
    let mut goes_on = false;
    for piece in pieces[begin..].iter().chain(&pieces[..begin]) {
        match lines.last_mut().filter(|_| goes_on) {
            _ if !piece.is_edge => {}
            Some(line) => line.push(flat(piece.to)),
            None => lines.push(vec![flat(piece.from), flat(piece.to)]),
        }
        goes_on = piece.is_edge;
    }
    lines
}

fn flat(point: Point) -> Point3 {
    Point3::new(point.x, point.y, 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outline(corners: &[(f64, f64)]) -> Vec<Point3> {
        corners.iter().map(|(x, y)| Point3::new(*x, *y, 7.0)).collect()
    }

    fn lane(from: (f64, f64), to: (f64, f64)) -> Lane {
        Lane { centerline: outline(&[from, to]), ..Lane::default() }
    }

    fn edges_of(areas: &[Vec<Point3>], lanes: &[Lane]) -> Vec<Vec<Point3>> {
        road_edges(areas, lanes, &Budget::of_a_scene()).unwrap()
    }

    fn length(lines: &[Vec<Point3>]) -> f64 {
        lines.iter().flat_map(|line| line.windows(2)).map(|pair| pair[0].xy().distance(pair[1].xy())).sum()
    }

    #[test]
    fn an_area_alone_is_gone_round_with_the_road_on_the_left() {
        let square = outline(&[(0.0, 0.0), (0.0, 10.0), (10.0, 10.0), (10.0, 0.0), (0.0, 0.0)]);
        let [ring] = &edges_of(&[square], &[])[..] else { panic!("one ring") };
        assert_eq!((ring.first(), length(std::slice::from_ref(ring))), (ring.last(), 40.0));
        let twice_area: f64 = ring.windows(2).map(|pair| pair[0].xy().cross(pair[1].xy())).sum();
        assert!((twice_area - 200.0).abs() < 1e-9 && ring.iter().all(|point| point.z == 0.0));
    }

    #[test]
    fn where_areas_meet_or_overlap_is_no_edge() {
        let one = outline(&[(0.0, 0.0), (10.0, 0.0), (10.0, 8.0), (0.0, 8.0)]);
        // The border has a corner more on the other side.
        let two = outline(&[(10.0, 0.0), (20.0, 0.0), (20.0, 8.0), (10.0, 8.0), (10.0, 3.0)]);
        assert!((length(&edges_of(&[one.clone(), two], &[])) - 56.0).abs() < 1e-9);
        let over = outline(&[(8.0, 0.0), (20.0, 0.0), (20.0, 8.0), (8.0, 8.0)]);
        assert!((length(&edges_of(&[one, over], &[])) - 60.0).abs() < 1e-9, "a curb of both is there twice");
    }

    #[test]
    fn where_a_lane_leads_out_the_map_ends_and_not_the_road() {
        let road = outline(&[(0.0, 0.0), (50.0, 0.0), (50.0, 8.0), (0.0, 8.0)]);
        let along = |y: f64| lane((0.0, y), (50.0, y));
        assert_eq!(edges_of(std::slice::from_ref(&road), &[along(2.0), along(6.0)]).len(), 2);
        // One that ends before, and one that runs along the curb, or cuts over it at a small angle, leave it alone.
        let others = [lane((10.0, 4.0), (49.0, 4.0)), lane((5.0, 0.1), (45.0, 0.1)), lane((5.0, 1.0), (45.0, -0.5))];
        assert!((length(&edges_of(&[road], &others)) - 116.0).abs() < 1e-9);
    }

    #[test]
    fn outlines_of_nothing_give_nothing() {
        let line = outline(&[(0.0, 0.0), (5.0, 0.0), (5.0, 0.0)]);
        let wild = outline(&[(0.0, 0.0), (f64::NAN, 0.0), (5.0, 5.0)]);
        assert!(edges_of(&[line, wild, Vec::new()], &[]).is_empty());
        let vast = outline(&[(0.0, 0.0), (1e7, 0.0), (0.0, 1e7)]);
        assert_eq!(road_edges(&[vast], &[], &Budget::of_a_scene()), Err(TooLarge));
    }
}
