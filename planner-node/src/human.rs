//! What the logged AV did. It knows the future: it reads the log from the scene set by itself, never from the bus.

use std::sync::Arc;

use scenarios::Logs;
use wire::node::{Planner, PlannerFactory, StepInput};
use world::observation::Briefing;
use world::plan::{PLAN_STEPS, PlanState, UncheckedPlan};
use world::scene::bridged::Bridged;
use world::scene::{AgentState, Scene};

/// The planner `human` for the scenes of these logs.
pub struct Human(pub Arc<dyn Logs>);

impl PlannerFactory for Human {
    fn start(&self, briefing: &Briefing) -> Result<Box<dyn Planner>, String> {
        let scene = self.0.scene(&briefing.scene)?;
        // `strict` fills in gaps of the log; `paper` takes it as it lies.
        let paper = briefing.protocol == "paper";
        Ok(Box::new(Log(if paper { scene } else { Arc::clone(Bridged::of(&scene).judged()) })))
    }
}

struct Log(Arc<Scene>);

impl Planner for Log {
    fn plan(&mut self, step: &StepInput<'_>) -> Result<UncheckedPlan, String> {
        let log = &self.0.av().states;
        let now = step.observation.log_index as usize;
        let mut last = standing(&step.observation.av);
        let states = (1..=PLAN_STEPS).map(|k| {
            last = match log.get(now + k).copied().flatten() {
                Some(state) => moving(&state),
                // Where the log has no AV, or has ended, it stays where it was last.
                None => PlanState { speed: 0.0, ..last },
            };
            last
        });
        Ok(UncheckedPlan { step: step.observation.step, states: states.collect(), ..Default::default() })
    }
}

fn moving(state: &AgentState) -> PlanState {
    PlanState { x: state.x, y: state.y, heading: state.heading, speed: state.speed() }
}

fn standing(state: &AgentState) -> PlanState {
    PlanState { speed: 0.0, ..moving(state) }
}
