//! The AV's next pose as a policy tells it: three numbers in [-1, 1], for a step of 0.1 s forward, to the left and around.

use world::geometry::{Point, Pose, wrap_angle};

/// Numbers of an action.
pub const ACTIONS: usize = 3;

/// The least and the most of each: metres forward (-5 to 35 m/s), metres to the left, radians.
const BOUNDS: [[f64; 2]; ACTIONS] = [[-0.5, 3.5], [-0.5, 0.5], [-0.2, 0.2]];

/// The action that leads from one pose to the next, as far as an action can.
#[must_use]
pub fn action_of(pose: Pose, next: Pose) -> [f32; ACTIONS] {
    let step = pose.pose_to_body(next);
    let numbers = [step.x, step.y, step.heading];
    std::array::from_fn(|index| {
        let [least, most] = BOUNDS[index];
        ((2.0 * (numbers[index] - least) / (most - least) - 1.0) as f32).clamp(-1.0, 1.0)
    })
}

/// The pose that an action leads to.
#[must_use]
pub fn next_pose(pose: Pose, action: [f32; ACTIONS]) -> Pose {
    let [forward, left, turn] = std::array::from_fn(|index| {
        let [least, most] = BOUNDS[index];
        least + 0.5 * (f64::from(action[index]) + 1.0) * (most - least)
    });
    let Point { x, y } = pose.to_world(Point::new(forward, left));
    Pose::new(x, y, wrap_angle(pose.heading + turn))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_action_leads_where_it_was_taken_from() {
        let (pose, next) = (Pose::new(100.0, -50.0, 3.1), Pose::new(98.5, -49.9, -3.12));
        let there = next_pose(pose, action_of(pose, next));
        let off = next.pose_to_body(there);
        assert!(off.position().norm() < 1e-6 && off.heading.abs() < 1e-7, "{off:?}");
    }

    #[test]
    fn what_no_action_can_do_is_done_as_far_as_it_goes() {
        let pose = Pose::new(0.0, 0.0, 0.0);
        assert_eq!(action_of(pose, Pose::new(9.0, -9.0, 1.0)), [1.0, -1.0, 1.0]);
        assert_eq!(next_pose(pose, [0.0; 3]).position(), Point::new(1.5, 0.0));
    }
}
