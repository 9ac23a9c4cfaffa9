//! Scenes as ScenarioNet and MetaDrive keep them: one Python pickle a scene, converted from WOMD, nuScenes, nuPlan, Argoverse 2 and others.
//!
//! [`read`] takes a file's bytes and gives a checked scene; [`scene_id`] finds its name in the first bytes. [`pickle`] reads pickles without
//! running them. None does IO. Layouts of all generations since 2022 are known, by what is in them rather than by what they call themselves.

pub mod database;
mod dataset;
mod features;
mod form;
mod layout;
mod outlines;
pub mod pickle;
mod read;
mod signals;
mod tracks;

use thiserror::Error;
use world::scene::SceneError;

use crate::budget::TooLarge;

pub use layout::Wrong;
pub use pickle::{PickleError, PickleProblem};
pub use read::{read, scene_id};

/// The longest file that is read: 64 MiB, as of a record; 20 times the largest scene seen.
pub const MAX_FILE_BYTES: u64 = crate::tfrecord::MAX_PAYLOAD_BYTES;

/// Why a pickle gives no scene.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum ScenarioNetError {
    #[error(transparent)]
    Pickle(#[from] PickleError),
    #[error("the pickle is no scene: {0}")]
    NoScene(&'static str),
    #[error("{at}: {wrong}")]
    Layout { at: String, wrong: Wrong },
    #[error("steps are {seconds} s apart, and scenes are driven in steps of 0.1 s")]
    StepLength { seconds: String },
    #[error(transparent)]
    TooLarge(#[from] TooLarge),
    #[error("the file has {0} bytes, more than the {MAX_FILE_BYTES} that are read")]
    TooLong(u64),
    #[error("the scene was called {first} when the set was opened, and calls itself {last}")]
    TwoIds { first: String, last: String },
    #[error("the scene cannot be used: {0}")]
    Scene(#[from] SceneError),
}

impl ScenarioNetError {
    /// What the user can do.
    #[must_use]
    pub fn hint(&self) -> &'static str {
        match self {
            Self::Pickle(error) => error.problem.hint(),
            Self::NoScene(_) => {
                "give pickles of ScenarioNet or MetaDrive, or the folder of such: docs/scenes.md says which"
            }
            Self::Layout { .. } => {
                "docs/scenes.md says which layouts are known: convert the scene again by ScenarioNet of today"
            }
            Self::StepLength { .. } => "convert it again by ScenarioNet, whose converters fill in steps of 0.1 s",
            Self::TooLarge(_) | Self::TooLong(_) => "cut it into shorter scenes or a smaller map when it is converted",
            Self::TwoIds { .. } => {
                "leave scene files alone while they are being driven; else ask whoever wrote the file"
            }
            Self::Scene(_) => "leave the scene out: `exclude` in a scene-set TOML names what is not to be driven",
        }
    }
}
