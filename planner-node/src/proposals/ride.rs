//! What is felt in the car, as nuPlan's comfort bounds read it: the filters of the metric, at a few multiplications a step.

use episode::metrics::savitzky_golay::SavitzkyGolay;
use world::plan::STEP_SECONDS;

/// A chain of filters as what it is, a sum of neighbouring samples with fixed factors.
#[derive(Clone, Debug)]
pub struct Filter {
    /// Of the first samples, where the signal begins there.
    begin: Vec<Vec<f64>>,
    /// Of any other, and how many of the factors lie before it.
    inner: Vec<f64>,
    before: usize,
}

/// Longer than twice any chain of filters.
const LENGTH: usize = 96;

impl Filter {
    /// The chain of these.
    pub fn of(chain: &[SavitzkyGolay]) -> Self {
        let mut rows = vec![vec![0.0; LENGTH]; LENGTH];
        for sample in 0..LENGTH {
            let mut signal = vec![0.0; LENGTH];
            signal[sample] = 1.0;
            for filter in chain {
                signal = filter.apply(&signal, STEP_SECONDS).unwrap_or_default();
            }
            for (row, value) in rows.iter_mut().zip(&signal) {
                row[sample] = *value;
            }
        }
        let middle = LENGTH / 2;
        let counts = |row: &[f64]| {
            let first = row.iter().position(|factor| factor.abs() > 1e-12).unwrap_or(0);
            let last = row.iter().rposition(|factor| factor.abs() > 1e-12).unwrap_or(0);
            (first, last + 1)
        };
        let (first, end) = counts(&rows[middle]);
        let reach = chain.iter().map(|filter| filter.window / 2).sum::<usize>();
        let begin = rows[..reach].iter().map(|row| row[..counts(row).1].to_vec()).collect();
        Self { begin, inner: rows[middle][first..end].to_vec(), before: middle - first }
    }

    /// The least and the greatest filtered value of a signal at samples that know a sample from `from` on; those whose filter
    /// goes beyond the signal are left out. `begins` says whether the signal begins with its first sample.
    pub fn extremes(&self, signal: &[f64], from: usize, begins: bool) -> (f64, f64) {
        let (mut least, mut greatest) = (f64::INFINITY, f64::NEG_INFINITY);
        let mut see = |value: f64| {
            least = least.min(value);
            greatest = greatest.max(value);
        };
        let dot = |factors: &[f64], signal: &[f64]| factors.iter().zip(signal).map(|(f, s)| f * s).sum::<f64>();
        if begins {
            for row in &self.begin {
                if row.len() > from && row.len() <= signal.len() {
                    see(dot(row, signal));
                }
            }
        }
        let skipped = if begins { self.begin.len().saturating_sub(self.before) } else { 0 };
        for start in
            skipped.max((from + 1).saturating_sub(self.inner.len()))..=signal.len().saturating_sub(self.inner.len())
        {
            if start + self.inner.len() <= signal.len() {
                see(dot(&self.inner, &signal[start..]));
            }
        }
        (least, greatest)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const SMOOTH: SavitzkyGolay = SavitzkyGolay { window: 8, degree: 2, derivative: 0 };
    const JERK: SavitzkyGolay = SavitzkyGolay { window: 15, degree: 2, derivative: 1 };

    /// The extremes of the whole filtered signal, between these samples.
    fn whole(chain: &[SavitzkyGolay], signal: &[f64], samples: std::ops::Range<usize>) -> (f64, f64) {
        let apply = |signal: Vec<f64>, filter: &SavitzkyGolay| filter.apply(&signal, STEP_SECONDS).unwrap();
        let filtered = chain.iter().fold(signal.to_vec(), apply);
        let samples = filtered[samples].iter();
        samples.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), value| (a.min(*value), b.max(*value)))
    }

    fn agree(a: (f64, f64), b: (f64, f64)) -> bool {
        (a.0 - b.0).abs() < 1e-9 && (a.1 - b.1).abs() < 1e-9
    }

    proptest! {
        #[test]
        fn it_is_the_filter_of_the_whole_signal(signal in prop::collection::vec(-5.0..5.0, 50..100), share in 0.0..1.0) {
            // Samples before the cut are forgotten; `before` and `after` say how far a filter looks.
            let cut = (20.0 * share) as usize;
            for (chain, before, after) in [(&[SMOOTH][..], 3, 4), (&[SMOOTH, JERK][..], 10, 11)] {
                let filter = Filter::of(chain);
                let end = signal.len() - after;
                prop_assert!(agree(filter.extremes(&signal, 0, true), whole(chain, &signal, 0..end)));
                // Those that know a sample from here on.
                let from = (share * end as f64) as usize;
                if from > before + after {
                    prop_assert!(agree(filter.extremes(&signal, from, true), whole(chain, &signal, from - after..end)));
                }
                // Where a signal begins, an even window is read beside its middle.
                let first = (from.max(cut) - cut).saturating_sub(after).max(before) + cut;
                if first > before + 1 {
                    let told = filter.extremes(&signal[cut..], from.max(cut) - cut, false);
                    prop_assert!(agree(told, whole(chain, &signal, first..end)));
                }
            }
        }
    }

    #[test]
    fn a_signal_that_is_too_short_tells_nothing() {
        let filter = Filter::of(&[SMOOTH, JERK]);
        for length in 0..19 {
            assert_eq!(filter.extremes(&vec![1.0; length], 0, true), (f64::INFINITY, f64::NEG_INFINITY), "{length}");
        }
    }
}
