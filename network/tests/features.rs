//! Laws of the features, on generated scenes and one small enough to check by hand.

#![allow(clippy::unwrap_used, clippy::disallowed_methods, reason = "a test says what failed by failing")]

use std::f64::consts::TAU;
use std::sync::Arc;

use network::Frame;
use network::features::{History, SceneFeatures, Settings, Window};
use proptest::prelude::*;
use scenarios::generated::FAMILIES;
use world::geometry::{Point, Point3, Pose};
use world::map::{Area, BoundarySegment, Lane, LaneKind, Map, MapId, RoadEdge, RoadEdgeKind, RoadLine, RoadLineKind};
use world::observation::{Briefing, HistoryStep, Observation, ObservedAgent};
use world::plan::Control;
use world::reference_line::{ReferenceLine, ReferenceWindow};
use world::scene::bridged::SeenSignal;
use world::scene::{AgentKind, AgentState, Scene, SceneParts, Track, TrackId};
use world::signal::{Signal, SignalState};

fn generated(family: usize, seed: u64) -> Scene {
    let family = &FAMILIES[family % FAMILIES.len()];
    scenarios::womd::read(&family.payload("law", seed, 0, &Default::default()).unwrap()).unwrap().0
}

fn features(scene: &Scene, step: usize, settings: Settings) -> network::features::Features {
    SceneFeatures::new(scene.map(), settings).at(&Window::logged(scene, step).unwrap())
}

/// The scene with every point of its map some centimetres off. In generated ones many distances are equal, and what is chosen among equals may well
/// turn with the scene.
fn jittered(scene: &Scene) -> Scene {
    let mut parts = scene.clone().into_parts();
    let map = &mut parts.map;
    let lines = map.lanes.iter_mut().map(|lane| &mut lane.centerline);
    let lines = lines.chain(map.road_lines.iter_mut().map(|line| &mut line.polyline));
    let lines = lines.chain(map.road_edges.iter_mut().map(|edge| &mut edge.polyline));
    let points = lines.chain(map.crosswalks.iter_mut().map(|area| &mut area.polygon)).flatten();
    for (index, point) in points.enumerate() {
        let off = |salt: u64| ((index as u64 + salt).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40) as f64 * 2e-9;
        point.x += off(1);
        point.y += off(77);
    }
    parts.check().unwrap().0
}

/// The scene turned by `pose.heading` and moved.
fn moved(scene: &Scene, pose: Pose) -> Scene {
    let mut parts = scene.clone().into_parts();
    let turn = Pose::new(0.0, 0.0, pose.heading);
    let place = |x: &mut f64, y: &mut f64| {
        let point = pose.to_world(Point::new(*x, *y));
        (*x, *y) = (point.x, point.y);
    };
    for state in parts.tracks.iter_mut().flat_map(|track| track.states.iter_mut().flatten()) {
        place(&mut state.x, &mut state.y);
        state.heading += pose.heading;
        let velocity = turn.to_world(state.velocity());
        (state.velocity_x, state.velocity_y) = (velocity.x, velocity.y);
    }
    let map = &mut parts.map;
    let lines = map.lanes.iter_mut().map(|lane| &mut lane.centerline);
    let lines = lines.chain(map.road_lines.iter_mut().map(|line| &mut line.polyline));
    let lines = lines.chain(map.road_edges.iter_mut().map(|edge| &mut edge.polyline));
    for point in lines.chain(map.crosswalks.iter_mut().map(|area| &mut area.polygon)).flatten() {
        place(&mut point.x, &mut point.y);
    }
    for signal in parts.signals.iter_mut().flatten() {
        place(&mut signal.stop_point.x, &mut signal.stop_point.y);
    }
    parts.check().unwrap().0
}

/// Whether two frames are the same but for rounding.
fn is_close(a: &Frame, b: &Frame) -> Result<(), TestCaseError> {
    let close = |a: &[f32], b: &[f32], headings: &[usize]| {
        a.iter().zip(b).enumerate().all(|(column, (a, b))| {
            let apart = (f64::from(*a) - f64::from(*b)).abs();
            apart < 2e-4 || (headings.contains(&column) && (apart - TAU).abs() < 2e-4)
        })
    };
    prop_assert_eq!(&a.presence, &b.presence);
    for (a, b) in a.ego.iter().zip(&b.ego) {
        prop_assert!(close(a, b, &[2]), "{a:?} {b:?}");
    }
    for (a, b) in a.neighbors.as_flattened().iter().zip(b.neighbors.as_flattened()) {
        prop_assert!(close(a, b, &[2]), "{a:?} {b:?}");
    }
    for (a, b) in a.lanes.as_flattened().iter().zip(b.lanes.as_flattened()) {
        prop_assert!(close(a, b, &[2, 5, 8]), "{a:?} {b:?}");
    }
    for (a, b) in a.crosswalks.as_flattened().iter().zip(b.crosswalks.as_flattened()) {
        prop_assert!(close(a, b, &[2]), "{a:?} {b:?}");
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn turning_and_moving_the_whole_scene_changes_nothing_beyond_rounding(
        family: usize, seed in 0..9_u64, step in 10..190_usize, (x, y, heading) in (-9e3..9e3, -9e3..9e3, -3.1..3.1),
    ) {
        let scene = jittered(&generated(family, seed));
        let other = moved(&scene, Pose::new(x, y, heading));
        is_close(&features(&scene, step, Settings::Mended).frame, &features(&other, step, Settings::Mended).frame)?;
    }

    #[test]
    fn the_order_of_the_log_changes_nothing(family: usize, seed in 0..9_u64, step in 0..190_usize, shift in 1..9_usize) {
        let scene = generated(family, seed);
        let mut parts = scene.clone().into_parts();
        let count = parts.tracks.len();
        parts.tracks.rotate_left(shift % count);
        parts.av_index = (parts.av_index + count - shift % count) % count;
        let other = parts.check().unwrap().0;
        for settings in [Settings::Authors, Settings::Mended] {
            let (a, b) = (features(&scene, step, settings), features(&other, step, settings));
            prop_assert_eq!(a, b);
        }
    }

    #[test]
    fn what_is_observed_live_is_what_is_in_the_log(family: usize, seed in 0..9_u64, skipped in 20..40_u32) {
        let scene = generated(family, seed);
        let (mut history, start) = (History::new(&briefing(&scene, 19)), 19);
        for step in 0..40 {
            // An observation may be lost, and one may come twice.
            if step == skipped {
                continue;
            }
            let live = history.observe(&observation(&scene, start, step));
            prop_assert_eq!(&live, &history.observe(&observation(&scene, start, step)));
            let mut logged = Window::logged(&scene, (start + step) as usize).unwrap();
            logged.av_is_logged = step == 0;
            if let Some(lost) = (skipped + 19).checked_sub(step).filter(|lost| step > skipped && *lost < 19) {
                logged.av_before[lost as usize] = None;
                logged.neighbors.iter_mut().for_each(|neighbor| neighbor.before[lost as usize] = None);
            }
            prop_assert_eq!(live, logged);
        }
    }
}

fn observed(scene: &Scene, step: usize) -> Vec<ObservedAgent> {
    let others = scene.tracks().iter().enumerate().filter(|(index, _)| *index != scene.av_index());
    let agent = |track: &Track| {
        Some(ObservedAgent { track: track.id, kind: track.kind, unseen: 0, state: track.states[step]? })
    };
    others.filter_map(|(_, track)| agent(track)).collect()
}

fn briefing(scene: &Scene, start: u32) -> Briefing {
    let step = |index: u32| HistoryStep {
        log_index: index,
        av: scene.av().states[index as usize].unwrap(),
        agents: observed(scene, index as usize),
    };
    Briefing {
        scene: scene.id().clone(),
        protocol: "paper".to_owned(),
        start,
        horizon: 150,
        wheelbase: 3.0,
        map: Arc::clone(scene.map()),
        route: Vec::new(),
        reference_line: Arc::new(ReferenceLine::default()),
        history: (0..start).map(step).collect(),
    }
}

fn observation(scene: &Scene, start: u32, step: u32) -> Observation {
    let index = (start + step) as usize;
    Observation {
        step,
        log_index: start + step,
        av: scene.av().states[index].unwrap(),
        control: Control::default(),
        agents: observed(scene, index),
        signals: scene.signals(index).iter().map(|&signal| SeenSignal { signal, unseen: 0 }).collect(),
        window: ReferenceWindow {
            line: Arc::new(ReferenceLine::default()),
            start: 0,
            samples: 0,
            first_sample: 0,
            red_stops: Vec::new(),
            speed_limit: None,
        },
    }
}

/// A road along x: lane 1 (60 m) leads to lane 2 (20 m, within the junction, at red), lane 3 is to the left of lane 1. A line between the
/// two, an edge to the right, a crosswalk from 30 to 33 m. The AV stands at 10.2 m; a car ahead of it is seen for the second time.
fn road() -> Scene {
    let line = |from: f64, to: f64, y: f64, step: f64| -> Vec<Point3> {
        (0..=((to - from) / step) as usize).map(|index| Point3::new(from + step * index as f64, y, 0.0)).collect()
    };
    let segment = |feature: i64, kind| BoundarySegment {
        lane_start_index: 0,
        lane_end_index: 120,
        feature: MapId(feature),
        kind,
    };
    let beside = world::map::LaneNeighbor {
        lane: MapId(3),
        self_start_index: 0,
        self_end_index: 120,
        neighbor_start_index: 0,
        neighbor_end_index: 120,
        boundaries: Vec::new(),
    };
    let lanes = vec![
        Lane {
            id: MapId(1),
            kind: LaneKind::SurfaceStreet,
            speed_limit_mph: 45.0,
            centerline: line(0.0, 60.0, 0.0, 0.5),
            exits: vec![MapId(2)],
            left_neighbors: vec![beside],
            left_boundaries: vec![segment(10, RoadLineKind::BrokenSingleWhite)],
            right_boundaries: vec![segment(11, RoadLineKind::Unknown)],
            ..Lane::default()
        },
        Lane {
            id: MapId(2),
            interpolating: true,
            centerline: line(60.0, 80.0, 0.0, 0.5),
            entries: vec![MapId(1)],
            ..Lane::default()
        },
        Lane { id: MapId(3), centerline: line(0.0, 60.0, 3.5, 0.5), ..Lane::default() },
    ];
    let map = Map {
        lanes,
        road_lines: vec![RoadLine {
            id: MapId(10),
            kind: RoadLineKind::BrokenSingleWhite,
            polyline: line(0.0, 60.0, 1.75, 1.0),
        }],
        road_edges: vec![RoadEdge {
            id: MapId(11),
            kind: RoadEdgeKind::Boundary,
            polyline: line(0.0, 60.0, -1.75, 1.0),
        }],
        crosswalks: vec![Area {
            id: MapId(20),
            polygon: [(30.0, -4.0), (33.0, -4.0), (33.0, 4.0), (30.0, 4.0)]
                .map(|(x, y)| Point3::new(x, y, 0.0))
                .to_vec(),
        }],
        ..Map::default()
    };
    let state = |x: f64, velocity_x: f64| {
        Some(AgentState { x, velocity_x, length: 4.5, width: 2.0, height: 1.5, ..AgentState::default() })
    };
    let mut car = vec![None; 18];
    car.extend([state(19.5, 5.0), state(20.0, 5.0)]);
    let signal = Signal { lane: MapId(2), state: SignalState::Stop, stop_point: Point3::new(60.0, 0.0, 0.0) };
    let parts = SceneParts {
        id: "road".to_owned(),
        timestamps: (0..20).map(|step| 0.1 * f64::from(step)).collect(),
        tracks: vec![
            Track { id: TrackId(7), kind: AgentKind::Vehicle, states: car },
            Track { id: TrackId(5), kind: AgentKind::Vehicle, states: vec![state(10.2, 0.0); 20] },
        ],
        av_index: 1,
        signals: vec![vec![signal]; 20],
        map,
        ..SceneParts::default()
    };
    parts.check().unwrap().0
}

#[test]
fn on_a_road_that_can_be_checked_by_hand_every_number_is_as_reckoned() {
    let scene = road();
    // Setting, first point of lane 1, k = 50: index and light, what is filled in has.
    let cases = [(Settings::Authors, 14, 88, 4.0, 0.0), (Settings::Mended, 20, 91, 0.0, 4.5)];
    for (settings, first, fiftieth, light, filled_length) in cases {
        let features = features(&scene, 19, settings);
        let frame = &features.frame;
        let close = |got: &[f32], wanted: &[f32]| {
            assert!(
                got.iter().zip(wanted).all(|(got, wanted)| (got - wanted).abs() < 1e-5),
                "{got:?} is not {wanted:?}"
            );
        };
        assert_eq!(features.tracks, [TrackId(7)]);
        assert_eq!(features.views[0].candidates, Some(2));
        assert_eq!(features.views[0].sequences[0].lanes, [(MapId(1), first), (MapId(2), 0)]);
        assert_eq!(features.views[0].sequences[1].lanes, [(MapId(3), 20)]);
        assert_eq!(features.views[0].crosswalks, [MapId(20)]);
        assert_eq!(frame.presence.agents[..3], [true, true, false]);
        assert_eq!(frame.presence.slots[0], [true, true, false, false, false, false, true, false, false, false]);

        close(&frame.ego[19], &[0.0, 0.0, 0.0, 0.0, 0.0, 4.5, 2.0, 1.5]);
        close(&frame.neighbors[0][19], &[9.8, 0.0, 0.0, 5.0, 0.0, 4.5, 2.0, 1.5, 1.0]);
        close(&frame.neighbors[0][18], &[9.3, 0.0, 0.0, 5.0, 0.0, 4.5, 2.0, 1.5, 1.0]);
        close(&frame.neighbors[0][17][..6], &[8.8, 0.0, 0.0, 5.0, 0.0, filled_length]);
        close(&frame.neighbors[0][0][..5], &[0.3, 0.0, 0.0, 5.0, 0.0]);

        let x = |index: usize| 0.5 * index as f32 - 10.2;
        let row = &frame.lanes[0][50];
        close(&row[..3], &[x(fiftieth), 0.0, 0.0]);
        // Boundaries have a vertex every metre: of two as near, the first.
        let vertex = (fiftieth / 2) as f32 - 10.2;
        close(&row[3..9], &[vertex, 1.75, 0.0, vertex, -1.75, 0.0]);
        close(&row[9..], &[45.0 / 2.237, 2.0, 1.0, 9.0, light, 0.0, 0.0, 0.0]);
        let last = &frame.lanes[0][99];
        assert_eq!((last[3..9].to_vec(), last[13], last[15]), (vec![0.0; 6], 4.0, 1.0), "in the junction, at red");

        // 7 + 17 + 7 + 17 points around the crosswalk: fewer than a hundred, so that they repeat.
        let crosswalk = &frame.crosswalks[0];
        close(&crosswalk[0], &[19.8, -4.0, 0.0]);
        close(&crosswalk[99][..2], &[19.8, 4.0 - 8.0 * 16.0 / 17.0]);
    }
}
