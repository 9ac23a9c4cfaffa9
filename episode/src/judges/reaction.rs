//! Whether a replayed agent would have had to react to the AV. It cannot: it does what it did in the log. Where somebody at its wheel would
//! have braked or swerved, what follows is nothing that would have happened.

use world::geometry::boxes_overlap;
use world::plan::STEP_SECONDS;

use super::collision::{STANDING_SPEED, front_bumper, overlaps};
use super::time_to_collision::{TrafficAgent, time_to_collision};
use super::{Body, STOREY};

/// How far ahead (s) a driver looks.
pub const HORIZON: f64 = 2.0;

/// The time (s) until `agent` meets the AV with its front if both go on at constant speed and heading, up to [`HORIZON`]; 0 where it is
/// driving through the AV already. None where it does not, where it stands, or where it is the AV that runs into it: with its front, and not
/// into the other's.
#[must_use]
pub fn must_react(av: &Body, agent: &TrafficAgent) -> Option<f64> {
    if agent.speed <= STANDING_SPEED || (av.state.z - agent.z).abs() > STOREY {
        return None;
    }
    if overlaps(av, agent) {
        let ran_into_it = boxes_overlap(&front_bumper(&av.outline), &agent.outline);
        return (!ran_into_it || boxes_overlap(&front_bumper(&agent.outline), &av.outline)).then_some(0.0);
    }
    // Half a step more than the horizon: times are multiples of a tenth, as far as floating point has them.
    let time = time_to_collision(av, agent).filter(|time| *time < HORIZON + 0.5 * STEP_SECONDS)?;
    let (mut own, mut other) = (av.outline, agent.outline);
    own.center = own.center + av.velocity() * time;
    other.center = other.center + other.forward * (agent.speed * time);
    boxes_overlap(&front_bumper(&other), &own).then_some(time)
}

#[cfg(test)]
mod tests {
    use world::geometry::{Point, Pose};
    use world::scene::{AgentKind, AgentState};

    use super::*;

    fn state(pose: Pose, speed: f64) -> AgentState {
        let velocity = Point::unit(pose.heading) * speed;
        let (x, y, heading) = (pose.x, pose.y, pose.heading);
        let (velocity_x, velocity_y) = (velocity.x, velocity.y);
        AgentState { x, y, heading, velocity_x, velocity_y, length: 5.0, width: 2.0, ..AgentState::default() }
    }

    fn agent(pose: Pose, speed: f64) -> TrafficAgent {
        let state = state(pose, speed);
        TrafficAgent {
            track: 1,
            kind: AgentKind::Vehicle,
            outline: state.oriented_box(),
            z: 0.0,
            velocity: state.velocity(),
            speed,
            sudden: false,
        }
    }

    /// What an agent does about an AV in the origin that heads east.
    fn told(speed: f64, pose: Pose, other: f64) -> Option<f64> {
        must_react(&Body::of(state(Pose::default(), speed)), &agent(pose, other))
    }

    const NORTH: f64 = std::f64::consts::FRAC_PI_2;

    #[test]
    fn who_comes_up_from_behind_must_brake_as_soon_as_two_seconds_are_left() {
        // 10 m between the bumpers at 5 m/s more: 2 s, and the overlap a tenth later.
        assert_eq!(told(5.0, Pose::new(-15.0, 0.0, 0.0), 10.0), None);
        assert_eq!(told(5.0, Pose::new(-14.9, 0.0, 0.0), 10.0), Some(2.0));
        assert_eq!(told(5.0, Pose::new(-14.9, 0.0, 0.0), 5.0), None, "it is no faster");
    }

    #[test]
    fn whom_the_av_runs_into_need_not() {
        assert_eq!(told(10.0, Pose::new(9.0, 0.0, 0.0), 5.0), None);
        assert_eq!(told(10.0, Pose::new(4.0, 0.0, 0.0), 5.0), None, "it is in its back");
        assert_eq!(told(10.0, Pose::new(3.0, 0.5, NORTH), 5.0), None, "it is in its side");
        assert_eq!(told(10.0, Pose::new(9.0, 0.0, 0.0), 0.0), None, "it stands");
    }

    #[test]
    fn who_crosses_and_meets_the_av_with_its_front_must_and_whose_side_is_met_need_not() {
        // It comes from the south, and the AV's middle is in its way.
        assert!(told(5.0, Pose::new(5.0, -8.5, NORTH), 5.0).is_some());
        // It is nearly past when the AV gets there.
        assert_eq!(told(5.0, Pose::new(8.0, 0.0, NORTH), 2.0), None);
    }

    #[test]
    fn who_drives_through_the_av_does_so_now() {
        assert_eq!(told(0.0, Pose::new(-4.0, 0.0, 0.0), 3.0), Some(0.0));
        assert_eq!(told(0.0, Pose::new(0.0, 1.0, NORTH), 3.0), Some(0.0), "half way through");
        assert_eq!(told(5.0, Pose::new(4.0, 0.0, 2.0 * NORTH), 5.0), Some(0.0), "head on");
    }

    #[test]
    fn on_a_bridge_nobody_meets() {
        let mut av = Body::of(state(Pose::default(), 0.0));
        av.state.z = 5.0;
        let agent = agent(Pose::new(-6.0, 0.0, 0.0), 10.0);
        assert_eq!(must_react(&av, &agent), None);
        av.state.z = 0.0;
        assert!(must_react(&av, &agent).is_some());
    }
}
