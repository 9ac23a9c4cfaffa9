//! Loops compiled for the widest vector instructions of the machine that runs them.
//!
//! Results are the same to the bit on any machine: each number comes from the same operations in the same order, however many are
//! computed together. (A product and a sum stay two roundings.)

use pulp::Arch;

/// Does some work by those instructions. What it calls must be inlined into it, else it stays as it is.
#[inline(always)]
pub fn wide<T>(work: impl FnOnce() -> T) -> T {
    Arch::new().dispatch(work)
}
