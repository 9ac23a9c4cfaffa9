//! What the log says. It knows the future: it reads the log from the scene set by itself, never from the bus.

use std::sync::Arc;

use scenarios::Logs;
use wire::node::{Predictor, PredictorFactory, StepInput};
use world::geometry::Pose;
use world::observation::{Briefing, ObservedAgent};
use world::plan::{PLAN_STEPS, PredictedTrajectory, UncheckedPrediction};
use world::scene::Scene;
use world::scene::bridged::Bridged;

/// The predictor `oracle` for the scenes of these logs.
pub struct Oracle(pub Arc<dyn Logs>);

impl PredictorFactory for Oracle {
    fn start(&self, briefing: &Briefing) -> Result<Box<dyn Predictor>, String> {
        let scene = self.0.scene(&briefing.scene)?;
        // `strict` fills in gaps of the log; `paper` takes it as it lies.
        let paper = briefing.protocol == "paper";
        Ok(Box::new(Log(if paper { scene } else { Arc::clone(Bridged::of(&scene).judged()) })))
    }
}

struct Log(Arc<Scene>);

impl Predictor for Log {
    fn predict(&mut self, step: &StepInput<'_>) -> Result<UncheckedPrediction, String> {
        let now = step.observation.log_index as usize;
        let trajectories: Result<Vec<_>, String> =
            step.observation.agents.iter().map(|agent| logged(&self.0, agent, now)).collect();
        let trajectories = trajectories?;
        Ok(UncheckedPrediction::certain(step.observation.step, trajectories))
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

#[cfg(test)]
mod tests {
    use world::geometry::Point;
    use world::scene::{AgentKind, AgentState, SceneParts, Track, TrackId};

    use super::*;

    /// A car at 10 m/s that is not listed for a second.
    fn scene() -> Scene {
        let at = |step: usize| AgentState { x: step as f64, velocity_x: 10.0, length: 4.0, ..AgentState::default() };
        let track =
            |id| Track { id: TrackId(id), kind: AgentKind::Vehicle, states: (0..60).map(|s| Some(at(s))).collect() };
        let mut parts = SceneParts {
            id: "gap".into(),
            timestamps: (0..60).map(|step| step as f64 * 0.1).collect(),
            tracks: vec![track(1), track(2)],
            av_index: 1,
            ..SceneParts::default()
        };
        parts.tracks[0].states[20..30].fill(None);
        parts.check().unwrap().0
    }

    #[test]
    fn who_is_not_listed_for_a_while_goes_on_unless_the_log_is_taken_as_it_lies() {
        let scene = Arc::new(scene());
        let state = scene.tracks()[0].states[19].unwrap();
        let agent = ObservedAgent { track: TrackId(1), kind: AgentKind::Vehicle, state, unseen: 0 };
        let after = |scene: &Scene| logged(scene, &agent, 19).unwrap().poses[4].position();
        assert_eq!(after(&scene), Point::new(19.0, 0.0));
        assert!(after(Bridged::of(&scene).judged()).distance(Point::new(24.0, 0.0)) < 1e-9);
    }
}
