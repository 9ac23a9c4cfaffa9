//! From a plan's states to the control that is driven: nuPlan's LQR tracker on our bicycle model.
//!
//! Two small problems, each with the input held constant over a horizon of 1 s (nuPlan: `controller/tracker/lqr.py` and
//! `lqr_tracker.yaml`):
//!
//! - speed: `v' = a`; the acceleration that brings the speed to the plan's in 1 s, cost 10 dv^2 + 1 a^2;
//! - across: state (lateral error, heading error, steering angle) with `e' = v h`, `h' = v (steering / wheelbase - curvature)`,
//!   `steering' = rate`; the rate that makes the errors small after 1 s, cost 1 e^2 + 10 h^2 + 1 rate^2.
//!
//! Below 0.2 m/s, with a plan below 0.2 m/s, it brakes in proportion (gain 0.5) and leaves the wheels alone.
//!
//! Wanted speed and curvatures are read from the plan's poses (`profile`), from the present moment on, as nuPlan reads them.
//! Plans here begin 0.1 s ahead: the path is carried back by that step to meet the present, and no actuator lag follows.

mod profile;

use nalgebra::{Matrix3, Vector3};
use world::geometry::{Point, Pose, angle_difference, wrap_angle};
use world::plan::{Control, PlanState, STEP_SECONDS};
use world::vehicle::VehicleState;

use self::profile::Profile;

/// Steps that the tracker looks ahead.
const HORIZON: usize = 10;
/// States that a plan must have left to be followed.
pub(crate) const LEAST_STATES: usize = HORIZON + 1;
/// Cost of a speed error, against 1 for acceleration.
const SPEED_COST: f64 = 10.0;
/// Costs of lateral error, heading error and steering angle, against 1 for the steering rate.
const LATERAL_COSTS: [f64; 3] = [1.0, 10.0, 0.0];
/// Below this speed (m/s) of AV and plan, the AV is stopping.
const STOPPING_SPEED: f64 = 0.2;
/// Deceleration per speed while stopping (1/s).
const STOPPING_GAIN: f64 = 0.5;
/// The control, before any limit, that follows `states` (the plan's, [`world::plan::PLAN_STEPS`] of them) from `vehicle`
/// with the wheels at `steering` (rad), for a step.
#[must_use]
pub fn track(vehicle: &VehicleState, steering: f64, wheelbase: f64, states: &[PlanState]) -> Control {
    track_for(STEP_SECONDS, vehicle, steering, wheelbase, states)
}

/// As [`track`], the control that is held for so many seconds.
pub(crate) fn track_for(
    seconds: f64,
    vehicle: &VehicleState,
    steering: f64,
    wheelbase: f64,
    states: &[PlanState],
) -> Control {
    if states.len() < LEAST_STATES {
        return Control { acceleration: 0.0, steering };
    }
    let reference = Reference::of(states);
    if vehicle.speed <= STOPPING_SPEED && reference.speed <= STOPPING_SPEED {
        return Control { acceleration: -STOPPING_GAIN * (vehicle.speed - reference.speed), steering };
    }
    let acceleration = speed_control(vehicle.speed, reference.speed);
    let rate = steering_rate(vehicle, steering, wheelbase, acceleration, &reference);
    Control { acceleration, steering: steering + rate * seconds }
}

/// What is to be followed.
struct Reference {
    /// Where the plan's path is now.
    pose: Pose,
    /// Speed wanted at the horizon (m/s).
    speed: f64,
    /// Curvature (1/m) from now on, a value a step.
    curvatures: [f64; HORIZON],
}

impl Reference {
    fn of(states: &[PlanState]) -> Self {
        let profile = Profile::of(states);
        let back = |values: &[f64]| 2.0 * values[0] - values[1];
        let speed = back(&profile.speeds).max(0.0);
        let mut curvatures = [back(&profile.curvatures); HORIZON];
        curvatures[1..].copy_from_slice(&profile.curvatures[..HORIZON - 1]);
        let (first, travel) = (states[0], speed * STEP_SECONDS);
        let heading = first.heading - travel * curvatures[0];
        let place = Point::new(first.x, first.y) - Point::unit(heading) * travel;
        Self { pose: Pose::new(place.x, place.y, heading), speed: profile.speeds[HORIZON - 1], curvatures }
    }

    /// How far `vehicle` is to the left of the path (m), and turned to the left of it (rad).
    fn errors(&self, vehicle: &VehicleState) -> (f64, f64) {
        let offset = Point::new(vehicle.x - self.pose.x, vehicle.y - self.pose.y);
        (Point::unit(self.pose.heading).cross(offset), angle_difference(self.pose.heading, vehicle.heading))
    }
}

/// `v + T a` shall be the wanted speed after the horizon's `T` seconds.
fn speed_control(speed: f64, wanted: f64) -> f64 {
    let seconds = HORIZON as f64 * STEP_SECONDS;
    SPEED_COST * seconds * (wanted - speed) / (SPEED_COST * seconds * seconds + 1.0)
}

fn steering_rate(
    vehicle: &VehicleState,
    steering: f64,
    wheelbase: f64,
    acceleration: f64,
    reference: &Reference,
) -> f64 {
    let (lateral_error, heading_error) = reference.errors(vehicle);
    let start = Vector3::new(lateral_error, heading_error, steering);
    // After the horizon the state is `a start + b rate + g`.
    let (mut a, mut b, mut g) = (Matrix3::identity(), Vector3::zeros(), Vector3::zeros());
    for (step, curvature) in reference.curvatures.into_iter().enumerate() {
        let travel = (vehicle.speed + acceleration * step as f64 * STEP_SECONDS) * STEP_SECONDS;
        let now = Matrix3::new(1.0, travel, 0.0, 0.0, 1.0, travel / wheelbase, 0.0, 0.0, 1.0);
        a = now * a;
        b = now * b + Vector3::new(0.0, 0.0, STEP_SECONDS);
        g = now * g - Vector3::new(0.0, travel * curvature, 0.0);
    }
    let mut error = a * start + g;
    error.y = wrap_angle(error.y);
    error.z = wrap_angle(error.z);
    let cost = Vector3::from(LATERAL_COSTS);
    -b.component_mul(&cost).dot(&error) / (b.component_mul(&cost).dot(&b) + 1.0)
}

#[cfg(test)]
mod tests {
    use world::plan::PLAN_STEPS;
    use world::vehicle::{BicycleModel, Limits};

    use super::*;

    /// A plan at constant speed along a circle of `curvature` through the origin, heading along x, `ahead` seconds on.
    fn circle(curvature: f64, speed: f64, ahead: f64) -> Vec<PlanState> {
        (1..=PLAN_STEPS)
            .map(|step| {
                let arc = speed * (step as f64 * STEP_SECONDS + ahead);
                let heading = arc * curvature;
                let (x, y) = if curvature == 0.0 {
                    (arc, 0.0)
                } else {
                    (libm::sin(heading) / curvature, (1.0 - libm::cos(heading)) / curvature)
                };
                PlanState { x, y, heading, speed }
            })
            .collect()
    }

    fn drive(mut vehicle: VehicleState, curvature: f64, speed: f64, steps: usize) -> (VehicleState, f64) {
        let model = BicycleModel::default();
        let mut steering = 0.0;
        for step in 0..steps {
            let plan = circle(curvature, speed, step as f64 * STEP_SECONDS);
            let wanted = track(&vehicle, steering, model.wheelbase, &plan);
            let control = Limits::STRICT.apply(wanted, steering, STEP_SECONDS);
            steering = control.steering;
            vehicle = model.step(vehicle, control, STEP_SECONDS);
        }
        (vehicle, steering)
    }

    #[test]
    fn a_vehicle_on_a_straight_plan_needs_no_control() {
        let vehicle = VehicleState { speed: 8.0, ..VehicleState::default() };
        let control = track(&vehicle, 0.0, 3.089, &circle(0.0, 8.0, 0.0));
        assert!(control.acceleration.abs() < 1e-12 && control.steering.abs() < 1e-12, "{control:?}");
    }

    #[test]
    fn one_metre_beside_a_straight_plan_is_closed_without_overshooting_far() {
        let (end, steering) = drive(VehicleState { y: 1.0, speed: 8.0, ..VehicleState::default() }, 0.0, 8.0, 80);
        assert!(end.y.abs() < 0.05 && end.heading.abs() < 0.02 && steering.abs() < 0.02, "{end:?}");
    }

    #[test]
    fn a_circle_is_driven_with_the_steering_of_its_radius() {
        let (end, steering) = drive(VehicleState { speed: 6.0, ..VehicleState::default() }, 0.05, 6.0, 120);
        assert!((steering - libm::atan(3.089 * 0.05)).abs() < 5e-3, "{steering}");
        let radius = libm::hypot(end.x, end.y - 20.0);
        assert!((radius - 20.0).abs() < 0.4, "{radius}");
    }

    #[test]
    fn the_speed_control_is_the_least_squares_one() {
        // min 10 (dv - a)^2 + a^2  =>  a = 10/11 dv
        assert!((speed_control(5.0, 7.2) - 2.0).abs() < 1e-12);
    }

    #[test]
    fn a_standing_vehicle_with_a_standing_plan_is_left_alone() {
        let control = track(&VehicleState::default(), 0.3, 3.089, &[PlanState::default(); PLAN_STEPS]);
        assert_eq!(control, Control { acceleration: 0.0, steering: 0.3 });
    }
}
