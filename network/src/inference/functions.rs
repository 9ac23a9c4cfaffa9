//! What is applied number by number or row by row: activations, softmax, norms.
//!
//! Plain arithmetic in a fixed order, no library function and nothing fused: the same bytes whatever vectors it is compiled to.

use crate::constants::{HEADS, NORM_EPSILON, WIDTH};

/// The exponential, to 1e-7 relative: a power of two, and a polynomial on what is left.
#[inline(always)]
pub fn exp(x: f32) -> f32 {
    /// Adding it rounds to a whole number, which is then in the lowest bits.
    const ROUND: f32 = 12_582_912.0;
    // ln 2 in two parts: the first has so few digits that its products with whole numbers are exact.
    const LN_2_HIGH: f32 = 0.693_359_4;
    const LN_2_LOW: f32 = -2.121_944_4e-4;
    let x = x.clamp(-87.0, 88.0);
    let shifted = x * std::f32::consts::LOG2_E + ROUND;
    let whole = shifted - ROUND;
    let rest = x - whole * LN_2_HIGH - whole * LN_2_LOW;
    let mut sum = 1.987_569_2e-4;
    for term in [1.398_199_9e-3, 8.333_452e-3, 4.166_579_6e-2, 1.666_666_5e-1, 0.5] {
        sum = sum * rest + term;
    }
    let power = f32::from_bits((shifted.to_bits() << 23).wrapping_add(0x3f80_0000));
    (sum * rest * rest + rest + 1.0) * power
}

/// The logistic function.
#[inline(always)]
pub fn sigmoid(x: f32) -> f32 {
    1.0 / (1.0 + exp(-x))
}

/// The hyperbolic tangent, to 3e-7.
#[inline(always)]
pub fn tanh(x: f32) -> f32 {
    2.0 * sigmoid(2.0 * x) - 1.0
}

/// The exponential linear unit, on each number.
#[inline(always)]
pub(super) fn elu(values: &mut [f32]) {
    for value in values {
        let below = exp(value.min(0.0)) - 1.0;
        *value = if *value > 0.0 { *value } else { below };
    }
}

/// A sum in sixteen strands that are joined in pairs.
#[inline(always)]
fn sum(row: impl Fn(usize) -> f32) -> f32 {
    let mut strands = [0.0_f32; 16];
    for start in (0..WIDTH).step_by(16) {
        for (lane, strand) in strands.iter_mut().enumerate() {
            *strand += row(start + lane);
        }
    }
    for half in [8, 4, 2, 1] {
        for lane in 0..half {
            strands[lane] += strands[lane + half];
        }
    }
    strands[0]
}

/// The product of two rows.
#[inline(always)]
pub(super) fn dot(a: &[f32; WIDTH], b: &[f32; WIDTH]) -> f32 {
    sum(|index| a[index] * b[index])
}

/// A layer norm's scale and shift.
#[derive(Clone, Debug)]
pub(super) struct Norm {
    pub weight: [f32; WIDTH],
    pub bias: [f32; WIDTH],
}

impl Norm {
    /// Norms a row.
    #[inline(always)]
    pub fn apply(&self, row: &mut [f32; WIDTH]) {
        let mean = sum(|index| row[index]) / WIDTH as f32;
        for value in row.iter_mut() {
            *value -= mean;
        }
        let variance = sum(|index| row[index] * row[index]) / WIDTH as f32;
        let scale = 1.0 / (variance + NORM_EPSILON).sqrt();
        for (value, (weight, bias)) in row.iter_mut().zip(self.weight.iter().zip(&self.bias)) {
            *value = *value * scale * weight + bias;
        }
    }
}

/// Scores into shares that sum to 1 over the rows, for each head by itself.
#[inline(always)]
pub(super) fn softmax<'a>(scores: impl Iterator<Item = &'a [f32]> + Clone, shares: &mut [[f32; HEADS]]) {
    let mut most = [f32::NEG_INFINITY; HEADS];
    for row in scores.clone() {
        for (most, score) in most.iter_mut().zip(row) {
            *most = if *score > *most { *score } else { *most };
        }
    }
    let mut sums = [0.0; HEADS];
    for (shares, row) in shares.iter_mut().zip(scores) {
        for head in 0..HEADS {
            shares[head] = exp(row[head] - most[head]);
            sums[head] += shares[head];
        }
    }
    for shares in shares.iter_mut() {
        for (share, sum) in shares.iter_mut().zip(&sums) {
            *share /= sum;
        }
    }
}

/// The same over a few numbers.
pub(super) fn softmax_of(scores: &mut [f32]) {
    let most = scores.iter().fold(f32::NEG_INFINITY, |most, score| if *score > most { *score } else { most });
    scores.iter_mut().for_each(|score| *score = exp(*score - most));
    let sum: f32 = scores.iter().sum();
    scores.iter_mut().for_each(|score| *score /= sum);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_exponential_is_right_to_two_units_in_the_last_place() {
        for step in -80_000..80_000 {
            let x = step as f32 * 1e-3;
            let exact = libm::exp(f64::from(x));
            assert!((f64::from(exp(x)) / exact - 1.0).abs() < 2.5e-7, "{x}");
        }
        assert_eq!(exp(0.0), 1.0);
        assert!(exp(-1e30) > 0.0 && exp(1e30).is_finite());
    }

    #[test]
    fn activations_are_what_their_names_say() {
        for step in -2_000..2_000 {
            let x = step as f32 * 1e-2;
            assert!((f64::from(tanh(x)) - libm::tanh(f64::from(x))).abs() < 3e-7);
            let mut value = [x];
            elu(&mut value);
            let exact = if x > 0.0 { f64::from(x) } else { libm::expm1(f64::from(x)) };
            assert!((f64::from(value[0]) - exact).abs() < 2e-7);
        }
    }

    #[test]
    fn a_normed_row_has_the_mean_0_and_the_variance_1() {
        let norm = Norm { weight: [1.0; WIDTH], bias: [0.0; WIDTH] };
        let mut row: [f32; WIDTH] = std::array::from_fn(|index| (index * index % 37) as f32 + 100.0);
        norm.apply(&mut row);
        assert!(sum(|index| row[index]).abs() < 1e-3);
        assert!((dot(&row, &row) / WIDTH as f32 - 1.0).abs() < 1e-4);
    }
}
