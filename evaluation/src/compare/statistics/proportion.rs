//! Shares: how sure a rate is, and whether two rates over the same scenes differ.

use statrs::distribution::{Binomial, DiscreteCDF as _};

use super::{Interval, LEVEL, normal_quantile};

/// Wilson's score interval (95 %) of the rate behind `hits` of `trials`; none of no trial, or of more hits than trials.
///
/// E. B. Wilson, "Probable inference, the law of succession, and statistical inference", 1927; without correction for continuity.
#[must_use]
pub fn wilson(hits: usize, trials: usize) -> Option<Interval> {
    if trials == 0 || hits > trials {
        return None;
    }
    let (n, share) = (trials as f64, hits as f64 / trials as f64);
    let z = normal_quantile(1.0 - LEVEL / 2.0);
    let scale = 1.0 + z * z / n;
    let center = (share + z * z / (2.0 * n)) / scale;
    let half = z * (share * (1.0 - share) / n + z * z / (4.0 * n * n)).sqrt() / scale;
    // The ends that are certain are so to the last bit.
    let low = if hits == 0 { 0.0 } else { center - half };
    let high = if hits == trials { 1.0 } else { center + half };
    Some(Interval { low, high })
}

/// McNemar's exact test, two-sided: how likely flips are to be split at least this unevenly where each way is as likely. 1 of no flip.
#[must_use]
pub fn mcnemar(one_way: usize, other_way: usize) -> f64 {
    let flips = (one_way + other_way) as u64;
    let Ok(fair) = Binomial::new(0.5, flips) else { return 1.0 };
    (2.0 * fair.cdf(one_way.min(other_way) as u64)).min(1.0)
}

/// How many flips one way it takes beside `other_way` of them for McNemar's test to fall below 5 %.
#[must_use]
pub fn flips_needed(other_way: usize) -> usize {
    // At least twice as many and six always suffice.
    let enough = |flips: &usize| mcnemar(*flips, other_way) < LEVEL;
    (other_way..).find(enough).unwrap_or(usize::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(value: f64, wanted: f64) {
        assert!((value - wanted).abs() < 1e-9, "{value} is not {wanted}");
    }

    #[test]
    fn a_rate_of_nothing_or_all_has_wilsons_closed_form() {
        // z^2 / (n + z^2)
        let square = normal_quantile(0.975) * normal_quantile(0.975);
        let none = wilson(0, 10).unwrap();
        assert_eq!(none.low, 0.0);
        near(none.high, square / (10.0 + square));
        let all = wilson(10, 10).unwrap();
        assert_eq!(all.high, 1.0);
        near(all.low, 10.0 / (10.0 + square));
        assert_eq!((wilson(0, 0), wilson(2, 1)), (None, None));
    }

    #[test]
    fn half_of_the_scenes_has_a_symmetric_interval() {
        let half = wilson(50, 100).unwrap();
        near(half.low + half.high, 1.0);
        near(half.low, 0.403_831_530_365_995_3);
    }

    #[test]
    fn mcnemar_sums_the_tails_of_a_fair_coin() {
        assert_eq!(mcnemar(0, 0), 1.0);
        near(mcnemar(1, 0), 1.0);
        near(mcnemar(5, 0), 2.0 / 32.0);
        near(mcnemar(0, 6), 2.0 / 64.0);
        near(mcnemar(8, 2), 2.0 * (1.0 + 10.0 + 45.0) / 1024.0);
        assert_eq!(mcnemar(3, 3), 1.0);
        assert_eq!(mcnemar(8, 2), mcnemar(2, 8));
        assert!(mcnemar(6000, 4000) < 1e-80);
    }

    #[test]
    fn six_flips_one_way_are_the_fewest_that_tell() {
        assert_eq!([0, 1, 2, 3].map(flips_needed), [6, 8, 10, 12]);
        assert!(mcnemar(5, 0) >= LEVEL && mcnemar(7, 1) >= LEVEL);
    }
}
