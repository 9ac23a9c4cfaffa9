//! One test for each thing that can be wrong with a scene, and for what is done about it.

use super::*;
use crate::map::{Area, BoundarySegment, LaneNeighbor, RoadLine, RoadLineKind, StopSign};
use crate::scene::{AgentState, Track, TrackToPredict};
use crate::signal::{Signal, SignalState};

fn lane(id: i64, entries: &[i64], exits: &[i64]) -> Lane {
    let ids = |ids: &[i64]| ids.iter().map(|id| MapId(*id)).collect();
    Lane {
        id: MapId(id),
        centerline: vec![Point3::default(); 3],
        entries: ids(entries),
        exits: ids(exits),
        ..Lane::default()
    }
}

fn track(id: i32) -> Track {
    Track { id: TrackId(id), states: vec![Some(AgentState::default()); 4], ..Track::default() }
}

fn signal(lane: i64) -> Signal {
    Signal { lane: MapId(lane), state: SignalState::Go, stop_point: Point3::default() }
}

/// Two tracks over four steps on two lanes; nothing is wrong with it.
fn sound() -> SceneParts {
    let mut parts = SceneParts {
        id: "sound".into(),
        timestamps: vec![0.0, 0.1, 0.2, 0.3],
        tracks: vec![track(5), track(6)],
        av_index: 1,
        ..SceneParts::default()
    };
    parts.map.lanes = vec![lane(1, &[], &[2]), lane(2, &[1], &[])];
    parts.map.road_lines =
        vec![RoadLine { id: MapId(3), kind: RoadLineKind::Unknown, polyline: vec![Point3::default()] }];
    parts.map.stop_signs = vec![StopSign { id: MapId(4), lanes: vec![MapId(1)], position: Point3::default() }];
    parts
}

fn changed(change: impl FnOnce(&mut SceneParts)) -> Result<(Scene, Vec<Finding>), SceneError> {
    let mut parts = sound();
    change(&mut parts);
    parts.check()
}

fn error(change: impl FnOnce(&mut SceneParts)) -> SceneError {
    changed(change).unwrap_err()
}

/// The one finding, and the scene that was made of it all the same.
fn finding(change: impl FnOnce(&mut SceneParts)) -> (Scene, Finding) {
    let (scene, findings) = changed(change).unwrap();
    assert_eq!(findings.len(), 1, "{findings:?}");
    (scene, findings[0].clone())
}

#[test]
fn a_sound_scene_comes_through_as_it_was() {
    let (scene, findings) = sound().check().unwrap();
    assert_eq!(findings, []);
    assert_eq!((scene.av().id, scene.steps(), scene.id().as_str()), (TrackId(6), 4, "sound"));
    // Signals that are not given at all are given as none at each step.
    assert!(scene.signals(3).is_empty() && scene.signals(99).is_empty());
    let expected = SceneParts { signals: vec![Vec::new(); 4], ..sound() };
    assert_eq!(scene.into_parts(), expected);
}

#[test]
fn an_id_must_be_a_file_name_and_a_bus_key() {
    for id in ["", ".hidden", "a/b", "a b", "a*", "ä", &"x".repeat(129)] {
        assert!(matches!(error(|parts| parts.id = id.into()), SceneError::BadId(_)), "{id:?}");
    }
    for id in ["c403d5992cab9e0", "a.b-c_D", &"x".repeat(128)] {
        assert!(changed(|parts| parts.id = id.into()).is_ok(), "{id:?}");
    }
}

#[test]
fn what_a_scene_cannot_do_without_is_an_error() {
    assert_eq!(error(|parts| parts.timestamps.clear()), SceneError::NoSteps);
    assert_eq!(error(|parts| parts.tracks.clear()), SceneError::NoTracks);
    assert_eq!(error(|parts| parts.av_index = 2), SceneError::AvIndex { index: 2, tracks: 2 });
    let short = SceneError::TrackLength { track: TrackId(5), states: 3, steps: 4 };
    assert_eq!(error(|parts| parts.tracks[0].states.truncate(3)), short);
    assert_eq!(error(|parts| parts.tracks[1].id = TrackId(5)), SceneError::DuplicateTrack(TrackId(5)));
    assert_eq!(error(|parts| parts.tracks[1].states = vec![None; 4]), SceneError::AvNeverValid(TrackId(6)));
    assert_eq!(error(|parts| parts.timestamps[2] = f64::NAN), SceneError::Timestamp { step: 2 });
    let signals = SceneError::SignalLength { signals: 3, steps: 4 };
    assert_eq!(error(|parts| parts.signals = vec![Vec::new(); 3]), signals);
}

#[test]
fn a_track_that_is_never_seen_is_kept_and_reported() {
    let (scene, found) = finding(|parts| parts.tracks[0].states = vec![None; 4]);
    assert_eq!((found, scene.tracks().len()), (Finding::EmptyTrack { track: TrackId(5) }, 2));
}

#[test]
fn a_state_that_cannot_be_is_taken_as_not_valid() {
    let bad = [
        AgentState { x: f64::NAN, ..AgentState::default() },
        AgentState { velocity_y: f64::INFINITY, ..AgentState::default() },
        AgentState { z: 2e7, ..AgentState::default() },
    ];
    for state in bad {
        let (scene, found) = finding(|parts| parts.tracks[0].states[2] = Some(state));
        assert_eq!(found, Finding::BadState { track: TrackId(5), steps: [2].into_iter().collect() });
        assert_eq!(scene.tracks()[0].states[2], None);
    }
}

#[test]
fn a_state_without_a_size_is_kept_apart_and_comes_back() {
    let spoilt = |state: &mut AgentState| (state.length, state.width) = (-3.0, f64::NAN);
    let (scene, findings) = changed(|parts| parts.tracks[0].states[2].iter_mut().for_each(spoilt)).unwrap();
    assert_eq!((findings.len(), scene.tracks()[0].states[2]), (0, None));
    let logged = *scene.logged(0, 2).unwrap();
    assert_eq!((logged.length, logged.width, logged.height), (-1.0, -1.0, 0.0));
    assert_eq!(scene.clone().into_parts().tracks[0].states[2], Some(logged));
    assert_eq!(scene.clone().into_parts().check().unwrap().0, scene);
}

#[test]
fn gaps_of_the_av_are_reported() {
    let (_, found) = finding(|parts| parts.tracks[1].states[1] = None);
    assert_eq!(found, Finding::AvGaps { missing: 1, steps: 4, first: 1 });
}

#[test]
fn a_link_to_no_lane_is_dropped() {
    let (scene, found) = finding(|parts| parts.map.lanes[0].exits.push(MapId(9)));
    assert_eq!(found, Finding::DanglingLane { lane: MapId(1), missing: MapId(9) });
    assert_eq!(scene.map().lanes[0].exits, [MapId(2)]);
    let (_, found) = finding(|parts| parts.map.lanes[1].entries.push(MapId(3)));
    // A road line is no lane.
    assert_eq!(found, Finding::DanglingLane { lane: MapId(2), missing: MapId(3) });
}

#[test]
fn a_link_that_is_not_mutual_is_kept_and_reported() {
    let (scene, found) = finding(|parts| parts.map.lanes[1].entries.clear());
    assert_eq!(found, Finding::OneWayLink { from: MapId(1), to: MapId(2) });
    assert_eq!(scene.map().lanes[0].exits, [MapId(2)]);
}

#[test]
fn a_boundary_must_be_a_line_or_edge_of_the_map_or_none() {
    let segment = |feature: i64, last: i32| BoundarySegment {
        lane_start_index: 0,
        lane_end_index: last,
        feature: MapId(feature),
        kind: RoadLineKind::Unknown,
    };
    assert_eq!(changed(|parts| parts.map.lanes[0].left_boundaries = vec![segment(3, 2), segment(0, 2)]).unwrap().1, []);
    for wrong in [segment(9, 2), segment(3, 3), segment(3, -1)] {
        let (scene, found) = finding(|parts| parts.map.lanes[0].right_boundaries = vec![wrong]);
        assert_eq!(found, Finding::DanglingBoundary { lane: MapId(1), missing: wrong.feature });
        assert!(scene.map().lanes[0].right_boundaries.is_empty());
    }
}

#[test]
fn a_neighbor_must_be_a_lane_over_points_that_are_there() {
    let beside = |lane: i64, last: i32| LaneNeighbor {
        lane: MapId(lane),
        self_start_index: 0,
        self_end_index: last,
        neighbor_start_index: 0,
        neighbor_end_index: 2,
        boundaries: Vec::new(),
    };
    assert_eq!(changed(|parts| parts.map.lanes[0].left_neighbors = vec![beside(2, 2)]).unwrap().1, []);
    let (scene, found) = finding(|parts| parts.map.lanes[0].left_neighbors = vec![beside(2, 3)]);
    assert_eq!(found, Finding::BadNeighbor { lane: MapId(1), neighbor: MapId(2) });
    assert!(scene.map().lanes[0].left_neighbors.is_empty());
    let (_, found) = finding(|parts| parts.map.lanes[0].right_neighbors = vec![beside(9, 2)]);
    assert_eq!(found, Finding::DanglingLane { lane: MapId(1), missing: MapId(9) });
}

#[test]
fn a_stop_sign_rules_only_lanes_that_are_there() {
    let (scene, found) = finding(|parts| parts.map.stop_signs[0].lanes.push(MapId(9)));
    assert_eq!(found, Finding::DanglingStopSign { sign: MapId(4), missing: MapId(9) });
    assert_eq!(scene.map().stop_signs[0].lanes, [MapId(1)]);
}

#[test]
fn signals_of_lanes_that_are_not_there_are_kept_and_reported_once() {
    let (scene, found) = finding(|parts| parts.signals = vec![vec![signal(9)]; 4]);
    assert_eq!(found, Finding::SignalWithoutLane { lane: MapId(9), step: 0 });
    assert_eq!(scene.signals(3).len(), 1);
}

#[test]
fn a_signal_without_a_place_is_dropped() {
    let nowhere = Signal { stop_point: Point3::new(f64::NAN, 0.0, 0.0), ..signal(1) };
    let (scene, found) = finding(|parts| parts.signals = vec![vec![nowhere], vec![], vec![], vec![]]);
    assert_eq!(found, Finding::BadSignal { lane: MapId(1), steps: [0].into_iter().collect() });
    assert!(scene.signals(0).is_empty());
}

#[test]
fn of_two_signals_of_a_lane_the_first_counts() {
    let red = Signal { state: SignalState::Stop, ..signal(1) };
    let (scene, found) = finding(|parts| parts.signals = vec![vec![], vec![red, signal(1)], vec![], vec![]]);
    assert_eq!(found, Finding::DuplicateSignal { lane: MapId(1), steps: [1].into_iter().collect() });
    assert_eq!(scene.signals(1), [red]);
}

#[test]
fn a_feature_without_usable_points_is_dropped() {
    for polygon in [vec![], vec![Point3::new(0.0, f64::INFINITY, 0.0)], vec![Point3::new(0.0, 0.0, -2e7)]] {
        let (scene, found) = finding(|parts| parts.map.crosswalks = vec![Area { id: MapId(8), polygon }]);
        assert_eq!(found, Finding::BadFeature(MapId(8)));
        assert!(scene.map().crosswalks.is_empty());
    }
}

#[test]
fn of_two_features_with_one_id_the_later_is_dropped() {
    let again = Area { id: MapId(1), polygon: vec![Point3::default()] };
    let (scene, found) = finding(|parts| parts.map.driveways = vec![again]);
    assert_eq!(found, Finding::DuplicateFeature(MapId(1)));
    assert!(scene.map().driveways.is_empty() && scene.map().lanes.len() == 2);
}

#[test]
fn a_lane_of_one_point_is_kept_and_reported() {
    let (_, found) = finding(|parts| parts.map.lanes[0].centerline.truncate(1));
    assert_eq!(found, Finding::OnePointLane(MapId(1)));
}

#[test]
fn a_speed_limit_that_cannot_be_is_not_known() {
    for limit in [-1.0, 201.0, f64::NAN] {
        let (scene, found) = finding(|parts| parts.map.lanes[0].speed_limit_mph = limit);
        assert_eq!(found, Finding::BadSpeedLimit { lane: MapId(1), text: limit.to_string() });
        assert_eq!(scene.map().lanes[0].speed_limit(), None);
    }
    let (scene, _) = changed(|parts| parts.map.lanes[0].speed_limit_mph = 25.0).unwrap();
    assert_eq!(scene.map().lanes[0].speed_limit(), Some(25.0 * crate::map::METERS_PER_SECOND_PER_MPH));
}

#[test]
fn time_that_goes_back_is_reported() {
    let (_, found) = finding(|parts| parts.timestamps[3] = 0.15);
    assert_eq!(found, Finding::TimeGoesBack { step: 3 });
}

#[test]
fn tasks_about_no_track_are_dropped() {
    let (scene, found) = finding(|parts| parts.objects_of_interest = vec![TrackId(5), TrackId(1)]);
    assert_eq!(found, Finding::UnknownObjectOfInterest(TrackId(1)));
    assert_eq!(scene.objects_of_interest(), [TrackId(5)]);
    let task = |track_index| TrackToPredict { track_index, difficulty: 1 };
    let (scene, found) = finding(|parts| parts.tracks_to_predict = vec![task(0), task(2)]);
    assert_eq!(found, Finding::UnknownTrackToPredict { index: 2 });
    assert_eq!(scene.tracks_to_predict(), [task(0)]);
}

#[test]
fn a_current_time_past_the_end_is_the_last_step() {
    let (scene, found) = finding(|parts| parts.current_time_index = 4);
    assert_eq!(found, Finding::CurrentTimeIndex { index: 4 });
    assert_eq!(scene.current_time_index(), 3);
}
