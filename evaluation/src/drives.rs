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

use episode::protocol::{Protocol, SettingError};
use episode::traffic::TrafficSettings;
use episode::{Episode, Undrivable};
use rayon::prelude::*;
use results::folder::read_run_file;
use results::moves::{self, Moved};
use results::parquet::{ByScene, ParquetError, Table};
use results::settings::RunFile;
use results::summary::{Summary, SummaryError};
use scenarios::{SceneSet, SetError};
use thiserror::Error;
use world::geometry::Point;
use world::plan::{Control, PlanState};
use world::scene::{Scene, TrackId};
use world::traffic::{MoveError, TrafficMove, UncheckedMoves};

/// Episodes that are in memory at a time, for each core.
const AT_A_TIME: usize = 8;

/// The columns of `steps.parquet` that say where the AV is, and what brought it there.
const PLACES: [&str; 7] = [
    "av_x_m",
    "av_y_m",
    "av_heading_rad",
    "av_velocity_x_mps",
    "av_velocity_y_mps",
    "acceleration_mps2",
    "steering_rad",
];

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
    #[error(
        "{scene} of {}: where its agents are that react is not what this build makes of them: {why}\nhint: judge it by the version that drove it, or drive it again",
        run.display()
    )]
    Moves { run: PathBuf, scene: String, why: RetraceError },
    #[error("step {step} of {scene} in {}: {column} is none", run.display())]
    NoPlace { run: PathBuf, scene: String, step: usize, column: &'static str },
}

/// A drive that cannot be judged again.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum RetraceError {
    #[error(transparent)]
    Undrivable(#[from] Undrivable),
    #[error(transparent)]
    Setting(#[from] SettingError),
    #[error("step {step}: {source}")]
    Move { step: u32, source: MoveError },
}

/// A finished run, and where its scenes are.
#[derive(Debug)]
pub struct Run {
    /// Its folder.
    pub folder: PathBuf,
    /// It in a line.
    pub summary: Summary,
    /// Who drove what, by which rules.
    pub file: RunFile,
    /// Its episodes, a row each, in the order of its scenes.
    pub results: Table,
    /// Its scenes, where they are open.
    scenes: Option<Scenes>,
}

/// The scenes of a run.
#[derive(Debug)]
struct Scenes {
    set: SceneSet,
    /// Where each of the run's scenes is in the set.
    places: Vec<usize>,
}

/// A drive.
#[derive(Debug)]
pub struct Driven {
    /// Its place among the run's scenes: its row of `results.parquet`.
    pub index: usize,
    /// The scene as it was driven: who reacted is where he was. As it was logged in replay.
    pub scene: Arc<Scene>,
    /// Log index of step 0, where the AV is as it was logged.
    pub start: u32,
    /// The AV after each step, 0.1 s apart (m, rad, m/s). Speed is along its heading. Empty where nothing was driven.
    pub states: Vec<PlanState>,
    /// What brought it to each of them.
    pub controls: Vec<Control>,
    /// Its rows of `steps.parquet`; none where nothing was driven.
    pub table: Option<Table>,
    /// Who reacted in each step, and where he was after it; nothing in replay.
    pub moved: Vec<Vec<Moved>>,
    /// The scene as it was logged.
    pub logged: Arc<Scene>,
    /// Who was taken over; none in replay.
    traffic: Option<TrafficSettings>,
}

impl Run {
    /// The finished run in `folder`, held to its digest, its scenes not opened yet: who asks its results alone needs none.
    ///
    /// # Errors
    /// [`DrivesError`].
    pub fn read(folder: &Path) -> Result<Self, DrivesError> {
        // It refuses all that is no finished run, with the reason.
        let summary = Summary::read(folder)?;
        let file = read_run_file(folder).map_err(SummaryError::from)?;
        let file = file.ok_or_else(|| SummaryError::NoRun(folder.to_owned()))?;
        let results = Table::read(&folder.join("results.parquet"))?;
        Ok(Self { folder: folder.to_owned(), summary, file, results, scenes: None })
    }

    /// The finished run in `folder`, held to its digest. Its scenes are looked for where they were, or in `scenarios` if that says
    /// something; each is held to the one that was driven when its turn comes.
    ///
    /// # Errors
    /// [`DrivesError`].
    pub fn open(folder: &Path, scenarios: &[String]) -> Result<Self, DrivesError> {
        let mut run = Self::read(folder)?;
        let set = SceneSet::open(if scenarios.is_empty() { &run.file.machine.scenarios } else { scenarios })?;
        let entries = set.entries().iter().enumerate();
        let by_id: BTreeMap<&str, usize> = entries.map(|(place, entry)| (entry.id.as_str(), place)).collect();
        let mut places = Vec::with_capacity(run.file.scenes.len());
        for line in &run.file.scenes {
            let (run, scene) = (folder.to_owned(), line.id.clone());
            let Some(&place) = by_id.get(line.id.as_str()) else { return Err(DrivesError::NoScene { run, scene }) };
            places.push(place);
        }
        run.scenes = Some(Scenes { set, places });
        Ok(run)
    }

    /// What `judge` says of each episode by its place and its drive, in the order of the scenes, for any number of cores; there is no drive where
    /// the scene could not be read when it was to be driven. `columns` of `steps.parquet` are read beside the AV's place. Few drives are in
    /// memory at a time.
    ///
    /// # Errors
    /// [`DrivesError`] of the first drive that cannot be read.
    pub fn each<T: Send>(
        &self,
        columns: &[&str],
        judge: impl Fn(usize, Option<&Driven>) -> T + Sync,
    ) -> Result<Vec<T>, DrivesError> {
        self.walk(columns, |_| true, |index, driven| Some(judge(index, driven)))
    }

    /// The same for drives by their places in the run, and no others.
    ///
    /// # Errors
    /// [`DrivesError`] of the first drive that cannot be read.
    pub fn picked<T: Send>(
        &self,
        columns: &[&str],
        indices: &BTreeSet<usize>,
        judge: impl Fn(&Driven) -> T + Sync,
    ) -> Result<Vec<T>, DrivesError> {
        self.walk(columns, |index| indices.contains(&index), |_, driven| driven.map(&judge))
    }

    fn walk<T: Send>(
        &self,
        columns: &[&str],
        is_wanted: impl Fn(usize) -> bool,
        judge: impl Fn(usize, Option<&Driven>) -> Option<T> + Sync,
    ) -> Result<Vec<T>, DrivesError> {
        let Some(scenes) = &self.scenes else {
            return Self::open(&self.folder, &[])?.walk(columns, is_wanted, judge);
        };
        let moves = self.file.settings.traffic.as_ref().map(|_| moves::COLUMN);
        let wanted: Vec<&str> = PLACES.into_iter().chain(moves).chain(columns.iter().copied()).collect();
        let mut steps = ByScene::open(&self.folder.join("steps.parquet"), &wanted)?;
        let (driven, starts) = (self.results.counts("steps")?, self.results.counts("start_log_index")?);
        let mut judged = Vec::new();
        let mut indices = (0..scenes.places.len()).peekable();
        while indices.peek().is_some() {
            let mut rows = Vec::new();
            while let Some(index) = indices.next_if(|_| rows.len() < AT_A_TIME * rayon::current_num_threads()) {
                let table = if driven[index] == 0 { None } else { Some(self.rows(&mut steps, index)?) };
                if is_wanted(index) {
                    rows.push((index, table));
                }
            }
            let told = rows
                .into_par_iter()
                .map(|(index, steps)| Ok(judge(index, self.drive(scenes, index, starts[index], steps)?.as_ref())));
            for one in told.collect::<Vec<Result<Option<T>, DrivesError>>>() {
                judged.extend(one?);
            }
        }
        Ok(judged)
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

    /// The drive of a scene; none where that could not be read then.
    fn drive(
        &self,
        scenes: &Scenes,
        index: usize,
        start: u32,
        steps: Option<Table>,
    ) -> Result<Option<Driven>, DrivesError> {
        let (place, line) = (scenes.places[index], &self.file.scenes[index]);
        if line.sha256.is_empty() {
            return Ok(None);
        }
        let (scene, _) = scenes.set.load_hashed(place)?;
        if scenes.set.known_sha256(place).as_deref() != Some(&*line.sha256) {
            return Err(DrivesError::OtherScene { run: self.folder.clone(), scene: line.id.clone() });
        }
        let (states, controls) = match &steps {
            Some(table) => self.states(&line.id, table)?,
            None => Default::default(),
        };
        let settings = &self.file.settings;
        let traffic = settings.traffic.as_ref().map(|traffic| traffic.hand_over.clone());
        let moved = match &steps {
            Some(table) if traffic.is_some() => moves::of(table)?,
            _ => Vec::new(),
        };
        let logged = Arc::clone(&scene);
        let mut driven = Driven { index, scene, start, states, controls, table: steps, moved, logged, traffic };
        if !driven.moved.is_empty() {
            let again = driven.retrace(&settings.protocol, |_, _| ());
            let refused = |why| DrivesError::Moves { run: self.folder.clone(), scene: line.id.clone(), why };
            driven.scene = again.map_err(refused)?.driven_scene();
        }
        Ok(Some(driven))
    }

    fn states(&self, scene: &str, table: &Table) -> Result<(Vec<PlanState>, Vec<Control>), DrivesError> {
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
            let [x, y, heading, velocity_x, velocity_y, acceleration, steering] = PLACES.map(number);
            let heading = heading?;
            let velocity = Point { x: velocity_x?, y: velocity_y? };
            let state = PlanState { x: x?, y: y?, heading, speed: velocity.dot(Point::unit(heading)) };
            Ok((state, Control { acceleration: acceleration?, steering: steering? }))
        };
        (0..rows).map(state).collect()
    }
}

impl Driven {
    /// Judges the drive again, among those who reacted in it. `each` is shown the episode after each step.
    ///
    /// # Errors
    /// [`RetraceError`] where its scene cannot be driven, so that nothing was, or others reacted than this build takes over.
    pub fn retrace(&self, protocol: &Protocol, mut each: impl FnMut(u32, &Episode)) -> Result<Episode, RetraceError> {
        let mut episode = Episode::new(Arc::clone(&self.logged), protocol)?;
        if let Some(traffic) = &self.traffic {
            episode = episode.with_traffic(traffic)?;
        }
        for (step, state) in (0..).zip(self.steps()) {
            if let Some(moved) = self.moved.get(step as usize) {
                let before = |track: TrackId| episode.taken().iter().find(|agent| agent.track == track);
                let told = |moved: &Moved| TrafficMove {
                    track: moved.track,
                    state: moved.state(&before(moved.track).map(|agent| agent.state).unwrap_or_default()),
                };
                let moves = UncheckedMoves { step, moves: moved.iter().map(told).collect() };
                episode.move_traffic(moves).map_err(|source| RetraceError::Move { step, source })?;
            }
            episode.retrace([state]);
            each(step, &episode);
        }
        Ok(episode)
    }

    /// Its states with what brought it there, as [`episode::Episode::retrace`] takes them.
    pub fn steps(&self) -> impl Iterator<Item = (PlanState, Option<Control>)> {
        self.states.iter().copied().zip(self.controls.iter().copied().map(Some))
    }
}
