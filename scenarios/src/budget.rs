//! A bound on what is made of one file: what a few bytes name could come to any amount.

use std::cell::Cell;

use thiserror::Error;

/// The most states, points and links of a scene. The largest scene seen has 100,000.
pub(crate) const MOST_PARTS: usize = 4_000_000;

/// The scene has more states, points or links than any.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("the scene has more states, points or links than any: it is not read further than to {MOST_PARTS}")]
pub struct TooLarge;

/// How much may still be made.
pub(crate) struct Budget(Cell<usize>);

impl Budget {
    pub fn of_a_scene() -> Self {
        Self::new(MOST_PARTS)
    }

    pub fn new(parts: usize) -> Self {
        Self(Cell::new(parts))
    }

    /// Counts `parts` that are about to be made.
    pub fn spend(&self, parts: usize) -> Result<(), TooLarge> {
        self.0.set(self.0.get().checked_sub(parts).ok_or(TooLarge)?);
        Ok(())
    }
}
