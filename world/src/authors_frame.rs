//! What the paper's code makes of a state in the AV's frame, rounded where it rounds: NumPy in single precision, but for the turning
//! of places. Plans react to these roundings (half a millimetre moves a nearest sample), so reproducing them takes the last bit.
//!
//! A component that is exactly 0 in the log's frame is a missing one to that code, and stays 0 in the AV's, each by itself: an
//! agent with the heading 0 seems to head where the AV does (`dipp/closed-loop.md` section 3).

use crate::geometry::{Point, Pose, wrap_angle_single};
use crate::scene::AgentState;

/// A number as they store it.
#[must_use]
pub fn single(value: f64) -> f64 {
    f64::from(value as f32)
}

/// Place and heading of a logged state in the frame of an AV at `av`.
#[must_use]
pub fn pose(state: &AgentState, av: Pose) -> Pose {
    let (x, y) = (state.x as f32, state.y as f32);
    let place = av.to_body(Point::new(f64::from(x), f64::from(y)));
    Pose::new(unless_missing(x, place.x as f32), unless_missing(y, place.y as f32), heading(state, av))
}

/// Heading of a logged state in the frame of an AV at `av`.
#[must_use]
pub fn heading(state: &AgentState, av: Pose) -> f64 {
    let heading = state.heading as f32;
    unless_missing(heading, wrap_angle_single(heading - av.heading as f32))
}

/// Velocity of a logged state in the frame of an AV at `av`.
#[must_use]
pub fn velocity(state: &AgentState, av: Pose) -> Point {
    let (x, y) = (state.velocity_x as f32, state.velocity_y as f32);
    let (cos, sin) = (libm::cos(av.heading) as f32, libm::sin(av.heading) as f32);
    Point::new(unless_missing(x, x * cos + y * sin), unless_missing(y, y * cos - x * sin))
}

/// The velocity of the AV in its own frame at a step of its drive. At step 0 it is a logged one, see [`velocity`]; later states are in
/// double precision and rounded at the end.
#[must_use]
pub fn av_velocity(av: &AgentState, step: u32) -> Point {
    if step == 0 {
        return velocity(av, av.pose());
    }
    let own = Pose::new(0.0, 0.0, av.heading).to_body(av.velocity());
    let kept = |logged: f64, own: f64| if logged == 0.0 { 0.0 } else { single(own) };
    Point::new(kept(av.velocity_x, own.x), kept(av.velocity_y, own.y))
}

fn unless_missing(logged: f32, own: f32) -> f64 {
    f64::from(if logged == 0.0 { 0.0 } else { own })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An agent 13 m away on a map at 10 km, and the AV.
    fn agent_and_av() -> (AgentState, Pose) {
        let agent = AgentState {
            x: 10_012.0,
            y: -8_495.0,
            heading: 2.9,
            velocity_x: -6.5,
            velocity_y: 1.5,
            ..AgentState::default()
        };
        (agent, Pose::new(10_000.123_456_789, -8_500.987_654_321, -2.5))
    }

    #[test]
    fn it_is_the_av_s_frame_but_for_rounding() {
        let (agent, av) = agent_and_av();
        let exact = av.pose_to_body(agent.pose());
        let own = pose(&agent, av);
        assert!(own.position().distance(exact.position()) < 1e-5 && (own.heading - exact.heading).abs() < 1e-6);
        let exact = Pose::new(0.0, 0.0, av.heading).to_body(agent.velocity());
        for own in [velocity(&agent, av), av_velocity(&AgentState { heading: av.heading, ..agent }, 7)] {
            assert!(own.distance(exact) < 1e-5);
        }
    }

    #[test]
    fn what_is_exactly_zero_stays_zero_and_nothing_else_does() {
        let (agent, av) = agent_and_av();
        let odd = AgentState { y: 0.0, heading: 0.0, velocity_x: 0.0, ..agent };
        let (own, of_odd) = (pose(&agent, av), pose(&odd, av));
        assert!(own.y != 0.0 && own.heading != 0.0);
        assert_eq!((of_odd.y, of_odd.heading), (0.0, 0.0));
        assert!(of_odd.x != 0.0);
        for velocity in [velocity(&odd, av), av_velocity(&AgentState { heading: av.heading, ..odd }, 7)] {
            assert!(velocity.x == 0.0 && velocity.y != 0.0);
        }
    }

    #[test]
    fn every_number_has_single_precision() {
        let (agent, av) = agent_and_av();
        let (own, moving) = (pose(&agent, av), velocity(&agent, av));
        for value in [own.x, own.y, own.heading, moving.x, moving.y] {
            assert_eq!(value, f64::from(value as f32));
        }
    }
}
