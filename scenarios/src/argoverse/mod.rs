//! Scenes of Argoverse 2's motion forecasting set: a Parquet table of states, and the map beside it in JSON.
//!
//! ```text
//! scenario_ID.parquet ──▶ table (footer, pages, values) ──▶ tracks ──┐
//! log_map_archive_ID.json ──▶ archive ──▶ map (ladder, outlines) ─────┴──▶ world::scene
//! ```
//!
//! [`read`] takes both files' bytes and gives a checked scene. No IO.

mod archive;
mod footer;
mod kinds;
mod ladder;
mod map;
mod outlines;
mod pages;
mod read;
mod table;
mod thrift;
mod tracks;
mod values;

use thiserror::Error;
use world::scene::SceneError;

use crate::budget::TooLarge;

pub use read::{read, scene_id};
pub use table::TableError;

/// The longest table or map that is read: 64 MiB, as of a record; real ones have some 200 kB.
pub const MAX_FILE_BYTES: u64 = crate::tfrecord::MAX_PAYLOAD_BYTES;

/// Why a table and a map give no scene.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum ArgoverseError {
    #[error("the table cannot be used: {0}")]
    Table(#[from] TableError),
    #[error("the table has no rows")]
    NoRows,
    #[error("no track is called AV")]
    NoAv,
    #[error("track {track} has a state at step {step}, but the scene has {steps} steps")]
    Step { track: String, step: i64, steps: usize },
    #[error("track {track} has two states at step {step}")]
    Twice { track: String, step: usize },
    #[error("the log is there up to step {} of {steps} alone: it is of the test split, which withholds the future", known - 1)]
    FutureWithheld { known: usize, steps: usize },
    #[error("steps are {seconds} s apart, and scenes are driven in steps of 0.1 s")]
    StepLength { seconds: String },
    #[error("there is no map beside it: no {expected}")]
    NoMap { expected: String },
    #[error("the map beside it cannot be used: {0}")]
    Map(String),
    #[error(transparent)]
    TooLarge(#[from] TooLarge),
    #[error("a file has {0} bytes, more than the {MAX_FILE_BYTES} that are read")]
    TooLong(u64),
    #[error("the file is of the scene {first} by its name, and of {last} by its content")]
    TwoIds { first: String, last: String },
    #[error("the scene cannot be used: {0}")]
    Scene(#[from] SceneError),
}

impl ArgoverseError {
    /// What the user can do.
    #[must_use]
    pub fn hint(&self) -> &'static str {
        match self {
            Self::Table(_) | Self::NoRows | Self::NoAv | Self::Step { .. } | Self::Twice { .. } => {
                "give scenario files of Argoverse 2's motion forecasting set: fetch it again, or write it anew by pandas"
            }
            Self::FutureWithheld { .. } => "take scenes of the train or val split",
            Self::StepLength { .. } => "docs/scenes.md says what scenes there can be",
            Self::NoMap { .. } => {
                "keep the files of a scene together: its scenario_ID.parquet and log_map_archive_ID.json"
            }
            Self::Map(_) => "fetch the map again; docs/scenes.md says what of it is read",
            Self::TooLarge(_) | Self::TooLong(_) => "cut it into shorter scenes or a smaller map",
            Self::TwoIds { .. } => "leave scene files and their names as they are",
            Self::Scene(_) => "leave the scene out: `exclude` in a scene-set TOML names what is not to be driven",
        }
    }
}
