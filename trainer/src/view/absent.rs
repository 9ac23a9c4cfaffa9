//! In place of the drawing, in a trainer that was built without Rerun.

use std::path::Path;

use thiserror::Error;

use crate::checkpoint::Checkpoint;
use crate::settings::Settings;
use crate::step::Look;
use crate::windows::Window;

/// There is no drawing.
#[derive(Debug, Error)]
#[error(
    "this trainer was built without Rerun\nhint: leave --rerun out, or build it with the feature rerun, as is the default"
)]
pub struct ViewError;

/// There is none.
pub enum View {}

impl View {
    /// Refuses.
    ///
    /// # Errors
    /// Always.
    pub fn open(_: &Path, _: &str, _: &Settings, _: Vec<Window>, _: &Checkpoint) -> Result<Self, ViewError> {
        Err(ViewError)
    }

    /// The windows that are drawn.
    #[must_use]
    pub fn windows(&self) -> &[Window] {
        match *self {}
    }

    /// Draws an epoch.
    ///
    /// # Errors
    /// Never.
    pub fn epoch(&mut self, _: usize, _: u64, _: &[Look]) -> Result<(), ViewError> {
        match *self {}
    }
}
