//! How ways are made: of where a track went in the log, and on along the lanes when the log ends; or along lanes alone, for who changes his.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::way::{LaneStretch, SPACING, Way, even};
use crate::geometry::{Point, Point3};
use crate::lane_graph::LaneGraph;
use crate::map::{LaneNeighbor, Map, MapId, RoadLineKind};
use crate::map_matching::{LaneMatch, LanePoints};
use crate::route::{Lanes, POSE_SPACING, Place, drive};
use crate::scene::{AgentKind, AgentState};

/// How far a way reaches back from where its agent is (m).
const BEHIND: f64 = 10.0;
/// As many samples of the way.
pub const BEHIND_SAMPLES: usize = (BEHIND / SPACING) as usize;

/// Who goes less far in the rest of the log (m), and is slower when it ends (m/s), stands, as far as anybody can tell.
const LEAST_WAY: f64 = 1.0;
const LEAST_SPEED: f64 = 1.0;

/// Who ends beside the middle of a lane is led there over this distance (m).
const MERGING: f64 = 20.0;

/// Who ends farther than this (m) from the middle of a lane is beside it.
const BESIDE: f64 = 2.0;

/// Whoever is on a lane, or on the one beside it, has its middle within this distance (m).
const NEAR: f64 = 8.0;

/// A lane that is to be changed to must lead on this far (m).
const LEAST_BESIDE: f64 = 40.0;

/// Makes ways on a map.
#[derive(Clone, Debug)]
pub struct Ways {
    map: Arc<Map>,
    indices: BTreeMap<MapId, usize>,
    graph: LaneGraph,
    points: LanePoints,
    /// Those of no lane: for who walks.
    nowhere: LanePoints,
}

impl Ways {
    /// The ways of `map`.
    #[must_use]
    pub fn on(map: &Arc<Map>) -> Self {
        let points = LanePoints::new(map, |lane| map.lanes[lane].kind.is_drivable());
        Self {
            map: Arc::clone(map),
            indices: map.lane_indices(),
            graph: LaneGraph::new(map),
            points,
            nowhere: LanePoints::new(map, |_| false),
        }
    }

    fn lanes(&self) -> Lanes<'_> {
        Lanes { map: &self.map, graph: &self.graph, points: &self.points }
    }

    /// The way of a track from its state number `now` on: where it goes in the log, and from there along the straightest lanes. It begins
    /// 10 m back. None of who stands, or drives backwards, for the rest of the log.
    #[must_use]
    pub fn of_log(&self, states: &[Option<AgentState>], now: usize, kind: AgentKind) -> Option<Way> {
        let here = (*states.get(now)?)?;
        let behind = states[..now]
            .iter()
            .rposition(|state| state.is_some_and(|state| state.position().distance(here.position()) >= BEHIND));
        let points = if kind == AgentKind::Pedestrian { &self.nowhere } else { &self.points };
        let from = behind.unwrap_or(0);
        let places = forward(&drive(&states[from..], &self.graph, points));
        let last = places.last()?;
        // Who still goes when the log ends goes on; a track that is lost before says nothing of where it goes then.
        let speed = |state: AgentState| state.velocity().dot(Point::unit(state.heading));
        let goes_on = states.last()?.is_some_and(|last| speed(last) >= LEAST_SPEED);
        if !goes_on && last.driven - driven(&states[from..=now]) < LEAST_WAY {
            return None;
        }
        let mut course: Vec<(Point3, Option<usize>)> = places.iter().map(on_its_place).collect();
        self.lead_on(last, &mut course);
        self.way(&course)
    }

    /// Leads a course on from its last place. Beside the middle of the lane it is led there, not thrown; beside the lane it stays there.
    fn lead_on(&self, last: &Place, course: &mut Vec<(Point3, Option<usize>)>) {
        let (from, mut direction) = (last.pose.position(), Point::unit(last.pose.heading));
        let leads_on =
            |point: Point, led: f64| led > MERGING || (point - from).dot(Point::unit(last.pose.heading)) > 0.0;
        let (ahead, _) = self.lanes().ahead(last);
        let Some(mut before) = ahead.first().map(|mark| mark.waypoint.point.xy()) else { return };
        let aside = last.lane.map_or(0.0, |_| direction.cross(from - before));
        let mut led = 0.0;
        for mark in ahead {
            let (middle, z) = (mark.waypoint.point.xy(), mark.waypoint.point.z);
            let step = middle - before;
            if step.norm() > 0.0 {
                direction = step * (1.0 / step.norm());
            }
            led += step.norm();
            before = middle;
            let rest = if aside.abs() > BESIDE { 1.0 } else { (1.0 - led / MERGING).max(0.0) };
            let point = middle + Point::new(-direction.y, direction.x) * (aside * rest * rest);
            if leads_on(point, led) {
                course.push((Point3::new(point.x, point.y, z), mark.waypoint.lane));
            }
        }
    }

    /// The way from a point of a lane on, along the straightest lanes.
    #[must_use]
    pub fn along(&self, from: LaneMatch) -> Option<Way> {
        let (marks, _) = self.lanes().onward(from);
        let course: Vec<_> = marks.iter().map(|mark| (mark.waypoint.point, mark.waypoint.lane)).collect();
        self.way(&course)
    }

    /// The way from where `lane` is nearest to `point` on, along the straightest lanes.
    #[must_use]
    pub fn along_lane(&self, lane: MapId, point: Point) -> Option<Way> {
        self.along(self.nearest_on(*self.indices.get(&lane)?, point)?)
    }

    /// The lanes beside `lane`, left before right, that cars may change to from `point`: no solid line lies between, and they lead on far
    /// enough. For each the point of it that is nearest.
    pub fn beside(&self, lane: MapId, point: Point) -> impl Iterator<Item = LaneMatch> {
        let index = self.indices.get(&lane).copied();
        let own = index
            .map(|index| &self.map.lanes[index])
            .filter(|own| !(own.left_neighbors.is_empty() && own.right_neighbors.is_empty()));
        let on = own.and_then(|_| self.nearest_on(index?, point));
        let sides = own.zip(on).into_iter().flat_map(|(own, on)| {
            let at = on.point as i32;
            let open = move |neighbor: &&LaneNeighbor| {
                let is_along = (neighbor.self_start_index..=neighbor.self_end_index).contains(&at);
                let is_solid = neighbor.boundaries.iter().any(|boundary| {
                    (boundary.lane_start_index..=boundary.lane_end_index).contains(&at) && is_solid(boundary.kind)
                });
                is_along && !is_solid
            };
            own.left_neighbors.iter().filter(open).chain(own.right_neighbors.iter().filter(open))
        });
        sides.filter_map(move |neighbor| {
            let beside = self.nearest_on(*self.indices.get(&neighbor.lane)?, point)?;
            let rest = self.graph.length(beside.lane) - self.points.station(&beside);
            (rest >= LEAST_BESIDE).then_some(beside)
        })
    }

    /// The point of a drivable lane that is nearest; the first of equals.
    fn nearest_on(&self, lane: usize, point: Point) -> Option<LaneMatch> {
        let mut nearest: Option<LaneMatch> = None;
        self.points.for_each_near(point, NEAR, |on| {
            let is_nearer = |so_far: LaneMatch| (on.distance, on.point) < (so_far.distance, so_far.point);
            if on.lane == lane && nearest.is_none_or(is_nearer) {
                nearest = Some(on);
            }
        });
        nearest
    }

    /// Where a lane's point lies, and its direction (rad).
    #[must_use]
    pub fn place(&self, on: &LaneMatch) -> (Point, f64) {
        (self.points.point(on).xy(), self.points.heading(on))
    }

    /// The speed limit (m/s) of a lane, where the map knows it.
    #[must_use]
    pub fn speed_limit(&self, lane: MapId) -> Option<f64> {
        self.map.lanes[*self.indices.get(&lane)?].speed_limit()
    }

    fn way(&self, course: &[(Point3, Option<usize>)]) -> Option<Way> {
        let points: Vec<Point3> = course.iter().map(|(point, _)| *point).collect();
        let mut lanes: Vec<LaneStretch> = Vec::new();
        let mut station = 0.0;
        for (index, (point, lane)) in course.iter().enumerate() {
            station += index.checked_sub(1).map_or(0.0, |before| points[before].xy().distance(point.xy()));
            let lane = lane.map(|lane| self.map.lanes[lane].id);
            if lanes.last().is_none_or(|last| last.lane != lane) {
                lanes.push(LaneStretch { from: station, lane });
            }
        }
        Way::new(&even(&points), lanes)
    }
}

fn on_its_place(place: &Place) -> (Point3, Option<usize>) {
    (Point3::new(place.pose.x, place.pose.y, place.ground), place.lane.map(|on| on.lane))
}

fn is_solid(kind: RoadLineKind) -> bool {
    use RoadLineKind::{SolidDoubleWhite, SolidDoubleYellow, SolidSingleWhite, SolidSingleYellow};
    matches!(kind, SolidSingleWhite | SolidDoubleWhite | SolidSingleYellow | SolidDoubleYellow)
}

/// The distance (m) that [`Place::driven`] has at the last of these states.
fn driven(states: &[Option<AgentState>]) -> f64 {
    let mut last: Option<Point> = None;
    let mut driven = 0.0;
    for state in states.iter().flatten() {
        let moved = last.map_or(0.0, |last| last.distance(state.position()));
        if last.is_none() || moved >= POSE_SPACING {
            driven += moved;
            last = Some(state.position());
        }
    }
    driven
}

/// The places that lead on: who backs up and goes on again has a way that does not.
fn forward(places: &[Place]) -> Vec<Place> {
    let mut kept: Vec<Place> = Vec::new();
    for place in places {
        let leads_on = |last: &Place| {
            let step = place.pose.position() - last.pose.position();
            let forward = Point::unit(last.pose.heading) + Point::unit(place.pose.heading);
            step.dot(forward) > 0.5 * step.norm() * forward.norm()
        };
        if kept.last().is_none_or(leads_on) {
            kept.push(*place);
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::Lane;

    /// Lane 1 for 100 m to the east, lane 2 on from there.
    fn road() -> Arc<Map> {
        let line = |from: i32| (0..=200).map(|k| Point3::new(f64::from(from) + 0.5 * f64::from(k), 0.0, 0.0)).collect();
        let lanes = vec![
            Lane { id: MapId(1), centerline: line(0), exits: vec![MapId(2)], ..Lane::default() },
            Lane { id: MapId(2), centerline: line(100), entries: vec![MapId(1)], ..Lane::default() },
        ];
        Arc::new(Map { lanes, ..Map::default() })
    }

    /// Somebody half a metre beside the lane's middle, who goes `speed` (m/s).
    fn log(speed: impl Fn(usize) -> f64, steps: usize) -> Vec<Option<AgentState>> {
        let mut x = 20.0;
        let state = |step| {
            x += 0.1 * speed(step);
            Some(AgentState { x, y: 0.5, velocity_x: speed(step), length: 4.5, width: 2.0, ..AgentState::default() })
        };
        (0..steps).map(state).collect()
    }

    #[test]
    fn a_way_says_where_and_not_when() {
        let ways = Ways::on(&road());
        let even = ways.of_log(&log(|_| 8.0, 60), 10, AgentKind::Vehicle).unwrap();
        // The same road, in stops and starts; both are told at the same place.
        let unsteady = log(|step| if step == 10 || step % 20 > 12 { 1.0 } else { 8.0 }, 120);
        let now = unsteady.iter().position(|state| state.unwrap().x >= 28.0).unwrap();
        let other = ways.of_log(&unsteady, now, AgentKind::Vehicle).unwrap();
        for station in [5.0, 15.0, 30.0] {
            let place = other.follow(even.point_at(station), 0);
            assert!(place.lateral.abs() < 0.02, "{place:?}");
        }
    }

    #[test]
    fn where_the_log_ends_it_goes_on_along_the_lanes_without_a_jump() {
        let way = Ways::on(&road()).of_log(&log(|_| 8.0, 60), 10, AgentKind::Vehicle).unwrap();
        assert!(way.length() > 140.0, "{}", way.length());
        assert!(way.points().last().unwrap().y.abs() < 0.01, "it is led to the middle of the lane");
        let turns = (0..way.len()).map(|sample| way.curvature(sample).abs()).fold(0.0, f64::max);
        assert!(turns < 0.02, "{turns}");
        assert_eq!((way.lane_at(20.0), way.lane_at(110.0)), (Some(MapId(1)), Some(MapId(2))));
    }

    #[test]
    fn who_ends_beside_a_lane_stays_beside_it() {
        let beside = |state: Option<AgentState>| state.map(|state| AgentState { y: 3.0, ..state });
        let log: Vec<_> = log(|_| 8.0, 60).into_iter().map(beside).collect();
        let way = Ways::on(&road()).of_log(&log, 10, AgentKind::Vehicle).unwrap();
        assert!(way.length() > 140.0, "{}", way.length());
        assert!(way.points().iter().all(|point| (point.y - 3.0).abs() < 0.01), "{:?}", way.points().last());
    }

    #[test]
    fn who_stands_or_backs_up_has_no_way() {
        let ways = Ways::on(&road());
        assert!(ways.of_log(&log(|_| 0.0, 60), 10, AgentKind::Vehicle).is_none());
        assert!(ways.of_log(&log(|_| -4.0, 60), 10, AgentKind::Vehicle).is_none());
        let stops = log(|step| if step < 30 { 8.0 } else { 0.0 }, 60);
        assert!(ways.of_log(&stops, 29, AgentKind::Vehicle).is_none(), "what it has driven before is no matter");
        let fast = log(|_| 8.0, 60);
        assert!(ways.of_log(&fast, 59, AgentKind::Vehicle).is_some(), "it still goes when the log ends");
        let lost: Vec<_> = fast.iter().copied().chain([None; 30]).collect();
        assert!(ways.of_log(&lost, 59, AgentKind::Vehicle).is_none(), "nobody knows where it went");
        assert!(ways.of_log(&log(|step| if step < 30 { 0.0 } else { 6.0 }, 60), 10, AgentKind::Vehicle).is_some());
    }
}
