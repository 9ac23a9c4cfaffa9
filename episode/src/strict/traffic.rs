//! The other road users of a scene, laid out step by step for the judges.

use world::geometry::Point;
use world::plan::STEP_SECONDS;
use world::scene::bridged::Bridged;

use crate::judges::time_to_collision::{HORIZON_STEPS, TrafficAgent};

/// All valid agents but the AV, step after step. What the broad phase reads lies in columns of its own: one pass over a
/// step is a few kilobytes.
#[derive(Clone, Debug, Default)]
pub struct Traffic {
    /// Where each log index begins; one more than there are.
    starts: Vec<usize>,
    x: Vec<f64>,
    y: Vec<f64>,
    /// How far from its centre an agent may matter within the projection of time to collision (m): the box's radius and
    /// what it can travel.
    reach: Vec<f64>,
    agents: Vec<TrafficAgent>,
    tracks: usize,
    /// Those who react, where they are now, in the log's order.
    reacting: Vec<TrafficAgent>,
    /// For each track whether the log no longer says where it is; empty where nobody reacts.
    is_left: Vec<bool>,
}

/// Who is seen to be elsewhere by more than this (m) is not seen.
const SEEN_WITHIN: f64 = 1.0;

/// Steps in which a driver reacts to what appears: a second.
const REACTION: usize = 10;

impl Traffic {
    /// The traffic of all steps of a scene.
    #[must_use]
    pub fn of(bridged: &Bridged) -> Self {
        let scene = bridged.judged();
        let mut traffic = Self { starts: vec![0], tracks: scene.tracks().len(), ..Self::default() };
        let others = || scene.tracks().iter().enumerate().filter(|(track, _)| *track != scene.av_index());
        let sudden: Vec<Vec<bool>> = (0..scene.tracks().len()).map(|track| sudden(bridged, track)).collect();
        for step in 0..scene.steps() {
            for (track, logged) in others() {
                let Some(state) = logged.states[step] else { continue };
                let sudden = sudden[track].get(step).copied().unwrap_or_default();
                let agent = TrafficAgent::of(track, logged.kind, &state, sudden);
                traffic.x.push(state.x);
                traffic.y.push(state.y);
                traffic.reach.push(reach(&agent));
                traffic.agents.push(agent);
            }
            traffic.starts.push(traffic.agents.len());
        }
        traffic
    }

    /// Number of tracks of the scene, the AV's among them.
    #[must_use]
    pub fn tracks(&self) -> usize {
        self.tracks
    }

    /// The largest number of agents at a step.
    #[must_use]
    pub fn most_agents(&self) -> usize {
        self.starts.windows(2).map(|pair| pair[1] - pair[0]).max().unwrap_or(0)
    }

    /// The agents that the log has at `log_index`, in its order.
    #[must_use]
    pub fn at(&self, log_index: usize) -> &[TrafficAgent] {
        let range = self.starts.get(log_index).zip(self.starts.get(log_index + 1));
        range.map_or(&[], |(from, until)| &self.agents[*from..*until])
    }

    /// From now on these agents are where they are told to be, in the log's order, and who was one of them before and is no more has left:
    /// the log says nothing of any of them.
    pub fn react(&mut self, agents: impl Iterator<Item = TrafficAgent>) {
        self.is_left.resize(self.tracks, false);
        self.reacting.clear();
        self.reacting.extend(agents);
        self.reacting.iter().for_each(|agent| self.is_left[agent.track] = true);
    }

    /// From now on track number `track` is nowhere, whatever the log says.
    pub fn leave(&mut self, track: usize) {
        self.is_left.resize(self.tracks, false);
        self.is_left[track] = true;
    }

    /// Whether track number `track` reacts now, and is not replayed.
    #[must_use]
    pub fn reacts(&self, track: usize) -> bool {
        self.reacting.iter().any(|agent| agent.track == track)
    }

    /// Calls `visit` with each agent at `log_index` whose reach and `reach` (m) around `center` meet: those whom the log drives in its order,
    /// then those who react.
    pub fn for_each_near(&self, log_index: usize, center: Point, reach: f64, mut visit: impl FnMut(&TrafficAgent)) {
        let Some(range) = self.starts.get(log_index).zip(self.starts.get(log_index + 1)) else { return };
        for index in *range.0..*range.1 {
            let (dx, dy) = (self.x[index] - center.x, self.y[index] - center.y);
            let both = self.reach[index] + reach;
            let agent = &self.agents[index];
            if dx * dx + dy * dy <= both * both && !self.is_left.get(agent.track).is_some_and(|is_left| *is_left) {
                visit(agent);
            }
        }
        for agent in &self.reacting {
            let both = self::reach(agent) + reach;
            if agent.outline.center.distance_squared(center) <= both * both {
                visit(agent);
            }
        }
    }
}

/// How far from its centre an agent may matter within the projection of time to collision (m).
fn reach(agent: &TrafficAgent) -> f64 {
    agent.outline.radius() + agent.speed * HORIZON_STEPS as f64 * STEP_SECONDS
}

/// For each step whether nobody could have reacted to a track: within the last second it was not to be seen, or was supposed to be
/// elsewhere. What is there when the log begins has been there.
fn sudden(bridged: &Bridged, track: usize) -> Vec<bool> {
    let states = &bridged.judged().tracks()[track].states;
    let unseen = |step: usize| match (states[step], bridged.logged().logged(track, step)) {
        (Some(_), Some(_)) => false,
        (None, _) => true,
        (Some(state), None) => bridged
            .observed(track, step)
            .is_none_or(|seen| seen.state.position().distance(state.position()) > SEEN_WITHIN),
    };
    let mut since = usize::MAX;
    (0..states.len())
        .map(|step| {
            since = if unseen(step) { 0 } else { since.saturating_add(1) };
            since < REACTION
        })
        .collect()
}
