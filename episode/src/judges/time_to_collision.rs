//! How soon the AV's box and an agent's would overlap if both went on at constant speed and heading.
//!
//! nuPlan moves all boxes in steps of 0.1 s up to 2.9 s and takes the first step with an overlap. The boxes keep their
//! headings, so on each of the four separating axes the offset grows linearly with time: the times of overlap are an
//! interval in closed form, and nuPlan's answer is the first multiple of 0.1 s in it.

use world::geometry::{OrientedBox, Point};
use world::plan::STEP_SECONDS;
use world::scene::{AgentKind, AgentState};

use super::Body;

/// Steps of the projection: 0.1 s to 2.9 s, as `numpy.arange(0.1, 3.0, 0.1)`.
pub const HORIZON_STEPS: usize = 29;

/// Below this (s) a time to collision is too short (nuPlan, `time_to_collision_within_bound`).
pub const LEAST_TIME_TO_COLLISION: f64 = 0.95;

/// At most this speed (m/s) the AV has no time to collision: it stands.
pub const STANDING_SPEED: f64 = 0.005;

/// A road user at one step.
#[derive(Clone, Copy, Debug)]
pub struct TrafficAgent {
    /// Place of its track in the scene.
    pub track: usize,
    /// What it is.
    pub kind: AgentKind,
    /// Its box.
    pub outline: OrientedBox,
    /// Height of the box's centre (m).
    pub z: f64,
    /// Velocity (m/s).
    pub velocity: Point,
    /// Speed (m/s).
    pub speed: f64,
    /// It appeared less than a second ago, or was supposed elsewhere: nobody could have reacted to it.
    pub sudden: bool,
}

impl TrafficAgent {
    /// Track number `track` in `state`.
    #[must_use]
    pub fn of(track: usize, kind: AgentKind, state: &AgentState, sudden: bool) -> Self {
        let (outline, velocity, speed) = (state.oriented_box(), state.velocity(), state.speed());
        Self { track, kind, outline, z: state.z, velocity, speed, sudden }
    }
}

/// The time (s) to the first overlap of the AV with `agent`, a multiple of 0.1 s from 0.1 to 2.9, if there is one.
#[must_use]
pub fn time_to_collision(av: &Body, agent: &TrafficAgent) -> Option<f64> {
    // nuPlan lets an agent go where its box points, not where its velocity does.
    let relative = agent.outline.forward * agent.speed - av.velocity();
    let (from, to) = overlap_interval(&av.outline, &agent.outline, relative)?;
    let step = (from / STEP_SECONDS).floor().max(0.0) + 1.0;
    (step <= HORIZON_STEPS as f64 && step * STEP_SECONDS < to).then_some(step * STEP_SECONDS)
}

/// The open interval of times (s) at which `b`, moving at `velocity` (m/s) relative to `a`, overlaps it.
fn overlap_interval(a: &OrientedBox, b: &OrientedBox, velocity: Point) -> Option<(f64, f64)> {
    let offset = b.center - a.center;
    let cosine = a.forward.dot(b.forward).abs();
    let sine = a.forward.cross(b.forward).abs();
    let reach = |own: f64, along: f64, across: f64| own + (along * cosine + across * sine);
    let axes = [
        (a.forward, reach(a.half_length, b.half_length, b.half_width)),
        (a.left(), reach(a.half_width, b.half_width, b.half_length)),
        (b.forward, reach(b.half_length, a.half_length, a.half_width)),
        (b.left(), reach(b.half_width, a.half_width, a.half_length)),
    ];
    let (mut from, mut to) = (f64::NEG_INFINITY, f64::INFINITY);
    for (axis, reach) in axes {
        let (gap, rate) = (offset.dot(axis), velocity.dot(axis));
        if rate == 0.0 {
            if gap.abs() >= reach {
                return None;
            }
            continue;
        }
        let (one, other) = ((-reach - gap) / rate, (reach - gap) / rate);
        from = from.max(one.min(other));
        to = to.min(one.max(other));
    }
    (from < to && to > 0.0).then_some((from, to))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use world::geometry::{Pose, boxes_overlap};

    use super::*;

    fn body(pose: Pose, speed: f64) -> Body {
        let velocity = Point::unit(pose.heading) * speed;
        let (x, y, heading) = (pose.x, pose.y, pose.heading);
        let (velocity_x, velocity_y) = (velocity.x, velocity.y);
        let state =
            AgentState { x, y, heading, velocity_x, velocity_y, length: 4.8, width: 2.0, ..AgentState::default() };
        Body { speed, ..Body::of(state) }
    }

    fn agent(pose: Pose, speed: f64) -> TrafficAgent {
        let Body { state, outline, .. } = body(pose, speed);
        TrafficAgent {
            track: 0,
            kind: AgentKind::Vehicle,
            outline,
            z: 0.0,
            velocity: state.velocity(),
            speed,
            sudden: false,
        }
    }

    #[test]
    fn closing_five_metres_at_ten_metres_a_second_takes_half_a_second() {
        // 5 m between the bumpers: they touch at 0.5 s, and overlap at the next tenth.
        let av = body(Pose::new(0.0, 0.0, 0.0), 10.0);
        let wall = agent(Pose::new(9.8 - 1e-9, 0.0, 0.0), 0.0);
        assert_eq!(time_to_collision(&av, &wall), Some(0.5));
        assert_eq!(time_to_collision(&av, &agent(Pose::new(9.8 + 1e-9, 0.0, 0.0), 0.0)), Some(6.0 * 0.1));
    }

    #[test]
    fn following_at_equal_speed_never_collides() {
        let av = body(Pose::new(0.0, 0.0, 0.0), 10.0);
        assert_eq!(time_to_collision(&av, &agent(Pose::new(6.0, 0.0, 0.0), 10.0)), None);
    }

    #[test]
    fn the_neighbouring_lane_is_missed() {
        let av = body(Pose::new(0.0, 0.0, 0.0), 10.0);
        assert_eq!(time_to_collision(&av, &agent(Pose::new(20.0, 3.5, 0.0), 0.0)), None);
    }

    proptest! {
        #[test]
        fn the_closed_form_is_the_first_step_with_an_overlap(
            (x, y, heading) in (-30.0..30.0, -15.0..15.0, -3.2..3.2), speed in 0.0..15.0, other in 0.0..15.0,
        ) {
            let (av, agent) = (body(Pose::new(0.0, 0.0, 0.3), speed), agent(Pose::new(x, y, heading), other));
            let moved = |outline: OrientedBox, speed: f64, time: f64| {
                OrientedBox { center: outline.center + outline.forward * (speed * time), ..outline }
            };
            let stepped = (1..=HORIZON_STEPS).map(|step| step as f64 * STEP_SECONDS).find(|time| {
                boxes_overlap(&moved(av.outline, speed, *time), &moved(agent.outline, other, *time))
            });
            prop_assert_eq!(time_to_collision(&av, &agent), stepped);
        }
    }
}
