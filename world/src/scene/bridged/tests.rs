//! Gaps of each kind, cut into a small scene.

use std::sync::Arc;

use super::*;
use crate::geometry::Point3;
use crate::map::{BoundarySegment, Lane, LaneNeighbor, Map, RoadLineKind};
use crate::scene::AgentKind;
use crate::signal::SignalState;

const STEPS: usize = 100;

/// A car that brakes evenly from 15 m/s, 0.1 m/s a step.
fn braking(step: usize) -> AgentState {
    let seconds = step as f64 * 0.1;
    AgentState {
        x: 15.0 * seconds - 0.5 * seconds * seconds,
        velocity_x: 15.0 - seconds,
        length: 4.5,
        width: 2.0,
        height: 1.5,
        ..AgentState::default()
    }
}

/// The AV and a braking car, listed throughout; signals and map as they are given.
fn parts() -> SceneParts {
    let track = |id, kind| Track { id: TrackId(id), kind, states: (0..STEPS).map(|s| Some(braking(s))).collect() };
    SceneParts {
        id: "gaps".into(),
        timestamps: (0..STEPS).map(|step| step as f64 * 0.1).collect(),
        tracks: vec![track(7, AgentKind::Vehicle), track(8, AgentKind::Vehicle)],
        av_index: 1,
        signals: vec![Vec::new(); STEPS],
        ..SceneParts::default()
    }
}

fn bridged(change: impl FnOnce(&mut SceneParts)) -> Bridged {
    let mut parts = parts();
    change(&mut parts);
    Bridged::of(&Arc::new(parts.check().unwrap().0))
}

fn without(steps: std::ops::Range<usize>) -> Bridged {
    bridged(|parts| parts.tracks[0].states[steps].fill(None))
}

fn judged(bridged: &Bridged, step: usize) -> Option<AgentState> {
    bridged.judged().tracks()[0].states[step]
}

#[test]
fn where_nothing_is_missing_the_scene_is_judged_as_it_is() {
    let whole = bridged(|_| {});
    assert!(Arc::ptr_eq(whole.judged(), whole.logged()));
    for step in 0..STEPS {
        assert_eq!(whole.observed(0, step), Some(SeenAgent { state: braking(step), unseen: 0 }));
        assert_eq!((whole.unseen(0, step), whole.visible_for(0, step)), (Some(0), Some(step as u32 + 1)));
    }
}

#[test]
fn judges_see_who_brakes_evenly_where_he_was() {
    let gap = without(20..50);
    for step in 0..STEPS {
        let (state, truth) = (judged(&gap, step).unwrap(), braking(step));
        assert!((state.x - truth.x).abs() < 1e-9 && (state.velocity_x - truth.velocity_x).abs() < 1e-9, "{step}");
        let unseen = if (20..50).contains(&step) { step - 19 } else { 0 };
        assert_eq!(gap.unseen(0, step), Some(unseen as u32));
    }
    assert_eq!(gap.gaps(), [TrackGap { track: 0, before: 19, after: 50, bridged: true }]);
    assert!(gap.logged().tracks()[0].states[20].is_none(), "the logged scene is as it was");
}

#[test]
fn longer_gaps_and_ends_stay_for_judges() {
    let long = without(20..51);
    assert!((20..51).all(|step| judged(&long, step).is_none() && long.unseen(0, step).is_none()));
    assert!(!long.gaps()[0].bridged);
    let early = without(75..STEPS);
    assert!(judged(&early, 75).is_none() && early.gaps().is_empty());
    let late = without(0..90);
    assert!(judged(&late, 89).is_none() && late.observed(0, 89).is_none());
    assert_eq!((late.visible_for(0, 89), late.visible_for(0, 90), late.visible_for(0, 99)), (None, Some(1), Some(10)));
}

#[test]
fn a_jump_is_not_bridged() {
    let jump = bridged(|parts| {
        parts.tracks[0].states[20..25].fill(None);
        parts.tracks[0].states[25..].iter_mut().flatten().for_each(|state| state.x += 100.0);
    });
    assert!(judged(&jump, 22).is_none() && !jump.gaps()[0].bridged);
}

#[test]
fn velocities_that_lead_astray_are_left_aside() {
    let astray = bridged(|parts| {
        parts.tracks[0].states[20..24].fill(None);
        parts.tracks[0].states[19].as_mut().unwrap().velocity_x = 74.0;
    });
    let (from, to) = (braking(19).x, braking(24).x);
    assert!((judged(&astray, 20).unwrap().x - (from + 0.2 * (to - from))).abs() < 1e-9);
}

#[test]
fn a_driver_supposes_that_others_go_on_for_three_seconds() {
    let gap = without(75..STEPS);
    let last = braking(74);
    // The median of the last five speeds is that of two steps before.
    let speed = braking(72).velocity_x;
    let seen = gap.observed(0, 84).unwrap();
    assert_eq!(seen.unseen, 10);
    assert!((seen.state.x - (last.x + speed)).abs() < 1e-9 && (seen.state.velocity_x - speed).abs() < 1e-12);
    assert_eq!(gap.visible_for(0, 84), Some(85));
    let gone = bridged(|parts| parts.tracks[0].states[30..STEPS].fill(None));
    assert!(gone.observed(0, 59).is_some() && gone.observed(0, 60).is_none() && gone.visible_for(0, 60).is_none());
}

#[test]
fn who_was_away_for_longer_appears_anew() {
    let long = without(20..51);
    assert_eq!((long.visible_for(0, 49), long.visible_for(0, 50), long.visible_for(0, 51)), (Some(50), None, Some(1)));
    let short = without(20..50);
    assert_eq!((short.visible_for(0, 50), short.logged_for(0, 50), short.logged_for(0, 49)), (Some(51), 1, 0));
}

#[test]
fn what_a_driver_supposes_hangs_on_no_later_step() {
    let spoilt = |later: usize| {
        bridged(|parts| {
            parts.tracks[0].states[20..24].fill(None);
            parts.tracks[0].states[30].as_mut().unwrap().length = 40.0;
            parts.tracks[0].states[40..60].iter_mut().flatten().for_each(|state| state.width = -1.0);
            for (step, signals) in parts.signals.iter_mut().enumerate().filter(|(step, _)| step % 9 < 6) {
                signals.push(signal(if step / 20 % 2 == 0 { SignalState::Stop } else { SignalState::Go }));
            }
            for step in later..STEPS {
                parts.tracks[0].states[step] = None;
                parts.signals[step].clear();
            }
        })
    };
    let whole = spoilt(STEPS);
    for later in 1..STEPS {
        let cut = spoilt(later);
        for step in 0..later {
            assert_eq!(cut.observed(0, step), whole.observed(0, step));
            assert_eq!(cut.visible_for(0, step), whole.visible_for(0, step));
            assert_eq!(cut.observed_signals(step), whole.observed_signals(step));
        }
    }
}

#[test]
fn sizes_that_are_none_or_jump_are_mended_once_a_track() {
    let sized = |change: &dyn Fn(usize, &mut AgentState)| {
        bridged(|parts| {
            let states = parts.tracks[0].states.iter_mut().enumerate();
            states.for_each(|(step, state)| change(step, state.as_mut().unwrap()));
        })
    };
    let one = |bridged: &Bridged| bridged.mended_sizes()[0].clone();
    let never = sized(&|_, state| (state.length, state.width, state.height) = (-1.0, -1.0, -1.0));
    assert!(never.logged().tracks()[0].states.iter().all(Option::is_none), "the protocol `paper` is not told");
    assert_eq!(
        (one(&never).source, one(&never).size, one(&never).steps.count()),
        (SizeSource::Kind, [4.6, 2.1, 1.7], STEPS)
    );
    assert_eq!((judged(&never, 50).unwrap().length, never.observed(0, 50).unwrap().state.width), (4.6, 2.1));
    assert_eq!(never.unseen(0, 50), Some(0));

    let flat = sized(&|step, state| state.height *= f64::from(u8::from(step % 2 == 0)));
    assert_eq!((one(&flat).source, judged(&flat, 51).unwrap().height), (SizeSource::Median, 1.5));
    let pulse = sized(&|step, state| state.length = if step == 50 { 40.0 } else { state.length });
    assert_eq!((one(&pulse).steps.to_string().as_str(), judged(&pulse, 50).unwrap().length), ("step 50", 4.5));
    assert_eq!(pulse.observed(0, 50).unwrap().state.length, 4.5);
    assert_eq!(pulse.logged().tracks()[0].states[50].unwrap().length, 40.0);

    let unknown = bridged(|parts| {
        parts.tracks[0].kind = AgentKind::Other;
        parts.tracks[0].states.iter_mut().flatten().for_each(|state| state.length = 0.0);
    });
    assert_eq!(one(&unknown).source, SizeSource::Nothing);
}

fn signal(state: SignalState) -> Signal {
    Signal { lane: MapId(1), state, stop_point: Point3::default() }
}

#[test]
fn a_signal_holds_what_it_showed_for_three_seconds_and_is_judged_where_both_sides_agree() {
    use SignalState::{Go, Stop, Unknown};
    let show = |state_at: &dyn Fn(usize) -> Option<SignalState>| {
        bridged(|parts| {
            let steps = parts.signals.iter_mut().enumerate();
            steps.for_each(|(step, signals)| signals.extend(state_at(step).map(signal)));
        })
    };
    let at = |bridged: &Bridged, step: usize| bridged.judged().signals(step).first().map(|signal| signal.state);
    let seen =
        |bridged: &Bridged, step: usize| bridged.observed_signals(step).first().map(|s| (s.signal.state, s.unseen));

    let red_again = show(&|step| (!(30..60).contains(&step)).then_some(Stop));
    assert_eq!((at(&red_again, 45), seen(&red_again, 45)), (Some(Stop), Some((Stop, 16))));
    assert_eq!(red_again.signal_known_for(MapId(1), 70), Some(71));
    let green_then = show(&|step| if step < 30 { Some(Stop) } else { (step >= 60).then_some(Go) });
    assert_eq!((at(&green_then, 45), seen(&green_then, 45)), (None, Some((Stop, 16))), "nobody knows when it changed");
    let gone = show(&|step| (step < 30).then_some(Stop));
    assert_eq!((at(&gone, 30), seen(&gone, 59), seen(&gone, 60)), (None, Some((Stop, 30)), None));
    assert_eq!((gone.signal_known_for(MapId(1), 59), gone.signal_known_for(MapId(1), 60)), (Some(60), None));
    let flicker = show(&|step| Some(if step % 3 == 1 { Unknown } else { Stop }));
    assert_eq!((at(&flicker, 40), seen(&flicker, 40)), (Some(Stop), Some((Stop, 1))));
    let never = show(&|_| Some(Unknown));
    assert_eq!((at(&never, 40), seen(&never, 40)), (Some(Unknown), Some((Unknown, 0))));
    assert_eq!(never.signal_known_for(MapId(1), 40), None);
}

#[test]
fn sparse_lanes_get_points_and_what_counts_in_points_is_recounted() {
    let point = |x: f64| Point3::new(x, 0.0, 0.1 * x);
    let segment = |lane_start_index, lane_end_index| BoundarySegment {
        lane_start_index,
        lane_end_index,
        feature: MapId(0),
        kind: RoadLineKind::Unknown,
    };
    let neighbor = |lane| LaneNeighbor {
        lane: MapId(lane),
        self_start_index: 0,
        self_end_index: 2,
        neighbor_start_index: 1,
        neighbor_end_index: 2,
        boundaries: vec![segment(1, 2)],
    };
    let lane = |id, other, xs: [f64; 3]| Lane {
        id: MapId(id),
        centerline: xs.map(point).to_vec(),
        left_neighbors: vec![neighbor(other)],
        right_boundaries: vec![segment(0, 1), segment(1, 2)],
        ..Lane::default()
    };
    let map = Map { lanes: vec![lane(1, 2, [0.0, 10.0, 10.4]), lane(2, 1, [0.0, 0.5, 1.0])], ..Map::default() };
    let bridged = bridged(|parts| parts.map = map.clone());
    assert_eq!(bridged.sparse_lanes(), [MapId(1)]);
    let lanes = &bridged.judged().map().lanes;
    assert_eq!(lanes[0].centerline.len(), 22);
    assert_eq!(lanes[0].centerline[7], Point3::new(3.5, 0.0, 0.1 * 10.0 * 7.0 / 20.0));
    let indices = |s: &BoundarySegment| (s.lane_start_index, s.lane_end_index);
    assert_eq!(lanes[0].right_boundaries.iter().map(indices).collect::<Vec<_>>(), [(0, 20), (20, 21)]);
    let [own, other] = [&lanes[0].left_neighbors[0], &lanes[1].left_neighbors[0]];
    assert_eq!((own.self_start_index, own.self_end_index, own.neighbor_start_index), (0, 21, 1));
    assert_eq!((other.self_end_index, other.neighbor_start_index, other.neighbor_end_index), (2, 20, 21));
    assert_eq!((indices(&own.boundaries[0]), indices(&other.boundaries[0])), ((20, 21), (1, 2)));
    assert_eq!(bridged.logged().map().lanes, map.lanes, "the logged map is as it was");
}
