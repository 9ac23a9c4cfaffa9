//! What tells a difference from chance; numbers in, numbers out. `evaluation/checks/statistics.py` holds each to SciPy and
//! statsmodels, `docs/compare.md` says what they mean.
//!
//! | module | what |
//! | --- | --- |
//! | [`proportion`] | shares of passed scenes: Wilson's interval, McNemar's exact test |
//! | [`bootstrap`] | the interval of a mean, by resampling (BCa) |
//! | [`signs`] | whether a mean difference may be chance, exact at any number of pairs |
//! | [`power`] | how large a difference must be to be found |

pub mod bootstrap;
pub mod power;
pub mod proportion;
pub mod signs;

use serde::Serialize;
use statrs::distribution::{ContinuousCDF as _, Normal};

/// The chance of a false alarm that all tests and intervals keep to: 5 %, so intervals are of 95 %.
pub const LEVEL: f64 = 0.05;

/// From `low` to `high`, both in it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Interval {
    /// Its lower end.
    pub low: f64,
    /// Its upper end.
    pub high: f64,
}

impl Interval {
    /// Whether `value` is in it.
    #[must_use]
    pub fn holds(&self, value: f64) -> bool {
        self.low <= value && value <= self.high
    }
}

/// The standard normal's quantile; `share` is cut to 0..1.
fn normal_quantile(share: f64) -> f64 {
    Normal::standard().inverse_cdf(share.clamp(0.0, 1.0))
}

/// The standard normal's share below `value`.
fn normal_share(value: f64) -> f64 {
    Normal::standard().cdf(value)
}
