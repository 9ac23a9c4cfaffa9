//! The interval of a mean by resampling: Efron's BCa (bias-corrected and accelerated), as `scipy.stats.bootstrap` computes it.
//!
//! B. Efron, "Better bootstrap confidence intervals", 1987. The mean's acceleration is known in closed form, so no jackknife is run.

use world::pcg::Pcg32;

use super::{Interval, LEVEL, normal_quantile, normal_share};

/// The stream of the generator that draws resamples.
const STREAM: u64 = 0xB0075;

/// Draws that one interval may cost.
const DRAWS: usize = 40_000_000;

/// Sums that differ by less than this share of what is summed are the same one.
const ROUNDING: f64 = 1e-12;

/// How many resamples of `values` numbers are drawn: 10,000, of many numbers fewer, never less than 2,000.
#[must_use]
pub fn resamples(values: usize) -> usize {
    (DRAWS / values.max(1)).clamp(2_000, 10_000)
}

/// The 95 % BCa interval of the mean of `values`; none of fewer than two, or where a sum is not finite. The same seed draws the same
/// indices for as many values, so the negated values have the negated interval.
#[must_use]
pub fn mean_interval(values: &[f64], seed: u64, resamples: usize) -> Option<Interval> {
    let [first, _, ..] = values else { return None };
    let sum: f64 = values.iter().sum();
    let mean = sum / values.len() as f64;
    if !values.iter().map(|value| value * value).sum::<f64>().is_finite() || resamples == 0 {
        return None;
    }
    if values.iter().all(|value| value == first) {
        return Some(Interval { low: *first, high: *first });
    }
    let mut sums = resampled_sums(values, seed, resamples);
    sums.sort_unstable_by(f64::total_cmp);
    // The same values drawn in another order sum to the same but for rounding.
    let rounding = ROUNDING * values.iter().map(|value| value.abs()).sum::<f64>();
    let below = sums.partition_point(|resampled| *resampled < sum - rounding);
    let tied = sums[below..].partition_point(|resampled| *resampled <= sum + rounding);
    let count = resamples as f64;
    // At least half a resample lies on either side: a bias is never infinite.
    let bias = normal_quantile(((below as f64 + tied as f64 / 2.0) / count).clamp(0.5 / count, 1.0 - 0.5 / count));
    let acceleration = acceleration(values, mean);
    let end = |share: f64| {
        let shifted = bias + normal_quantile(share);
        let corrected = normal_share(bias + shifted / (1.0 - acceleration * shifted));
        quantile(&sums, corrected) / values.len() as f64
    };
    let (low, high) = (end(LEVEL / 2.0), end(1.0 - LEVEL / 2.0));
    (low.is_finite() && high.is_finite()).then_some(Interval { low, high })
}

/// The sums of resamples: of as many values, each drawn from all.
fn resampled_sums(values: &[f64], seed: u64, resamples: usize) -> Vec<f64> {
    let mut generator = Pcg32::new(seed, STREAM);
    let count = values.len() as u64;
    let sum = |_| {
        // The high half of 32 bits times the count: uneven by count / 2^32, far below what resampling itself is off by.
        let mut drawn = || values[((u64::from(generator.bits()) * count) >> 32) as usize];
        (0..count).map(|_| drawn()).sum()
    };
    (0..resamples).map(sum).collect()
}

/// A sixth of the skewness of the jackknife's means.
fn acceleration(values: &[f64], mean: f64) -> f64 {
    let (squares, cubes) = values.iter().fold((0.0, 0.0), |(squares, cubes), value| {
        let off = value - mean;
        (squares + off * off, cubes + off * off * off)
    });
    let scale = squares * squares.sqrt();
    if scale > 0.0 { cubes / (6.0 * scale) } else { 0.0 }
}

/// The quantile of sorted numbers, between neighbours in proportion, as NumPy has it.
fn quantile(sorted: &[f64], share: f64) -> f64 {
    let last = sorted.len().saturating_sub(1);
    let place = share.clamp(0.0, 1.0) * last as f64;
    let below = (place.floor() as usize).min(last);
    let above = (below + 1).min(last);
    sorted[below] + (sorted[above] - sorted[below]) * (place - place.floor())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_many_normal_values_it_is_the_normal_interval() {
        // The normal's quantiles themselves: mean 0, no skew.
        let values: Vec<f64> = (0..1000).map(|at| normal_quantile((f64::from(at) + 0.5) / 1000.0)).collect();
        let interval = mean_interval(&values, 0, 10_000).unwrap();
        let wanted = 1.96 / 1000.0_f64.sqrt();
        assert!((interval.high - wanted).abs() < 0.05 * wanted, "{interval:?}");
        assert!((interval.low + wanted).abs() < 0.05 * wanted, "{interval:?}");
    }

    #[test]
    fn the_negated_values_have_the_negated_interval() {
        let values = [3.0, -1.0, 0.5, 0.0, 7.25, 0.0, 2.0];
        let there = mean_interval(&values, 7, 5_000).unwrap();
        let back = mean_interval(&values.map(|value| -value), 7, 5_000).unwrap();
        assert!((there.low + back.high).abs() < 1e-9 && (there.high + back.low).abs() < 1e-9, "{there:?} {back:?}");
    }

    #[test]
    fn a_skew_moves_the_interval_towards_the_long_tail() {
        let values: Vec<f64> = (0..40).map(|at| libm::exp(f64::from(at) / 10.0)).collect();
        let mean = values.iter().sum::<f64>() / 40.0;
        let interval = mean_interval(&values, 1, 10_000).unwrap();
        assert!(interval.high - mean > mean - interval.low, "{interval:?} about {mean}");
    }

    #[test]
    fn what_has_no_spread_or_no_sum_is_told_plainly() {
        assert_eq!(mean_interval(&[2.5; 9], 0, 1_000), Some(Interval { low: 2.5, high: 2.5 }));
        assert_eq!(mean_interval(&[1.0], 0, 1_000), None);
        assert_eq!(mean_interval(&[], 0, 1_000), None);
        assert_eq!(mean_interval(&[f64::MAX, f64::MAX, 0.0], 0, 1_000), None);
        assert_eq!(mean_interval(&[f64::NAN, 1.0], 0, 1_000), None);
    }

    #[test]
    fn the_seed_alone_decides() {
        let values: Vec<f64> = (0..50).map(|at| f64::from(at * at % 17)).collect();
        assert_eq!(mean_interval(&values, 3, 2_000), mean_interval(&values, 3, 2_000));
        assert_ne!(mean_interval(&values, 3, 2_000), mean_interval(&values, 4, 2_000));
        assert_eq!([11, 4_000, 10_000, 1_000_000].map(resamples), [10_000, 10_000, 4_000, 2_000]);
    }
}
