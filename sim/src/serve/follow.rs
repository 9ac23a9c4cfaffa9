//! How far a run is, as its folder says: the ends of its episodes, in the order in which they came to be known.
//!
//! While a run is on, each finished episode is a part in its folder, which is there whole or not at all. Once it is done its rows are in
//! `results.parquet`. Nothing is asked of the process that drives.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use results::digest::DIGEST;
use results::folder::{part_of, read_run_file, scenes_of_parts};
use results::parquet::{ParquetError, Table};
use results::part::reason_name;
use wire::proto::service::End;

/// The ends of one run's episodes.
#[derive(Debug)]
pub struct Follow {
    folder: PathBuf,
    /// What no other list of ends is called: numbers of one mean nothing in another.
    pub epoch: u64,
    /// How many there will be; none before that is known.
    episodes: Option<usize>,
    known: BTreeSet<String>,
    /// Those that are known.
    pub ends: Vec<End>,
}

impl Follow {
    /// The ends of the run in `folder`, none of which is known yet.
    #[must_use]
    pub fn new(folder: &Path, epoch: u64) -> Self {
        Self { folder: folder.to_owned(), epoch, episodes: None, known: BTreeSet::new(), ends: Vec::new() }
    }

    /// How many episodes the run has, as far as it was begun.
    #[must_use]
    pub fn episodes(&self) -> Option<usize> {
        self.episodes
    }

    /// How many of those that are known have no result.
    #[must_use]
    pub fn failed(&self) -> usize {
        self.ends.iter().filter(|end| end.failed).count()
    }

    /// Looks what is new. What cannot be read now is read later.
    pub fn look(&mut self) {
        if self.episodes.is_none() {
            self.episodes = read_run_file(&self.folder).ok().flatten().map(|file| file.scenes.len());
        }
        if self.folder.join(DIGEST).exists() {
            let ends = ends_of_results(&self.folder).unwrap_or_default();
            return ends.into_iter().for_each(|end| self.learn(end));
        }
        for scene in scenes_of_parts(&self.folder) {
            if !self.known.contains(&scene)
                && let Ok(Some(part)) = part_of(&self.folder, &scene)
            {
                let (reason, failed) = (reason_name(part.reason()).to_owned(), part.failed());
                let (steps, detail) = (part.records.len() as u32, part.end.map(|end| end.detail).unwrap_or_default());
                self.learn(End { scene, reason, detail, steps, failed });
            }
        }
    }

    fn learn(&mut self, end: End) {
        if self.known.insert(end.scene.clone()) {
            self.ends.push(end);
        }
    }
}

/// The ends of a run that is done, in the order of its scenes.
///
/// # Errors
/// [`ParquetError`] where its results cannot be read.
pub fn ends_of_results(folder: &Path) -> Result<Vec<End>, ParquetError> {
    let table = Table::read(&folder.join("results.parquet"))?;
    let (reasons, details) = (table.text("end_reason")?, table.text("end_detail")?);
    let (failed, steps) = (table.flags("failed")?, table.counts("steps")?);
    let rows = table.text("scene")?.into_iter().zip(reasons).zip(details).zip(failed).zip(steps);
    Ok(rows.map(|((((scene, reason), detail), failed), steps)| End { scene, reason, detail, steps, failed }).collect())
}
