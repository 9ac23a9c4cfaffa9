//! From curves and motions to a scene's parts, by WOMD's conventions.

use world::geometry::Point3;
use world::map::{Map, MapId};
use world::plan::STEP_SECONDS;
use world::scene::{AgentKind, AgentState, SceneParts, Track, TrackId};
use world::signal::{Signal, SignalState};

use super::STEPS;
use super::motion::Motion;
use super::old_curve::Curve;

/// The AV's length, width and height (m), those of WOMD's own.
pub(super) const AV_SIZE: [f64; 3] = [5.286, 2.332, 2.33];
/// A passenger car's.
pub(super) const CAR_SIZE: [f64; 3] = [4.7, 1.95, 1.6];
/// A van's.
pub(super) const VAN_SIZE: [f64; 3] = [5.9, 2.1, 2.4];
const PEDESTRIAN_SIZE: [f64; 3] = [0.7, 0.7, 1.75];

/// Others are seen within this distance of the AV (m).
const SIGHT: f64 = 100.0;

/// The actors and the set.
#[derive(Debug)]
pub(super) struct Stage {
    av: Track,
    others: Vec<Track>,
    signals: Vec<Vec<Signal>>,
}

impl Stage {
    /// A stage with the AV alone.
    pub(super) fn new(curve: &Curve, motion: &Motion) -> Self {
        let states = states(curve, motion, AV_SIZE);
        Self {
            av: Track { kind: AgentKind::Vehicle, states, ..Track::default() },
            others: Vec::new(),
            signals: vec![Vec::new(); STEPS],
        }
    }

    pub(super) fn vehicle(&mut self, curve: &Curve, motion: &Motion, size: [f64; 3]) {
        self.enter(AgentKind::Vehicle, curve, motion, size);
    }

    pub(super) fn pedestrian(&mut self, curve: &Curve, motion: &Motion) {
        self.enter(AgentKind::Pedestrian, curve, motion, PEDESTRIAN_SIZE);
    }

    fn enter(&mut self, kind: AgentKind, curve: &Curve, motion: &Motion, size: [f64; 3]) {
        let mut states = states(curve, motion, size);
        for (state, av) in states.iter_mut().zip(&self.av.states) {
            let seen = |a: &AgentState| av.is_some_and(|av| av.position().distance(a.position()) <= SIGHT);
            *state = state.filter(seen);
        }
        if states.iter().any(Option::is_some) {
            self.others.push(Track { id: TrackId(0), kind, states });
        }
    }

    /// Lets signals show a state at each step.
    pub(super) fn signal(&mut self, lanes: &[(MapId, Point3)], state: impl Fn(usize) -> SignalState) {
        for (step, signals) in self.signals.iter_mut().enumerate() {
            let shown = |(lane, stop_point): &(MapId, Point3)| Signal {
                lane: *lane,
                state: state(step),
                stop_point: *stop_point,
            };
            signals.extend(lanes.iter().map(shown));
        }
    }

    /// The scene's parts; the AV comes last, as in WOMD.
    pub(super) fn finish(self, map: Map) -> SceneParts {
        let mut tracks = self.others;
        tracks.push(self.av);
        for (index, track) in tracks.iter_mut().enumerate() {
            track.id = TrackId(index as i32 + 1);
            difference(&mut track.states);
        }
        SceneParts {
            timestamps: (0..STEPS).map(|step| step as f64 / 10.0).collect(),
            av_index: tracks.len() - 1,
            tracks,
            signals: self.signals,
            map,
            ..SceneParts::default()
        }
    }
}

/// The states of a box that moves along `curve`; nothing where that has ended.
fn states(curve: &Curve, motion: &Motion, [length, width, height]: [f64; 3]) -> Vec<Option<AgentState>> {
    let state = |station: &f64| {
        let pose = curve.pose(*station);
        let there = (0.0..=curve.length()).contains(station);
        there.then_some(AgentState {
            x: pose.x,
            y: pose.y,
            z: 0.5 * height,
            heading: pose.heading,
            length,
            width,
            height,
            ..AgentState::default()
        })
    };
    motion.stations.iter().map(state).collect()
}

/// WOMD's velocities: backward differences; the first state of a run repeats the second's.
fn difference(states: &mut [Option<AgentState>]) {
    for step in 1..states.len() {
        let Some(before) = states[step - 1] else { continue };
        let Some(state) = &mut states[step] else { continue };
        let velocity = (state.position() - before.position()) * (1.0 / STEP_SECONDS);
        (state.velocity_x, state.velocity_y) = (velocity.x, velocity.y);
    }
    for step in 0..states.len() {
        let begins = step == 0 || states[step - 1].is_none();
        let next = states.get(step + 1).copied().flatten();
        if let (true, Some(next), Some(state)) = (begins, next, &mut states[step]) {
            (state.velocity_x, state.velocity_y) = (next.velocity_x, next.velocity_y);
        }
    }
}
