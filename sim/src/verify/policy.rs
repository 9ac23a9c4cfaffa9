//! Who drives the episodes of the vectors.

use episode::driver::Driver;
use episode::paper::START;
use world::observation::Observation;
use world::plan::{PLAN_STEPS, Plan, PlanState, STEP_SECONDS, UncheckedPlan};
use world::scene::Scene;

use super::vector::Vector;

/// A policy of the vectors; only the first state of its plans is driven.
pub enum Policy<'a> {
    /// Where the logged AV is next.
    Human(&'a Scene),
    /// Straight on at the speed that the logged AV had at the start (m/s).
    ConstantVelocity(f64),
    /// Where the recorded AV is next.
    Recorded(&'a [[f64; 8]]),
}

impl<'a> Policy<'a> {
    /// Their names.
    pub const NAMES: [&'static str; 3] = ["human", "constant-velocity", "planner"];

    /// The policy of this name for one episode.
    pub fn named(name: &str, scene: &'a Scene, vector: &'a Vector) -> Self {
        let start = scene.av().states.get(START as usize).copied().flatten().unwrap_or_default();
        match name {
            "human" => Self::Human(scene),
            "constant-velocity" => Self::ConstantVelocity(start.speed()),
            _ => Self::Recorded(&vector.states),
        }
    }

    /// Where the AV is to be in the step after `observation`.
    fn next(&self, observation: &Observation) -> PlanState {
        let av = &observation.av;
        let (x, y, heading) = match self {
            Self::Human(scene) => {
                let logged = scene.av().states.get(observation.log_index as usize + 1).copied().flatten();
                let state = logged.unwrap_or(*av);
                (state.x, state.y, state.heading)
            }
            Self::ConstantVelocity(speed) => {
                let place = av.pose().to_world(world::geometry::Point::new(STEP_SECONDS * speed, 0.0));
                (place.x, place.y, av.heading)
            }
            Self::Recorded(states) => {
                let [x, y, heading, ..] = states[observation.step as usize + 1];
                (x, y, heading)
            }
        };
        PlanState { x, y, heading, speed: 0.0 }
    }
}

impl Driver for &Policy<'_> {
    fn plan(&mut self, observation: &Observation) -> Result<Plan, String> {
        let step = observation.step;
        let states = vec![self.next(observation); PLAN_STEPS];
        UncheckedPlan { step, states, ..UncheckedPlan::default() }.check(step).map_err(|error| error.to_string())
    }
}
