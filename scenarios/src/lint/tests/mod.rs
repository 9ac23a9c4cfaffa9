//! Each finding on a scene that was spoilt for it.

mod road;

use std::sync::Arc;

use world::map::{LaneKind, Map};
use world::scene::{AgentState, Judgement, SceneParts, Unjudged};
use world::signal::SignalState;

use super::{Lint, Severity, Summary, lint};

/// What is found in the scene of `road` after `spoil`.
fn found(spoil: impl Fn(&mut SceneParts)) -> Vec<Lint> {
    let mut parts = road::scene("x");
    spoil(&mut parts);
    let (scene, findings) = parts.check().unwrap();
    lint(&Arc::new(scene), &findings)
}

fn for_av(parts: &mut SceneParts, change: impl Fn(usize, &mut AgentState)) {
    let states = &mut parts.tracks[parts.av_index].states;
    states.iter_mut().enumerate().for_each(|(step, state)| change(step, state.as_mut().unwrap()));
}

#[test]
fn in_a_scene_that_was_not_spoilt_there_is_nothing_to_find() {
    assert_eq!(found(|_| {}), []);
}

#[test]
fn an_overlap_names_the_track_and_the_steps() {
    let lints = found(|parts| {
        let av = parts.tracks[parts.av_index].states[100];
        parts.tracks[0].states[100] = av;
    });
    let [Lint::AvOverlap { track, steps, .. }] = &lints[..1] else { panic!("{lints:?}") };
    assert_eq!((track.0, steps.to_string().as_str()), (1, "step 100"));
}

#[test]
fn an_av_beside_the_road_is_off_road_far_from_lanes_and_off_its_route_or_without_one() {
    let shift = |by: f64| found(move |parts| for_av(parts, |step, av| av.y -= if step >= 150 { by } else { 0.0 }));
    assert!(!shift(4.2).iter().any(|lint| matches!(lint, Lint::AvOffRoad { .. })));
    let lints = shift(4.8);
    let beyond = lints.iter().find_map(|lint| match lint {
        Lint::AvOffRoad { worst, steps } => Some((*worst, steps.to_string())),
        _ => None,
    });
    let (worst, steps) = beyond.unwrap();
    assert!((worst - (4.8 + 0.5 * road::AV_WIDTH + road::CURB)).abs() < 1e-9, "{worst}");
    assert_eq!(steps, "steps 150-199");
    assert!(shift(12.0).iter().any(|lint| matches!(lint, Lint::AvFarFromLane { .. })));
}

#[test]
fn a_red_light_that_is_run_is_found_once() {
    let red = |parts: &mut SceneParts| parts.signals.iter_mut().flatten().for_each(|s| s.state = SignalState::Stop);
    let lints = found(red);
    let runs: Vec<&Lint> = lints.iter().filter(|lint| matches!(lint, Lint::AvRunsRed { .. })).collect();
    assert_eq!(runs.len(), 1, "{lints:?}");
    let flashing =
        |parts: &mut SceneParts| parts.signals.iter_mut().flatten().for_each(|s| s.state = SignalState::FlashingStop);
    assert!(!found(flashing).iter().any(|lint| matches!(lint, Lint::AvRunsRed { .. })));
}

#[test]
fn a_parked_av_a_jump_and_a_dropped_frame() {
    let lints = found(|parts| {
        let first = parts.tracks[parts.av_index].states[0];
        for_av(parts, |_, av| *av = first.unwrap());
    });
    assert!(matches!(lints[0], Lint::AvParked { meters } if meters == 0.0), "{lints:?}");

    let jump = |parts: &mut SceneParts| parts.tracks[0].states[7].as_mut().unwrap().x += 9.0;
    let lints = found(jump);
    assert!(
        lints.iter().any(|l| matches!(l, Lint::Teleport { steps, .. } if steps.to_string() == "steps 7-8")),
        "{lints:?}"
    );

    let late = |by: f64| move |parts: &mut SceneParts| parts.timestamps[50..].iter_mut().for_each(|time| *time += by);
    let severity = |by| {
        found(late(by)).iter().find_map(|lint| match lint {
            Lint::IrregularTime { step: 50, .. } => Some(lint.severity()),
            _ => None,
        })
    };
    assert_eq!([severity(0.01), severity(0.03), severity(0.2)], [None, Some(Severity::Note), Some(Severity::Warning)]);
}

#[test]
fn what_is_missing_is_said() {
    let has = |lints: &[Lint], wanted: Lint| assert!(lints.contains(&wanted), "{wanted:?} is not in {lints:?}");
    has(&found(|parts| parts.signals.clear()), Lint::NoSignals);
    has(&found(|parts| parts.signals[9].clear()), Lint::PartialSignals { with: 199, steps: 200 });
    has(&found(|parts| parts.map.road_edges.clear()), Lint::Unjudged(Unjudged::NoRoadEdges));
    has(&found(|parts| parts.map = Map::default()), Lint::NoDrivableLane);
    has(&found(|parts| parts.map.lanes.iter_mut().for_each(|l| l.kind = LaneKind::BikeLane)), Lint::NoDrivableLane);
    has(
        &found(|parts| parts.map.lanes.iter_mut().for_each(|l| l.speed_limit_mph = 0.0)),
        Lint::Unjudged(Unjudged::NoSpeedLimits),
    );
    let short = |parts: &mut SceneParts| {
        parts.timestamps.truncate(91);
        parts.signals.truncate(91);
        parts.tracks.iter_mut().for_each(|track| track.states.truncate(91));
    };
    has(&found(short), Lint::Short { steps: 91 });
}

#[test]
fn the_gravest_come_first() {
    let lints = found(|parts| {
        parts.map = Map::default();
        parts.signals.iter_mut().for_each(Vec::clear);
    });
    assert!(lints.is_sorted_by_key(|lint| std::cmp::Reverse(lint.severity())));
    assert_eq!(lints[0].severity(), Severity::Error);
}

fn of<'a>(lints: &'a [Lint], code: &str) -> &'a Lint {
    lints.iter().find(|lint| lint.code() == code).unwrap_or_else(|| panic!("no {code} in {lints:?}"))
}

/// The leader of `following` is track 1, the first.
fn without(steps: std::ops::Range<usize>) -> Vec<Lint> {
    found(move |parts| parts.tracks[0].states[steps.clone()].fill(None))
}

#[test]
fn who_drops_out_begins_or_ends_in_the_way_is_told() {
    let severity = |lints: &[Lint], code| of(lints, code).severity();
    let long = without(60..75);
    assert!(
        of(&long, "track-drops-out").to_string().contains("1 drops out near the AV's way at steps 60-74, for 15 steps")
    );
    assert_eq!(severity(&long, "track-drops-out"), Severity::Warning);
    assert_eq!(severity(&without(60..64), "track-drops-out"), Severity::Note);
    assert!(matches!(of(&without(60..100), "track-drops-out"), Lint::TrackDropsOut { bridged: false, .. }));
    assert!(matches!(of(&without(0..90), "track-appears"), Lint::TrackAppears { step: 90, .. }));
    assert!(matches!(of(&without(75..200), "track-vanishes"), Lint::TrackVanishes { step: 74, .. }));
}

#[test]
fn who_is_not_in_the_way_may_come_and_go() {
    let lints = found(|parts| {
        parts.tracks[0].states.iter_mut().flatten().for_each(|state| state.z += 6.0);
        parts.tracks[0].states[60..75].fill(None);
        parts.tracks[0].states[150..].fill(None);
    });
    assert!(lints.iter().all(|lint| !lint.code().starts_with("track-")), "{lints:?}");
}

#[test]
fn a_size_is_told_once_a_track() {
    let lints = found(|parts| parts.tracks[0].states.iter_mut().flatten().for_each(|s| s.length = -1.0));
    let sizes: Vec<String> = lints.iter().filter(|l| l.code() == "size-mended").map(ToString::to_string).collect();
    assert_eq!(sizes.len(), 1);
    assert!(sizes[0].contains("1 has no size at steps 0-199: taken as 4.6 x "), "{sizes:?}");
}

#[test]
fn a_signal_that_falls_silent_in_the_way_is_told() {
    let silent = |steps: std::ops::Range<usize>| {
        found(move |parts| parts.signals[steps.clone()].iter_mut().for_each(Vec::clear))
    };
    let lints = silent(20..50);
    assert!(matches!(of(&lints, "signal-drops-out"), Lint::SignalDropsOut { longest: 30, .. }), "{lints:?}");
    assert_eq!(of(&lints, "signal-drops-out").severity(), Severity::Warning);
    assert!(silent(20..23).iter().all(|lint| lint.code() != "signal-drops-out"));
}

#[test]
fn a_signal_that_nobody_keeps_to_is_out_of_step() {
    // Red throughout: whoever waited and went on started at it. The other way round for who waited at green.
    let all = |state| {
        move |parts: &mut SceneParts| parts.signals.iter_mut().flatten().for_each(|signal| signal.state = state)
    };
    let starts = found(all(SignalState::Stop));
    assert!(of(&starts, "signal-out-of-step").to_string().contains("start at its red"), "{starts:?}");
    let waits = found(all(SignalState::Go));
    assert!(of(&waits, "signal-out-of-step").to_string().contains("stand at its green"), "{waits:?}");
    // Who would turn left waits at green for others: only where all lanes of a light go straight on is waiting odd.
    let turns = found(|parts| {
        all(SignalState::Go)(parts);
        let left = parts.map.lanes.iter_mut().find(|lane| lane.id.0 == 11).unwrap();
        left.centerline.iter_mut().for_each(|point| (point.x, point.y) = (80.0, point.x - 80.0));
        parts.signals.iter_mut().flatten().for_each(|signal| signal.stop_point.y = 0.0);
    });
    assert!(turns.iter().all(|lint| lint.code() != "signal-out-of-step"), "{turns:?}");
}

#[test]
fn an_av_against_its_lane_or_too_fast() {
    let reversed = found(|parts| {
        parts.map.lanes.iter_mut().for_each(|lane| {
            lane.centerline.reverse();
            std::mem::swap(&mut lane.entries, &mut lane.exits);
        });
    });
    of(&reversed, "av-against-lane");
    let slow = found(|parts| parts.map.lanes.iter_mut().for_each(|lane| lane.speed_limit_mph = 10.0));
    assert!(matches!(of(&slow, "av-speeding"), Lint::AvSpeeding { worst, .. } if *worst > 5.0), "{slow:?}");
    let faster = found(|parts| parts.map.lanes.iter_mut().for_each(|lane| lane.speed_limit_mph = 100.0));
    assert!(faster.iter().all(|lint| lint.code() != "av-speeding"));
}

#[test]
fn sparse_lanes_and_an_av_that_ends_early_are_told() {
    let sparse = found(|parts| {
        for lane in &mut parts.map.lanes {
            let points = &mut lane.centerline;
            *points = points.iter().copied().step_by(9).chain(points.last().copied()).collect();
            lane.left_boundaries.clear();
            lane.right_boundaries.clear();
        }
    });
    assert_eq!(of(&sparse, "sparse-lanes").severity(), Severity::Warning);
    let ends = |steps: std::ops::Range<usize>| {
        found(move |parts| parts.tracks[parts.av_index].states[steps.clone()].fill(None))
    };
    assert_eq!(of(&ends(120..200), "av-missing").severity(), Severity::Warning);
    assert_eq!(of(&ends(10..30), "av-missing").severity(), Severity::Warning, "filled in");
    assert_eq!(of(&ends(0..60), "av-missing").severity(), Severity::Error);
}

#[test]
fn a_summary_names_each_kind_once_and_what_cannot_be_judged() {
    let lints = found(|parts| {
        parts.map.road_edges.clear();
        parts.map.lanes.iter_mut().for_each(|lane| lane.speed_limit_mph = 0.0);
        parts.tracks[0].states[7].as_mut().unwrap().x += 9.0;
    });
    let summary = Summary::of(&lints);
    assert_eq!(summary.codes, ["no-road-edges", "no-speed-limits", "track-jumps"]);
    assert_eq!((summary.warnings, summary.errors), (3, 0));
    assert_eq!(summary.unjudged, [Judgement::OffRoad, Judgement::Speeding]);
}
