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
