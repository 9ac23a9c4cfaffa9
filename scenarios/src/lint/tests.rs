//! Each finding on a generated scene that was spoilt for it.

use world::map::{LaneKind, Map};
use world::scene::{AgentState, SceneParts};
use world::signal::SignalState;

use super::{Lint, Severity, lint};
use crate::generated::Family;
use crate::womd;

/// What is found in a generated scene after `spoil`.
fn found(family: &str, spoil: impl Fn(&mut SceneParts)) -> Vec<Lint> {
    let payload = Family::named(family).unwrap().payload("x", 3, 0).unwrap();
    let mut parts = womd::read(&payload).unwrap().0.into_parts();
    spoil(&mut parts);
    let (scene, findings) = parts.check().unwrap();
    lint(&scene, &findings)
}

fn for_av(parts: &mut SceneParts, change: impl Fn(usize, &mut AgentState)) {
    let states = &mut parts.tracks[parts.av_index].states;
    states.iter_mut().enumerate().for_each(|(step, state)| change(step, state.as_mut().unwrap()));
}

#[test]
fn an_overlap_names_the_track_and_the_steps() {
    let lints = found("following", |parts| {
        let av = parts.tracks[parts.av_index].states[100];
        parts.tracks[0].states[100] = av;
    });
    let [Lint::AvOverlap { track, steps, .. }] = &lints[..1] else { panic!("{lints:?}") };
    assert_eq!((track.0, steps.to_string().as_str()), (1, "step 100"));
}

#[test]
fn an_av_beside_the_road_is_off_road_far_from_lanes_and_off_its_route_or_without_one() {
    let shift =
        |by: f64| found("cut-in", move |parts| for_av(parts, |step, av| av.y -= if step >= 150 { by } else { 0.0 }));
    // The AV's lane is the second of three, so its outer lane's curb is 5.95 m to its right; half its width is 1.17 m.
    assert!(!shift(4.9).iter().any(|lint| matches!(lint, Lint::AvOffRoad { .. })));
    let lints = shift(5.3);
    let beyond = lints.iter().find_map(|lint| match lint {
        Lint::AvOffRoad { worst, steps } => Some((*worst, steps.to_string())),
        _ => None,
    });
    let (worst, steps) = beyond.unwrap();
    assert!((worst - (5.3 + 1.166 - 5.95)).abs() < 0.05, "{worst}");
    assert_eq!(steps, "steps 150-199");
    assert!(shift(12.0).iter().any(|lint| matches!(lint, Lint::AvFarFromLane { .. })));
}

#[test]
fn a_red_light_that_is_run_is_found_once() {
    let red = |parts: &mut SceneParts| parts.signals.iter_mut().flatten().for_each(|s| s.state = SignalState::Stop);
    let lints = found("red-light", red);
    let runs: Vec<&Lint> = lints.iter().filter(|lint| matches!(lint, Lint::AvRunsRed { .. })).collect();
    assert_eq!(runs.len(), 1, "{lints:?}");
    let flashing =
        |parts: &mut SceneParts| parts.signals.iter_mut().flatten().for_each(|s| s.state = SignalState::FlashingStop);
    assert!(!found("red-light", flashing).iter().any(|lint| matches!(lint, Lint::AvRunsRed { .. })));
}

#[test]
fn a_parked_av_a_jump_and_a_dropped_frame() {
    let lints = found("curve", |parts| {
        let first = parts.tracks[parts.av_index].states[0];
        for_av(parts, |_, av| *av = first.unwrap());
    });
    assert!(matches!(lints[0], Lint::AvParked { meters } if meters == 0.0), "{lints:?}");

    let jump = |parts: &mut SceneParts| parts.tracks[0].states[7].as_mut().unwrap().x += 9.0;
    let lints = found("curve", jump);
    assert!(
        lints.iter().any(|l| matches!(l, Lint::Teleport { steps, .. } if steps.to_string() == "steps 7-8")),
        "{lints:?}"
    );

    let late = |by: f64| move |parts: &mut SceneParts| parts.timestamps[50..].iter_mut().for_each(|time| *time += by);
    let severity = |by| {
        found("curve", late(by)).iter().find_map(|lint| match lint {
            Lint::IrregularTime { step: 50, .. } => Some(lint.severity()),
            _ => None,
        })
    };
    assert_eq!([severity(0.01), severity(0.03), severity(0.2)], [None, Some(Severity::Note), Some(Severity::Warning)]);
}

#[test]
fn what_is_missing_is_said() {
    let has = |lints: &[Lint], wanted: Lint| assert!(lints.contains(&wanted), "{wanted:?} is not in {lints:?}");
    has(&found("red-light", |parts| parts.signals.clear()), Lint::NoSignals);
    has(&found("red-light", |parts| parts.signals[9].clear()), Lint::PartialSignals { with: 199, steps: 200 });
    has(&found("curve", |parts| parts.map.road_edges.clear()), Lint::NoRoadEdges);
    has(&found("curve", |parts| parts.map = Map::default()), Lint::NoDrivableLane);
    has(
        &found("curve", |parts| parts.map.lanes.iter_mut().for_each(|l| l.kind = LaneKind::BikeLane)),
        Lint::NoDrivableLane,
    );
    has(&found("curve", |parts| parts.map.lanes.iter_mut().for_each(|l| l.speed_limit_mph = 0.0)), Lint::NoSpeedLimits);
    let short = |parts: &mut SceneParts| {
        parts.timestamps.truncate(91);
        parts.signals.truncate(91);
        parts.tracks.iter_mut().for_each(|track| track.states.truncate(91));
    };
    has(&found("curve", short), Lint::Short { steps: 91 });
}

#[test]
fn the_gravest_come_first() {
    let lints = found("red-light", |parts| {
        parts.map = Map::default();
        parts.signals.iter_mut().for_each(Vec::clear);
    });
    assert!(lints.is_sorted_by_key(|lint| std::cmp::Reverse(lint.severity())));
    assert_eq!(lints[0].severity(), Severity::Error);
}
