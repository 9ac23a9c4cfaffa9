//! The table: percentiles of every quantity, and shares.

use super::quantity::{Quantity, Share};
use super::samples::{Samples, mean, percentile, sorted};

/// The percentiles that the table has.
pub const PERCENTS: [f64; 5] = [5.0, 25.0, 50.0, 75.0, 95.0];

/// How a quantity is spread.
#[derive(Clone, Debug, PartialEq)]
pub struct SpreadRow {
    /// Which.
    pub quantity: Quantity,
    /// Its percentiles, as [`PERCENTS`] has them; none without a sample.
    pub percentiles: Option<[f64; 5]>,
    /// Its mean; none without a sample.
    pub mean: Option<f64>,
    /// Number of samples.
    pub n: usize,
}

/// How often something is so.
#[derive(Clone, Debug, PartialEq)]
pub struct ShareRow {
    /// What.
    pub share: Share,
    /// The part of those that were looked at, 0 to 1; none where nothing was.
    pub part: Option<f64>,
    /// How many were looked at.
    pub n: u64,
}

/// All figures of a set, in the order of [`Quantity::ALL`] and [`Share::ALL`].
#[derive(Clone, Debug, PartialEq)]
pub struct Figures {
    /// Quantities.
    pub spreads: Vec<SpreadRow>,
    /// Shares.
    pub shares: Vec<ShareRow>,
}

impl Figures {
    /// The figures of what was measured.
    #[must_use]
    pub fn of(samples: &Samples) -> Self {
        let spread = |quantity: &Quantity| {
            let values = samples.of(*quantity);
            let sorted = sorted(values);
            SpreadRow {
                quantity: *quantity,
                percentiles: (!sorted.is_empty())
                    .then(|| PERCENTS.map(|percent| percentile(&sorted, percent).unwrap_or(f64::NAN))),
                mean: mean(values.iter().copied()),
                n: values.len(),
            }
        };
        let share = |share: &Share| {
            let count = samples.count(*share);
            ShareRow { share: *share, part: count.share(), n: count.of }
        };
        Self { spreads: Quantity::ALL.iter().map(spread).collect(), shares: Share::ALL.iter().map(share).collect() }
    }
}
