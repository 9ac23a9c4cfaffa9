//! What a node knows at a step, in terms of the world: the same whether it comes out of a logged scene or off the bus.

use std::collections::VecDeque;

use world::observation::{Briefing, Observation, ObservedAgent};
use world::scene::{AgentKind, AgentState, Scene, TrackId};
use world::signal::Signal;

use crate::constants::{HISTORY, NEIGHBORS};

/// The AV, the agents nearest to it, and the signals, at one step and over the two seconds before.
#[derive(Clone, Debug, PartialEq)]
pub struct Window {
    /// The AV now.
    pub av: AgentState,
    /// The AV before, oldest first; none where it was not seen.
    pub av_before: [Option<AgentState>; HISTORY - 1],
    /// The AV's states are logged ones, as before the first step is driven; the authors' code rounds those in other places.
    pub av_is_logged: bool,
    /// The agents nearest to the AV, nearest first, of equally near ones the log's first first; at most [`NEIGHBORS`].
    pub neighbors: Vec<Neighbor>,
    /// Signals that are reported now.
    pub signals: Vec<Signal>,
}

/// An agent that is seen now.
#[derive(Clone, Debug, PartialEq)]
pub struct Neighbor {
    /// Which track.
    pub track: TrackId,
    /// What it is.
    pub kind: AgentKind,
    /// Its state now.
    pub now: AgentState,
    /// Its states before, oldest first; none where it was not seen.
    pub before: [Option<AgentState>; HISTORY - 1],
}

impl Window {
    /// Step `step` of a scene as it was logged; none where the AV was not seen.
    #[must_use]
    pub fn logged(scene: &Scene, step: usize) -> Option<Self> {
        let state = |step: usize| scene.av().states.get(step).copied().flatten();
        let before = std::array::from_fn(|index| (step + index).checked_sub(HISTORY - 1).and_then(state));
        Some(Self::driven(scene, step, state(step)?, before, true))
    }

    /// Step `step` of a scene in which the AV drives by itself.
    #[must_use]
    pub fn driven(
        scene: &Scene,
        step: usize,
        av: AgentState,
        av_before: [Option<AgentState>; HISTORY - 1],
        av_is_logged: bool,
    ) -> Self {
        let others = scene.tracks().iter().enumerate().filter(|(index, _)| *index != scene.av_index());
        let seen = others.filter_map(|(_, track)| Some((track, track.states.get(step).copied().flatten()?)));
        let neighbors = nearest(&av, seen.collect(), |(_, state)| state).into_iter().map(|(track, now)| {
            let state = |step: usize| track.states.get(step).copied().flatten();
            let before = std::array::from_fn(|index| (step + index).checked_sub(HISTORY - 1).and_then(state));
            Neighbor { track: track.id, kind: track.kind, now, before }
        });
        let neighbors = neighbors.collect();
        Self { av, av_before, av_is_logged, neighbors, signals: scene.signals(step).to_vec() }
    }
}

/// The [`NEIGHBORS`] nearest, nearest first, by distance of centres; equals keep their order.
fn nearest<T>(av: &AgentState, mut agents: Vec<T>, state: impl Fn(&T) -> &AgentState) -> Vec<T> {
    let distance = |agent: &T| state(agent).position().distance(av.position());
    agents.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
    agents.truncate(NEIGHBORS);
    agents
}

/// What a node has seen of an episode: the steps of the last two seconds.
#[derive(Clone, Debug, Default)]
pub struct History {
    /// Log index, AV, agents; oldest first.
    steps: VecDeque<(u32, AgentState, Vec<ObservedAgent>)>,
}

impl History {
    /// What the briefing tells of the time before the episode.
    #[must_use]
    pub fn new(briefing: &Briefing) -> Self {
        let skip = briefing.history.len().saturating_sub(HISTORY - 1);
        let steps = briefing.history.iter().skip(skip);
        Self { steps: steps.map(|step| (step.log_index, step.av, step.agents.clone())).collect() }
    }

    /// Takes in an observation, and answers what is known at its step. One that is given again takes the place of the first.
    pub fn observe(&mut self, observation: &Observation) -> Window {
        let now = observation.log_index;
        self.steps.retain(|(index, ..)| *index < now && now - *index < HISTORY as u32);
        let at = |index: usize| {
            let wanted = (now as usize + index).checked_sub(HISTORY - 1)?;
            self.steps.iter().find(|(step, ..)| *step as usize == wanted)
        };
        let before: [Option<&(u32, AgentState, Vec<ObservedAgent>)>; HISTORY - 1] = std::array::from_fn(at);
        let neighbors = nearest(&observation.av, observation.agents.iter().collect(), |agent| &agent.state);
        let neighbors = neighbors.into_iter().map(|agent| Neighbor {
            track: agent.track,
            kind: agent.kind,
            now: agent.state,
            before: before.map(|step| {
                let (_, _, agents) = step?;
                agents.iter().find(|other| other.track == agent.track).map(|other| other.state)
            }),
        });
        let window = Window {
            av: observation.av,
            av_before: before.map(|step| step.map(|(_, av, _)| *av)),
            av_is_logged: observation.step == 0,
            neighbors: neighbors.collect(),
            signals: observation.signals.iter().map(|seen| seen.signal).collect(),
        };
        self.steps.push_back((now, observation.av, observation.agents.clone()));
        window
    }
}
