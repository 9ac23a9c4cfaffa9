//! What the log says. It knows the future: it reads the log from the scene set by itself, never from the bus.

use std::sync::Arc;

use scenarios::{SceneSet, SetError};
use wire::node::{Predictor, PredictorFactory, StepInput};
use world::geometry::Pose;
use world::observation::{Briefing, ObservedAgent};
use world::plan::{Future, PLAN_STEPS, PredictedTrajectory, UncheckedPrediction};
use world::scene::Scene;

/// The predictor `oracle`.
pub struct Oracle(SceneSet);

impl Oracle {
    /// The predictor for the scenes of these inputs, see [`SceneSet::open`].
    ///
    /// # Errors
    /// [`SetError`] where they cannot be opened.
    pub fn open(scenarios: &[String]) -> Result<Self, SetError> {
        SceneSet::open(scenarios).map(Self)
    }
}

impl PredictorFactory for Oracle {
    fn start(&self, briefing: &Briefing) -> Result<Box<dyn Predictor>, String> {
        let index = self.0.entries().iter().position(|entry| entry.id == briefing.scene);
        let index = index.ok_or_else(|| format!("scene {} is not in the scene set of this node", briefing.scene))?;
        let (scene, _) = self.0.load(index).map_err(|e| e.to_string())?;
        Ok(Box::new(Log(scene)))
    }
}

struct Log(Arc<Scene>);

impl Predictor for Log {
    fn predict(&mut self, step: &StepInput<'_>) -> Result<UncheckedPrediction, String> {
        let now = step.observation.log_index as usize;
        let trajectories: Result<Vec<_>, String> =
            step.observation.agents.iter().map(|agent| logged(&self.0, agent, now)).collect();
        let trajectories = trajectories?;
        let futures = if trajectories.is_empty() { vec![] } else { vec![Future { probability: 1.0, trajectories }] };
        Ok(UncheckedPrediction { step: step.observation.step, futures, ..Default::default() })
    }
}

fn logged(scene: &Scene, agent: &ObservedAgent, now: usize) -> Result<PredictedTrajectory, String> {
    let track = scene.tracks().iter().find(|track| track.id == agent.track);
    let track = track.ok_or_else(|| format!("track {} is not in this node's scene {}", agent.track, scene.id()))?;
    let mut last: Pose = agent.state.pose();
    let poses = (1..=PLAN_STEPS).map(|k| {
        // Where the log does not see it, or has ended, it stays where it was last.
        if let Some(state) = track.states.get(now + k).copied().flatten() {
            last = state.pose();
        }
        last
    });
    Ok(PredictedTrajectory { track: agent.track, poses: poses.collect() })
}
