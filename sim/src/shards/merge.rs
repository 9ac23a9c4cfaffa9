//! `sim merge`: what the shards of a run have driven becomes the files of a run that one process drove.

use std::path::{Path, PathBuf};

use results::files::FileError;
use results::folder::{Folder, FolderError, scenes_of_parts};
use results::gather::{GatherError, gather};
use results::parquet::ParquetError;
use results::part::Part;
use results::settings::{Build, RunFile};
use results::survey::{State, Survey};
use thiserror::Error;

use crate::run::console::Console;

/// Names that a message has at most.
const MOST_NAMES: usize = 5;

/// A run that cannot be merged.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum MergeError {
    #[error(transparent)]
    Folder(#[from] FolderError),
    #[error(transparent)]
    File(#[from] FileError),
    #[error(transparent)]
    Gather(#[from] GatherError),
    #[error(transparent)]
    Results(#[from] ParquetError),
    #[error("the run in {} was driven by another build, {there}, and this is {here}\nhint: merge with the sim that drove it", path.display())]
    OtherBuild { path: PathBuf, there: String, here: String },
    #[error("the run.toml in {} was changed since the run was begun: its settings or scenes are not those that were pinned\nhint: take it from a copy", .0.display())]
    Changed(PathBuf),
    #[error("{count} of {total} episodes of the run in {} are missing: {names}\nhint: `sim status {}` says who drives them", path.display(), path.display())]
    Missing { path: PathBuf, count: usize, total: usize, names: String },
    #[error("{count} episodes in {} are of another run: {names}\nhint: only shards of one run, by one build, are merged; remove {}", path.display(), parts(path, names))]
    Foreign { path: PathBuf, count: usize, names: String },
}

fn parts(folder: &Path, names: &str) -> String {
    let first = names.split(", ").next().unwrap_or_default();
    folder.join("parts").join(format!("{first}.part")).display().to_string()
}

/// Merges the run in `path`, with what is in the folders `others`.
///
/// # Errors
/// [`MergeError`] where something is missing, or is not of this run; then nothing is changed but for what was copied.
pub fn merge(path: &Path, others: &[PathBuf], console: &Console) -> Result<(), MergeError> {
    let (folder, file) = Folder::of_run(path)?;
    if folder.is_finished() {
        console.line(&format!("{} is merged already", path.display()));
        return Ok(folder.remove_parts()?);
    }
    check_pinned(path, &file)?;
    let copied = gather(&folder, &file, others)?;
    if copied > 0 {
        console.line(&format!("{copied} episodes were copied into {}", path.display()));
    }
    let complain = || check(path, &file, &Survey::of(path, &file)?);
    if scenes_of_parts(path).len() != file.scenes.len() {
        complain()?;
    }
    let identity = file.identity();
    let is_done = |_: usize, part: &Part| State::of(path, part, &identity).is_done();
    results::merge(&folder, &file, None, is_done).map_err(|error| complain().err().unwrap_or(error.into()))?;
    Ok(folder.remove_parts()?)
}

/// That the run is as it was begun, and by this build.
fn check_pinned(path: &Path, file: &RunFile) -> Result<(), MergeError> {
    let build = Build::this();
    if file.build != build {
        let said = |build: &Build| format!("{} of {}", build.version, build.git_revision);
        let (there, here) = (said(&file.build), said(&build));
        return Err(MergeError::OtherBuild { path: path.to_owned(), there, here });
    }
    match &file.machine.shards {
        Some(shards) if shards.sha256 != file.identity() => Err(MergeError::Changed(path.to_owned())),
        _ => Ok(()),
    }
}

/// That nothing is missing, and nothing is of another run.
fn check(path: &Path, file: &RunFile, survey: &Survey) -> Result<(), MergeError> {
    let ids = || file.scenes.iter().map(|line| line.id.as_str()).zip(&survey.scenes);
    let foreign: Vec<&str> = ids().filter(|(_, state)| **state == State::Foreign).map(|(id, _)| id).collect();
    let foreign: Vec<&str> = foreign.into_iter().chain(survey.strangers.iter().map(String::as_str)).collect();
    if !foreign.is_empty() {
        return Err(MergeError::Foreign { path: path.to_owned(), count: foreign.len(), names: names(&foreign) });
    }
    let missing: Vec<&str> = ids().filter(|(_, state)| !state.is_done()).map(|(id, _)| id).collect();
    if missing.is_empty() {
        return Ok(());
    }
    let (count, total) = (missing.len(), file.scenes.len());
    Err(MergeError::Missing { path: path.to_owned(), count, total, names: names(&missing) })
}

/// The first of some names, and how many more there are.
pub(super) fn names(all: &[&str]) -> String {
    let shown = all[..all.len().min(MOST_NAMES)].join(", ");
    match all.len().saturating_sub(MOST_NAMES) {
        0 => shown,
        more => format!("{shown} and {more} more"),
    }
}
