//! Constant turn rate and velocity: every agent goes on at the turn rate of its last two states and at its speed.
//!
//! With heading h, turn rate w and speed v at the observation: h_k = h + 0.1 w (k + 1), and each step goes 0.1 v in the
//! direction h_k, for k = 0 to 49. The authors' own baseline (`dipp/closed-loop.md`, section 9).

use wire::node::{Predictor, PredictorFactory, StepInput};
use world::authors_frame;
use world::geometry::{Point, Pose, angle_difference, wrap_angle};
use world::observation::{Briefing, ObservedAgent};
use world::plan::{PLAN_STEPS, PredictedTrajectory, STEP_SECONDS, UncheckedPrediction};
use world::scene::AgentState;

/// Turn rates are clipped to this magnitude (rad/s).
const LARGEST_TURN_RATE: f64 = 0.5;

/// How an agent's turn rate is taken from its last two headings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum TurnRate {
    /// From the turn between them, in [-pi, pi)
    Wrapped,
    /// As the authors' code: the difference of headings wrapped in the AV's frame, itself not wrapped, all in single precision; oncoming agents turn where their heading passes pi
    Authors,
}

impl TurnRate {
    /// That of a protocol.
    fn of(protocol: &str) -> Self {
        if protocol == "paper" { Self::Authors } else { Self::Wrapped }
    }
}

/// The predictor `ctrv`: the turn rate is taken this way, or where none is given as the protocol's rules say.
pub struct Ctrv(pub Option<TurnRate>);

impl PredictorFactory for Ctrv {
    fn start(&self, briefing: &Briefing) -> Result<Box<dyn Predictor>, String> {
        Ok(Box::new(self.0.unwrap_or_else(|| TurnRate::of(&briefing.protocol))))
    }
}

impl Predictor for TurnRate {
    fn predict(&mut self, step: &StepInput<'_>) -> Result<UncheckedPrediction, String> {
        let observation = step.observation;
        let trajectory = |agent: &ObservedAgent| {
            let before = observation.log_index.checked_sub(1).and_then(|index| step.history.state(agent.track, index));
            // One that was not seen before keeps its heading: the authors fill in what it left out.
            let before = before.unwrap_or(&agent.state);
            let poses = match self {
                Self::Wrapped => wrapped(before, &agent.state),
                Self::Authors => authors(before, &agent.state, observation.av.pose()),
            };
            PredictedTrajectory { track: agent.track, poses }
        };
        let trajectories: Vec<PredictedTrajectory> = observation.agents.iter().map(trajectory).collect();
        Ok(UncheckedPrediction::certain(observation.step, trajectories))
    }
}

fn wrapped(before: &AgentState, now: &AgentState) -> Vec<Pose> {
    poses(now.pose(), now.speed(), clipped(angle_difference(before.heading, now.heading)))
}

/// By the authors' numbers, in the AV's frame.
fn authors(before: &AgentState, now: &AgentState, av: Pose) -> Vec<Pose> {
    let start = authors_frame::pose(now, av);
    let speed = authors_frame::velocity(now, av).norm();
    let ahead = poses(start, speed, clipped(start.heading - authors_frame::heading(before, av)));
    let in_the_log = |own: &Pose| {
        let place = av.to_world(own.position());
        Pose::new(place.x, place.y, wrap_angle(own.heading + av.heading))
    };
    ahead.iter().map(in_the_log).collect()
}

/// The turn rate (rad/s) of this turn in a step.
fn clipped(turn: f64) -> f64 {
    (turn / STEP_SECONDS).clamp(-LARGEST_TURN_RATE, LARGEST_TURN_RATE)
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

    fn agent(x: f64, y: f64, heading: f64, speed: f64) -> AgentState {
        let velocity = Point::unit(heading) * speed;
        AgentState { x, y, heading, velocity_x: velocity.x, velocity_y: velocity.y, ..AgentState::default() }
    }

    /// The turn rate of a trajectory (rad/s).
    fn turn_rate(poses: &[Pose]) -> f64 {
        angle_difference(poses[0].heading, poses[1].heading) / STEP_SECONDS
    }

    #[test]
    fn a_heading_that_passes_pi_is_no_turn_unless_the_authors_rate_is_wanted() {
        let (before, now) = (agent(9.0, 3.0, PI - 0.01, 5.0), agent(8.5, 3.0, -PI + 0.01, 5.0));
        assert!((turn_rate(&wrapped(&before, &now)) - 0.2).abs() < 1e-9);
        // The authors': a spurious turn at the bound, to the other side.
        let av = Pose::new(0.0, 1.0, 0.0);
        assert!((turn_rate(&authors(&before, &now, av)) + LARGEST_TURN_RATE).abs() < 1e-9);
        // Away from pi the two agree, but for single precision.
        let av = Pose::new(0.0, 1.0, 0.3);
        let (before, now) = (agent(9.0, 3.0, 0.1, 5.0), agent(9.5, 3.0, 0.12, 5.0));
        for (a, b) in authors(&before, &now, av).iter().zip(wrapped(&before, &now)) {
            assert!(a.position().distance(b.position()) < 1e-3 && angle_difference(a.heading, b.heading).abs() < 1e-4);
        }
    }

    #[test]
    fn a_heading_of_exactly_zero_is_missing_to_the_authors() {
        // In the AV's frame it should be -1; it stays 0 there, so the car is taken to go where the AV heads.
        let (now, av) = (agent(9.0, 3.0, 0.0, 5.0), Pose::new(0.0, 1.0, 1.0));
        assert!((authors(&now, &now, av)[0].heading - 1.0).abs() < 1e-9);
        assert_eq!(wrapped(&now, &now)[0].heading, 0.0);
    }

    #[test]
    fn only_under_paper_are_the_authors_rules_taken_by_themselves() {
        assert_eq!((TurnRate::of("paper"), TurnRate::of("strict")), (TurnRate::Authors, TurnRate::Wrapped));
    }
}
