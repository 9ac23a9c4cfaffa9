//! Where scenes come from: files of the Waymo Open Motion Dataset (WOMD), ScenarioNet's pickles, Argoverse 2's tables, generated families, and
//! sets of them.
//!
//! ```text
//! inputs ──▶ SceneSet ──▶ tfrecord (frames, checksums) ──▶ womd, tf_example (protobuf) ──▶ world::scene (the one check) ──▶ Scene
//! generated ──▶ womd::write ──────────▲                        scenarionet (pickles) ──────▲
//!                                                              argoverse (tables, maps) ───▲
//! ```
//!
//! Readers are without IO at their core, take hostile bytes, and name file, record and offset in every error.

pub mod argoverse;
mod budget;
mod content;
mod error;
#[doc(hidden)]
pub mod fuzzing;
pub mod generated;
mod joints;
pub mod lint;
mod numbering;
pub mod picture;
pub mod scenarionet;
mod set;
mod source;
pub mod stats;
pub mod tf_example;
pub mod tfrecord;
mod wire;
pub mod womd;

pub use budget::TooLarge;
pub use content::Content;
pub use error::{RecordError, RecordProblem, SetError};
pub use set::{GENERATED_TOML, IndexError, Logs, Note, SceneEntry, SceneSet, SetFile, TomlProblem};
pub use source::{Place, SceneFile, Source};
