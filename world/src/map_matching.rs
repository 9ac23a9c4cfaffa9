//! Which point of which lane a pose is on.

use std::sync::OnceLock;

use crate::geometry::{Point, Point3, PointGrid, Pose, angle_difference};
use crate::map::Map;

/// How far a lane point's heading may differ from the pose's in the authors' rule (rad): 10 degrees, inclusive.
pub const HEADING_TOLERANCE: f64 = 10.0 * std::f64::consts::PI / 180.0;

/// All points of all lanes, lanes in the map's order, with their headings, in a grid.
#[derive(Clone, Debug, PartialEq)]
pub struct LanePoints {
    /// For each lane the number of its first point; one more than there are lanes.
    firsts: Vec<usize>,
    /// For each point its lane's index.
    lanes: Vec<u32>,
    /// The direction (rad) from each to the next, as far as it was asked for.
    headings: Vec<OnceLock<f64>>,
    heights: Vec<f64>,
    /// For each point its distance (m) along its lane.
    stations: Vec<f64>,
    grid: PointGrid,
}

/// A lane whose ends are this near to each other (m), and point the same way within 60 degrees, is closed.
const CLOSED_WITHIN: f64 = 2.0;
const CLOSED_COSINE: f64 = 0.5;

/// A point of a lane that a pose is matched to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LaneMatch {
    /// The lane, by its index in [`Map::lanes`].
    pub lane: usize,
    /// The point, by its index in the lane's center line.
    pub point: usize,
    /// Distance to it (m).
    pub distance: f64,
}

impl LanePoints {
    /// The points of every lane of `map` that `accept` takes, by index.
    #[must_use]
    pub fn new(map: &Map, accept: impl Fn(usize) -> bool) -> Self {
        let (mut firsts, mut lanes) = (vec![0], Vec::new());
        let (mut points, mut heights, mut stations) = (Vec::new(), Vec::new(), Vec::new());
        for (index, lane) in map.lanes.iter().enumerate() {
            if accept(index) {
                points.extend(lane.centerline.iter().map(|point| point.xy()));
                heights.extend(lane.centerline.iter().map(|point| point.z));
                stations.extend(lane_stations(&lane.centerline));
                lanes.resize(points.len(), index as u32);
            }
            firsts.push(points.len());
        }
        let headings = vec![OnceLock::new(); points.len()];
        Self { firsts, lanes, headings, heights, stations, grid: PointGrid::new(points, 4.0) }
    }

    /// The authors' rule: of all points whose heading differs by at most [`HEADING_TOLERANCE`] the nearest; the first of
    /// equals. No distance is too far, and no lane graph is looked at.
    ///
    /// Their heading difference |a - b|, above pi replaced by 2 pi - |a - b|, is right only where both lie within pi of
    /// zero; a pose whose heading has wound up further may match nothing or a wrong lane, here as there.
    #[must_use]
    pub fn authors_match(&self, pose: Pose) -> Option<LaneMatch> {
        let accept = |number: usize| authors_difference(pose.heading, self.heading_at(number)) <= HEADING_TOLERANCE;
        let (number, distance) = self.grid.nearest_where(pose.position(), f64::INFINITY, accept)?;
        Some(self.matched(number, distance))
    }

    /// The nearest point within `radius` (m) whose heading differs by at most `tolerance` (rad, on the circle); the first of
    /// equals.
    #[must_use]
    pub fn nearest(&self, pose: Pose, radius: f64, tolerance: f64) -> Option<LaneMatch> {
        let accept = |number: usize| angle_difference(pose.heading, self.heading_at(number)).abs() <= tolerance;
        let (number, distance) = self.grid.nearest_where(pose.position(), radius, accept)?;
        Some(self.matched(number, distance))
    }

    /// The same of the points at about the height `ground` (m): nearer to it than `storey`.
    #[must_use]
    pub fn nearest_on_level(
        &self,
        pose: Pose,
        radius: f64,
        tolerance: f64,
        ground: f64,
        storey: f64,
    ) -> Option<LaneMatch> {
        let accept = |number: usize| {
            (self.heights[number] - ground).abs() <= storey
                && angle_difference(pose.heading, self.heading_at(number)).abs() <= tolerance
        };
        let (number, distance) = self.grid.nearest_where(pose.position(), radius, accept)?;
        Some(self.matched(number, distance))
    }

    /// Calls `visit` with each lane point within `radius` metres, in no order to rely on.
    pub fn for_each_near(&self, point: Point, radius: f64, mut visit: impl FnMut(LaneMatch)) {
        self.grid.for_each_near(point, radius, |number| {
            visit(self.matched(number, point.distance(self.grid.points()[number])));
        });
    }

    /// The heading of a lane at one of its points (rad).
    #[must_use]
    pub fn heading(&self, matched: &LaneMatch) -> f64 {
        self.heading_at(self.firsts[matched.lane] + matched.point)
    }

    /// The point itself, with its height.
    #[must_use]
    pub fn point(&self, matched: &LaneMatch) -> Point3 {
        let number = self.firsts[matched.lane] + matched.point;
        let Point { x, y } = self.grid.points()[number];
        Point3::new(x, y, self.heights[number])
    }

    /// Distance (m) along its lane, from the first point.
    #[must_use]
    pub fn station(&self, matched: &LaneMatch) -> f64 {
        self.stations[self.firsts[matched.lane] + matched.point]
    }

    /// Length (m) of a lane that ends where it begins, on the same level and in the same direction; none of one that does not.
    #[must_use]
    pub fn closed_length(&self, lane: usize) -> Option<f64> {
        let last = self.firsts[lane + 1].checked_sub(1).filter(|last| *last > self.firsts[lane])?;
        let first = self.firsts[lane];
        let gap = self.grid.points()[first].distance(self.grid.points()[last]);
        let climb = (self.heights[first] - self.heights[last]).abs();
        let turn = Point::unit(self.heading_at(first)).dot(Point::unit(self.heading_at(last)));
        let length = self.stations[last] + gap;
        // A lane that is as short as the gap has no round to it.
        let is_closed = gap.max(climb) <= CLOSED_WITHIN && turn >= CLOSED_COSINE && length > 4.0 * CLOSED_WITHIN;
        is_closed.then_some(length)
    }

    /// The direction from a point to the next; the last one's is that of the one before, a single point's is 0.
    fn heading_at(&self, number: usize) -> f64 {
        *self.headings[number].get_or_init(|| {
            let lane = self.lanes[number] as usize;
            let points = &self.grid.points()[self.firsts[lane]..self.firsts[lane + 1]];
            let from = (number - self.firsts[lane]).min(points.len().saturating_sub(2));
            points.get(from + 1).map_or(0.0, |next| (*next - points[from]).heading())
        })
    }

    fn matched(&self, number: usize, distance: f64) -> LaneMatch {
        let lane = self.lanes[number] as usize;
        LaneMatch { lane, point: number - self.firsts[lane], distance }
    }
}

/// The distance of each point along the lane (m).
fn lane_stations(points: &[Point3]) -> impl Iterator<Item = f64> {
    let mut station = 0.0;
    points.iter().enumerate().map(move |(index, point)| {
        station += index.checked_sub(1).map_or(0.0, |before| points[before].xy().distance(point.xy()));
        station
    })
}

fn authors_difference(a: f64, b: f64) -> f64 {
    let difference = (a - b).abs();
    if difference > std::f64::consts::PI { std::f64::consts::TAU - difference } else { difference }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::map::{Lane, MapId};

    fn map(lanes: &[Vec<(f64, f64)>]) -> Map {
        let lane = |(index, points): (usize, &Vec<(f64, f64)>)| Lane {
            id: MapId(index as i64 + 1),
            centerline: points.iter().map(|(x, y)| Point3::new(*x, *y, 0.0)).collect(),
            ..Lane::default()
        };
        Map { lanes: lanes.iter().enumerate().map(lane).collect(), ..Map::default() }
    }

    /// The direction from each point to the next; the last one's is repeated, a single point's is 0.
    fn lane_headings(points: &[Point3]) -> Vec<f64> {
        let mut headings: Vec<f64> = points.windows(2).map(|pair| (pair[1].xy() - pair[0].xy()).heading()).collect();
        headings.push(headings.last().copied().unwrap_or(0.0));
        headings
    }

    fn points(lanes: &[Vec<(f64, f64)>]) -> LanePoints {
        LanePoints::new(&map(lanes), |_| true)
    }

    #[test]
    fn the_nearer_lane_of_another_direction_is_not_taken() {
        let lanes = points(&[vec![(0.0, 0.0), (0.0, 9.0)], vec![(0.0, 5.0), (9.0, 5.0)]]);
        let east = lanes.authors_match(Pose::new(0.0, 1.0, 0.1)).unwrap();
        assert_eq!((east.lane, east.point, east.distance), (1, 0, 4.0));
        assert_eq!(lanes.authors_match(Pose::new(0.0, 1.0, 0.8)), None);
    }

    #[test]
    fn a_shared_point_goes_to_the_lane_that_comes_first() {
        let lanes = points(&[vec![(5.0, 0.0), (9.0, 0.0)], vec![(0.0, 0.0), (5.0, 0.0)]]);
        let shared = lanes.authors_match(Pose::new(5.0, 1.0, 0.0)).unwrap();
        assert_eq!((shared.lane, shared.point), (0, 0));
    }

    #[test]
    fn a_lane_of_one_point_looks_east() {
        let lanes = points(&[vec![(3.0, 3.0)]]);
        assert!(lanes.authors_match(Pose::new(0.0, 0.0, 0.1)).is_some());
        assert!(lanes.authors_match(Pose::new(0.0, 0.0, 1.0)).is_none());
    }

    #[test]
    fn a_heading_wound_up_past_a_full_turn_misleads_the_authors_rule_but_not_ours() {
        let lanes = points(&[vec![(0.0, 0.0), (9.0, 0.0)]]);
        let wound_up = Pose::new(1.0, 0.0, 4.0 * std::f64::consts::PI);
        // |a - b| = 4 pi becomes -2 pi, which passes for any tolerance; three turns pass for a lane across as well.
        assert!(lanes.authors_match(Pose::new(1.0, 0.0, 2.0 * std::f64::consts::PI + 1.5)).is_some());
        assert!(lanes.nearest(Pose::new(1.0, 0.0, 2.0 * std::f64::consts::PI + 1.5), 9.0, 0.5).is_none());
        assert!(lanes.nearest(wound_up, 9.0, 0.5).is_some());
    }

    #[test]
    fn a_map_without_lanes_matches_nothing() {
        assert_eq!(points(&[]).authors_match(Pose::default()), None);
    }

    proptest! {
        #[test]
        fn the_grid_matches_as_the_authors_search_of_all_points_does(
            lanes in prop::collection::vec(prop::collection::vec((-9_i32..9, -9_i32..9), 1..8), 0..6),
            (x, y, heading) in (-12_i32..12, -12_i32..12, -7.0..7.0),
        ) {
            let lanes: Vec<Vec<(f64, f64)>> =
                lanes.iter().map(|l| l.iter().map(|(x, y)| (f64::from(*x), f64::from(*y))).collect()).collect();
            let pose = Pose::new(f64::from(x), f64::from(y), heading);
            let mut best: Option<LaneMatch> = None;
            for (lane, line) in map(&lanes).lanes.iter().enumerate() {
                for (point, heading) in lane_headings(&line.centerline).into_iter().enumerate() {
                    let distance = pose.position().distance(line.centerline[point].xy());
                    let fits = authors_difference(pose.heading, heading) <= HEADING_TOLERANCE;
                    if fits && best.is_none_or(|best| distance < best.distance) {
                        best = Some(LaneMatch { lane, point, distance });
                    }
                }
            }
            prop_assert_eq!(points(&lanes).authors_match(pose), best);
        }
    }
}
