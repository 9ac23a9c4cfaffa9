//! The Waymo Open Motion Dataset's scenario format: one protobuf `Scenario` a record of a TFRecord file.
//!
//! [`read`] takes a record's payload, also of the data set's other format ([`crate::tf_example`]), and gives a checked scene; [`write()`] writes
//! one; [`Skim`] finds the id alone. None does IO.

pub(crate) mod kinds;
pub mod message;
mod read;
mod skim;
mod write;

use thiserror::Error;
use world::scene::{SceneError, SceneId};

use crate::tf_example::ExampleError;
use crate::wire;

pub use read::{read, scene_id};
pub use skim::{Skim, Skimmed};
pub use write::write;

/// Why a record's payload gives no scene.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum WomdError {
    /// It is WOMD's other format, and something is wrong with it.
    #[error("the tf.Example: {0}")]
    TfExample(#[from] ExampleError),
    /// It is some other message.
    #[error("the record is not a Scenario: it begins as another message does, such as a perception Frame")]
    NotAScenario,
    /// It is no protobuf message, or its fields have other types.
    #[error("the record does not decode as a Scenario: {0}")]
    Protobuf(String),
    /// It holds the laser data of a scene alone.
    #[error("the record holds the laser data of scene {id} alone: no tracks and no map")]
    LaserOnly {
        /// The scene.
        id: SceneId,
    },
    /// It has two ids: files are skimmed for the first, and messages are read by the last.
    #[error("the record calls itself {first} first, and {last} further on")]
    TwoIds {
        /// The first.
        first: String,
        /// The last.
        last: String,
    },
    /// It decodes, but makes no sense.
    #[error("the scene cannot be used: {0}")]
    Scene(#[from] SceneError),
}

impl WomdError {
    /// What the user can do.
    #[must_use]
    pub fn hint(&self) -> &'static str {
        match self {
            Self::TfExample(error) => error.hint(),
            Self::NotAScenario => "take files from the Waymo Open MOTION Dataset's `scenario` folder",
            Self::Protobuf(_) | Self::TwoIds { .. } => {
                "the checksums are right, so it was written this way: ask whoever wrote the file"
            }
            Self::LaserOnly { .. } => {
                "take the data set's `scenario` folder; its `lidar_and_camera` folder only goes with it"
            }
            Self::Scene(_) => "leave the scene out: `exclude` in a scene-set TOML names what is not to be driven",
        }
    }
}

/// What else a payload is that failed to be a Scenario. Those begin with a 64-bit field 1, or a packed one, whose length divides by 8.
fn diagnose(payload: &[u8]) -> Option<WomdError> {
    let Some(Ok((1, wire::Field::Bytes(first)))) = wire::fields(payload).next() else { return None };
    (!first.len().is_multiple_of(8)).then_some(WomdError::NotAScenario)
}
