//! The Savitzky-Golay filter as `scipy.signal.savgol_filter` computes it (mode `interp`): a polynomial is fitted to each
//! window by least squares and read, or differentiated, at its middle; at both ends the first and the last window's
//! polynomials are read at each sample. A window of even length is read between its two middle samples.

/// The filter: window length (samples), degree of the polynomial, and which derivative is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SavitzkyGolay {
    /// Samples of a window; cut to the signal's length.
    pub window: usize,
    /// Degree of the polynomial, below `window`.
    pub degree: usize,
    /// 0 for the smoothed value, 1 for the slope, 2 for its slope.
    pub derivative: usize,
}

impl SavitzkyGolay {
    /// The filtered signal, whose samples are `spacing` apart; `None` where it is too short for the polynomial.
    #[must_use]
    pub fn apply(self, signal: &[f64], spacing: f64) -> Option<Vec<f64>> {
        let window = self.window.min(signal.len());
        if self.degree >= window || self.degree > MAX_DEGREE {
            return None;
        }
        let half = window / 2;
        let last = signal.len() - window;
        let middle = (window - 1) as f64 / 2.0;
        let scale = 1.0 / power(spacing, self.derivative);
        let filtered = (0..signal.len()).map(|index| {
            // Of an even window, scipy's sample is the one before the middle.
            let (start, position) = if index < half {
                (0, index as f64 - middle)
            } else if index >= signal.len() - half {
                (last, (index - last) as f64 - middle)
            } else {
                (index - (window - 1) / 2, 0.0)
            };
            self.read(&signal[start..start + window], position) * scale
        });
        Some(filtered.collect())
    }

    /// The derivative at `position` (samples from the window's middle) of the polynomial through `window`.
    fn read(self, window: &[f64], position: f64) -> f64 {
        let middle = (window.len() - 1) as f64 / 2.0;
        let terms = self.degree + 1;
        // The normal equations of the fit, with the right-hand side as their last column.
        let mut equations = [[0.0; MAX_DEGREE + 2]; MAX_DEGREE + 1];
        for (index, value) in window.iter().enumerate() {
            let x = index as f64 - middle;
            for (row, equation) in equations.iter_mut().enumerate().take(terms) {
                for (column, entry) in equation.iter_mut().enumerate().take(terms) {
                    *entry += power(x, row + column);
                }
                equation[terms] += power(x, row) * value;
            }
        }
        let coefficients = solve(equations, terms);
        (self.derivative..terms).fold(0.0, |sum, degree| {
            let falling: f64 = (0..self.derivative).map(|k| (degree - k) as f64).product();
            sum + coefficients[degree] * falling * power(position, degree - self.derivative)
        })
    }
}

/// The highest degree that is asked for.
const MAX_DEGREE: usize = 3;

/// `base` to the `exponent`, by the same multiplications on every machine.
fn power(base: f64, exponent: usize) -> f64 {
    (0..exponent).fold(1.0, |product, _| product * base)
}

/// Gauss-Jordan elimination. The normal equations of distinct positions are positive definite: no pivot is zero.
fn solve(mut rows: [[f64; MAX_DEGREE + 2]; MAX_DEGREE + 1], terms: usize) -> [f64; MAX_DEGREE + 1] {
    for pivot in 0..terms {
        let pivot_row = rows[pivot].map(|value| value / rows[pivot][pivot]);
        for (index, row) in rows.iter_mut().enumerate().take(terms) {
            let factor = row[pivot];
            for (value, above) in row.iter_mut().zip(pivot_row) {
                *value = if index == pivot { above } else { *value - factor * above };
            }
        }
    }
    rows.map(|row| row[terms])
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    fn signal(samples: usize) -> Vec<f64> {
        (0..samples).map(|i| ((i * i * 7 + 3 * i) % 23) as f64 * 0.1 - 0.7).collect()
    }

    /// (samples, window, degree, derivative, scipy 1.x's answer for a spacing of 0.1)
    type Vector = (usize, usize, usize, usize, &'static [f64]);

    #[rustfmt::skip]
    const SCIPY: &[Vector] = &[
        (18, 8, 2, 0, &[-0.22083333333, -0.20654761905, -0.13392857143, -0.00297619048, 0.234375, 0.41875, 0.78125, 1.034375, 1.034375, 0.78125, 0.41875, 0.234375, 0.084375, -0.03125, -0.09285714286, -0.19285714286, -0.2619047619, -0.3]),
        (18, 15, 2, 1, &[3.08697478992, 2.68781512605, 2.28865546218, 1.88949579832, 1.49033613445, 1.09117647059, 0.69201680672, 0.29285714286, -0.0, -0.29285714286, -0.42142857143, -0.85032320621, -1.27921784098, -1.70811247576, -2.13700711054, -2.56590174531, -2.99479638009, -3.42369101487]),
        (12, 5, 2, 1, &[5.95714285714, 3.52857142857, 1.1, -1.0, 1.5, 4.0, 1.9, 2.1, 0.0, -2.1, -4.52857142857, -6.95714285714]),
        (12, 5, 3, 2, &[-254.28571428571, -139.28571428571, -24.28571428571, 8.57142857143, 41.42857142857, 8.57142857143, -24.28571428571, -24.28571428571, 8.57142857143, -24.28571428571, -139.28571428571, -254.28571428571]),
        (7, 7, 2, 1, &[0.53571428571, 0.84523809524, 1.15476190476, 1.46428571429, 1.77380952381, 2.08333333333, 2.39285714286]),
        (6, 6, 2, 0, &[-0.45357142857, -0.07785714286, 0.13714285714, 0.19142857143, 0.085, -0.18214285714]),
        (4, 4, 3, 2, &[-90.0, -90.0, -90.0, -90.0]),
    ];

    #[test]
    fn it_gives_the_numbers_of_scipy() {
        for (samples, window, degree, derivative, expected) in SCIPY.iter().copied() {
            let filtered = SavitzkyGolay { window, degree, derivative }.apply(&signal(samples), 0.1).unwrap();
            for (index, (got, expected)) in filtered.iter().zip(expected).enumerate() {
                assert!(
                    (got - expected).abs() < 1e-9,
                    "window {window}, derivative {derivative}, {index}: {got} {expected}"
                );
            }
            assert_eq!(filtered.len(), expected.len());
        }
    }

    #[test]
    fn a_parabola_is_its_own_smoothing() {
        let parabola: Vec<f64> = (0..30).map(|i| 0.5 - 0.1 * f64::from(i) + 0.02 * f64::from(i * i)).collect();
        let slope = SavitzkyGolay { window: 15, degree: 2, derivative: 1 }.apply(&parabola, 1.0).unwrap();
        for (index, slope) in slope.iter().enumerate() {
            assert!((slope - (-0.1 + 0.04 * index as f64)).abs() < 1e-9);
        }
    }

    #[test]
    fn too_short_a_signal_has_no_answer() {
        assert_eq!(SavitzkyGolay { window: 8, degree: 2, derivative: 0 }.apply(&signal(2), 0.1), None);
        assert_eq!(SavitzkyGolay { window: 8, degree: 2, derivative: 0 }.apply(&[], 0.1), None);
    }
}
