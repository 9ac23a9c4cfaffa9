//! Where scenes come from: files of the Waymo Open Motion Dataset (WOMD), generated families, and sets of both.
//!
//! ```text
//! inputs ──▶ SceneSet ──▶ tfrecord (frames, checksums) ──▶ womd (protobuf) ──▶ world::scene (the one check) ──▶ Scene
//! generated ──▶ womd::write ──────────▲
//! ```
//!
//! Readers are without IO at their core, take hostile bytes, and name file, record and offset in every error.

mod content;
mod error;
#[doc(hidden)]
pub mod fuzzing;
pub mod generated;
pub mod lint;
pub mod picture;
mod set;
mod source;
pub mod stats;
pub mod tfrecord;
pub mod womd;

pub use content::Content;
pub use error::{RecordError, RecordProblem, SetError};
pub use set::{GENERATED_TOML, IndexError, Logs, Note, SceneEntry, SceneSet, SetFile, TomlProblem};
pub use source::{Place, SceneFile, Source};
