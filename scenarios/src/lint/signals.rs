//! Signals by the AV's way that fall silent, and signals that others do not keep to.

use std::collections::{BTreeMap, BTreeSet};

use world::geometry::{Point, Point3, Pose, angle_difference};
use world::map::{Lane, MapId};
use world::scene::bridged::{Bridged, LONGEST_GAP};
use world::scene::{AgentKind, AgentState, Scene, Steps, TrackId};
use world::signal::{Signal, SignalState};

use super::Lint;
use super::way::{IN_THE_WAY, Way};

/// Silence shorter than this (steps) is not told: signals flicker.
const SHORTEST_SILENCE: usize = 5;

pub(super) fn lint(bridged: &Bridged, way: &Way, lints: &mut Vec<Lint>) {
    drop_outs(bridged.logged(), way, lints);
    out_of_step(bridged.judged(), lints);
}

/// Steps between two at which a signal is known, for each lane of the AV's way.
fn drop_outs(scene: &Scene, way: &Way, lints: &mut Vec<Lint>) {
    let mut known: BTreeMap<MapId, (usize, SignalState)> = BTreeMap::new();
    let mut silent: BTreeMap<MapId, (Steps, usize, bool)> = BTreeMap::new();
    for step in 0..scene.steps() {
        for signal in scene.signals(step).iter().filter(|signal| signal.state != SignalState::Unknown) {
            let Some((last, state)) = known.insert(signal.lane, (step, signal.state)) else { continue };
            let gap = step - last - 1;
            if gap >= SHORTEST_SILENCE && way.holds(signal.stop_point, IN_THE_WAY, last) {
                let (steps, longest, bridged) = silent.entry(signal.lane).or_insert((Steps::default(), 0, true));
                (last + 1..step).for_each(|step| steps.push(step));
                *longest = (*longest).max(gap);
                *bridged &= gap <= LONGEST_GAP && state == signal.state;
            }
        }
    }
    let lint = |(lane, (steps, longest, bridged))| Lint::SignalDropsOut { lane, steps, longest, bridged };
    lints.extend(silent.into_iter().map(lint));
}

/// A lane that turns more than this (rad) may be entered at red, to the right, and is waited before at green, to the left.
const STRAIGHT: f64 = 0.5;

/// A light has to show the same for so many steps before anybody is held to it: people are slow, and so are detectors.
const SETTLED: usize = 20;

/// Who was slower than this (m/s) stood.
const STANDING: f64 = 0.5;

/// Who stands this near (m) before a stop point is the first in its line.
const FIRST_IN_LINE: f64 = 6.0;

/// Who passes a stop point farther to the side than this (m) is on another lane.
const BESIDE: f64 = 1.8;

/// After so many steps it shows who turns.
const TURNED: usize = 25;

/// Who stands at green for so many steps has not seen it, or it is not there.
const WAITS: usize = 50;

/// No more stop points than these are looked at: a damaged file may have a million.
const MOST_LIGHTS: usize = 500;

/// What one stop point shows, where one of its lanes goes straight on.
struct Light {
    lane: MapId,
    stop: Pose,
    /// All of its lanes go straight on.
    straight: bool,
    z: f64,
    /// Whether one may go, step by step; nothing where its lanes differ.
    shown: Vec<Option<bool>>,
}

/// Lights with those who start at their red, and those who stand at their green.
fn out_of_step(scene: &Scene, lints: &mut Vec<Lint>) {
    for light in lights(scene) {
        let (mut starts, mut waits) = (BTreeSet::new(), BTreeSet::new());
        for track in scene.tracks().iter().filter(|track| track.kind == AgentKind::Vehicle) {
            let seen: Vec<Option<Approach>> =
                track.states.iter().map(|state| light.approach(state.as_ref()?)).collect();
            let starts_straight_on =
                |step: usize| light.is_started_at_red(&seen, step) && light.is_along_after(&track.states, step);
            if (1..seen.len()).any(starts_straight_on) {
                starts.insert(track.id);
            }
            if light.straight && light.is_waited_at_green(&seen) {
                waits.insert(track.id);
            }
        }
        if !starts.is_empty() || !waits.is_empty() {
            let [starts, waits] = [starts, waits].map(|tracks| tracks.into_iter().collect::<Vec<TrackId>>());
            lints.push(Lint::SignalOutOfStep { lane: light.lane, starts, waits });
        }
    }
}

/// How a vehicle stands to a stop point: how far its front is before it (m), and how fast it is.
#[derive(Clone, Copy)]
struct Approach {
    ahead: f64,
    speed: f64,
}

impl Light {
    fn approach(&self, state: &AgentState) -> Option<Approach> {
        let front = self.stop.to_body(state.oriented_box().front());
        let along = angle_difference(self.stop.heading, state.heading).abs() < STRAIGHT;
        let near = along && front.y.abs() <= BESIDE && (state.z - self.z).abs() < 4.0;
        near.then(|| Approach { ahead: -front.x, speed: state.speed() })
    }

    /// Whether the light has shown `go` for long enough up to `step`.
    fn has_shown(&self, go: bool, step: usize) -> bool {
        step + 1 >= SETTLED && self.shown[step + 1 - SETTLED..=step].iter().all(|shown| *shown == Some(go))
    }

    /// Whether a vehicle that had stood passes the stop point at red at `step`.
    fn is_started_at_red(&self, seen: &[Option<Approach>], step: usize) -> bool {
        let (Some(before), Some(now)) = (seen[step - 1], seen[step]) else { return false };
        let passes = before.ahead >= 0.0 && now.ahead < 0.0;
        let since = step.saturating_sub(SETTLED + LONGEST_GAP);
        let stood = || seen[since..step].iter().flatten().any(|at| at.speed < STANDING && at.ahead < FIRST_IN_LINE);
        passes && self.has_shown(false, step) && stood()
    }

    /// Whether a vehicle that passes at `step` has not turned a while later: to the right one may go at red.
    fn is_along_after(&self, states: &[Option<AgentState>], step: usize) -> bool {
        let later = (step + TURNED..(step + 2 * TURNED).min(states.len())).find_map(|at| states[at]);
        later.is_some_and(|state| angle_difference(self.stop.heading, state.heading).abs() < STRAIGHT)
    }

    /// Whether a vehicle stands first in line for long while the light is green.
    fn is_waited_at_green(&self, seen: &[Option<Approach>]) -> bool {
        let waits = |step: usize| {
            let first = seen[step].is_some_and(|at| at.speed < STANDING && (0.0..FIRST_IN_LINE).contains(&at.ahead));
            first && self.has_shown(true, step)
        };
        let mut run = 0;
        (0..seen.len()).any(|step| {
            run = if waits(step) { run + 1 } else { 0 };
            run >= WAITS
        })
    }
}

/// The lanes of a stop point, and what each of them is shown at which step.
type Group = BTreeMap<MapId, Vec<(usize, Signal)>>;

fn lights(scene: &Scene) -> Vec<Light> {
    let map = scene.map();
    let lanes = map.lane_indices();
    // Stop points by the centimetre: lanes that part at a stop line share it.
    let mut groups: BTreeMap<(i64, i64), Group> = BTreeMap::new();
    for step in 0..scene.steps() {
        for signal in scene.signals(step) {
            let group = groups.entry(key(signal.stop_point)).or_default();
            group.entry(signal.lane).or_default().push((step, *signal));
        }
    }
    let light = |group: Group| {
        let straight = |lane: &MapId| lanes.get(lane).and_then(|index| straight_heading(&map.lanes[*index]));
        let (lane, heading) = group.keys().find_map(|lane| Some((*lane, straight(lane)?)))?;
        let stop = group.get(&lane)?.first()?.1.stop_point;
        let all_straight = group.keys().all(|lane| straight(lane).is_some());
        let shown = (0..scene.steps()).map(|_| None).collect();
        let mut light =
            Light { lane, stop: Pose::new(stop.x, stop.y, heading), straight: all_straight, z: stop.z, shown };
        let mut all: Vec<Vec<Option<bool>>> = vec![Vec::new(); scene.steps()];
        group.values().flatten().for_each(|(step, signal)| all[*step].push(go(signal.state)));
        for (shown, of_step) in light.shown.iter_mut().zip(all) {
            *shown = of_step
                .first()
                .copied()
                .flatten()
                .filter(|first| of_step.len() == group.len() && of_step.iter().all(|other| *other == Some(*first)));
        }
        Some(light)
    };
    groups.into_values().take(MOST_LIGHTS).filter_map(light).collect()
}

fn key(point: Point3) -> (i64, i64) {
    ((point.x * 100.0).round() as i64, (point.y * 100.0).round() as i64)
}

/// Whether one may go; nothing where it is neither green nor red.
fn go(state: SignalState) -> Option<bool> {
    match state {
        SignalState::Go | SignalState::ArrowGo => Some(true),
        SignalState::Stop | SignalState::ArrowStop => Some(false),
        _ => None,
    }
}

/// The heading of a lane that goes straight on.
fn straight_heading(lane: &Lane) -> Option<f64> {
    let heading = |pair: &[Point3]| {
        let way: Point = pair[1].xy() - pair[0].xy();
        (way.norm() > 0.0).then(|| way.heading())
    };
    let mut headings = lane.centerline.windows(2).filter_map(heading);
    let first = headings.next()?;
    let last = headings.next_back().unwrap_or(first);
    (angle_difference(first, last).abs() < STRAIGHT).then_some(first)
}
