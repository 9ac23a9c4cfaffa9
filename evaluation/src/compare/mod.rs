//! Two runs over the same scenes, A the baseline and B the candidate: which scenes flipped, which figures moved, and what of it
//! may be chance.
//!
//! | module | what |
//! | --- | --- |
//! | [`run`] | a finished run, as far as a comparison reads it |
//! | `pairs` | which episodes are set side by side, and which runs cannot be compared |
//! | [`outcome`] | whether a drive passed, and why not |
//! | `steps` | when a fault began, and where two drives part |
//! | [`figures`] | what is compared, and which way it is better |
//! | [`statistics`] | intervals, tests, power |
//! | [`comparison`] | all of it together |
//! | [`gate`] | what makes `sim compare` fail |
//! | `sentences`, `grid`, [`text`], [`markdown`], [`json`], [`junit`] | what people and programs read |
//!
//! `docs/compare.md` defines every figure.

pub mod comparison;
pub mod figures;
pub mod gate;
pub(crate) mod grid;
pub mod json;
pub mod junit;
pub mod markdown;
pub mod outcome;
mod pairs;
pub mod run;
pub(crate) mod sentences;
pub mod statistics;
mod steps;
pub mod text;

use std::collections::BTreeSet;
use std::path::Path;

use clap::ValueEnum;
use results::parquet::ParquetError;

pub use comparison::Comparison;
pub use pairs::{CompareError, LeftOut};
use run::Run;

/// How `sim compare` prints.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum CompareFormat {
    /// For the terminal
    #[default]
    Text,
    /// For a pull request
    Markdown,
    /// For programs: every number, every scene
    Json,
}

/// The first step after which the AVs of two runs under `protocol` are more than half a metre apart in `scene`; none where they never are
/// while both drive.
///
/// # Errors
/// [`ParquetError`] where the steps cannot be read.
pub fn parting(a: &Path, b: &Path, protocol: &str, scene: &str) -> Result<Option<u32>, ParquetError> {
    let scenes = BTreeSet::from([scene]);
    let read = |folder: &Path| steps::Steps::read(folder, protocol, &scenes);
    Ok(read(a)?.parting(&read(b)?, scene))
}

/// The finished runs in the folders `a` (the baseline) and `b` (the candidate), compared; `seed` draws the resamples.
///
/// # Errors
/// [`CompareError`] where one is no finished run, or the two cannot be compared.
pub fn compare(a: &Path, b: &Path, seed: u64) -> Result<Comparison, CompareError> {
    let (a, b) = (Run::read(a)?, Run::read(b)?);
    let mut comparison = Comparison::of(&a, &b, seed)?;
    comparison.look_into_flips(&a.folder, &b.folder)?;
    Ok(comparison)
}
