//! Loops on the widest vectors that the machine has.
//!
//! An operation is a type of its own: what is in a closure would be compiled outside, for the narrowest. Every number is computed alone, or in
//! the same order on any width: the results are the same on all machines.

use pulp::{Arch, Simd, WithSimd};

/// What can be run so.
pub(super) trait Wide {
    /// Does it; to be `#[inline(always)]`.
    fn run(self);
}

struct Run<W>(W);

impl<W: Wide> WithSimd for Run<W> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.0.run();
    }
}

/// Runs it.
pub(super) fn widely(operation: impl Wide) {
    Arch::new().dispatch(Run(operation));
}
