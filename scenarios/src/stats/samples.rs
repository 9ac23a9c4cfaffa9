//! What was measured in some scenes: values by quantity, and counts by share. Samples of scenes are joined in the scenes' order, so
//! that a table's bytes do not depend on who measured what.

use super::quantity::{Quantity, Share};

/// Values of all quantities. Single precision: a set of ten thousand scenes has a hundred million of them.
#[derive(Clone, Debug, PartialEq)]
pub struct Samples {
    values: Vec<Vec<f32>>,
    shares: Vec<Count>,
}

/// How often something was so.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Count {
    /// How often it was.
    pub so: u64,
    /// How often it was looked at.
    pub of: u64,
}

impl Default for Samples {
    fn default() -> Self {
        Self { values: vec![Vec::new(); Quantity::ALL.len()], shares: vec![Count::default(); Share::ALL.len()] }
    }
}

impl Samples {
    /// Adds a value; what is no number is left out.
    pub(super) fn add(&mut self, quantity: Quantity, value: f64) {
        if value.is_finite() {
            self.values[quantity as usize].push(value as f32);
        }
    }

    /// Adds a count.
    pub(super) fn add_count(&mut self, quantity: Quantity, count: usize) {
        self.add(quantity, count as f64);
    }

    /// Looks once whether it is so.
    pub(super) fn look(&mut self, share: Share, so: bool) {
        let count = &mut self.shares[share as usize];
        count.so += u64::from(so);
        count.of += 1;
    }

    /// Adds what was measured in later scenes.
    pub fn append(&mut self, later: &Self) {
        for (mine, theirs) in self.values.iter_mut().zip(&later.values) {
            mine.extend_from_slice(theirs);
        }
        for (mine, theirs) in self.shares.iter_mut().zip(&later.shares) {
            mine.so += theirs.so;
            mine.of += theirs.of;
        }
    }

    /// The values of `quantity`, in the order in which they were measured.
    #[must_use]
    pub fn of(&self, quantity: Quantity) -> &[f32] {
        &self.values[quantity as usize]
    }

    /// How often `share` was so.
    #[must_use]
    pub fn count(&self, share: Share) -> Count {
        self.shares[share as usize]
    }

    /// The mean of `quantity`; none without a value.
    #[must_use]
    pub fn mean(&self, quantity: Quantity) -> Option<f64> {
        mean(self.of(quantity).iter().copied())
    }

    /// The percentile (0 to 100) of `quantity`; none without a value.
    #[must_use]
    pub fn percentile(&self, quantity: Quantity, percent: f64) -> Option<f64> {
        percentile(&sorted(self.of(quantity)), percent)
    }
}

impl Count {
    /// How large a part it was; none where nobody looked.
    #[must_use]
    pub fn share(self) -> Option<f64> {
        (self.of > 0).then(|| self.so as f64 / self.of as f64)
    }
}

pub(super) fn mean(values: impl ExactSizeIterator<Item = f32>) -> Option<f64> {
    let n = values.len();
    (n > 0).then(|| values.map(f64::from).sum::<f64>() / n as f64)
}

pub(super) fn sorted(values: &[f32]) -> Vec<f32> {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f32::total_cmp);
    sorted
}

/// The percentile (0 to 100) of sorted values, linear between the two nearest ranks, as NumPy has it.
pub(super) fn percentile(sorted: &[f32], percent: f64) -> Option<f64> {
    let last = sorted.len().checked_sub(1)?;
    let rank = percent / 100.0 * last as f64;
    let below = (rank as usize).min(last);
    let [low, high] = [below, (below + 1).min(last)].map(|index| f64::from(sorted[index]));
    Some(low + (high - low) * (rank - below as f64))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_linear_between_ranks() {
        let values = sorted(&[4.0, 1.0, 3.0, 2.0]);
        assert_eq!(percentile(&values, 50.0), Some(2.5));
        assert_eq!(percentile(&values, 5.0), Some(1.15));
        assert_eq!((percentile(&values, 0.0), percentile(&values, 100.0)), (Some(1.0), Some(4.0)));
        assert_eq!(percentile(&[], 50.0), None);
    }

    #[test]
    fn what_is_no_number_is_no_sample() {
        let mut samples = Samples::default();
        samples.add(Quantity::Gap, f64::NAN);
        samples.add(Quantity::Gap, 2.0);
        assert_eq!((samples.of(Quantity::Gap), samples.mean(Quantity::Gap)), (&[2.0][..], Some(2.0)));
        assert_eq!(samples.mean(Quantity::Headway), None);
    }
}
