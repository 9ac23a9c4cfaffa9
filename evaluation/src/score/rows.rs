//! Scores as Parquet: a row an episode with every figure, and a row a step of those that are told step by step.

use std::path::Path;

use results::columns::Columns;
use results::parquet::{self, ParquetError};

use super::waymax::STEP_FIGURES;
use super::{Episode, Scored};

/// Writes every figure of every episode, a row each. All runs have the same scores.
///
/// # Errors
/// [`ParquetError`] where the file cannot be written.
pub fn write(path: &Path, runs: &[Scored]) -> Result<(), ParquetError> {
    let rows = runs.iter().flat_map(|run| run.episodes.iter().map(move |episode| (run, episode)));
    // Columns ask how many there are.
    let rows: Vec<(&Scored, &Episode)> = rows.collect();
    let episodes = || rows.iter().copied();
    let mut columns = Columns::default();
    columns.text("run", episodes().map(|(run, _)| run.run.folder.to_string_lossy()));
    columns.text("driver", episodes().map(|(run, _)| &run.run.driver));
    columns.text("protocol", episodes().map(|(run, _)| &run.run.protocol));
    columns.text("scene", episodes().map(|(_, episode)| &episode.scene));
    for group in runs.first().map(|run| run.groups.as_slice()).unwrap_or_default() {
        for (index, figure) in group.figures.iter().enumerate().filter(|(_, figure)| figure.is_of_episodes()) {
            columns.maybe(&figure.name, episodes().map(|(_, episode)| group.values(episode)[index]));
        }
    }
    columns.text("not_judged", episodes().map(|(_, episode)| reasons(episode)));
    let batch = columns.batch()?;
    parquet::write(path, batch.schema(), [Ok(batch)])
}

/// Why a score says nothing, or not all, of an episode, in a line.
pub(super) fn reasons(episode: &Episode) -> String {
    let reasons = episode.reasons.iter().map(|(score, reason)| format!("{}: {reason}", score.name()));
    reasons.collect::<Vec<_>>().join("; ")
}

/// Writes Waymax's figures of every step, a row each.
///
/// # Errors
/// [`ParquetError`] where the file cannot be written.
pub fn write_steps(path: &Path, runs: &[Scored]) -> Result<(), ParquetError> {
    let episodes = runs.iter().flat_map(|run| run.episodes.iter().map(move |episode| (run, episode)));
    let rows = episodes.flat_map(|(run, episode)| (0..episode.steps.len()).map(move |step| (run, episode, step)));
    let rows: Vec<(&Scored, &Episode, usize)> = rows.collect();
    let steps = || rows.iter().copied();
    let mut columns = Columns::default();
    columns.text("run", steps().map(|(run, ..)| run.run.folder.to_string_lossy()));
    columns.text("driver", steps().map(|(run, ..)| &run.run.driver));
    columns.text("scene", steps().map(|(_, episode, ..)| &episode.scene));
    columns.count("step", steps().map(|(.., step)| step as u32));
    columns.count("log_index", steps().map(|(_, episode, step)| episode.start + 1 + step as u32));
    for (index, (name, _)) in STEP_FIGURES.iter().enumerate() {
        columns.maybe(name, steps().map(|(_, episode, step)| episode.steps[step][index]));
    }
    let batch = columns.batch()?;
    parquet::write(path, batch.schema(), [Ok(batch)])
}
