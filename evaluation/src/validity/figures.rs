//! The figures of a run.

use std::path::{Path, PathBuf};

use episode::metrics::METRICS;
use results::parquet::Table;

use super::{Checked, check};
use crate::drives::{DrivesError, Run};

/// How far the AV strays from the log (m).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stray {
    /// From where the logged AV is at the same moment, on average.
    pub from_log: f64,
    /// The same at most.
    pub most_from_log: f64,
    /// From its path, on average.
    pub from_path: f64,
    /// Steps that have both.
    pub steps: usize,
}

/// A metric over a run: of all steps, and without those at which somebody would have had to react.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Figure {
    /// Its name.
    pub name: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// Mean over the episodes that define it, and how many do.
    pub all: Option<(f64, usize)>,
    /// The same without those steps.
    pub without: Option<(f64, usize)>,
}

/// A run.
#[derive(Clone, Debug)]
pub struct Figures {
    /// Its folder.
    pub folder: PathBuf,
    /// What tables call the driver.
    pub driver: String,
    /// The rules.
    pub protocol: &'static str,
    /// Who drives the agents that react; none in replay.
    pub traffic: Option<String>,
    /// Each scene, and what was found; none where nothing was driven or the driver failed.
    pub episodes: Vec<(String, Option<Checked>)>,
    /// All metrics that some episode defines.
    pub metrics: Vec<Figure>,
}

impl Figures {
    /// Checks the finished run in `folder`, whose scenes are where they were or in `scenarios`. The same for any number of cores.
    ///
    /// # Errors
    /// [`DrivesError`].
    pub fn of(folder: &Path, scenarios: &[String]) -> Result<Self, DrivesError> {
        let run = Run::open(folder, scenarios)?;
        let protocol = &run.file.settings.protocol;
        let failed = run.results.flags("failed")?;
        let checked = run.each(&[], |index, driven| {
            driven.filter(|_| !failed[index]).and_then(|driven| check(driven, protocol).ok())
        })?;
        let scenes = run.file.scenes.iter().map(|scene| scene.id.clone());
        let episodes: Vec<(String, Option<Checked>)> = scenes.zip(checked).collect();
        Ok(Self {
            metrics: metrics(&run.results, &episodes)?,
            folder: folder.to_owned(),
            driver: run.file.settings.driver.clone(),
            protocol: protocol.name(),
            traffic: run.file.settings.traffic.as_ref().map(ToString::to_string),
            episodes,
        })
    }

    /// The episodes that were driven.
    pub fn driven(&self) -> impl Iterator<Item = (&str, &Checked)> {
        self.episodes.iter().filter_map(|(scene, checked)| Some((scene.as_str(), checked.as_ref()?)))
    }

    /// How far the AV strays.
    #[must_use]
    pub fn stray(&self) -> Option<Stray> {
        stray(self.driven().map(|(_, checked)| checked))
    }
}

/// How far the AV strays in these episodes; none where the log has no AV beside it.
pub(super) fn stray<'a>(episodes: impl Iterator<Item = &'a Checked>) -> Option<Stray> {
    let mut stray = Stray::default();
    for (from_log, from_path) in
        episodes.flat_map(|checked| &checked.steps).filter_map(|step| Some((step.from_log?, step.from_path?)))
    {
        stray.from_log += from_log;
        stray.from_path += from_path;
        stray.most_from_log = stray.most_from_log.max(from_log);
        stray.steps += 1;
    }
    let steps = stray.steps as f64;
    (stray.steps > 0).then(|| Stray { from_log: stray.from_log / steps, from_path: stray.from_path / steps, ..stray })
}

fn metrics(results: &Table, episodes: &[(String, Option<Checked>)]) -> Result<Vec<Figure>, DrivesError> {
    let numbers = results.numbers()?;
    let figure = |(index, metric): (usize, &episode::metrics::Metric)| {
        let column = numbers.get(metric.name);
        let driven = || episodes.iter().enumerate().filter_map(|(row, (_, checked))| Some((row, checked.as_ref()?)));
        let of_all = |(row, _): (usize, &Checked)| column.and_then(|values| values[row]);
        let without = |(row, checked): (usize, &Checked)| {
            // What no step is left out of is what it was, to the last bit.
            let is_whole = checked.steps.iter().all(super::Step::is_valid);
            if is_whole { of_all((row, checked)) } else { checked.without[index].filter(|value| !value.is_nan()) }
        };
        Figure {
            name: metric.name,
            unit: metric.unit,
            all: mean(driven().filter_map(of_all)),
            without: mean(driven().filter_map(without)),
        }
    };
    let figures = METRICS.iter().enumerate().map(figure);
    Ok(figures.filter(|figure| figure.all.is_some() || figure.without.is_some()).collect())
}

fn mean(values: impl Iterator<Item = f64>) -> Option<(f64, usize)> {
    let values: Vec<f64> = values.collect();
    (!values.is_empty()).then(|| (values.iter().sum::<f64>() / values.len() as f64, values.len()))
}
