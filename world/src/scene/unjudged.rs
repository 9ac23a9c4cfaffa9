//! What cannot be judged in a scene, because the scene does not hold what it would be judged by.
//!
//! A term that cannot be judged has no value; it is never a good one.

use std::collections::BTreeMap;
use std::fmt;

use thiserror::Error;

use super::bridged::{Bridged, SizeSource};
use super::{AgentState, Scene, TrackId};
use crate::geometry::{Bounds, Point, Point3, PointGrid, SegmentGrid};
use crate::map::{Lane, Map};

/// What is judged of a drive, as far as a scene may not allow it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Judgement {
    /// Collisions and time to collision.
    Collision,
    /// Off road, and nuPlan's drivable area.
    OffRoad,
    /// Driving the wrong way.
    WrongWay,
    /// Speeding.
    Speeding,
}

impl fmt::Display for Judgement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Collision => "collisions",
            Self::OffRoad => "off road",
            Self::WrongWay => "wrong way",
            Self::Speeding => "speeding",
        })
    }
}

/// Why something cannot be judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum Unjudged {
    #[error("off road cannot be judged: no road edge is within {EDGES_WITHIN} m of the logged AV's way")]
    NoRoadEdges,
    #[error(
        "off road cannot be judged: {reversed} of {edges} road edges by the logged AV's way have the lanes on their right"
    )]
    ReversedEdges { reversed: usize, edges: usize },
    #[error("wrong way cannot be judged: no lane for cars is within {BY_THE_WAY} m of the logged AV's way")]
    NoLanes,
    #[error("speeding cannot be judged: no lane by the logged AV's way has a speed limit")]
    NoSpeedLimits,
    #[error("collisions cannot be judged: track {track} comes near the logged AV's way, and nothing tells its size")]
    NoSize { track: TrackId },
}

impl Unjudged {
    /// What it is that cannot be judged.
    #[must_use]
    pub fn judgement(&self) -> Judgement {
        match self {
            Self::NoRoadEdges | Self::ReversedEdges { .. } => Judgement::OffRoad,
            Self::NoLanes => Judgement::WrongWay,
            Self::NoSpeedLimits => Judgement::Speeding,
            Self::NoSize { .. } => Judgement::Collision,
        }
    }
}

/// Edges farther from the logged AV's way than this (m) end no road that is driven on: the reach of the judges of a drive.
const EDGES_WITHIN: f64 = 40.0;

/// Lanes and road users that are this near (m) are by the way.
const BY_THE_WAY: f64 = 20.0;

/// What is higher or lower (m) is on another level of the road.
const STOREY: f64 = 4.0;

/// An edge bounds the lanes that are this near (m).
const EDGE_OF_LANE: f64 = 8.0;

/// Nearer lanes (m) are on the edge itself, on no side of it.
const ON_THE_EDGE: f64 = 0.3;

/// An edge of fewer lane points than this says nothing: 2.5 m.
const FEWEST_POINTS: usize = 5;

/// The share of lane points that may lie by reversed edges. In 471 real scenes four have such an edge, the worst a share of 0.08.
const REVERSED_SHARE: f64 = 0.15;

impl Bridged {
    /// What cannot be judged in this scene, and why.
    #[must_use]
    pub fn unjudged(&self) -> Vec<Unjudged> {
        let scene = self.judged();
        let way = Way::of(scene);
        let no_size = self.mended_sizes().iter().filter(|size| size.source == SizeSource::Nothing);
        let near = no_size.filter(|size| {
            let states = scene.tracks()[size.track].states.iter().flatten();
            way.near(states.map(|state| Point3::new(state.x, state.y, state.z)), BY_THE_WAY).next().is_some()
        });
        let mut unjudged: Vec<Unjudged> = near.map(|size| Unjudged::NoSize { track: size.id }).collect();
        let lanes = lanes(scene.map(), &way);
        unjudged.extend(road_edges(scene.map(), &way, lanes.iter().flat_map(|(_, points)| points)));
        unjudged.extend(lanes.is_empty().then_some(Unjudged::NoLanes));
        unjudged.extend(lanes.iter().all(|(lane, _)| lane.speed_limit().is_none()).then_some(Unjudged::NoSpeedLimits));
        unjudged
    }
}

/// The places where the logged AV was.
struct Way {
    points: PointGrid,
    heights: Vec<f64>,
}

impl Way {
    fn of(scene: &Scene) -> Self {
        let mut states: Vec<&AgentState> = scene.av().states.iter().flatten().collect();
        // One that stands is at one place.
        states.dedup_by(|next, last| last.position().distance(next.position()) < 1.0);
        let points = states.iter().map(|state| state.position()).collect();
        Self { points: PointGrid::new(points, 10.0), heights: states.iter().map(|state| state.z).collect() }
    }

    /// Those points of a line that are near. It is looked at only where it may have come near since the last look.
    fn near<'a>(
        &'a self,
        line: impl IntoIterator<Item = Point3> + 'a,
        radius: f64,
    ) -> impl Iterator<Item = Point3> + 'a {
        // The last point, and how far (m) the line may go on from there without coming near.
        let mut clear: Option<(Point, f64)> = None;
        line.into_iter().filter(move |point| {
            let place = point.xy();
            clear = clear.map(|(last, left)| (place, left - last.distance(place)));
            if clear.is_some_and(|(_, left)| left > 0.0) {
                return false;
            }
            let on_level = |index: usize| (self.heights[index] - point.z).abs() <= STOREY;
            let is_near = self.points.any_within(place, radius, on_level);
            let distance = || self.points.nearest(place).map_or(f64::INFINITY, |(_, distance)| distance);
            // A hair less: distances are rounded.
            clear = (!is_near).then(|| (place, distance() - radius - 1e-3));
            is_near
        })
    }
}

/// `lanes`: the points of lanes for cars by the way.
fn road_edges<'a>(map: &Map, way: &Way, lanes: impl Iterator<Item = &'a Point3>) -> Option<Unjudged> {
    let edges = map.road_edges.iter().enumerate();
    let near: Vec<_> = edges.filter(|(_, edge)| passes_near(&edge.polyline, way)).collect();
    if near.is_empty() {
        return Some(Unjudged::NoRoadEdges);
    }
    // Only what is near lane points by the way is asked for.
    let asked = Bounds::of(way.points.points().iter().copied()).grown(BY_THE_WAY + EDGE_OF_LANE + 1.0);
    let runs = near.iter().flat_map(|(index, edge)| asked.runs(&edge.polyline).map(|run| (*index as u32, run)));
    let grid = SegmentGrid::new(runs.map(|(index, run)| (index, run.iter().map(|point| point.xy()))), 5.0);
    // For each edge the lane points that it bounds, and those of them on its right.
    let mut bounded: BTreeMap<u32, (usize, usize)> = BTreeMap::new();
    for point in lanes {
        let edge = grid.nearest(point.xy(), EDGE_OF_LANE);
        if let Some(edge) = edge.filter(|edge| !edge.beyond_end && edge.distance() > ON_THE_EDGE) {
            let (all, right) = bounded.entry(edge.payload).or_default();
            *all += 1;
            *right += usize::from(edge.signed_distance < 0.0);
        }
    }
    let all: usize = bounded.values().map(|(all, _)| all).sum();
    let reversed = bounded.values().filter(|(all, right)| *all >= FEWEST_POINTS && 2 * right > *all);
    let (reversed, by_reversed) = reversed.fold((0, 0), |(edges, points), (all, _)| (edges + 1, points + all));
    let too_many = by_reversed as f64 > REVERSED_SHARE * all as f64;
    too_many.then_some(Unjudged::ReversedEdges { reversed, edges: bounded.len() })
}

/// Whether a line comes near the way. Its points may be far apart: what is between two of them counts.
fn passes_near(line: &[Point3], way: &Way) -> bool {
    let ends = line.windows(2).map(|pair| (pair[0], pair[1]));
    let is_near = way.near(line.iter().copied(), EDGES_WITHIN).next().is_some();
    is_near
        || ends.filter(|(from, to)| from.xy().distance(to.xy()) > EDGES_WITHIN).any(|(from, to)| {
            let parts = (from.xy().distance(to.xy()) / EDGES_WITHIN).ceil().min(MOST_PARTS);
            let mix = move |a: f64, b: f64, part: f64| a + (b - a) * part / parts;
            let between = (1..parts as usize).map(|part| part as f64);
            let points =
                between.map(move |p| Point3::new(mix(from.x, to.x, p), mix(from.y, to.y, p), mix(from.z, to.z, p)));
            way.near(points, EDGES_WITHIN).next().is_some()
        })
}

/// A segment of more than 4 km is looked at more coarsely: no road has one.
const MOST_PARTS: f64 = 100.0;

/// The lanes for cars by the way, with their points that are.
fn lanes<'a>(map: &'a Map, way: &Way) -> Vec<(&'a Lane, Vec<Point3>)> {
    let lanes = map.lanes.iter().filter(|lane| lane.kind.is_drivable());
    let near = lanes.map(|lane| (lane, way.near(lane.centerline.iter().copied(), BY_THE_WAY).collect::<Vec<_>>()));
    near.filter(|(_, points)| !points.is_empty()).collect()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::map::{LaneKind, MapId, RoadEdge, RoadEdgeKind};
    use crate::scene::{AgentKind, SceneParts, Track};

    /// A straight road with an edge on either side, the AV on it, and something of unknown kind `beside` it.
    fn parts(beside: f64) -> SceneParts {
        let line = |y: f64| (0..200).map(|k| Point3::new(f64::from(k) * 0.5, y, 0.0)).collect::<Vec<_>>();
        let edge = |id, polyline| RoadEdge { id: MapId(id), kind: RoadEdgeKind::Boundary, polyline };
        let at = |x, y, length| Some(AgentState { x, y, length, width: 2.0, height: 1.5, ..AgentState::default() });
        let mut parts = SceneParts {
            id: "road".into(),
            timestamps: (0..50).map(|step| f64::from(step) * 0.1).collect(),
            tracks: vec![
                Track {
                    id: TrackId(1),
                    kind: AgentKind::Vehicle,
                    states: (0..50).map(|k| at(f64::from(k), 0.0, 5.0)).collect(),
                },
                Track { id: TrackId(2), kind: AgentKind::Other, states: vec![at(20.0, beside, 1.0); 50] },
            ],
            ..SceneParts::default()
        };
        parts.map.lanes = vec![Lane { id: MapId(1), speed_limit_mph: 25.0, centerline: line(0.0), ..Lane::default() }];
        parts.map.road_edges = vec![edge(2, line(-3.0)), edge(3, line(3.0).into_iter().rev().collect())];
        parts
    }

    fn unjudged(change: impl FnOnce(&mut SceneParts)) -> Vec<Unjudged> {
        let mut parts = parts(10.0);
        change(&mut parts);
        Bridged::of(&Arc::new(parts.check().unwrap().0)).unjudged()
    }

    #[test]
    fn a_whole_scene_can_be_judged() {
        assert_eq!(unjudged(|_| {}), []);
    }

    #[test]
    fn without_edges_or_with_edges_that_are_far_or_of_another_level_off_road_is_not_judged() {
        assert_eq!(unjudged(|parts| parts.map.road_edges.clear()), [Unjudged::NoRoadEdges]);
        let shifted = |by: Point3| {
            unjudged(move |parts| {
                for point in parts.map.road_edges.iter_mut().flat_map(|edge| &mut edge.polyline) {
                    *point = Point3::new(point.x, point.y + by.y, point.z + by.z);
                }
            })
        };
        assert_eq!(shifted(Point3::new(0.0, 60.0, 0.0)), [Unjudged::NoRoadEdges]);
        assert_eq!(shifted(Point3::new(0.0, 0.0, 6.0)), [Unjudged::NoRoadEdges]);
        assert_eq!(Unjudged::NoRoadEdges.judgement(), Judgement::OffRoad);
    }

    #[test]
    fn an_edge_of_two_points_is_as_near_as_its_middle() {
        let long = |parts: &mut SceneParts| {
            let (from, to) = (Point3::new(-900.0, -3.0, 0.0), Point3::new(1000.0, -3.0, 0.0));
            parts.map.road_edges.truncate(1);
            parts.map.road_edges[0].polyline = vec![from, to];
        };
        assert_eq!(unjudged(long), []);
    }

    #[test]
    fn edges_drawn_the_other_way_round_are_seen_on_either_side() {
        let reversed = |edges: std::ops::Range<usize>| {
            unjudged(move |parts| parts.map.road_edges[edges].iter_mut().for_each(|edge| edge.polyline.reverse()))
        };
        assert_eq!(reversed(0..2), [Unjudged::ReversedEdges { reversed: 1, edges: 1 }]);
        // The lane lies in the middle: the first edge is the nearest one throughout, so shift it to the second.
        let other = unjudged(|parts| {
            parts.map.road_edges[1].polyline.iter_mut().for_each(|point| point.y -= 1.0);
            parts.map.road_edges[1].polyline.reverse();
        });
        assert_eq!(other, [Unjudged::ReversedEdges { reversed: 1, edges: 1 }]);
    }

    #[test]
    fn without_a_lane_for_cars_by_the_way_neither_wrong_way_nor_speeding_is_judged() {
        let neither = [Unjudged::NoLanes, Unjudged::NoSpeedLimits];
        assert_eq!(unjudged(|parts| parts.map.lanes.clear()), neither);
        assert_eq!(unjudged(|parts| parts.map.lanes[0].kind = LaneKind::BikeLane), neither);
    }

    #[test]
    fn without_a_speed_limit_by_the_way_speeding_is_not_judged() {
        assert_eq!(unjudged(|parts| parts.map.lanes[0].speed_limit_mph = 0.0), [Unjudged::NoSpeedLimits]);
        let far = |parts: &mut SceneParts| {
            let mut far = parts.map.lanes[0].clone();
            far.id = MapId(9);
            far.centerline.iter_mut().for_each(|point| point.y += 100.0);
            parts.map.lanes[0].speed_limit_mph = 0.0;
            parts.map.lanes.push(far);
        };
        assert_eq!(unjudged(far), [Unjudged::NoSpeedLimits]);
    }

    #[test]
    fn what_has_neither_size_nor_kind_spoils_collisions_where_it_is_near() {
        let flat = |parts: &mut SceneParts| {
            parts.tracks[1].states.iter_mut().flatten().for_each(|state| state.height = 0.0);
        };
        assert_eq!(unjudged(flat), [Unjudged::NoSize { track: TrackId(2) }]);
        let mut far = parts(30.0);
        flat(&mut far);
        assert_eq!(Bridged::of(&Arc::new(far.check().unwrap().0)).unjudged(), []);
    }
}
