//! Constant turn rate and acceleration, both fading: every agent goes on as it has moved over the last half second, and after a while straight
//! on at the speed that it has by then. What is told of it is steadier than `ctrv`'s, which takes the turn of two states, and it sees
//! who brakes.

use wire::node::{Predictor, PredictorFactory, StepInput};
use world::geometry::{Point, Pose, angle_difference, wrap_angle};
use world::observation::{Briefing, ObservedAgent};
use world::plan::{PLAN_STEPS, PredictedTrajectory, STEP_SECONDS, UncheckedPrediction};
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
/// ... of who brakes harder than this (m/s^2): that is mostly for a reason that lasts.
const BRAKING_FADES: f64 = 2.0;
const BRAKING: f64 = 1.0;

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
        Ok(UncheckedPrediction::certain(observation.step, trajectories))
    }
}

/// Where one is expected who is in the state `now`, and was in `before` so many seconds ago.
fn poses(now: &AgentState, before: &AgentState, seconds: f64) -> Vec<Pose> {
    let mut speed = now.speed();
    let turn = angle_difference(before.heading, now.heading) / seconds;
    let mut turn_rate = if speed < STANDING { 0.0 } else { turn.clamp(-LARGEST_TURN_RATE, LARGEST_TURN_RATE) };
    let mut acceleration = ((speed - before.speed()) / seconds).clamp(*ACCELERATIONS.start(), *ACCELERATIONS.end());
    let turn_fades = libm::exp(-STEP_SECONDS / TURN_FADES);
    let in_seconds = if acceleration < -BRAKING { BRAKING_FADES } else { ACCELERATION_FADES };
    let acceleration_fades = libm::exp(-STEP_SECONDS / in_seconds);
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

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use std::sync::Arc;

    use wire::node::History;
    use world::observation::{HistoryStep, Observation};
    use world::plan::Control;
    use world::reference_line::ReferenceWindow;
    use world::scene::{AgentKind, SceneId, TrackId};

    use super::*;

    fn agent(x: f64, y: f64, heading: f64, speed: f64) -> AgentState {
        let velocity = Point::unit(heading) * speed;
        AgentState { x, y, heading, velocity_x: velocity.x, velocity_y: velocity.y, ..AgentState::default() }
    }

    /// Ways from pose to pose (m).
    fn ways(poses: &[Pose]) -> Vec<f64> {
        poses.windows(2).map(|pair| pair[0].position().distance(pair[1].position())).collect()
    }

    #[test]
    fn without_a_turn_it_goes_straight_on() {
        let state = agent(1.0, 2.0, 0.0, 10.0);
        let poses = poses(&state, &state, 0.5);
        assert!((poses[0].x - 2.0).abs() < 1e-12 && (poses[49].x - 51.0).abs() < 1e-9);
        assert!(poses.iter().all(|pose| pose.y == 2.0 && pose.heading == 0.0));
    }

    #[test]
    fn who_brakes_stops_and_does_not_go_back() {
        let poses = poses(&agent(0.0, 0.0, 0.0, 1.5), &agent(-1.0, 0.0, 0.0, 4.0), 0.5);
        assert!(poses.windows(2).all(|pair| pair[1].x >= pair[0].x));
        // From 1.5 m/s by 5 m/s^2 that fades.
        assert!(poses[49].x > 0.2 && poses[49].x < 0.4, "{}", poses[49].x);
        assert_eq!(ways(&poses)[48], 0.0);
    }

    #[test]
    fn who_speeds_up_soon_drives_evenly() {
        // By 2 m/s^2 now: that is 1 m/s more in the end.
        let poses = poses(&agent(0.0, 0.0, 0.0, 8.0), &agent(-4.0, 0.0, 0.0, 7.0), 0.5);
        let ways = ways(&poses);
        assert!(ways.windows(2).all(|pair| pair[1] >= pair[0] - 1e-12));
        assert!((ways[48] / STEP_SECONDS - 9.1).abs() < 0.1, "{}", ways[48]);
    }

    #[test]
    fn who_brakes_hard_goes_on_braking_and_who_slows_down_a_little_does_not() {
        // By 3 m/s^2 of 15 m/s, and by 0.9.
        let speed_after_4_s = |before: f64| {
            let poses = poses(&agent(0.0, 0.0, 0.0, 15.0), &agent(-7.5, 0.0, 0.0, before), 0.5);
            ways(&poses)[39] / STEP_SECONDS
        };
        let (hard, little) = (speed_after_4_s(16.5), speed_after_4_s(15.45));
        // 3 m/s^2 for 2 s, 0.9 m/s^2 for half a second, but for what is left to fade.
        assert!(hard > 9.0 && hard < 10.0, "{hard}");
        assert!((little - (15.0 - 0.45)).abs() < 0.05, "{little}");
    }

    #[test]
    fn a_turn_fades() {
        for turn in [0.3, -0.3] {
            let poses = poses(&agent(0.0, 0.0, 3.0, 8.0), &agent(0.0, 0.0, 3.0 - 0.5 * turn, 8.0), 0.5);
            let turns = poses.windows(2).map(|pair| angle_difference(pair[0].heading, pair[1].heading) / turn);
            let turns: Vec<f64> = turns.collect();
            assert!(turns.windows(2).all(|pair| pair[1] < pair[0] && pair[1] > 0.0), "{turns:?}");
            assert!(turns[48] < 0.01 * turns[0]);
            // All of it is what it turns in one second.
            let all = angle_difference(3.0, poses[49].heading) / turn;
            assert!((all - 1.0).abs() < 0.06, "{all}");
        }
    }

    #[test]
    fn a_turn_or_a_brake_beyond_all_measure_is_cut() {
        let poses = poses(&agent(0.0, 0.0, 0.0, 20.0), &agent(0.0, 0.0, -3.0, 90.0), 0.1);
        assert!((poses[0].heading - LARGEST_TURN_RATE * STEP_SECONDS).abs() < 1e-12);
        assert!((poses[0].position().norm() - 1.975).abs() < 1e-9, "{:?}", poses[0]);
    }

    #[test]
    fn who_stands_does_not_turn() {
        let poses = poses(&agent(3.0, 4.0, 1.0, 0.2), &agent(3.0, 4.0, 0.5, 0.2), 0.5);
        assert!(poses.iter().all(|pose| (pose.heading - 1.0).abs() < 1e-12));
        assert!(poses[49].position().distance(Point::new(3.0, 4.0)) < 1.1);
    }

    /// What is expected of someone who was seen at these log indices, the last is now.
    fn predict(seen: &[(u32, AgentState)]) -> Vec<Pose> {
        let observed =
            |state: AgentState| ObservedAgent { track: TrackId(5), kind: AgentKind::Vehicle, state, unseen: 0 };
        let (now, state) = seen[seen.len() - 1];
        let history = seen.iter().map(|(log_index, state)| HistoryStep {
            log_index: *log_index,
            av: AgentState::default(),
            agents: vec![observed(*state)],
        });
        let briefing = Briefing {
            scene: SceneId::new("seen").unwrap(),
            protocol: "strict".to_owned(),
            start: 0,
            horizon: 150,
            wheelbase: 3.089,
            map: Arc::default(),
            route: vec![],
            reference_line: Arc::default(),
            history: history.collect(),
        };
        let observation = Observation {
            step: 0,
            log_index: now,
            av: AgentState::default(),
            control: Control::default(),
            agents: vec![observed(state)],
            signals: vec![],
            window: ReferenceWindow {
                line: Arc::default(),
                start: 0,
                samples: 0,
                first_sample: 0,
                red_stops: vec![],
                speed_limit: None,
            },
        };
        let mut history = History::new(&briefing);
        history.push(&observation);
        let step = StepInput { briefing: &briefing, observation: &observation, history: &history, prediction: None };
        let mut predictor = Ctra.start(&briefing).unwrap();
        let prediction = predictor.predict(&step).unwrap().check(0).unwrap();
        prediction.futures()[0].trajectories[0].poses.clone()
    }

    #[test]
    fn who_is_seen_for_the_first_time_keeps_its_velocity() {
        for now in [0, 2, 19] {
            let poses = predict(&[(now, agent(0.0, 0.0, 0.5, 6.0))]);
            let straight = Point::unit(0.5) * 30.0;
            assert!(poses[49].position().distance(straight) < 1e-9, "{:?}", poses[49]);
        }
    }

    #[test]
    fn motion_is_measured_as_far_back_as_half_a_second() {
        let now = agent(0.0, 0.0, 0.0, 6.0);
        let long = predict(&[(10, agent(0.0, 0.0, 0.0, 5.0)), (13, agent(0.0, 0.0, 0.0, 9.0)), (15, now)]);
        assert_eq!(long, poses(&now, &agent(0.0, 0.0, 0.0, 5.0), 0.5));
        let short = predict(&[(9, agent(0.0, 0.0, 0.0, 5.0)), (13, agent(0.0, 0.0, 0.0, 6.4)), (15, now)]);
        assert_eq!(short, poses(&now, &agent(0.0, 0.0, 0.0, 6.4), 0.2));
    }
}
