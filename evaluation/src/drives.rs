//! The drives of a finished run, scene by scene: where the AV was at each step, beside the scene it drove through. For whoever judges
//! them again without driving.
//!
//! ```text
//! run.toml ─▶ Run ─ scenes ─────────────────┐
//! results.parquet ─ how each episode ended ─┼─▶ Driven ─▶ a judge, on all cores, in the run's order
//! steps.parquet ─ a scene's rows at a time ─┘
//! ```

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rayon::prelude::*;
use results::folder::read_run_file;
use results::parquet::{ByScene, ParquetError, Table};
use results::settings::RunFile;
use results::summary::{Summary, SummaryError};
use scenarios::{SceneSet, SetError};
use thiserror::Error;
use world::geometry::Point;
use world::plan::PlanState;
use world::scene::Scene;

/// Episodes that are in memory at a time, for each core.
const AT_A_TIME: usize = 8;

/// The columns of `steps.parquet` that say where the AV is.
const PLACES: [&str; 5] = ["av_x_m", "av_y_m", "av_heading_rad", "av_velocity_x_mps", "av_velocity_y_mps"];

/// A run whose drives cannot be judged again.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum DrivesError {
    #[error(transparent)]
    Summary(#[from] SummaryError),
    #[error(transparent)]
    Parquet(#[from] ParquetError),
    #[error("{0}\nhint: {hint}", hint = .0.hint())]
    Scenes(#[from] SetError),
    #[error("scene {scene} of {} is not among those given\nhint: --scenarios says where its scenes are now", run.display())]
    NoScene { run: PathBuf, scene: String },
    #[error(
        "scene {scene} is another one than was driven in {}: its SHA-256 differs\nhint: --scenarios says where its scenes are now",
        run.display()
    )]
    OtherScene { run: PathBuf, scene: String },
    #[error("steps.parquet of {} has rows of {scene}, which is not its next scene", run.display())]
    Order { run: PathBuf, scene: String },
    #[error("step {step} of {scene} in {}: {column} is none", run.display())]
    NoPlace { run: PathBuf, scene: String, step: usize, column: &'static str },
}

/// A finished run, and where its scenes are.
#[derive(Debug)]
pub struct Run {
    /// Its folder.
    pub folder: PathBuf,
    /// Who drove what, by which rules.
    pub file: RunFile,
    /// Its episodes, a row each, in the order of its scenes.
    pub results: Table,
    scenes: SceneSet,
    /// Where each of its scenes is in the set.
    places: Vec<usize>,
}

/// A drive.
#[derive(Debug)]
pub struct Driven {
    /// Its place among the run's scenes: its row of `results.parquet`.
    pub index: usize,
    /// The scene.
    pub scene: Arc<Scene>,
    /// Log index of step 0, where the AV is as it was logged.
    pub start: u32,
    /// The AV after each step, 0.1 s apart (m, rad, m/s). Speed is along its heading. Empty where nothing was driven.
    pub states: Vec<PlanState>,
    /// Its rows of `steps.parquet`; none where nothing was driven.
    pub steps: Option<Table>,
}

impl Run {
    /// The finished run in `folder`, held to its digest. Its scenes are looked for where they were, or in `scenarios` if that says
    /// something, and must be those that were driven.
    ///
    /// # Errors
    /// [`DrivesError`].
    pub fn open(folder: &Path, scenarios: &[String]) -> Result<Self, DrivesError> {
        // It refuses all that is no finished run, with the reason.
        Summary::read(folder)?;
        let file = read_run_file(folder).map_err(SummaryError::from)?;
        let file = file.ok_or_else(|| SummaryError::NoRun(folder.to_owned()))?;
        let scenes = SceneSet::open(if scenarios.is_empty() { &file.machine.scenarios } else { scenarios })?;
        let entries = scenes.entries().iter().enumerate();
        let by_id: BTreeMap<&str, usize> = entries.map(|(place, entry)| (entry.id.as_str(), place)).collect();
        let mut places = Vec::with_capacity(file.scenes.len());
        for line in &file.scenes {
            let (run, scene) = (folder.to_owned(), line.id.clone());
            let Some(&place) = by_id.get(line.id.as_str()) else { return Err(DrivesError::NoScene { run, scene }) };
            if scenes.entries()[place].sha256 != line.sha256 {
                return Err(DrivesError::OtherScene { run, scene });
            }
            places.push(place);
        }
        let results = Table::read(&folder.join("results.parquet"))?;
        Ok(Self { folder: folder.to_owned(), file, results, scenes, places })
    }

    /// What `judge` says of each drive, in the order of the scenes, for any number of cores. `columns` of `steps.parquet` are read
    /// beside the AV's place. Few drives are in memory at a time.
    ///
    /// # Errors
    /// [`DrivesError`] of the first drive that cannot be read.
    pub fn each<T: Send>(&self, columns: &[&str], judge: impl Fn(&Driven) -> T + Sync) -> Result<Vec<T>, DrivesError> {
        let wanted: Vec<&str> = PLACES.iter().chain(columns).copied().collect();
        let mut steps = ByScene::open(&self.folder.join("steps.parquet"), &wanted)?;
        let (driven, starts) = (self.results.counts("steps")?, self.results.counts("start_log_index")?);
        let mut judged = Vec::with_capacity(self.places.len());
        let indices: Vec<usize> = (0..self.places.len()).collect();
        for some in indices.chunks(AT_A_TIME * rayon::current_num_threads()) {
            let mut rows = Vec::with_capacity(some.len());
            for &index in some {
                let table = if driven[index] == 0 { None } else { Some(self.rows(&mut steps, index)?) };
                rows.push((index, table));
            }
            let told =
                rows.into_par_iter().map(|(index, steps)| Ok(judge(&self.drive(index, starts[index], steps)?)));
            for one in told.collect::<Vec<Result<T, DrivesError>>>() {
                judged.push(one?);
            }
        }
        Ok(judged)
    }

    /// The drives of these scenes alone, by their places in the run, each handed to `use_it` as soon as it is read; as [`Run::each`] otherwise.
    ///
    /// # Errors
    /// [`DrivesError`] of the first drive that cannot be read.
    pub fn picked<T: Send>(
        &self,
        columns: &[&str],
        indices: &BTreeSet<usize>,
        use_it: impl Fn(&Driven) -> T + Sync,
    ) -> Result<Vec<T>, DrivesError> {
        let wanted: Vec<&str> = PLACES.iter().chain(columns).copied().collect();
        let mut steps = ByScene::open(&self.folder.join("steps.parquet"), &wanted)?;
        let (driven, starts) = (self.results.counts("steps")?, self.results.counts("start_log_index")?);
        let mut rows = Vec::with_capacity(indices.len());
        for (index, steps_driven) in driven.iter().enumerate().take(indices.last().map_or(0, |last| last + 1)) {
            let table = if *steps_driven == 0 { None } else { Some(self.rows(&mut steps, index)?) };
            if indices.contains(&index) {
                rows.push((index, table));
            }
        }
        let told = rows.into_par_iter().map(|(index, steps)| Ok(use_it(&self.drive(index, starts[index], steps)?)));
        told.collect::<Vec<Result<T, DrivesError>>>().into_iter().collect()
    }

    /// The rows of a scene, which are the next.
    fn rows(&self, steps: &mut ByScene, index: usize) -> Result<Table, DrivesError> {
        let scene = &self.file.scenes[index].id;
        match steps.next().transpose()? {
            Some((found, table)) if found == *scene => Ok(table),
            other => {
                let scene = other.map_or_else(|| scene.clone(), |(found, _)| found);
                Err(DrivesError::Order { run: self.folder.clone(), scene })
            }
        }
    }

    fn drive(&self, index: usize, start: u32, steps: Option<Table>) -> Result<Driven, DrivesError> {
        let (scene, _) = self.scenes.load(self.places[index])?;
        let states = match &steps {
            Some(table) => self.states(&self.file.scenes[index].id, table)?,
            None => Vec::new(),
        };
        Ok(Driven { index, scene, start, states, steps })
    }

    fn states(&self, scene: &str, table: &Table) -> Result<Vec<PlanState>, DrivesError> {
        let numbers = table.numbers()?;
        let rows = numbers.values().next().map_or(0, Vec::len);
        let state = |step: usize| {
            let number = |column: &'static str| {
                numbers.get(column).and_then(|values| values[step]).ok_or_else(|| DrivesError::NoPlace {
                    run: self.folder.clone(),
                    scene: scene.to_owned(),
                    step,
                    column,
                })
            };
            let [x, y, heading, velocity_x, velocity_y] = PLACES.map(number);
            let heading = heading?;
            let velocity = Point { x: velocity_x?, y: velocity_y? };
            Ok(PlanState { x: x?, y: y?, heading, speed: velocity.dot(Point::unit(heading)) })
        };
        (0..rows).map(state).collect()
    }
}
