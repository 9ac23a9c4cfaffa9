//! What every input must keep, in a function that a fuzzer calls; `fuzz/` does so by the million, a test here by the dozen.

use crate::weights::{Precision, Weights};

/// Any bytes as a file of weights: no panic; what is read is written and read again the same.
///
/// # Panics
/// If that does not hold.
pub fn weights(bytes: &[u8]) {
    let Ok(weights) = Weights::read(bytes) else { return };
    let written = weights.write(Precision::Single);
    assert_eq!(written.and_then(|bytes| Weights::read(&bytes)), Ok(weights));
}
