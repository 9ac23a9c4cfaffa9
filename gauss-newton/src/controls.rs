//! The hundred unknowns: an acceleration and a steering angle for each of the fifty steps.

use world::plan::Control;

use super::constants::STEPS;

/// A control for each step, or a change of them, or a gradient by them.
#[derive(Clone, Debug, PartialEq)]
pub struct Controls {
    /// Accelerations (m/s^2).
    pub acceleration: [f64; STEPS],
    /// Steering angles (rad).
    pub steering: [f64; STEPS],
}

impl Controls {
    /// Straight on at the present speed.
    pub const ZERO: Self = Self { acceleration: [0.0; STEPS], steering: [0.0; STEPS] };

    /// From (acceleration, steering) pairs, first step first. `None` unless there are fifty.
    #[must_use]
    pub fn from_pairs(pairs: impl ExactSizeIterator<Item = (f64, f64)>) -> Option<Self> {
        if pairs.len() != STEPS {
            return None;
        }
        let mut controls = Self::ZERO;
        for (t, (acceleration, steering)) in pairs.enumerate() {
            controls.acceleration[t] = acceleration;
            controls.steering[t] = steering;
        }
        Some(controls)
    }

    /// The control of step `t`.
    #[must_use]
    #[inline]
    pub fn at(&self, t: usize) -> Control {
        Control { acceleration: self.acceleration[t], steering: self.steering[t] }
    }

    /// All numbers: acceleration and steering of the first step, of the second, and so on.
    pub fn interleaved(&self) -> impl Iterator<Item = f64> {
        self.acceleration.iter().zip(&self.steering).flat_map(|(a, s)| [*a, *s])
    }

    /// `self += factor * direction`.
    pub fn add_scaled(&mut self, factor: f64, direction: &Self) {
        for t in 0..STEPS {
            self.acceleration[t] += factor * direction.acceleration[t];
            self.steering[t] += factor * direction.steering[t];
        }
    }

    /// Sum of the products of both's numbers.
    #[must_use]
    pub fn dot(&self, other: &Self) -> f64 {
        let product = |a: &[f64; STEPS], b: &[f64; STEPS]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        product(&self.acceleration, &other.acceleration) + product(&self.steering, &other.steering)
    }

    /// Whether every number is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.acceleration.iter().chain(&self.steering).all(|v| v.is_finite())
    }
}
