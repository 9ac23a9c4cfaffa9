//! nuPlan's comfort bounds. The Savitzky-Golay filters are part of the definition, with the windows that its code really
//! uses: 8 for acceleration, 15 for jerk, and 5 for yaw rate and yaw acceleration (`extract_ego_yaw_rate` has a parameter
//! for a window of 15, but does not pass it on; commit ce3c323a).

use world::geometry::angle_difference;
use world::plan::STEP_SECONDS;

use super::Counted;
use super::savitzky_golay::SavitzkyGolay;

/// Of accelerations.
pub const SMOOTH: SavitzkyGolay = SavitzkyGolay { window: 8, degree: 2, derivative: 0 };
/// Of jerk, after it.
pub const JERK: SavitzkyGolay = SavitzkyGolay { window: 15, degree: 2, derivative: 1 };
const YAW_RATE: SavitzkyGolay = SavitzkyGolay { window: 5, degree: 2, derivative: 1 };
const YAW_ACCELERATION: SavitzkyGolay = SavitzkyGolay { window: 5, degree: 3, derivative: 2 };

/// Longitudinal acceleration (m/s^2).
pub const LONGITUDINAL_ACCELERATION: (f64, f64) = (-4.05, 2.40);
/// Magnitude of lateral acceleration (m/s^2).
pub const LATERAL_ACCELERATION: f64 = 4.89;
/// Magnitude of yaw acceleration (rad/s^2).
pub const YAW_ACCELERATION_BOUND: f64 = 1.93;
/// Magnitude of yaw rate (rad/s).
pub const YAW_RATE_BOUND: f64 = 0.95;
/// Magnitude of longitudinal jerk (m/s^3).
pub const LONGITUDINAL_JERK: f64 = 4.13;
/// Magnitude of the change of acceleration's magnitude (m/s^3).
pub const JERK_BOUND: f64 = 8.37;

/// What is needed of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// Acceleration along the heading (m/s^2).
    pub acceleration: f64,
    /// Acceleration across it (m/s^2).
    pub lateral_acceleration: f64,
    /// Magnitude of the acceleration whose change is felt as jerk (m/s^2).
    pub magnitude: f64,
    /// Heading (rad).
    pub heading: f64,
}

/// What a step does to the car.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ride {
    /// Change of speed over the step (m/s^2).
    pub acceleration: f64,
    /// Speed after it (m/s).
    pub speed: f64,
    /// Heading after it (rad).
    pub heading: f64,
    /// Change of heading over it (rad/s).
    pub turning: f64,
    /// Yaw rate (rad/s) of a bicycle at the speed and with the steering angle after it, which is what nuPlan's model notes.
    pub yaw_rate: f64,
}

impl Ride {
    /// What is felt at the rear axle: what the step drove, and speed times yaw rate across it.
    #[must_use]
    pub fn felt(&self) -> Sample {
        let across = self.speed * self.turning;
        let magnitude = (self.acceleration * self.acceleration + across * across).sqrt();
        Sample { acceleration: self.acceleration, lateral_acceleration: across, magnitude, heading: self.heading }
    }

    /// What nuPlan's code reads (`dynamic_car_state.py`), after a step with yaw rate `before` (rad/s). It moves the rear axle's acceleration
    /// to the centre, `rear_axle_to_center` (m) ahead, by adding (yaw rate^2 + yaw acceleration) times that way *along* the car; a rigid
    /// body's is minus and across. Across there is nothing, and jerk is that of the rear axle.
    #[must_use]
    pub fn nuplan(&self, before: f64, rear_axle_to_center: f64) -> Sample {
        let yaw_acceleration = (self.yaw_rate - before) / STEP_SECONDS;
        Sample {
            acceleration: self.acceleration + rear_axle_to_center * (self.yaw_rate * self.yaw_rate + yaw_acceleration),
            lateral_acceleration: 0.0,
            magnitude: self.acceleration.abs(),
            heading: self.heading,
        }
    }
}

/// The extremes of a drive, filtered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extremes {
    /// Least longitudinal acceleration (m/s^2).
    pub least_acceleration: f64,
    /// Greatest longitudinal acceleration (m/s^2).
    pub greatest_acceleration: f64,
    /// Greatest magnitude of lateral acceleration (m/s^2).
    pub lateral_acceleration: f64,
    /// Greatest magnitude of yaw rate (rad/s).
    pub yaw_rate: f64,
    /// Greatest magnitude of yaw acceleration (rad/s^2).
    pub yaw_acceleration: f64,
    /// Greatest magnitude of longitudinal jerk (m/s^3).
    pub longitudinal_jerk: f64,
    /// Greatest magnitude of the change of acceleration's magnitude (m/s^3).
    pub jerk: f64,
}

impl Extremes {
    /// Those of a drive, a sample a step, over the steps that count; `None` where none does, or it is too short for the filters (four
    /// steps are needed).
    #[must_use]
    pub fn of(drive: &[Sample], counted: Counted<'_>) -> Option<Self> {
        let longitudinal: Vec<f64> = drive.iter().map(|sample| sample.acceleration).collect();
        let lateral: Vec<f64> = drive.iter().map(|sample| sample.lateral_acceleration).collect();
        let magnitude: Vec<f64> = drive.iter().map(|sample| sample.magnitude).collect();
        let headings = unwrapped(drive.iter().map(|sample| sample.heading));
        let acceleration = filter(SMOOTH, &longitudinal)?;
        let jerk = |signal: &[f64]| filter(JERK, &filter(SMOOTH, signal)?);
        let greatest_magnitude = |signal: &[f64]| counted.of(0, signal).map(|value| value.abs()).reduce(f64::max);
        Some(Self {
            least_acceleration: counted.of(0, acceleration.iter().copied()).reduce(f64::min)?,
            greatest_acceleration: counted.of(0, acceleration.iter().copied()).reduce(f64::max)?,
            lateral_acceleration: greatest_magnitude(&filter(SMOOTH, &lateral)?)?,
            yaw_rate: greatest_magnitude(&filter(YAW_RATE, &headings)?)?,
            yaw_acceleration: greatest_magnitude(&filter(YAW_ACCELERATION, &headings)?)?,
            longitudinal_jerk: greatest_magnitude(&jerk(&longitudinal)?)?,
            jerk: greatest_magnitude(&jerk(&magnitude)?)?,
        })
    }

    /// Whether all are within nuPlan's bounds.
    #[must_use]
    pub fn are_comfortable(&self) -> bool {
        self.least_acceleration > LONGITUDINAL_ACCELERATION.0
            && self.greatest_acceleration < LONGITUDINAL_ACCELERATION.1
            && self.lateral_acceleration < LATERAL_ACCELERATION
            && self.yaw_rate < YAW_RATE_BOUND
            && self.yaw_acceleration < YAW_ACCELERATION_BOUND
            && self.longitudinal_jerk < LONGITUDINAL_JERK
            && self.jerk < JERK_BOUND
    }
}

/// Filtered, and rounded to 8 decimals as nuPlan does.
fn filter(filter: SavitzkyGolay, signal: &[f64]) -> Option<Vec<f64>> {
    let filtered = filter.apply(signal, STEP_SECONDS)?;
    Some(filtered.into_iter().map(|value| (value * 1e8).round_ties_even() / 1e8).collect())
}

/// Headings without jumps of a whole turn.
fn unwrapped(headings: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut unwrapped: Vec<f64> = Vec::new();
    for heading in headings {
        let previous = unwrapped.last().copied().unwrap_or(heading);
        unwrapped.push(previous + angle_difference(previous, heading));
    }
    unwrapped
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    #[test]
    fn a_circle_at_constant_speed_has_its_true_yaw_rate_through_the_jump_of_its_heading() {
        let drive: Vec<Sample> = (0..150)
            .map(|step| Sample {
                acceleration: 0.0,
                lateral_acceleration: 5.0,
                magnitude: 5.0,
                heading: world::geometry::wrap_angle(0.5 * f64::from(step) * STEP_SECONDS),
            })
            .collect();
        let extremes = Extremes::of(&drive, Counted::ALL).unwrap();
        assert!((extremes.yaw_rate - 0.5).abs() < 1e-8 && extremes.yaw_acceleration < 1e-6, "{extremes:?}");
        assert!((extremes.lateral_acceleration - 5.0).abs() < 1e-8 && extremes.jerk < 1e-8);
        assert!(!extremes.are_comfortable(), "5 m/s^2 is beyond 4.89");
    }

    #[test]
    fn steady_braking_is_within_the_bound_or_not() {
        let braking = |acceleration| {
            Extremes::of(&[Sample { acceleration, ..Sample::default() }; 40], Counted::ALL).unwrap().are_comfortable()
        };
        assert!(braking(-4.0) && !braking(-4.1) && braking(2.3) && !braking(2.5));
    }

    #[test]
    fn three_steps_are_too_few() {
        assert_eq!(Extremes::of(&[Sample::default(); 3], Counted::ALL), None);
        assert!(Extremes::of(&[Sample::default(); 4], Counted::ALL).is_some());
    }

    #[test]
    fn a_tight_turn_is_felt_across_the_car_and_read_along_it_by_nuplan() {
        // 5 m/s on a circle of 10 m: 2.5 m/s^2 across; nuPlan adds 1.461 m (0.5 rad/s)^2 along.
        let ride = Ride { speed: 5.0, turning: 0.5, yaw_rate: 0.5, ..Ride::default() };
        assert_eq!(ride.felt().lateral_acceleration, 2.5);
        let read = ride.nuplan(0.5, 1.461);
        assert_eq!((read.acceleration, read.lateral_acceleration, read.magnitude), (1.461 * 0.25, 0.0, 0.0));
    }
}
