//! A finished run, as far as a comparison reads it.

use std::path::{Path, PathBuf};

use episode::latency::Latency;
use episode::protocol::Protocol;
use results::folder::read_run_file;
use results::parquet::Table;
use results::settings::Build;
use results::summary::{Summary, SummaryError};

use super::figures::{FIGURES, PASSED};
use super::outcome::{Fault, UNDRIVABLE, faults};

/// Who drove what, and how it came out.
#[derive(Clone, Debug)]
pub struct Run {
    /// Its folder.
    pub folder: PathBuf,
    /// What tables call the driver.
    pub driver: String,
    /// The rules.
    pub protocol: Protocol,
    /// When its plans took effect; none: at once.
    pub latency: Option<Latency>,
    /// Who drove the agents that react; none: all were replayed.
    pub traffic: Option<String>,
    /// The build that drove.
    pub build: Build,
    /// How long an answer might take (s).
    pub deadline_s: f64,
    /// Its episodes, in its order.
    pub episodes: Vec<Episode>,
}

/// An episode, as its row of `results.parquet` tells it.
#[derive(Clone, Debug, PartialEq)]
pub struct Episode {
    /// The scene.
    pub scene: String,
    /// The hash of its record.
    pub sha256: String,
    /// How it ended, by name.
    pub end: String,
    /// The sentence on that.
    pub detail: String,
    /// Steps driven.
    pub steps: u32,
    /// Why it did not pass; empty where it did.
    pub faults: Vec<Fault>,
    /// In the order of [`FIGURES`]; nothing but [`PASSED`] where it has no result.
    pub values: Vec<Option<f64>>,
}

impl Episode {
    /// Whether the scene could be driven at all.
    #[must_use]
    pub fn is_drivable(&self) -> bool {
        self.end != UNDRIVABLE
    }

    /// Whether the driver gave no result.
    #[must_use]
    pub fn driver_failed(&self) -> bool {
        self.faults.contains(&Fault::DriverFailed)
    }

    /// Whether all that is measured of it is as of the other.
    #[must_use]
    pub fn is_same_drive(&self, other: &Self) -> bool {
        (&self.end, &self.detail, self.steps, &self.values) == (&other.end, &other.detail, other.steps, &other.values)
    }
}

impl Run {
    /// The finished run in `folder`, held to its digest.
    ///
    /// # Errors
    /// [`SummaryError`] where there is none, it is not finished, or it was changed.
    pub fn read(folder: &Path) -> Result<Self, SummaryError> {
        // It refuses all that is no finished run, with the reason.
        let summary = Summary::read(folder)?;
        let file = read_run_file(folder)?.ok_or_else(|| SummaryError::NoRun(folder.to_owned()))?;
        let table = Table::read(&folder.join("results.parquet"))?;
        Ok(Self {
            episodes: episodes(&table, &summary.protocol)?,
            folder: folder.to_owned(),
            driver: summary.driver,
            protocol: file.settings.protocol,
            latency: file.settings.latency,
            traffic: summary.traffic,
            build: file.build,
            deadline_s: file.settings.deadline_s,
        })
    }
}

fn episodes(table: &Table, protocol: &str) -> Result<Vec<Episode>, SummaryError> {
    let numbers = table.numbers()?;
    let (scenes, hashes) = (table.text("scene")?, table.text("scene_sha256")?);
    let (ends, details) = (table.text("end_reason")?, table.text("end_detail")?);
    let (failed, steps) = (table.flags("failed")?, table.counts("steps")?);
    let columns: Vec<Option<&Vec<Option<f64>>>> = FIGURES.iter().map(|(name, _)| numbers.get(*name)).collect();
    type Texts = ((String, String), (String, String));
    let rows = scenes.into_iter().zip(hashes).zip(ends.into_iter().zip(details)).enumerate();
    let episode = |(row, ((scene, sha256), (end, detail))): (usize, Texts)| {
        let is_set =
            |column: &str| numbers.get(column).is_some_and(|values| values[row].is_some_and(|value| value != 0.0));
        let faults = faults(protocol, &end, failed[row], is_set);
        let value = |(at, (name, _)): (usize, &(&str, _))| match *name {
            PASSED => (end != UNDRIVABLE).then(|| f64::from(u8::from(faults.is_empty()))),
            // What was measured before the driver failed is of another stretch than the other run's.
            _ => columns[at].and_then(|values| values[row]).filter(|_| !failed[row]),
        };
        let values = FIGURES.iter().enumerate().map(value).collect();
        Episode { scene, sha256, end, detail, steps: steps[row], faults, values }
    };
    Ok(rows.map(episode).collect())
}
