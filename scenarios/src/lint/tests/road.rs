//! A scene small enough to reckon by hand, in which there is nothing to find.
//!
//! Three lanes lead along +x, 3.5 m wide: 1, 2, 3 from the left, on through a junction as 11, 12, 13, and beyond it as 21, 22, 23. The curbs are
//! at y = 5.25 and -5.25. All lanes have a light at x = 80, which turns from red to green at step 100. The AV comes along the middle
//! lane with 12 m/s, stands from step 80 to 140 and goes on; track 1 does the same 12 m before it, and is the first at the light.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use world::geometry::Point3;
use world::map::{Lane, LaneKind, Map, MapId, RoadEdge, RoadEdgeKind};
use world::scene::{AgentKind, AgentState, SceneParts, Track, TrackId};
use world::signal::{Signal, SignalState};

pub(crate) const STEPS: usize = 200;
pub(crate) const AV_WIDTH: f64 = 2.0;
/// The right curb (y).
pub(crate) const CURB: f64 = -5.25;
/// The light turns green at this step.
pub(crate) const GREEN: usize = 100;

/// The whole scene under a name. The AV comes last.
pub(crate) fn scene(id: &str) -> SceneParts {
    let track = |id: i32, ahead: f64| Track {
        id: TrackId(id),
        kind: AgentKind::Vehicle,
        states: (0..STEPS).map(|step| Some(state(ahead, step))).collect(),
    };
    SceneParts {
        id: id.to_owned(),
        timestamps: (0..STEPS).map(|step| 0.1 * step as f64).collect(),
        tracks: vec![track(1, 12.0), track(2, 0.0)],
        av_index: 1,
        signals: (0..STEPS).map(signals).collect(),
        map: Map { lanes: lanes(), road_edges: vec![edge(91, -CURB, true), edge(92, CURB, false)], ..Map::default() },
        ..SceneParts::default()
    }
}

/// Somebody `ahead` (m) of the AV on the middle lane.
fn state(ahead: f64, step: usize) -> AgentState {
    let time = 0.1 * step as f64;
    // Even, braking for 6 s, standing for 6 s, speeding up.
    let (way, speed) = match time {
        t if t < 2.0 => (12.0 * t, 12.0),
        t if t < 8.0 => (24.0 + 12.0 * (t - 2.0) - (t - 2.0) * (t - 2.0), 12.0 - 2.0 * (t - 2.0)),
        t if t < 14.0 => (60.0, 0.0),
        t => (60.0 + (t - 14.0) * (t - 14.0), 2.0 * (t - 14.0)),
    };
    AgentState { x: ahead + way, velocity_x: speed, length: 4.5, width: AV_WIDTH, height: 1.5, ..AgentState::default() }
}

fn lanes() -> Vec<Lane> {
    let lane = |id: i64, from: f64, to: f64| {
        let (row, place) = (id / 10, id % 10);
        Lane {
            id: MapId(id),
            kind: LaneKind::SurfaceStreet,
            speed_limit_mph: 30.0,
            interpolating: row == 1,
            centerline: line(from, to, 0.5, 3.5 * (2 - place) as f64),
            entries: if row > 0 { vec![MapId(id - 10)] } else { vec![] },
            exits: if row < 2 { vec![MapId(id + 10)] } else { vec![] },
            ..Lane::default()
        }
    };
    (1..=3).flat_map(|id| [lane(id, -60.0, 80.0), lane(10 + id, 80.0, 100.0), lane(20 + id, 100.0, 260.0)]).collect()
}

fn signals(step: usize) -> Vec<Signal> {
    let state = if step < GREEN { SignalState::Stop } else { SignalState::Go };
    let signal =
        |id: i64| Signal { lane: MapId(10 + id), state, stop_point: Point3::new(80.0, 3.5 * (2 - id) as f64, 0.0) };
    (1..=3).map(signal).collect()
}

/// The road lies to the left of an edge.
fn edge(id: i64, y: f64, back: bool) -> RoadEdge {
    let mut polyline = line(-60.0, 260.0, 1.0, y);
    if back {
        polyline.reverse();
    }
    RoadEdge { id: MapId(id), kind: RoadEdgeKind::Boundary, polyline }
}

fn line(from: f64, to: f64, step: f64, y: f64) -> Vec<Point3> {
    (0..=((to - from) / step) as usize).map(|k| Point3::new(from + step * k as f64, y, 0.0)).collect()
}
