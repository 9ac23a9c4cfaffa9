//! WOMD's other format: a record is TensorFlow's `Example`, with states of 128 road users, 20,000 points of the map, and 16 signals.
//!
//! [`read`] takes a record's payload and gives a checked scene. The map is put together from its points: what it lacks is a finding. No IO.

mod features;
mod read;
mod roadgraph;

use thiserror::Error;
use world::scene::SceneError;

use crate::budget::TooLarge;

pub(crate) use features::{Entry, entries, looks_like_example};
pub use read::{read, scene_id};

/// The feature that has the scene's name.
pub(crate) const ID: &str = "scenario/id";

/// Why a record gives no scene.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum ExampleError {
    #[error("{0} is malformed")]
    Malformed(String),
    #[error("the feature {0} is missing")]
    Missing(String),
    #[error("the feature {0} is there twice")]
    Twice(String),
    #[error("the feature {0} is of another kind")]
    Kind(String),
    #[error("the feature {name} has {values} values, where {expected} should be")]
    Values { name: String, values: usize, expected: usize },
    #[error("{0} of its road users are said to be the AV, where one should be")]
    Avs(usize),
    #[error("nobody is there after step {current}: it is of the test split, which withholds the future")]
    FutureWithheld { current: usize },
    #[error(transparent)]
    TooLarge(#[from] TooLarge),
    #[error("the scene cannot be used: {0}")]
    Scene(#[from] SceneError),
}

impl ExampleError {
    /// What the user can do.
    #[must_use]
    pub fn hint(&self) -> &'static str {
        match self {
            Self::FutureWithheld { .. } => "take scenes of another split",
            Self::Scene(_) => "leave the scene out: `exclude` in a scene-set TOML names what is not to be driven",
            _ => {
                "take the data set's own files, of its `scenario` folder where there is a choice: they have all of the map"
            }
        }
    }
}
