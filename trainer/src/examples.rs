//! Where windows come from, as the loop sees it.

use network::features::Settings as Features;

use crate::windows::{Window, Windows};

/// A set of windows, each of training or of validation. A scene's windows are all of one.
pub trait Examples {
    /// How many there are.
    fn len(&self) -> usize;

    /// Whether there is none.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// One of them.
    ///
    /// # Errors
    /// Where the file is damaged.
    fn get(&self, index: usize) -> anyhow::Result<Window>;

    /// Those that are learned from.
    fn training(&self) -> &[usize];

    /// Those that are only looked at.
    fn validation(&self) -> &[usize];

    /// Whose features they have.
    fn features(&self) -> Features;

    /// Tells this set from any other.
    fn digest(&self) -> String;
}

impl Examples for Windows {
    fn len(&self) -> usize {
        Self::len(self)
    }

    fn get(&self, index: usize) -> anyhow::Result<Window> {
        Ok(Self::get(self, index)?)
    }

    fn training(&self) -> &[usize] {
        Self::training(self)
    }

    fn validation(&self) -> &[usize] {
        Self::validation(self)
    }

    fn features(&self) -> Features {
        self.recipe().features.into()
    }

    fn digest(&self) -> String {
        Self::digest(self)
    }
}
