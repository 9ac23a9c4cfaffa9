//! Logged scenes as a planner sees them: observations with the AV in a place of choice and everybody else as logged.
//! Shared by tests and benches.

use std::sync::Arc;

use predictor_node::Ctrv;
use wire::node::{History, PredictorFactory, StepInput};
use world::geometry::Pose;
use world::observation::{Briefing, HistoryStep, Observation, ObservedAgent};
use world::plan::{Control, Future, PLAN_STEPS, PredictedTrajectory, Prediction, UncheckedPrediction};
use world::route::{Route, RouteStyle};
use world::scene::bridged::SeenSignal;
use world::scene::{AgentState, Scene};
use world::vehicle::WHEELBASE;

/// The log index of step 0.
pub const START: usize = 19;
/// The most steps of a drive.
pub const HORIZON: usize = 150;

/// The folders of real scenes; none, with a word on it, where there are none.
pub fn real_scenes() -> Vec<String> {
    let folders = ["data/womd-derived/20s", "data/womd-derived/20s-partial"];
    folders.iter().filter_map(|folder| Some(vectors::shared(folder)?.to_string_lossy().into_owned())).collect()
}

/// Where predictions come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Foresight {
    /// Everybody keeps turn rate and speed.
    Ctrv,
    /// What the log says; who leaves stays where they were last.
    Oracle,
}

/// A scene, its route, and what was seen of it so far.
pub struct Log {
    pub scene: Arc<Scene>,
    pub route: Route,
    pub briefing: Briefing,
    pub history: History,
}

impl Log {
    /// Before the first step, under a protocol.
    pub fn new(scene: Arc<Scene>, protocol: &str) -> Self {
        let route = Route::of_log(&scene, RouteStyle::Strict).unwrap();
        let step = |index: usize| {
            let av = scene.av().states[index]?;
            Some(HistoryStep { log_index: index as u32, av, agents: agents(&scene, index) })
        };
        let briefing = Briefing {
            scene: scene.id().clone(),
            protocol: protocol.to_owned(),
            start: START as u32,
            horizon: HORIZON as u32,
            wheelbase: WHEELBASE,
            map: Arc::clone(scene.map()),
            route: route.lanes.clone(),
            reference_line: Arc::clone(&route.line),
            history: (0..START).filter_map(step).collect(),
        };
        let history = History::new(&briefing);
        Self { scene, route, briefing, history }
    }

    /// How many steps can be driven.
    pub fn steps(&self) -> usize {
        HORIZON.min(self.scene.steps() - 1 - START)
    }

    /// The logged AV.
    pub fn av(&self, index: usize) -> Option<AgentState> {
        self.scene.av().states.get(index).copied().flatten()
    }

    /// Everybody else who is there.
    pub fn agents(&self, index: usize) -> Vec<ObservedAgent> {
        agents(&self.scene, index)
    }

    /// What is seen at a step by an AV in this state, that was brought there by this control. It goes into the history.
    pub fn observe(&mut self, step: usize, av: AgentState, control: Control) -> Observation {
        let index = START + step;
        let signals = self.scene.signals(index);
        let observation = Observation {
            step: step as u32,
            log_index: index as u32,
            av,
            control,
            agents: self.agents(index),
            signals: signals.iter().map(|&signal| SeenSignal { signal, unseen: 0 }).collect(),
            window: self.route.window(self.route.nearest_sample(av.position()).0, signals),
        };
        self.history.push(&observation);
        observation
    }

    /// What is expected at the step that was observed last.
    pub fn predict(&self, observation: &Observation, foresight: Foresight) -> Prediction {
        let (briefing, history) = (&self.briefing, &self.history);
        let prediction = match foresight {
            Foresight::Ctrv => {
                let step = StepInput { briefing, observation, history, prediction: None };
                Ctrv(None).start(briefing).unwrap().predict(&step).unwrap()
            }
            Foresight::Oracle => {
                let trajectories: Vec<_> = observation.agents.iter().map(|a| self.logged(a, observation)).collect();
                let future = Future { probability: 1.0, trajectories, controls: vec![] };
                UncheckedPrediction { step: observation.step, futures: vec![future], ..Default::default() }
            }
        };
        prediction.check(observation.step).unwrap()
    }

    fn logged(&self, agent: &ObservedAgent, observation: &Observation) -> PredictedTrajectory {
        let track = self.scene.tracks().iter().find(|track| track.id == agent.track).unwrap();
        let mut last = agent.state.pose();
        let poses = (1..=PLAN_STEPS).map(|k| {
            let state = track.states.get(observation.log_index as usize + k).copied().flatten();
            last = state.map_or(last, |state| state.pose());
            last
        });
        PredictedTrajectory { track: agent.track, poses: poses.collect::<Vec<Pose>>() }
    }
}

fn agents(scene: &Scene, index: usize) -> Vec<ObservedAgent> {
    let others = scene.tracks().iter().enumerate().filter(|(place, _)| *place != scene.av_index());
    let seen = others.filter_map(|(_, track)| {
        let state = (*track.states.get(index)?)?;
        Some(ObservedAgent { track: track.id, kind: track.kind, unseen: 0, state })
    });
    seen.collect()
}
