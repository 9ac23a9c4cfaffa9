//! What a run leaves: its settings, a part as each episode ends, three Parquet files of all of them, and a summary.
//!
//! | module | what |
//! | --- | --- |
//! | [`drivers`] | who can drive: a planner with its predictor and settings, by one name |
//! | [`settings`] | what decides a run's results, as `run.toml` holds it |
//! | [`folder`] | a run's folder: begun, continued or finished |
//! | [`hold`] | who works in a folder: one sim, or several shards |
//! | [`part`] | one finished episode, kept until the run is complete |
//! | [`columns`] | the rows of each file: names, units, types |
//! | [`moves`] | where those were that reacted |
//! | [`parquet`] | written so that the same rows are the same bytes, and read back |
//! | [`survey`] | what is missing in a run that is not complete |
//! | [`gather`] | a run from several folders |
//! | [`merge()`], [`earlier`] | from parts to files; the rows of a run that is finished once more |
//! | [`digest()`] | what names the content of a finished run, and tells when it was changed |
//! | [`trace`] | how long each plan of a run took: read, to be repeated |
//! | [`summary`] | a finished run in one line |
//! | [`files`] | whole under their final name or not there at all |
//! | [`version`] | which build this is |
//! | [`weights`] | which weights are part of the repository |

pub mod columns;
pub mod digest;
pub mod drivers;
pub mod earlier;
pub mod files;
pub mod folder;
pub mod gather;
pub mod hold;
mod merge;
pub mod moves;
pub mod parquet;
pub mod part;
pub mod settings;
pub mod summary;
pub mod survey;
pub mod trace;
pub mod version;
pub mod weights;

pub use digest::digest;
pub use merge::merge;
