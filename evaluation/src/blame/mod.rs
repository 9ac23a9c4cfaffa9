//! What would have saved a drive that failed: each failure beside the same drive with one thing changed shortly before.
//!
//! | module | what |
//! | --- | --- |
//! | [`failure`] | where a drive that failed did so first |
//! | [`artefacts`] | agents that are the log's own mistakes |
//! | [`verdict`] | what came of each change |
//! | [`table`] | what people and programs read |
//!
//! Who drives again is `sim blame`; `docs/blame.md` defines all of it.

pub mod artefacts;
pub mod failure;
pub mod table;
pub mod verdict;

use clap::ValueEnum;

/// How `sim blame` prints.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum BlameFormat {
    /// For the terminal
    #[default]
    Text,
    /// For a spreadsheet
    Csv,
    /// For programs
    Json,
}
