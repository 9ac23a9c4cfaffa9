//! Constant turn rate and velocity: every agent goes on at the turn rate of its last two states and at its speed.
//!
//! With heading h, turn rate w and speed v at the observation: h_k = h + 0.1 w (k + 1), and each step goes 0.1 v in the
//! direction h_k, for k = 0 to 49. The authors' own baseline (`dipp/closed-loop.md`, section 9).

use wire::node::{Predictor, PredictorFactory, StepInput};
use world::geometry::{Point, Pose, angle_difference, wrap_angle};
use world::observation::{Briefing, ObservedAgent};
use world::plan::{Future, PLAN_STEPS, PredictedTrajectory, STEP_SECONDS, UncheckedPrediction};

/// Turn rates are clipped to this magnitude (rad/s).
const LARGEST_TURN_RATE: f64 = 0.5;

/// How an agent's turn rate is taken from its last two headings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum TurnRate {
    /// From the turn between them, in [-pi, pi)
    #[default]
    Wrapped,
    /// As the authors' code: the difference of headings wrapped in the AV's frame, itself not wrapped; oncoming agents turn where their heading passes pi
    Authors,
}

impl TurnRate {
    /// The turn rate (rad/s) of an agent whose heading was `before` and is `now`, seen from an AV that heads to `av`.
    fn of(self, before: f64, now: f64, av: f64) -> f64 {
        let turn = match self {
            Self::Wrapped => angle_difference(before, now),
            Self::Authors => wrap_angle(now - av) - wrap_angle(before - av),
        };
        (turn / STEP_SECONDS).clamp(-LARGEST_TURN_RATE, LARGEST_TURN_RATE)
    }
}

/// The predictor `ctrv`.
pub struct Ctrv(pub TurnRate);

impl PredictorFactory for Ctrv {
    fn start(&self, _: &Briefing) -> Result<Box<dyn Predictor>, String> {
        Ok(Box::new(Self(self.0)))
    }
}

impl Predictor for Ctrv {
    fn predict(&mut self, step: &StepInput<'_>) -> Result<UncheckedPrediction, String> {
        let observation = step.observation;
        let trajectory = |agent: &ObservedAgent| {
            let now = agent.state.heading;
            // One that was not seen before keeps its heading.
            let before = observation.log_index.checked_sub(1).and_then(|index| step.history.state(agent.track, index));
            let before = before.map_or(now, |state| state.heading);
            let turn_rate = self.0.of(before, now, observation.av.heading);
            PredictedTrajectory { track: agent.track, poses: poses(agent.state.pose(), agent.state.speed(), turn_rate) }
        };
        let trajectories: Vec<PredictedTrajectory> = observation.agents.iter().map(trajectory).collect();
        let futures = if trajectories.is_empty() { vec![] } else { vec![Future { probability: 1.0, trajectories }] };
        Ok(UncheckedPrediction { step: observation.step, futures, ..Default::default() })
    }
}

fn poses(start: Pose, speed: f64, turn_rate: f64) -> Vec<Pose> {
    let mut place = start.position();
    let step = |k: usize| {
        let heading = start.heading + STEP_SECONDS * turn_rate * (k + 1) as f64;
        place = place + Point::unit(heading) * (STEP_SECONDS * speed);
        Pose::new(place.x, place.y, wrap_angle(heading))
    };
    (0..PLAN_STEPS).map(step).collect()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    #[test]
    fn without_a_turn_it_goes_straight_on() {
        let poses = poses(Pose::new(1.0, 2.0, 0.0), 10.0, 0.0);
        assert!((poses[0].x - 2.0).abs() < 1e-12 && (poses[49].x - 51.0).abs() < 1e-9);
        assert!(poses.iter().all(|pose| pose.y == 2.0 && pose.heading == 0.0));
    }

    #[test]
    fn a_turning_agent_stays_on_its_circle() {
        // Each step is a chord of 0.1 v: the circle through them has the radius 0.05 v / sin(0.05 w).
        let (speed, rate) = (8.0, 0.4);
        let radius = 0.05 * speed / libm::sin(0.05 * rate);
        let poses = poses(Pose::new(0.0, 0.0, 0.0), speed, rate);
        // The first chord has the heading 0.04: the centre lies to the left of its middle.
        let first = Point::unit(0.1 * rate);
        let apothem = radius * libm::cos(0.05 * rate);
        let center = first * (0.05 * speed) + Point::new(-first.y, first.x) * apothem;
        for pose in poses {
            assert!((pose.position().distance(center) - radius).abs() < 1e-9);
        }
    }

    #[test]
    fn a_heading_that_passes_pi_is_no_turn_unless_the_authors_rate_is_wanted() {
        let (before, now) = (PI - 0.01, -PI + 0.01);
        assert!((TurnRate::Wrapped.of(before, now, 0.0) - 0.2).abs() < 1e-9);
        // The authors': a spurious turn at the bound, to the other side.
        assert_eq!(TurnRate::Authors.of(before, now, 0.0), -LARGEST_TURN_RATE);
        // Away from pi the two agree.
        assert!((TurnRate::Authors.of(0.1, 0.12, 0.3) - TurnRate::Wrapped.of(0.1, 0.12, 0.3)).abs() < 1e-12);
    }
}
