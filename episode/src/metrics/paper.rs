//! The paper's metrics, as its published code computes them (`dipp/closed-loop.md` section 7), but with no value where none
//! is defined: the authors' code gives NaN there, or repeats the last pose.

use world::geometry::{Point, Pose};
use world::plan::STEP_SECONDS;

use super::Counted;

/// Sum of the distances between successive poses (m). The first step's is missing, as in the paper's code: the start pose
/// is not among `poses`, of which there is one a step. `None` without any pose.
#[must_use]
pub fn progress(poses: &[Pose], counted: Counted<'_>) -> Option<f64> {
    let steps = poses.windows(2).map(|pair| pair[0].position().distance(pair[1].position()));
    (!poses.is_empty()).then(|| counted.of(1, steps).fold(0.0, |sum, step| sum + step))
}

/// How a drive feels.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Comfort {
    /// Mean magnitude of longitudinal acceleration (m/s^2); three poses at least.
    pub acceleration: Option<f64>,
    /// Mean magnitude of longitudinal jerk (m/s^3); four poses at least.
    pub jerk: Option<f64>,
    /// Mean magnitude of the change of lateral velocity in the body's frame (m/s^2); three poses at least. It is far below the
    /// true lateral acceleration in bends: that shows only through the angle between heading and motion.
    pub lateral_acceleration: Option<f64>,
}

/// The comfort of the drive through `poses`, 0.1 s apart. The velocity over a segment is taken in the body's frame at its start,
/// as the authors' closed loop does.
#[must_use]
pub fn comfort(poses: &[Pose], counted: Counted<'_>) -> Comfort {
    comfort_in(poses, counted, |pair| pair[0].heading)
}

/// The same with the velocity in the body's frame at the segment's end, as the authors' open-loop test does.
#[must_use]
pub fn comfort_by_ends(poses: &[Pose]) -> Comfort {
    comfort_in(poses, Counted::ALL, |pair| pair[1].heading)
}

fn comfort_in(poses: &[Pose], counted: Counted<'_>, heading: impl Fn(&[Pose]) -> f64) -> Comfort {
    // Velocity over each segment: longitudinal, lateral.
    let velocities = poses.windows(2).map(|pair| {
        let forward = Point::unit(heading(pair));
        let velocity = (pair[1].position() - pair[0].position()) * (1.0 / STEP_SECONDS);
        (forward.dot(velocity), forward.cross(velocity))
    });
    let (longitudinal, lateral): (Vec<f64>, Vec<f64>) = velocities.unzip();
    let accelerations = differences(&longitudinal);
    // The first acceleration is told by the third pose.
    let mean = |first: usize, values: &[f64]| mean_magnitude(counted.of(first, values.iter().copied()));
    Comfort {
        acceleration: mean(2, &accelerations),
        jerk: mean(3, &differences(&accelerations)),
        lateral_acceleration: mean(2, &differences(&lateral)),
    }
}

/// The rate of change (per second) from each sample to the next.
fn differences(samples: &[f64]) -> Vec<f64> {
    samples.windows(2).map(|pair| (pair[1] - pair[0]) / STEP_SECONDS).collect()
}

fn mean_magnitude(values: impl Iterator<Item = f64>) -> Option<f64> {
    let values: Vec<f64> = values.collect();
    (!values.is_empty()).then(|| values.iter().map(|value| value.abs()).sum::<f64>() / values.len() as f64)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    fn near(value: Option<f64>, expected: f64) {
        assert!((value.unwrap() - expected).abs() < 1e-9, "{value:?} {expected}");
    }

    #[test]
    fn a_straight_line_at_constant_acceleration() {
        // x = 3 t + 2 t^2 / 2 on a road that points to 0.7 rad.
        let direction = Point::unit(0.7);
        let poses: Vec<Pose> = (1..=50)
            .map(|step| {
                let time = f64::from(step) * STEP_SECONDS;
                let place = direction * (3.0 * time + time * time);
                Pose::new(place.x, place.y, 0.7)
            })
            .collect();
        let comfort = comfort(&poses, Counted::ALL);
        near(comfort.acceleration, 2.0);
        near(comfort.jerk, 0.0);
        near(comfort.lateral_acceleration, 0.0);
        near(progress(&poses, Counted::ALL), 15.0 + 25.0 - (0.3 + 0.01));
    }

    #[test]
    fn a_circle_at_constant_speed_has_no_lateral_acceleration_by_this_definition() {
        // Radius 20 m, 10 m/s: the true lateral acceleration is 5 m/s^2, the chord's angle to the heading is constant.
        let poses: Vec<Pose> = (1..=80)
            .map(|step| {
                let angle = 0.5 * f64::from(step) * STEP_SECONDS;
                Pose::new(20.0 * libm::sin(angle), 20.0 * (1.0 - libm::cos(angle)), angle)
            })
            .collect();
        let comfort = comfort(&poses, Counted::ALL);
        near(comfort.acceleration, 0.0);
        near(comfort.lateral_acceleration, 0.0);
        near(progress(&poses, Counted::ALL), 79.0 * 40.0 * libm::sin(0.025));
    }

    #[test]
    fn what_is_not_defined_has_no_value() {
        let poses = |count| vec![Pose::default(); count];
        let comfort = |poses: &[Pose]| comfort(poses, Counted::ALL);
        assert_eq!(progress(&[], Counted::ALL), None);
        assert_eq!(progress(&poses(1), Counted::ALL), Some(0.0));
        assert_eq!(comfort(&poses(2)), Comfort::default());
        let three = comfort(&poses(3));
        assert_eq!((three.acceleration, three.jerk), (Some(0.0), None));
        assert_eq!(comfort(&poses(4)).jerk, Some(0.0));
    }

    #[test]
    fn a_step_that_does_not_count_says_nothing() {
        // 1 m a step, but for a jump of 3 m at the sixth pose.
        let poses: Vec<Pose> =
            (0..20).map(|step| Pose::new(f64::from(step) + if step >= 5 { 2.0 } else { 0.0 }, 0.0, 0.0)).collect();
        let without = |left_out: &[usize]| {
            let flags: Vec<bool> = (0..20).map(|step| !left_out.contains(&step)).collect();
            (progress(&poses, Counted::only(&flags)).unwrap(), comfort(&poses, Counted::only(&flags)))
        };
        let (way, all) = without(&[]);
        assert_eq!((way, all), (progress(&poses, Counted::ALL).unwrap(), comfort(&poses, Counted::ALL)));
        assert!((way - 21.0).abs() < 1e-9 && all.acceleration.unwrap() > 1.0);
        let (way, calm) = without(&[5, 6, 7]);
        near(Some(way), 21.0 - 5.0);
        near(calm.acceleration, 0.0);
        near(calm.jerk, 0.0);
        let nothing: Vec<usize> = (0..20).collect();
        assert_eq!(without(&nothing).1, Comfort::default());
    }
}
