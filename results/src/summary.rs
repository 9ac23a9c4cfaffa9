//! A finished run in one line: means over its episodes.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use episode::latency::Latency;
use thiserror::Error;

use crate::digest::{DIGEST, DigestError, digest};
use crate::folder::{FolderError, read_run_file};
use crate::parquet::{ParquetError, Table};

/// Counts of an episode under a latency.
const COUNTS: [&str; 2] = ["plans_late", "plans_lost"];

/// A folder that holds no finished run.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum SummaryError {
    #[error(transparent)]
    Folder(#[from] FolderError),
    #[error(transparent)]
    Parquet(#[from] ParquetError),
    #[error(transparent)]
    Digest(#[from] DigestError),
    #[error("{} is not there\nhint: runs are in the folder `runs`, unless --out named another", .0.display())]
    Missing(PathBuf),
    #[error("{} holds no run: there is no run.toml in it", .0.display())]
    NoRun(PathBuf),
    #[error("the run in {} is not finished\nhint: repeat the command it was begun with, and it is continued", .0.display())]
    Unfinished(PathBuf),
}

/// An episode without a result.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failure {
    /// The scene.
    pub scene: String,
    /// `driver-failed` or `undrivable`.
    pub reason: String,
    /// The sentence on it.
    pub detail: String,
}

/// A run in one line.
#[derive(Clone, Debug, PartialEq)]
pub struct Summary {
    /// Its folder.
    pub folder: PathBuf,
    /// What tables call the driver.
    pub driver: String,
    /// The protocol's name.
    pub protocol: String,
    /// How the AV followed its plans.
    pub motion: String,
    /// Which settings of the protocol are not as usual; before them that it was forked, if it was.
    pub changes: Vec<String>,
    /// When its plans took effect; none: at once.
    pub latency: Option<Latency>,
    /// Who drives the agents that react; none: all are replayed.
    pub traffic: Option<String>,
    /// The scenes: names and hashes.
    pub scenes: Vec<(String, String)>,
    /// Those without a result; means are over the others.
    pub failures: Vec<Failure>,
    /// How many scenes have warnings.
    pub warned: usize,
    /// How many scenes do not hold all that a drive is judged by.
    pub unjudged: usize,
    /// Recordings that are not whole: scene and what is wrong.
    pub broken_recordings: Vec<(String, String)>,
    /// The mean of each metric over the episodes that define it, and how many do; none where no episode does.
    pub means: BTreeMap<String, Option<(f64, usize)>>,
}

impl Summary {
    /// The run in `folder`.
    ///
    /// # Errors
    /// [`SummaryError`] where there is none, or it is not finished.
    pub fn read(folder: &Path) -> Result<Self, SummaryError> {
        if !folder.exists() {
            return Err(SummaryError::Missing(folder.to_owned()));
        }
        let file = read_run_file(folder)?.ok_or_else(|| SummaryError::NoRun(folder.to_owned()))?;
        if !folder.join(DIGEST).exists() {
            return Err(SummaryError::Unfinished(folder.to_owned()));
        }
        digest(folder)?;
        let results = folder.join("results.parquet");
        let table = Table::read(&results)?;
        let scenes: Vec<_> = table.text("scene")?.into_iter().zip(table.text("scene_sha256")?).collect();
        let failed = table.flags("failed")?;
        let (reasons, details) = (table.text("end_reason")?, table.text("end_detail")?);
        let failures = (0..scenes.len()).filter(|row| failed[*row]).map(|row| Failure {
            scene: scenes[row].0.clone(),
            reason: reasons[row].clone(),
            detail: details[row].clone(),
        });
        let failures = failures.collect();
        let filled = |texts: Vec<String>| texts.iter().filter(|text| !text.is_empty()).count();
        let (warned, unjudged) = (filled(table.text("findings")?), filled(table.text("unjudged")?));
        let errors = table.text("recording_error")?;
        let broken = errors.into_iter().enumerate().filter(|(_, error)| !error.is_empty());
        let broken_recordings = broken.map(|(row, error)| (scenes[row].0.clone(), error)).collect();
        let of = |name: String| table.number(&name).map(|values| (name, mean(&values, &failed)));
        let mut means = table.number_columns().into_iter().map(of).collect::<Result<BTreeMap<_, _>, _>>()?;
        for name in COUNTS.into_iter().filter(|_| file.settings.latency.is_some()) {
            let counts: Vec<_> = table.counts(name)?.into_iter().map(|count| Some(f64::from(count))).collect();
            means.insert(name.to_owned(), mean(&counts, &failed));
        }
        let fork = file.settings.fork.as_ref().map(ToString::to_string);
        Ok(Self {
            folder: folder.to_owned(),
            driver: file.settings.driver,
            protocol: file.settings.protocol.name().to_owned(),
            motion: file.settings.protocol.motion_name().to_owned(),
            latency: file.settings.latency,
            traffic: file.settings.traffic.as_ref().map(ToString::to_string),
            changes: fork.into_iter().chain(file.settings.protocol.changes()).collect(),
            scenes,
            failures,
            warned,
            unjudged,
            broken_recordings,
            means,
        })
    }

    /// All that is not as usual, a text each.
    #[must_use]
    pub fn settings(&self) -> Vec<String> {
        let latency = self.latency.iter().map(|latency| format!("latency {latency}"));
        let traffic = self.traffic.iter().map(|name| format!("traffic {name}"));
        self.changes.iter().cloned().chain(latency).chain(traffic).collect()
    }

    /// How many episodes have a result.
    #[must_use]
    pub fn counted(&self) -> usize {
        self.scenes.len() - self.failures.len()
    }

    /// What is odd about its scenes, in a sentence; none where nothing is.
    #[must_use]
    pub fn oddities(&self) -> Option<String> {
        let total = self.scenes.len();
        let unjudged = |count| format!("{count} cannot be judged in full");
        match (self.warned, self.unjudged) {
            (0, 0) => None,
            (warned, 0) => Some(format!("{warned} of {total} scenes have warnings")),
            (warned, count) => Some(format!("{warned} of {total} scenes have warnings, {}", unjudged(count))),
        }
    }

    /// The mean of a metric, and over how many episodes.
    #[must_use]
    pub fn mean(&self, metric: &str) -> Option<(f64, usize)> {
        self.means.get(metric).copied().flatten()
    }
}

/// The mean of the values that are defined, in the rows that did not fail, and how many they are.
fn mean(values: &[Option<f64>], failed: &[bool]) -> Option<(f64, usize)> {
    let defined = values.iter().zip(failed).filter(|(_, failed)| !**failed).filter_map(|(value, _)| *value);
    let (sum, count) = defined.fold((0.0, 0), |(sum, count), value| (sum + value, count + 1));
    (count > 0).then(|| (sum / count as f64, count))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mean_is_over_what_is_defined_and_did_not_fail() {
        assert_eq!(mean(&[Some(1.0), None, Some(4.0), Some(100.0)], &[false, false, false, true]), Some((2.5, 2)));
        assert_eq!(mean(&[None, Some(1.0)], &[false, true]), None);
    }
}
