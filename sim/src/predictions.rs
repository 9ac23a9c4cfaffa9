//! `sim predictions`: all recordings of a run.

use std::path::{Path, PathBuf};

use evaluation::predictions::Figures;
use evaluation::recorded::RecordedError;
use rayon::prelude::*;
use recording::LoadError;
use results::folder::{FolderError, read_run_file, recording_of};
use results::settings::SceneLine;
use thiserror::Error;

/// A run whose predictions cannot be scored.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum RunPredictionsError {
    #[error(transparent)]
    Folder(#[from] FolderError),
    #[error("{} holds no run: there is no run.toml in it", .0.display())]
    NoRun(PathBuf),
    #[error("{} has no recording\nhint: `sim run --record all` keeps them", .0.display())]
    NothingRecorded(PathBuf),
    #[error("nobody predicts in {}: its driver has no predictor", .0.display())]
    NoPredictor(PathBuf),
    #[error(transparent)]
    Load(#[from] LoadError),
    #[error("{}: {source}", path.display())]
    Recording { path: PathBuf, source: RecordedError },
}

/// What came of a run.
#[derive(Debug)]
pub struct Scored {
    /// Over all recordings.
    pub figures: Figures,
    /// Episodes without one.
    pub unrecorded: usize,
}

/// Scores the recordings of the run in `folder`.
///
/// # Errors
/// [`RunPredictionsError`], of the first recording that cannot be used.
pub fn of_run(folder: &Path) -> Result<Scored, RunPredictionsError> {
    let file = read_run_file(folder)?.ok_or_else(|| RunPredictionsError::NoRun(folder.to_owned()))?;
    if file.settings.predictor.is_none() {
        return Err(RunPredictionsError::NoPredictor(folder.to_owned()));
    }
    let path = |scene: &SceneLine| recording_of(folder, &scene.id);
    let paths: Vec<PathBuf> = file.scenes.iter().map(path).filter(|path| path.exists()).collect();
    if paths.is_empty() {
        return Err(RunPredictionsError::NothingRecorded(folder.to_owned()));
    }
    let scored: Vec<_> = paths.par_iter().map(|path| of_recording(path)).collect();
    // In the order of the scenes: sums are the same for any number of cores.
    let mut figures = Figures::default();
    for one in scored {
        figures.merge(&one?);
    }
    Ok(Scored { figures, unrecorded: file.scenes.len() - paths.len() })
}

fn of_recording(path: &Path) -> Result<Figures, RunPredictionsError> {
    let bytes = recording::load(path)?;
    Figures::of_recording(&bytes).map_err(|source| RunPredictionsError::Recording { path: path.to_owned(), source })
}
