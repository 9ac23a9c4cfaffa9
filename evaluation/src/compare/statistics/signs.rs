//! Whether a mean difference may be chance, at any number of pairs: the sign-flip test (Fisher's randomization test for pairs).
//!
//! If A and B drive alike, each pair's difference is as likely to have the other sign, so every choice of signs is as likely as the one
//! that was seen. The share of choices whose mean is at least as far from 0 is p: exact, whatever the differences are like. Over
//! values of 0 and 1 it is McNemar's exact test. `scipy.stats.permutation_test` with `permutation_type="samples"` is the same.

use world::pcg::Pcg32;

/// The stream of the generator that draws signs.
const STREAM: u64 = 0x51675;

/// With so many differences that are not 0 or fewer all choices of signs are tried.
const TRIED: usize = 13;

/// Sums that differ by less than this share of what is summed are the same one.
const ROUNDING: f64 = 1e-12;

/// The two-sided p of the mean of `differences`; where there are many, over `resamples` drawn choices, the seen one counted in. None of
/// no difference, or where a sum is not finite.
#[must_use]
pub fn mean_chance(differences: &[f64], seed: u64, resamples: usize) -> Option<f64> {
    let size: f64 = differences.iter().map(|difference| difference.abs()).sum();
    if differences.is_empty() || !size.is_finite() {
        return None;
    }
    let moved: Vec<f64> = differences.iter().copied().filter(|difference| *difference != 0.0).collect();
    let seen = moved.iter().sum::<f64>().abs() - ROUNDING * size;
    if moved.len() <= TRIED {
        let choices = 1_u32 << moved.len();
        let far = (0..choices).filter(|signs| sum(&moved, std::iter::once(*signs)).abs() >= seen).count();
        return Some(far as f64 / f64::from(choices));
    }
    let mut generator = Pcg32::new(seed, STREAM);
    let far = (0..resamples).filter(|_| sum(&moved, std::iter::repeat_with(|| generator.bits())).abs() >= seen).count();
    Some((far + 1) as f64 / (resamples + 1) as f64)
}

/// The sum with these signs, 32 differences to a word.
fn sum(differences: &[f64], signs: impl Iterator<Item = u32>) -> f64 {
    let signed = |(index, difference): (usize, &f64), word: u32| {
        if (word >> index) & 1 == 0 { *difference } else { -difference }
    };
    let words = differences.chunks(32).zip(signs);
    words.map(|(chunk, word)| chunk.iter().enumerate().map(|at| signed(at, word)).sum::<f64>()).sum()
}

#[cfg(test)]
mod tests {
    use super::super::proportion::mcnemar;
    use super::*;

    #[test]
    fn few_differences_have_the_share_of_all_choices() {
        assert_eq!(mean_chance(&[1.0, 2.0, 4.0], 0, 0), Some(2.0 / 8.0), "all alike or all not");
        assert_eq!(mean_chance(&[1.0, 2.0, -4.0], 0, 0), Some(8.0 / 8.0), "1 is the least there is");
        assert_eq!(mean_chance(&[0.1, 0.2, -0.3], 0, 0), Some(1.0), "a sum of 0, but for rounding");
        assert_eq!(mean_chance(&[0.0, 0.0], 0, 0), Some(1.0));
        assert_eq!((mean_chance(&[], 0, 0), mean_chance(&[f64::NAN], 0, 0)), (None, None));
    }

    #[test]
    fn over_flags_it_is_mcnemars_test() {
        let flips = |ups: usize, downs: usize| [vec![1.0; ups], vec![-1.0; downs], vec![0.0; 50]].concat();
        for (ups, downs) in [(6, 0), (8, 2), (3, 3), (1, 0), (0, 7)] {
            assert!(
                (mean_chance(&flips(ups, downs), 0, 0).unwrap() - mcnemar(ups, downs)).abs() < 1e-12,
                "{ups} {downs}"
            );
        }
        // 40 flips are drawn.
        let drawn = mean_chance(&flips(26, 14), 0, 100_000).unwrap();
        assert!((drawn - mcnemar(26, 14)).abs() < 0.004, "{drawn} {}", mcnemar(26, 14));
    }

    #[test]
    fn the_negated_differences_have_the_same_chance() {
        let differences: Vec<f64> = (0..60).map(|at| f64::from(at * at % 23) - 9.0).collect();
        let negated: Vec<f64> = differences.iter().map(|difference| -difference).collect();
        assert_eq!(mean_chance(&differences, 4, 3_000), mean_chance(&negated, 4, 3_000));
    }
}
