//! A scene whose figures are known in closed form.

use std::sync::Arc;

use world::geometry::{Point, Point3};
use world::map::{Area, BoundarySegment, Lane, LaneKind, Map, MapId, RoadEdge, RoadEdgeKind, RoadLine, RoadLineKind};
use world::scene::{AgentKind, AgentState, Scene, SceneParts, Track, TrackId};
use world::signal::{Signal, SignalState};

use super::{Figures, Quantity, Samples, Share, Summary, measure};
use crate::SceneSet;

const STEPS: usize = 101;

/// Points every 0.5 m from `from` to `to`, at least two.
fn line(from: (f64, f64), to: (f64, f64)) -> Vec<Point3> {
    let (from, to) = (Point::new(from.0, from.1), Point::new(to.0, to.1));
    let pieces = (2.0 * from.distance(to)) as usize;
    let at = |index: usize| from + (to - from) * (index as f64 / pieces as f64);
    (0..=pieces).map(at).map(|point| Point3::new(point.x, point.y, 0.0)).collect()
}

/// A lane of 200 m with its sides, one of 100 m that it leads to, a quarter of a circle of 10 m, and one for bicycles.
fn map() -> Map {
    let bound = |feature: i64| BoundarySegment {
        lane_start_index: 0,
        lane_end_index: 400,
        feature: MapId(feature),
        kind: RoadLineKind::Unknown,
    };
    let lane = |id: i64, centerline: Vec<Point3>| Lane {
        id: MapId(id),
        kind: LaneKind::SurfaceStreet,
        speed_limit_mph: 35.0,
        centerline,
        ..Lane::default()
    };
    let bend = (0..=31).map(|index| Point::unit(f64::from(index) * 0.05 - std::f64::consts::FRAC_PI_2) * 10.0);
    let lanes = vec![
        Lane {
            exits: vec![MapId(2)],
            left_boundaries: vec![bound(10)],
            right_boundaries: vec![bound(11)],
            ..lane(1, line((0.0, 0.0), (200.0, 0.0)))
        },
        Lane { entries: vec![MapId(1)], ..lane(2, line((200.0, 0.0), (300.0, 0.0))) },
        lane(3, bend.map(|point| Point3::new(200.0 + point.x, 10.0 + point.y, 0.0)).collect()),
        Lane { kind: LaneKind::BikeLane, speed_limit_mph: 0.0, ..lane(4, line((0.0, -4.0), (50.0, -4.0))) },
    ];
    let kind = RoadLineKind::SolidSingleWhite;
    let corners = [(0.0, 0.0), (2.4, 1.8), (-4.8, 11.4), (-7.2, 9.6)]; // 3 by 12
    Map {
        lanes,
        road_lines: vec![RoadLine { id: MapId(10), kind, polyline: line((0.0, 1.8), (200.0, 1.8)) }],
        road_edges: vec![RoadEdge {
            id: MapId(11),
            kind: RoadEdgeKind::Boundary,
            polyline: line((200.0, -1.8), (0.0, -1.8)),
        }],
        crosswalks: vec![Area {
            id: MapId(20),
            polygon: corners.iter().map(|(x, y)| Point3::new(*x, *y, 0.0)).collect(),
        }],
        ..Map::default()
    }
}

/// Somebody who starts at `from`, heads east, and has the speed that this step has.
fn track(id: i32, kind: AgentKind, from: (f64, f64), length: f64, speed: impl Fn(f64) -> f64) -> Track {
    let mut x = from.0;
    let states = (0..STEPS).map(|step| {
        let velocity_x = speed(step as f64 * 0.1);
        let state = AgentState { x, y: from.1, velocity_x, length, width: 2.0, height: 1.5, ..AgentState::default() };
        x += 0.1 * velocity_x;
        Some(state)
    });
    Track { id: TrackId(id), kind, states: states.collect() }
}

fn scene(id: &str) -> Arc<Scene> {
    let vehicle = |id, from, length, speed: fn(f64) -> f64| track(id, AgentKind::Vehicle, from, length, speed);
    let mut walker = track(7, AgentKind::Pedestrian, (60.0, 10.0), 0.8, |_| 1.5);
    walker.states[50..].fill(None);
    let tracks = vec![
        vehicle(1, (10.0, 0.0), 5.0, |_| 10.0),
        vehicle(2, (40.0, 0.0), 4.0, |_| 10.0),
        vehicle(3, (100.0, 6.0), 8.0, |_| 0.0),
        vehicle(4, (215.0, 0.0), 4.0, |_| 0.0),
        vehicle(5, (221.0, 0.0), 4.0, |_| 0.0),
        vehicle(6, (0.0, 40.0), 4.0, |time| 2.0 + time),
        walker,
    ];
    let show = |step: usize| Signal {
        lane: MapId(2),
        state: match step {
            0..30 => SignalState::Go,
            30..60 => SignalState::Caution,
            _ => SignalState::Stop,
        },
        stop_point: Point3::new(200.0, 0.0, 0.0),
    };
    let parts = SceneParts {
        id: id.to_owned(),
        timestamps: (0..STEPS).map(|step| step as f64 * 0.1).collect(),
        tracks,
        signals: (0..STEPS).map(|step| vec![show(step)]).collect(),
        map: map(),
        ..SceneParts::default()
    };
    Arc::new(parts.check().unwrap().0)
}

#[track_caller]
fn same(samples: &Samples, quantity: Quantity, expected: &[f64]) {
    let values = samples.of(quantity);
    let near = |(value, expected): (&f32, &f64)| (f64::from(*value) - expected).abs() < 1e-4;
    let all = values.len() == expected.len() && values.iter().zip(expected).all(near);
    assert!(all, "{quantity:?}: {values:?}, not {expected:?}");
}

#[test]
fn who_is_there_and_how_large() {
    let samples = Samples::of_scene(&scene("closed-form"));
    same(&samples, Quantity::Vehicles, &[6.0]);
    same(&samples, Quantity::Pedestrians, &[1.0]);
    same(&samples, Quantity::Tracks, &[7.0]);
    same(&samples, Quantity::TracksValid, &[7.0, 7.0, 7.0, 7.0, 7.0, 6.0, 6.0, 6.0, 6.0, 6.0, 6.0]);
    same(&samples, Quantity::ShareValid, &[1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 50.0 / 101.0]);
    // The leader and the one far to the left; later the leader and the one parked; the AV never.
    assert_eq!(samples.of(Quantity::VehiclesWithin50)[0], 2.0);
    assert_eq!(samples.of(Quantity::MovingWithin50)[8], 1.0);
    same(&samples, Quantity::VehicleLength, &[5.0, 4.0, 8.0, 4.0, 4.0, 4.0]);
    same(&samples, Quantity::PedestrianLength, &[0.8]);
    assert_eq!((samples.count(Share::LongerThan6).so, samples.count(Share::LongerThan6).of), (1, 6));
}

#[test]
fn who_is_parked_and_who_moves() {
    let samples = Samples::of_scene(&scene("closed-form"));
    assert_eq!((samples.count(Share::Parked).so, samples.count(Share::Parked).of), (3, 5));
    same(&samples, Quantity::ParkedToLane, &[6.0, 0.0, 0.0]);
    same(&samples, Quantity::MovingToLane, &[0.0, 40.0]);
    let (speeds, walks) = (samples.of(Quantity::VehicleSpeed), samples.of(Quantity::PedestrianSpeed));
    assert_eq!((speeds.len(), speeds[0], speeds[21], speeds[41]), (42, 10.0, 2.0, 12.0));
    assert_eq!(walks, [1.5; 10]);
    // Neither the first steps nor the last have the three that a mean is of.
    let accelerations = [[0.0; 18], [1.0; 18]].concat();
    same(&samples, Quantity::VehicleAcceleration, &accelerations);
}

#[test]
fn gaps_are_from_bumper_to_bumper_and_go_on_over_exits() {
    let samples = Samples::of_scene(&scene("closed-form"));
    same(&samples, Quantity::AvGap, &[25.5; 11]);
    same(&samples, Quantity::AvHeadway, &[2.55; 11]);
    same(&samples, Quantity::GapBothMoving, &[25.5; 11]);
    // At the last step the leader, at 140 m, has the standing ones 75 m ahead.
    let mut gaps = [25.5; 12];
    gaps[11] = 71.0;
    same(&samples, Quantity::Gap, &gaps);
    same(&samples, Quantity::Gap10To15, &[25.5; 11]);
    same(&samples, Quantity::QueueGap, &[2.0; 3]);
}

#[test]
fn the_av_drives_evenly() {
    let samples = Samples::of_scene(&scene("closed-form"));
    same(&samples, Quantity::AvPath, &[100.0]);
    same(&samples, Quantity::AvMaxSpeed, &[10.0]);
    same(&samples, Quantity::AvStanding, &[0.0]);
    same(&samples, Quantity::AvSpeed, &[10.0; 20]);
    same(&samples, Quantity::AvAcceleration, &[0.0; 18]);
    same(&samples, Quantity::AvMeanJerk, &[0.0]);
}

#[test]
fn the_map_is_measured() {
    let samples = Samples::of_scene(&scene("closed-form"));
    same(&samples, Quantity::LanesPerScene, &[3.0]);
    assert_eq!(samples.of(Quantity::LaneLength)[..2], [200.0, 100.0]);
    same(&samples, Quantity::BikeLaneLength, &[50.0]);
    same(&samples, Quantity::LaneWidth, &[3.6; 41]);
    same(&samples, Quantity::SpeedLimit, &[35.0; 3]);
    same(&samples, Quantity::Exits, &[1.0, 0.0, 0.0]);
    // 15 pieces of 1 m around a circle of 10 m: the last is turned by 14 times 0.1 rad from the first.
    let (turn, largest) = (samples.of(Quantity::Turn), samples.of(Quantity::LargestCurvature));
    assert!((turn[2] - 1.4_f32.to_degrees()).abs() < 0.5 && (largest[2] - 0.1).abs() < 1e-3, "{turn:?} {largest:?}");
    same(&samples, Quantity::CrosswalkShort, &[3.0]);
    same(&samples, Quantity::CrosswalkLong, &[12.0]);
}

#[test]
fn signals_are_measured() {
    let samples = Samples::of_scene(&scene("closed-form"));
    same(&samples, Quantity::SignalLanes, &[1.0]);
    same(&samples, Quantity::SignalChanges, &[2.0]);
    same(&samples, Quantity::CautionTime, &[3.0]);
    same(&samples, Quantity::ControlledLength, &[100.0]);
    same(&samples, Quantity::LanesPerJunction, &[1.0]);
    same(&samples, Quantity::NextJunction, &[]);
    assert_eq!(samples.count(Share::Red).share(), Some(41.0 / 101.0));
}

#[test]
fn a_scene_with_nothing_but_an_av_that_is_seen_once_has_figures() {
    let mut lonely = track(1, AgentKind::Vehicle, (0.0, 0.0), 5.0, |_| 1.0);
    lonely.states[1..].fill(None);
    let parts = SceneParts {
        id: "lonely".to_owned(),
        timestamps: (0..STEPS).map(|step| step as f64 * 0.1).collect(),
        tracks: vec![lonely],
        ..SceneParts::default()
    };
    let scene = parts.check().unwrap().0;
    let samples = Samples::of_scene(&scene);
    same(&samples, Quantity::AvPath, &[0.0]);
    same(&samples, Quantity::AvMeanJerk, &[]);
    let row = Summary::new(&scene, &samples);
    assert!(row.values.iter().flatten().all(|value| value.is_finite()) && row.values.contains(&None), "{row:?}");
}

#[test]
fn one_worker_or_three_the_same_figures() {
    let set = SceneSet::open(&["demo".to_owned()]).unwrap();
    let with = |workers: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(workers).build().unwrap();
        let load = |index: usize| set.load(index).map(|(scene, _)| scene);
        pool.install(|| measure(set.entries().len(), load)).unwrap()
    };
    let (one, three) = (with(1), with(3));
    assert_eq!(one, three);
    assert_eq!(Figures::of(&one.0), Figures::of(&three.0));
    assert_eq!(one.1.len(), set.entries().len());
}

#[test]
fn the_first_scene_that_cannot_be_loaded_is_the_error() {
    let load = |index: usize| if index % 2 == 1 { Err(index) } else { Ok(scene("closed-form")) };
    assert_eq!(measure(4, load).unwrap_err(), 1);
}
