//! Whether a car could have driven so, as Waymax asks (`waymax/metrics/comfort.py` and `dynamics/bicycle_model.py`, commit 48b33d71):
//! the acceleration and the curvature that lead from one state to the next are within what a car can do.

use world::geometry::angle_difference;
use world::plan::STEP_SECONDS;

/// Largest magnitude of acceleration (m/s^2).
pub const ACCELERATION: f64 = 10.4;
/// Largest magnitude of curvature (1/m).
pub const CURVATURE: f64 = 0.3;
/// What rounding may add to either.
const TOLERANCE: f64 = 1e-3;
/// Below this speed (m/s) no curvature is read.
const SLOW: f64 = 0.6;

/// What is needed of a state.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pace {
    /// m/s.
    pub speed: f64,
    /// rad.
    pub heading: f64,
}

/// Whether no car gets from `before` to `after` in a step.
#[must_use]
pub fn is_infeasible(before: Pace, after: Pace) -> bool {
    let acceleration = (after.speed - before.speed) / STEP_SECONDS;
    let way = (before.speed + 0.5 * acceleration * STEP_SECONDS) * STEP_SECONDS;
    let turns = before.speed >= SLOW && after.speed >= SLOW;
    let curvature = if turns { angle_difference(before.heading, after.heading) / way } else { 0.0 };
    acceleration.abs() > ACCELERATION + TOLERANCE || curvature.abs() > CURVATURE + TOLERANCE
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_car_brakes_by_eleven_or_turns_on_three_metres() {
        let pace = |speed, heading| Pace { speed, heading };
        assert!(!is_infeasible(pace(10.0, 0.0), pace(9.0, 0.0)));
        assert!(is_infeasible(pace(10.0, 0.0), pace(8.9, 0.0)));
        // 0.5 m in a step: 0.14 rad are 3.6 m of radius, 0.16 rad are 3.1 m.
        assert!(!is_infeasible(pace(5.0, 3.1), pace(5.0, 3.1 + 0.14 - std::f64::consts::TAU)));
        assert!(is_infeasible(pace(5.0, 0.0), pace(5.0, 0.16)));
        assert!(!is_infeasible(pace(0.5, 0.0), pace(0.5, 1.0)), "who creeps has a heading of noise");
    }
}
