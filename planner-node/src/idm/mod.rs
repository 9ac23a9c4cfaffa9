//! The intelligent driver model along the reference line: speed by Treiber, Hennecke and Helbing, "Congested traffic
//! states in empirical observations and microscopic simulations", Phys. Rev. E 62 (2000); steering back onto the line.
//!
//! | file | what |
//! | --- | --- |
//! | `measured_line.rs` | what is reckoned of the whole line once |
//! | `corridor.rs` | the line ahead as stations, and where things lie beside it |
//! | `obstacles.rs` | who is in the way: leaders, crossing traffic, red lights, the line's end |
//! | `speed.rs` | the speed wanted on the line, and the acceleration |
//! | `steering.rs` | the front wheels' angle |
//!
//! The plan is a rollout of the simulator's own vehicle model under these two laws, so its controls can be driven as they are.
//! Under `paper` nothing but the first pose is driven, and its distance is the speed of the step: so there it is a rollout of the
//! authors' test model, which moves at the new speed, and not at the one before.

mod corridor;
mod measured_line;
mod obstacles;
pub mod speed;
pub mod steering;

use wire::node::{Planner, PlannerFactory, StepInput};
use world::observation::Briefing;
use world::plan::{Control, Diagnostics, PLAN_STEPS, PlanState, STEP_SECONDS, UncheckedPlan};
use world::scene::AgentState;
use world::vehicle::{BicycleModel, Limits, VehicleState};

pub use corridor::{Corridor, Footprint, Place};
pub use obstacles::{Obstacle, What, in_the_way};
pub use speed::{DesiredSpeed, Manner, Wanted};

/// A deceleration below this (m/s^2) is not worth a word.
const NOTICEABLE: f64 = 0.1;

/// The planner `idm`.
pub struct Idm;

impl PlannerFactory for Idm {
    fn start(&self, briefing: &Briefing) -> Result<Box<dyn Planner>, String> {
        if briefing.reference_line.len() < 2 {
            return Err("the reference line has less than two samples".to_owned());
        }
        Ok(Box::new(IdmDrive::new(briefing)))
    }
}

/// The planner in one episode. Buffers are kept from step to step.
pub struct IdmDrive {
    corridor: Corridor,
    desired: DesiredSpeed,
    obstacles: Vec<Obstacle>,
}

impl IdmDrive {
    /// At the start of an episode.
    pub fn new(briefing: &Briefing) -> Self {
        Self {
            corridor: Corridor::new(&briefing.reference_line),
            desired: DesiredSpeed::default(),
            obstacles: Vec::new(),
        }
    }
}

impl Planner for IdmDrive {
    fn plan(&mut self, step: &StepInput<'_>) -> Result<UncheckedPlan, String> {
        let StepInput { briefing, observation, .. } = step;
        let Self { corridor, desired, obstacles } = self;
        corridor.move_to(&observation.window).ok_or("the window of the reference line has less than two samples")?;
        desired.fill(corridor, &observation.window);
        let av = &observation.av;
        let own = corridor.own(av.position());
        let place = corridor.project(av.position(), own);
        in_the_way(corridor, place, observation, obstacles);

        let model = match briefing.protocol.as_str() {
            "paper" => BicycleModel::authors_test(),
            _ => BicycleModel::new(briefing.wheelbase),
        };
        let mut state = VehicleState { x: av.x, y: av.y, heading: av.heading, speed: av.speed() };
        let mut rollout = model.roll_out(state);
        let mut driven = observation.control;
        let mut hint = own;
        let mut plan = UncheckedPlan {
            step: observation.step,
            states: Vec::with_capacity(PLAN_STEPS),
            controls: Vec::with_capacity(PLAN_STEPS),
            diagnostics: Diagnostics { status: status(place, av, obstacles), ..Default::default() },
        };
        for k in 0..PLAN_STEPS {
            let place = corridor.project(state.pose().position(), hint);
            hint = place.sample;
            let front = place.station + 0.5 * av.length;
            let ahead = |o: &Obstacle| (o.station_after(k as f64 * STEP_SECONDS) - front, o.speed);
            let acceleration =
                speed::acceleration(&Manner::IDM, state.speed, desired.at(place.sample), obstacles.iter().map(ahead));
            let wanted = Control {
                acceleration: speed::smooth(driven.acceleration, acceleration),
                steering: steering::angle(corridor, &place, &state, briefing.wheelbase),
            };
            driven = Limits::STRICT.apply(wanted, driven.steering, STEP_SECONDS);
            state = rollout.step(driven, STEP_SECONDS);
            plan.controls.push(driven);
            plan.states.push(PlanState { x: state.x, y: state.y, heading: state.heading, speed: state.speed });
        }
        Ok(plan)
    }
}

/// What holds the AV back most, for whoever watches.
fn status(place: Place, av: &AgentState, obstacles: &[Obstacle]) -> String {
    let front = place.station + 0.5 * av.length;
    let hold = |o: &Obstacle| speed::interaction(&Manner::IDM, av.speed(), o.station - front, o.speed);
    let most = obstacles.iter().max_by(|a, b| hold(a).total_cmp(&hold(b)));
    most.filter(|o| hold(o) > NOTICEABLE).map_or_else(|| "free".to_owned(), |o| o.what.to_string())
}

#[cfg(test)]
mod tests;
