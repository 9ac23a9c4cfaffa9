//! Straight on at the speed of the start, whatever comes.

use wire::node::{Planner, PlannerFactory, StepInput};
use world::geometry::Point;
use world::observation::Briefing;
use world::plan::{Control, PLAN_STEPS, PlanState, STEP_SECONDS, UncheckedPlan};

/// The planner `constant-velocity`: no braking, no steering.
pub struct ConstantVelocity;

impl PlannerFactory for ConstantVelocity {
    fn start(&self, _: &Briefing) -> Result<Box<dyn Planner>, String> {
        Ok(Box::new(StraightOn { speed: None }))
    }
}

struct StraightOn {
    /// Speed of the first observation (m/s). What the simulator makes of a plan differs from it in the last bits.
    speed: Option<f64>,
}

impl Planner for StraightOn {
    fn plan(&mut self, step: &StepInput<'_>) -> Result<UncheckedPlan, String> {
        let av = &step.observation.av;
        let (heading, speed) = (av.heading, *self.speed.get_or_insert(av.speed()));
        let forward = Point::unit(heading);
        let state = |k: usize| {
            let place = av.position() + forward * (speed * STEP_SECONDS * k as f64);
            PlanState { x: place.x, y: place.y, heading, speed }
        };
        Ok(UncheckedPlan {
            step: step.observation.step,
            states: (1..=PLAN_STEPS).map(state).collect(),
            controls: vec![Control::default(); PLAN_STEPS],
            ..Default::default()
        })
    }
}
