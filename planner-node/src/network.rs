//! The planner `network`: what the prediction network would do itself, as it says (the paper's imitation baselines). Under `strict`
//! within the vehicle's limits; under `paper` by the authors' test model.

use gauss_newton::Controls;
use wire::node::{Planner, PlannerFactory, StepInput};
use world::authors_frame;
use world::observation::Briefing;
use world::plan::{PLAN_STEPS, UncheckedPlan};

use crate::gauss_newton_planner::Rules;

/// The planner `network`.
pub struct Network;

impl PlannerFactory for Network {
    fn start(&self, briefing: &Briefing) -> Result<Box<dyn Planner>, String> {
        Ok(Box::new(Drive(Rules::of(&briefing.protocol))))
    }

    fn needs_prediction(&self) -> bool {
        true
    }
}

struct Drive(Rules);

impl Planner for Drive {
    fn plan(&mut self, step: &StepInput<'_>) -> Result<UncheckedPlan, String> {
        let told = step.prediction.and_then(|prediction| prediction.initial_controls());
        let told = told.ok_or("the prediction has no controls\nhint: the predictor network gives them")?;
        let controls = Controls::from_pairs(told.iter().map(|control| (control.acceleration, control.steering)));
        let controls = controls.ok_or_else(|| format!("{} controls, but {PLAN_STEPS} are needed", told.len()))?;
        let observation = step.observation;
        let speed = match self.0 {
            Rules::Paper => authors_frame::av_velocity(&observation.av, observation.step).norm(),
            Rules::Strict => observation.av.speed(),
        };
        let (states, controls) = self.0.output(step, speed, &controls);
        Ok(UncheckedPlan { step: observation.step, states, controls, ..UncheckedPlan::default() })
    }
}
