//! Constant turn rate and acceleration, both fading: every agent goes on as it has moved over the last half second, and after a while straight
//! on at the speed that it has by then. What is told of it is steadier than `ctrv`'s, which takes the turn of two states, and it sees
//! who brakes.

use wire::node::{Predictor, PredictorFactory, StepInput};
use world::geometry::{Point, Pose, angle_difference, wrap_angle};
use world::observation::{Briefing, ObservedAgent};
use world::plan::{Future, PLAN_STEPS, PredictedTrajectory, STEP_SECONDS, UncheckedPrediction};
use world::scene::AgentState;

/// Steps over which motion is measured.
const MEASURED: u32 = 5;

/// Turn rates are clipped to this magnitude (rad/s).
const LARGEST_TURN_RATE: f64 = 0.5;

/// Accelerations are clipped to these (m/s^2).
const ACCELERATIONS: std::ops::RangeInclusive<f64> = -5.0..=2.5;

/// Turn rate and acceleration fall to a third in this time (s).
const TURN_FADES: f64 = 1.0;
const ACCELERATION_FADES: f64 = 0.5;

/// Below this (m/s) nobody turns: what is logged is noise.
const STANDING: f64 = 0.5;

/// The predictor `ctra`.
pub struct Ctra;

impl PredictorFactory for Ctra {
    fn start(&self, _: &Briefing) -> Result<Box<dyn Predictor>, String> {
        Ok(Box::new(Ctra))
    }
}

impl Predictor for Ctra {
    fn predict(&mut self, step: &StepInput<'_>) -> Result<UncheckedPrediction, String> {
        let observation = step.observation;
        let trajectory = |agent: &ObservedAgent| {
            // As far back as it was seen.
            let earlier = (1..=MEASURED).rev().find_map(|steps| {
                let index = observation.log_index.checked_sub(steps)?;
                Some((step.history.state(agent.track, index)?, steps))
            });
            let poses = match earlier {
                Some((before, steps)) => poses(&agent.state, before, f64::from(steps) * STEP_SECONDS),
                None => poses(&agent.state, &agent.state, STEP_SECONDS),
            };
            PredictedTrajectory { track: agent.track, poses }
        };
        let trajectories: Vec<PredictedTrajectory> = observation.agents.iter().map(trajectory).collect();
        let futures = if trajectories.is_empty() {
            vec![]
        } else {
            vec![Future { probability: 1.0, trajectories, controls: vec![] }]
        };
        Ok(UncheckedPrediction { step: observation.step, futures, ..Default::default() })
    }
}

/// Where one is expected who is in the state `now`, and was in `before` so many seconds ago.
fn poses(now: &AgentState, before: &AgentState, seconds: f64) -> Vec<Pose> {
    let mut speed = now.speed();
    let turn = angle_difference(before.heading, now.heading) / seconds;
    let mut turn_rate = if speed < STANDING { 0.0 } else { turn.clamp(-LARGEST_TURN_RATE, LARGEST_TURN_RATE) };
    let mut acceleration = ((speed - before.speed()) / seconds).clamp(*ACCELERATIONS.start(), *ACCELERATIONS.end());
    let (turn_fades, acceleration_fades) =
        (libm::exp(-STEP_SECONDS / TURN_FADES), libm::exp(-STEP_SECONDS / ACCELERATION_FADES));
    let (mut place, mut heading) = (now.position(), now.heading);
    let step = |_| {
        let after = (speed + acceleration * STEP_SECONDS).max(0.0);
        heading += turn_rate * STEP_SECONDS;
        place = place + Point::unit(heading - 0.5 * turn_rate * STEP_SECONDS) * (0.5 * (speed + after) * STEP_SECONDS);
        speed = after;
        (turn_rate, acceleration) = (turn_rate * turn_fades, acceleration * acceleration_fades);
        Pose::new(place.x, place.y, wrap_angle(heading))
    };
    (0..PLAN_STEPS).map(step).collect()
}
