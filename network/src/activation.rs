//! What stands between the products: in f32, element by element or summed in a fixed order, with the same bits on every machine.
//!
//! Written so that the compiler makes vectors of it, and fused multiply-adds of the core's, where it is called in a
//! [`pulp::WithSimd::with_simd`] that is always inlined. A closure may not be, and is then thirty times slower.

use pulp::{Simd, WithSimd};

/// a b + c, rounded once: by the core where it can, else by software, with the same bits.
#[inline(always)]
#[must_use]
#[allow(clippy::disallowed_methods, reason = "fused on every machine, since it is asked for by name")]
pub fn fused(a: f32, b: f32, c: f32) -> f32 {
    a.mul_add(b, c)
}

/// e to the power of `x`: within 2e-7 of it, relatively. It ends at -87 and 88.
#[inline(always)]
#[must_use]
pub fn exp(x: f32) -> f32 {
    /// Added and taken away again it rounds to an integer.
    const ROUND: f32 = 12_582_912.0;
    const LOG2_E: f32 = std::f32::consts::LOG2_E;
    const LN_2: [f32; 2] = [0.693_359_4, -2.121_944_4e-4];
    let x = x.clamp(-87.0, 88.0);
    let rounded = fused(x, LOG2_E, ROUND);
    let n = rounded - ROUND;
    let rest = fused(n, -LN_2[1], fused(n, -LN_2[0], x));
    let mut sum = 1.987_569_1e-4_f32;
    for term in [1.398_2e-3, 8.333_452e-3, 4.166_579_6e-2, 1.666_666_5e-1, 5.0e-1] {
        sum = fused(sum, rest, term);
    }
    let value = fused(sum * rest, rest, rest) + 1.0;
    // From 2^-126 to 2^127.
    let power = rounded.to_bits().wrapping_sub(ROUND.to_bits()).wrapping_add(127);
    value * f32::from_bits(power << 23)
}

/// 1 / (1 + exp(-x)).
#[inline(always)]
#[must_use]
pub fn sigmoid(x: f32) -> f32 {
    1.0 / (1.0 + exp(-x))
}

/// The hyperbolic tangent: within 2e-7 of it.
#[inline(always)]
#[must_use]
pub fn tanh(x: f32) -> f32 {
    1.0 - 2.0 / (exp(2.0 * x) + 1.0)
}

/// x where it is positive, else exp(x) - 1.
#[inline(always)]
#[must_use]
pub fn elu(x: f32) -> f32 {
    if x > 0.0 { x } else { exp(x) - 1.0 }
}

/// [`elu()`] of each value.
pub struct Elus<'a>(pub &'a mut [f32]);

impl WithSimd for Elus<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        self.0.iter_mut().for_each(|value| *value = elu(*value));
    }
}

/// Partial sums, side by side: how many decides about the last bits, so it is the same everywhere.
const LANES: usize = 16;

/// The sum of what `term` makes of each value.
#[inline(always)]
#[must_use]
pub fn sum(values: &[f32], term: impl Fn(f32) -> f32) -> f32 {
    let mut sums = [0.0_f32; LANES];
    let (chunks, rest) = values.as_chunks::<LANES>();
    for chunk in chunks {
        for (sum, value) in sums.iter_mut().zip(chunk) {
            *sum += term(*value);
        }
    }
    for (sum, value) in sums.iter_mut().zip(rest) {
        *sum += term(*value);
    }
    sums.iter().sum()
}

/// The greatest value; the least number where there is none.
#[inline(always)]
#[must_use]
pub fn greatest(values: &[f32]) -> f32 {
    values.iter().fold(f32::MIN, |greatest, value| if *value > greatest { *value } else { greatest })
}

/// Makes weights of `scores`, which sum to 1; those that are not `attended` to get 0, and all do where none is.
#[inline(always)]
pub fn softmax(scores: &mut [f32], attended: impl Fn(usize) -> bool) {
    for (index, score) in scores.iter_mut().enumerate() {
        if !attended(index) {
            *score = f32::MIN;
        }
    }
    let greatest = greatest(scores);
    for (index, score) in scores.iter_mut().enumerate() {
        *score = if attended(index) { exp(*score - greatest) } else { 0.0 };
    }
    let sum = sum(scores, |weight| weight);
    if sum > 0.0 {
        scores.iter_mut().for_each(|weight| *weight /= sum);
    }
}

/// Normalizes a row: mean 0, variance 1, then `scale` and `shift` for each column.
#[inline(always)]
pub fn layer_norm(row: &mut [f32], scale: &[f32], shift: &[f32]) {
    /// PyTorch's.
    const EPSILON: f32 = 1e-5;
    let count = row.len() as f32;
    let mean = sum(row, |value| value) / count;
    let variance = sum(row, |value| (value - mean) * (value - mean)) / count;
    let inverse = 1.0 / (variance + EPSILON).sqrt();
    for ((value, scale), shift) in row.iter_mut().zip(scale).zip(shift) {
        *value = fused((*value - mean) * inverse, *scale, *shift);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_functions_are_those_of_f64_to_single_precision() {
        for step in -20_000..=20_000_i32 {
            let x = step as f32 / 240.0;
            let exact = f64::from(x);
            let wanted = libm::exp(exact);
            assert!((f64::from(exp(x)) / wanted - 1.0).abs() < 2e-7, "exp({x}) = {} not {wanted}", exp(x));
            assert!((f64::from(tanh(x)) - libm::tanh(exact)).abs() < 2e-7, "tanh({x}) = {}", tanh(x));
            let wanted = 1.0 / (1.0 + libm::exp(-exact));
            assert!((f64::from(sigmoid(x)) - wanted).abs() < 2e-7, "sigmoid({x}) = {}", sigmoid(x));
        }
        assert_eq!((exp(0.0), tanh(0.0), sigmoid(0.0), elu(2.0)), (1.0, 0.0, 0.5, 2.0));
        assert_eq!((tanh(1e9), tanh(-1e9)), (1.0, -1.0));
        assert!(sigmoid(-1e9) < 1e-37 && exp(f32::MIN) < 2e-38);
    }

    #[test]
    fn weights_sum_to_one_and_leave_out_what_is_masked() {
        let mut scores = [1.0, 2.0, 1000.0, f32::MIN];
        softmax(&mut scores, |index| index != 2);
        assert!((scores[0] + scores[1] - 1.0).abs() < 1e-6 && scores[2] == 0.0 && scores[3] < 2e-38, "{scores:?}");
        let mut nobody = [1.0, 2.0];
        softmax(&mut nobody, |_| false);
        assert_eq!(nobody, [0.0, 0.0]);
    }

    #[test]
    fn a_row_is_normalized() {
        let mut row: Vec<f32> = (0..256).map(|k| (k % 7) as f32).collect();
        layer_norm(&mut row, &[2.0; 256], &[1.0; 256]);
        let mean = sum(&row, |value| value) / 256.0;
        let variance = sum(&row, |value| (value - 1.0) * (value - 1.0)) / 256.0;
        assert!((mean - 1.0).abs() < 1e-5 && (variance - 4.0).abs() < 1e-4, "{mean} {variance}");
    }
}
