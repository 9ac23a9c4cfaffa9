//! Which lanes an agent is on, and which lie beside those (`network.md` 3.1, 3.2).

use world::geometry::{Pose, SegmentGrid, angle_difference, wrap_angle};
use world::map::Map;
use world::map_matching::LanePoints;

use super::lane_points::PreparedLane;
use super::settings::Settings;

/// How far a lane may be at first, and how much farther each time that there is none (m).
const RADIUS: f64 = 3.5;
/// The same for the difference in heading: 10 degrees.
const TOLERANCE: f64 = 10.0 * std::f64::consts::PI / 180.0;
/// The same as [`RADIUS`] for pedestrians, whose heading does not count.
const PEDESTRIAN_RADIUS: f64 = 5.0;
/// After so many times every heading will do.
const ANY_HEADING: f64 = 18.0;
/// Metres that a radian of difference in heading counts for when lanes are put in order.
const METERS_PER_RADIAN: f64 = 5.0;

/// A lane and the point of it to start from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LaneStart {
    pub lane: usize,
    pub point: usize,
    /// How far from the agent it is, by distance and heading.
    pub cost: f64,
}

/// The lanes of a scene in grids.
#[derive(Clone, Debug)]
pub(super) struct LaneSearch {
    points: LanePoints,
    /// Lanes of two points and more.
    segments: SegmentGrid,
}

impl LaneSearch {
    pub fn new(map: &Map) -> Self {
        let lanes = map.lanes.iter().enumerate().filter(|(_, lane)| lane.centerline.len() > 1);
        let chains = lanes.map(|(index, lane)| (index as u32, lane.centerline.iter().map(|point| point.xy())));
        Self { points: LanePoints::new(map, |_| true), segments: SegmentGrid::new(chains, 8.0) }
    }

    /// The lanes that an agent is on; in the map's order.
    pub fn current(
        &self,
        pose: Pose,
        is_pedestrian: bool,
        lanes: &[PreparedLane],
        settings: Settings,
    ) -> Vec<LaneStart> {
        let mut found = if is_pedestrian { self.near_pedestrian(pose) } else { self.near_other(pose, settings) };
        found.sort_by_key(|start| start.lane);
        if settings == Settings::Mended && is_pedestrian {
            found.iter_mut().for_each(|start| start.point = nearest_point(&lanes[start.lane], pose));
        }
        found
    }

    fn near_pedestrian(&self, pose: Pose) -> Vec<LaneStart> {
        let Some(nearest) = self.segments.nearest(pose.position(), f64::INFINITY) else { return Vec::new() };
        let mut times = (nearest.distance() / PEDESTRIAN_RADIUS).floor().max(1.0);
        loop {
            let radius = PEDESTRIAN_RADIUS * times;
            let mut found: Vec<LaneStart> = Vec::new();
            self.segments.for_each_near(pose.position(), radius, |segment| {
                let distance = self.segments.segment(segment).nearest_to(pose.position()).distance_squared.sqrt();
                let lane = self.segments.payload(segment) as usize;
                if distance >= radius {
                    return;
                }
                match found.iter_mut().find(|start| start.lane == lane) {
                    Some(start) => start.cost = start.cost.min(distance),
                    None => found.push(LaneStart { lane, point: 0, cost: distance }),
                }
            });
            if !found.is_empty() {
                return found;
            }
            times += 1.0;
        }
    }

    /// Authors: the first point that will do. Mended: the nearest one of those.
    fn near_other(&self, pose: Pose, settings: Settings) -> Vec<LaneStart> {
        let Some(nearest) = self.points.nearest(pose, f64::INFINITY, std::f64::consts::PI) else { return Vec::new() };
        let first = (nearest.distance / RADIUS).floor().max(1.0);
        let mut times = first;
        loop {
            let (radius, tolerance) = (RADIUS * times, TOLERANCE * times);
            let mut found: Vec<(LaneStart, f64)> = Vec::new();
            self.points.for_each_near(pose.position(), radius, |point| {
                // Theirs are in [-pi, pi): where an agent's heading has wound up, it counts which of the two west has.
                let heading = wrap_angle(self.points.heading(&point));
                let difference = match settings {
                    Settings::Authors => authors_difference(pose.heading, heading),
                    Settings::Mended => angle_difference(pose.heading, heading).abs(),
                };
                if difference > tolerance {
                    return;
                }
                let cost = point.distance + METERS_PER_RADIAN * difference.abs();
                let start = LaneStart { lane: point.lane, point: point.point, cost };
                let Some(known) = found.iter_mut().find(|(known, _)| known.lane == point.lane) else {
                    found.push((start, point.distance));
                    return;
                };
                let is_better = match settings {
                    Settings::Authors => point.point < known.0.point,
                    Settings::Mended => (point.distance, point.point) < (known.1, known.0.point),
                };
                if is_better {
                    *known = (start, point.distance);
                }
            });
            // The last condition is for a heading that is no number, which cannot come in.
            if !found.is_empty() || times > first + 2.0 * ANY_HEADING {
                return found.into_iter().map(|(start, _)| start).collect();
            }
            times += 1.0;
        }
    }
}

/// The lanes beside `current`: for each of those the last on its left, the last on its right.
pub(super) fn beside(current: &[LaneStart], pose: Pose, lanes: &[PreparedLane]) -> Vec<LaneStart> {
    let mut found: Vec<LaneStart> = Vec::new();
    for start in current {
        for side in &lanes[start.lane].neighbors {
            let fits = |(lane, first, last): &&(usize, usize, usize)| {
                *first <= start.point && start.point <= *last && current.iter().all(|other| other.lane != *lane)
            };
            let Some((lane, ..)) = side.iter().rev().find(fits) else { continue };
            if found.iter().all(|other| other.lane != *lane) {
                let point = nearest_point(&lanes[*lane], pose);
                let at = lanes[*lane].points[point].pose;
                let turn = angle_difference(pose.heading, at.heading).abs();
                let cost = at.position().distance(pose.position()) + METERS_PER_RADIAN * turn;
                found.push(LaneStart { lane: *lane, point, cost });
            }
        }
    }
    found
}

/// The first of equally near ones.
fn nearest_point(lane: &PreparedLane, pose: Pose) -> usize {
    let mut best = (0, f64::INFINITY);
    for (index, point) in lane.points.iter().enumerate() {
        let distance = point.pose.position().distance(pose.position());
        if distance < best.1 {
            best = (index, distance);
        }
    }
    best.0
}

/// Right only where both headings are within pi of 0; beyond, it may be negative, and everything fits.
fn authors_difference(a: f64, b: f64) -> f64 {
    let difference = (a - b).abs();
    if difference > std::f64::consts::PI { std::f64::consts::TAU - difference } else { difference }
}
