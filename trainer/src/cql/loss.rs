//! What is learned from, as numbers in, numbers and slopes out; what is meant by each is in d3rlpy's `sac_impl.py` and `cql_impl.py`.

use std::f64::consts::{LN_2, TAU};

/// The logarithm of an action's spread stays within this, as in d3rlpy's `NormalPolicy`.
const LOG_SPREAD: [f64; 2] = [-20.0, 2.0];

/// What a critic should say of an action: its reward, and what the next state is worth unless the AV is at its goal.
#[must_use]
pub fn bellman_target(reward: f64, ends: bool, gamma: f64, next: f64) -> f64 {
    reward + if ends { 0.0 } else { gamma * next }
}

/// How far above the logged action's value all others are: `log sum exp (q - log density) - logged`, and its slope by each `q`, which is written over
/// them; by `logged` it is -1.
pub fn conservative_gap(values: &mut [f64], log_densities: &[f64], logged: f64) -> f64 {
    values.iter_mut().zip(log_densities).for_each(|(value, density)| *value -= density);
    let most = values.iter().copied().fold(f64::NEG_INFINITY, |most, value| if value > most { value } else { most });
    values.iter_mut().for_each(|value| *value = libm::exp(*value - most));
    let sum: f64 = values.iter().sum();
    values.iter_mut().for_each(|value| *value /= sum);
    most + libm::log(sum) - logged
}

/// The logarithm of the density of an action anywhere, of so many numbers in [-1, 1].
#[must_use]
pub fn uniform_log_density(numbers: usize) -> f64 {
    -(numbers as f64) * LN_2
}

/// A number of an action drawn from a normal distribution and squashed into (-1, 1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Squashed {
    /// The number.
    pub action: f64,
    /// Its share of the logarithm of the action's density.
    pub log_density: f64,
    /// Spread times noise; 0 slope beyond the bounds of the spread is in `spread_moves`.
    stretch: f64,
    /// Whether the spread is within its bounds.
    spread_moves: bool,
}

impl Squashed {
    /// `tanh(mean + spread noise)`.
    #[must_use]
    pub fn draw(mean: f64, log_spread: f64, noise: f64) -> Self {
        let [least, most] = LOG_SPREAD;
        let bounded = log_spread.clamp(least, most);
        let stretch = libm::exp(bounded) * noise;
        let raw = mean + stretch;
        let normal = -0.5 * noise * noise - bounded - 0.5 * libm::log(TAU);
        // log(1 - tanh(raw)^2), without the loss of digits.
        let squash = 2.0 * (LN_2 - raw - softplus(-2.0 * raw));
        Self {
            action: libm::tanh(raw),
            log_density: normal - squash,
            stretch,
            spread_moves: (least..=most).contains(&log_spread),
        }
    }

    /// Slopes by mean and logarithm of the spread, where that by the action is `by_action` and that by the log density `by_density`. The noise stays.
    #[must_use]
    pub fn back(&self, by_action: f64, by_density: f64) -> [f64; 2] {
        let by_raw = by_action * (1.0 - self.action * self.action) + 2.0 * by_density * self.action;
        let by_spread = if self.spread_moves { by_raw * self.stretch - by_density } else { 0.0 };
        [by_raw, by_spread]
    }
}

fn softplus(x: f64) -> f64 {
    let above = if x > 0.0 { x } else { 0.0 };
    above + libm::log1p(libm::exp(-x.abs()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_target_counts_what_comes_after_but_at_the_goal() {
        assert_eq!(bellman_target(1.5, false, 0.5, 8.0), 5.5);
        assert_eq!(bellman_target(1.5, true, 0.5, 8.0), 1.5);
    }

    #[test]
    fn a_gap_by_hand() {
        // exp(0) + exp(ln 3) = 4: ln 4 - 1; shares 1/4 and 3/4. A density of e^-1 adds 1 to its value.
        let mut values = [0.0, libm::log(3.0) - 1.0];
        let gap = conservative_gap(&mut values, &[0.0, -1.0], 1.0);
        assert!((gap - (libm::log(4.0) - 1.0)).abs() < 1e-15);
        assert!((values[0] - 0.25).abs() < 1e-15 && (values[1] - 0.75).abs() < 1e-15, "{values:?}");
        let mut far = [1000.0, 0.0];
        assert_eq!(conservative_gap(&mut far, &[0.0, 0.0], 0.0), 1000.0, "nothing overflows");
        assert_eq!(uniform_log_density(3), libm::log(0.125));
    }

    #[test]
    fn the_density_of_a_squashed_number_is_that_of_what_it_came_from_by_the_slope() {
        let drawn = Squashed::draw(0.3, -0.7, 1.1);
        let spread = libm::exp(-0.7);
        assert_eq!(drawn.action, libm::tanh(0.3 + spread * 1.1));
        let normal = libm::exp(-0.5 * 1.1 * 1.1) / (spread * TAU.sqrt());
        let density = normal / (1.0 - drawn.action * drawn.action);
        assert!((drawn.log_density - libm::log(density)).abs() < 1e-14);
        assert!(Squashed::draw(40.0, 0.0, 0.0).log_density.is_finite());
    }

    #[test]
    fn slopes_are_those_of_differences() {
        let loss = |mean: f64, spread: f64| {
            let drawn = Squashed::draw(mean, spread, -0.8);
            3.0 * drawn.action + 0.7 * drawn.log_density
        };
        for (mean, spread) in [(0.2, -1.0), (-1.5, 0.5), (0.1, 3.0), (0.0, -25.0)] {
            let slope = |by: [f64; 2]| {
                let h = 1e-6;
                let [dm, ds] = by.map(|by| by * h);
                (loss(mean + dm, spread + ds) - loss(mean - dm, spread - ds)) / (2.0 * h)
            };
            let [by_mean, by_spread] = Squashed::draw(mean, spread, -0.8).back(3.0, 0.7);
            assert!((slope([1.0, 0.0]) - by_mean).abs() < 1e-7, "{mean} {spread}");
            assert!((slope([0.0, 1.0]) - by_spread).abs() < 1e-7, "{mean} {spread}");
        }
    }
}
