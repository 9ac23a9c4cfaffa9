//! The loop: epochs of shuffled batches, a step of Adam after each, validation after each epoch (paper, Algorithm 1).
//!
//! ```text
//! FOLDER/settings.toml            all settings, resolved
//!        checkpoint.safetensors   all that goes on
//!        metrics.csv, steps.csv   a row an epoch, a row a step
//!        weights.safetensors      after the last epoch that is done, and weights.f16.safetensors
//!        weights/epoch-NN.f32.safetensors   after each, if asked for
//!        training.rrd             all of that to look at, if asked for
//! ```
//!
//! A step depends on the checkpoint before it and on its number alone: order and dropout are drawn anew from seed and number. So it does
//! not matter where a training is stopped, or how. A batch that has no finite loss or gradient ends it before anything is changed.

use std::fs::{self, File, TryLockError};
use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::Instant;

use network::weights::{Precision, WeightsError};
use thiserror::Error;

use crate::checkpoint::{Checkpoint, CheckpointError};
use crate::cost;
use crate::draw::{Draw, Purpose};
use crate::examples::Examples;
use crate::metrics::{EpochRow, Metrics, StepRow};
use crate::optimiser::{self, is_cost};
use crate::order::shuffled;
use crate::parameters::tensors;
use crate::schedule::Schedule;
use crate::settings::Settings;
use crate::start::{self, StartError};
use crate::step::{Answer, Ask, Learner, StepError, Sums};
use crate::view::{View, ViewError};
use crate::whole_file::{self, WriteError};
use crate::windows::Window;

/// The checkpoint's name in a training's folder.
pub const CHECKPOINT: &str = "checkpoint.safetensors";
/// Windows in a batch of validation, whatever the training's: so that its means can be compared.
pub const VALIDATION_BATCH: usize = 32;
/// Windows of validation that are drawn.
const LOOKED_AT: usize = 4;

/// What is to be trained.
#[derive(Clone, Copy)]
pub struct Task<'a> {
    /// How.
    pub settings: &'a Settings,
    /// On what.
    pub examples: &'a dyn Examples,
    /// Where to; made if it is not there.
    pub folder: &'a Path,
    /// Whether to go on from the checkpoint that is there, if there is one.
    pub resume: bool,
    /// Whether to draw it into `training.rrd`.
    pub rerun: bool,
}

/// Who looks on.
pub trait Watch {
    /// A training of this name begins: of so many steps so many are done.
    fn begin(&mut self, _name: &str, _settings: &Settings, _steps: u64, _done: u64) {}
    /// A step is done.
    fn step(&mut self, _row: &StepRow) {}
    /// An epoch is done.
    fn epoch(&mut self, _row: &EpochRow) {}
    /// Whether to stop here, with a checkpoint.
    fn stop(&self) -> bool {
        false
    }
}

/// How it ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ended {
    /// All epochs are done.
    Finished,
    /// Somebody stopped it; a checkpoint is written.
    Stopped,
}

/// Why it did not end well. A checkpoint that was there stays.
#[derive(Debug, Error)]
pub enum TrainingError {
    /// The folder has another training.
    #[error("{} has a checkpoint already\nhint: --resume goes on from it; or give another folder", .0.display())]
    Exists(PathBuf),
    /// The checkpoint is of another one.
    #[error("{} is of another training: {}\nhint: give the same settings and windows, or another folder", path.display(), differences.join("; "))]
    Other {
        /// The checkpoint.
        path: PathBuf,
        /// In what.
        differences: Vec<String>,
    },
    /// Two train there.
    #[error("somebody else trains in {}\nhint: wait for it, or give another folder", .0.display())]
    Busy(PathBuf),
    /// There is nothing to learn from.
    #[error(
        "there are no windows to train on, of {0} in all\nhint: prepare some of more scenes, or hold back fewer for validation"
    )]
    NoWindows(usize),
    /// There is not enough to fill a step.
    #[error(
        "there are {0} transitions to train on, and a step takes {1}\nhint: prepare some of more scenes, or set batch_size"
    )]
    NoTransitions(usize, usize),
    /// A window cannot be read.
    #[error("window {index}: {source:#}")]
    Window {
        /// Its number.
        index: usize,
        /// Why.
        source: anyhow::Error,
    },
    /// A batch has no loss.
    #[error(
        "step {step} (epoch {epoch}): {source}\nhint: the last checkpoint is good; a smaller learning_rate or clip may help, or leaving this window out"
    )]
    Step {
        /// The step, from 1.
        step: u64,
        /// Its epoch, from 1.
        epoch: usize,
        /// Which window.
        source: StepError,
    },
    /// A batch has a loss or a gradient that is no number.
    #[error(
        "step {step} (epoch {epoch}): {what} is not finite; the batch is {windows}\nhint: the last checkpoint is good; a smaller learning_rate or clip may help"
    )]
    NotFinite {
        /// The step, from 1.
        step: u64,
        /// Its epoch, from 1.
        epoch: usize,
        /// What was reckoned.
        what: &'static str,
        /// The batch: scene and step of each.
        windows: String,
    },
    /// The answer of a step has not the form of the parameters.
    #[error("step {0}: the gradient is of another network")]
    Form(u64),
    /// The weights to begin with cannot be read.
    #[error(transparent)]
    Start(Box<StartError>),
    /// The weights cannot be written.
    #[error(transparent)]
    Weights(#[from] WeightsError),
    /// The checkpoint cannot be read.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// It cannot be drawn.
    #[error(transparent)]
    View(#[from] ViewError),
    /// A file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

/// Trains, from the beginning or from a checkpoint.
///
/// # Errors
/// [`TrainingError`].
pub fn train(task: Task<'_>, learner: &mut dyn Learner, watch: &mut dyn Watch) -> Result<Ended, TrainingError> {
    fs::create_dir_all(task.folder).map_err(WriteError::at(task.folder))?;
    let _lock = lock(task.folder)?;
    if task.examples.training().is_empty() {
        return Err(TrainingError::NoWindows(task.examples.len()));
    }
    let state = begin(&task)?;
    whole_file::write(&task.folder.join("settings.toml"), task.settings.text().as_bytes())?;
    let variant = task.settings.variant();
    let frozen = tensors(variant).map(|(name, ..)| !task.settings.cost.learn && is_cost(&name)).collect();
    let metrics = Metrics::open(task.folder, state.epoch, state.step)?;
    let ranges = tensors(variant).map(|(.., range)| range).collect();
    let name = task.folder.file_name().unwrap_or(task.folder.as_os_str()).to_string_lossy().into_owned();
    let windows = if task.rerun { looked_at(&task)? } else { Vec::new() };
    let view = task.rerun.then(|| View::open(task.folder, &name, task.settings, windows, &state)).transpose()?;
    let speed = Speed::default();
    let mut training = Training { task, name, learner, watch, state, metrics, view, ranges, frozen, speed };
    training.run()
}

/// Nobody else may train in the folder while this is held.
pub(crate) fn lock(folder: &Path) -> Result<File, TrainingError> {
    let path = folder.join(".lock");
    let file = File::create(&path).map_err(WriteError::at(&path))?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => Err(TrainingError::Busy(folder.to_owned())),
        Err(TryLockError::Error(error)) => Err(WriteError::at(&path)(error).into()),
    }
}

/// The windows that are drawn: a few of validation, or of training where there are none, from the first to the last.
fn looked_at(task: &Task<'_>) -> Result<Vec<Window>, TrainingError> {
    let Some(all) = [task.examples.validation(), task.examples.training()].into_iter().find(|some| !some.is_empty())
    else {
        return Ok(Vec::new());
    };
    let count = all.len().min(LOOKED_AT);
    let indices: Vec<usize> = (0..count).map(|number| all[number * all.len() / count]).collect();
    windows(task, &indices)
}

fn windows(task: &Task<'_>, indices: &[usize]) -> Result<Vec<Window>, TrainingError> {
    let get = |index: &usize| {
        let index = *index;
        task.examples.get(index).map_err(|source| TrainingError::Window { index, source })
    };
    indices.iter().map(get).collect()
}

/// The checkpoint to begin from.
fn begin(task: &Task<'_>) -> Result<Checkpoint, TrainingError> {
    let path = task.folder.join(CHECKPOINT);
    let windows = task.examples.digest();
    if !path.exists() {
        return Ok(Checkpoint::first(
            task.settings,
            windows,
            start::first(task.settings).map_err(Box::new).map_err(TrainingError::Start)?,
        ));
    }
    if !task.resume {
        return Err(TrainingError::Exists(task.folder.to_owned()));
    }
    let mut found = Checkpoint::read(&path)?;
    let mut differences = task.settings.differences(&found.settings.table());
    if found.windows != windows {
        differences.push(format!("the windows are {windows} here and {} there", found.windows));
    }
    if !differences.is_empty() {
        return Err(TrainingError::Other { path, differences });
    }
    // What may differ is as it is said now.
    found.settings = task.settings.clone();
    Ok(found)
}

struct Training<'a> {
    task: Task<'a>,
    /// The folder's.
    name: String,
    learner: &'a mut dyn Learner,
    watch: &'a mut dyn Watch,
    state: Checkpoint,
    metrics: Metrics,
    /// Where it is drawn.
    view: Option<View>,
    /// Where each tensor's numbers are.
    ranges: Vec<Range<usize>>,
    /// Which tensors are not to be learned.
    frozen: Vec<bool>,
    /// Since the program began this epoch.
    speed: Speed,
}

#[derive(Default)]
struct Speed {
    windows: usize,
    seconds: f64,
}

impl Training<'_> {
    fn run(&mut self) -> Result<Ended, TrainingError> {
        let Settings { epochs, batch, checkpoint_every, .. } = *self.task.settings;
        let steps = self.task.examples.training().len().div_ceil(batch) * epochs;
        self.watch.begin(&self.name, self.task.settings, steps as u64, self.state.step);
        while self.state.epoch < epochs {
            let order = shuffled(self.task.examples.training(), self.task.settings.seed, self.state.epoch);
            for indices in order.chunks(batch).skip(self.state.sums.batches as usize) {
                self.step(indices)?;
                if self.watch.stop() {
                    return self.stopped();
                }
                if checkpoint_every > 0 && self.state.step.is_multiple_of(checkpoint_every) {
                    self.save()?;
                }
            }
            let Some(validation) = self.validate()? else { return self.stopped() };
            self.end_epoch(validation)?;
        }
        Ok(Ended::Finished)
    }

    fn step(&mut self, indices: &[usize]) -> Result<(), TrainingError> {
        let started = Instant::now();
        let settings = self.task.settings;
        let schedule = Schedule::of(settings, self.state.epoch);
        let windows = windows(&self.task, indices)?;
        let seed = Draw::new(settings.seed, Purpose::Dropout, self.state.step).wide();
        let ask = Ask {
            windows: &windows,
            parameters: &self.state.parameters,
            planning: schedule.planning,
            dropout: (settings.dropout > 0.0).then_some(seed),
            wants_gradient: true,
            wants_looks: false,
        };
        let answer = self.learner.step(&ask).map_err(|source| self.refused(source))?;
        let Answer { mut gradient, mut has_gradient, terms, .. } = answer;
        if gradient.len() != self.state.parameters.values().len() || has_gradient.len() != self.ranges.len() {
            return Err(TrainingError::Form(self.state.step + 1));
        }
        for (has, frozen) in has_gradient.iter_mut().zip(&self.frozen) {
            *has &= !frozen;
        }
        let gradient_norm = optimiser::clip(&mut gradient, &self.ranges, &has_gradient, settings.clip);
        for (what, number) in [("the loss", terms.total), ("the gradient", gradient_norm)] {
            if !number.is_finite() {
                return Err(self.not_finite(what, &windows));
            }
        }
        let Checkpoint { parameters, adam, .. } = &mut self.state;
        adam.step(parameters, &gradient, &has_gradient, &schedule, &settings.adam);
        self.learner.take_back(gradient);
        self.state.step += 1;
        self.state.sums.add(&terms, gradient_norm);
        let seconds = started.elapsed().as_secs_f64();
        self.speed.windows += windows.len();
        self.speed.seconds += seconds;
        let (step, epoch) = (self.state.step, self.state.epoch + 1);
        let row = StepRow { step, epoch, schedule, windows: windows.len(), terms, gradient_norm, seconds };
        self.metrics.step(&row)?;
        self.watch.step(&row);
        Ok(())
    }

    /// Sums over the batches of validation; none where somebody stopped it.
    fn validate(&mut self) -> Result<Option<Sums>, TrainingError> {
        let planning = Schedule::of(self.task.settings, self.state.epoch).planning;
        let mut sums = Sums::default();
        for indices in self.task.examples.validation().chunks(VALIDATION_BATCH) {
            let windows = windows(&self.task, indices)?;
            let ask = Ask::without_gradient(&windows, &self.state.parameters, planning);
            let terms = self.learner.step(&ask).map_err(|source| self.refused(source))?.terms;
            if !terms.total.is_finite() {
                return Err(self.not_finite("the validation's loss", &windows));
            }
            sums.add(&terms, 0.0);
            if self.watch.stop() {
                return Ok(None);
            }
        }
        Ok(Some(sums))
    }

    fn end_epoch(&mut self, validation: Sums) -> Result<(), TrainingError> {
        let settings = self.task.settings;
        let speed = std::mem::take(&mut self.speed);
        let row = EpochRow {
            run: self.name.clone(),
            epoch: self.state.epoch + 1,
            schedule: Schedule::of(settings, self.state.epoch),
            train: self.state.sums,
            validation,
            cost_weights: cost::weights(&self.state.parameters, settings.cost.kind),
            windows_per_second: (speed.windows > 0).then(|| speed.windows as f64 / speed.seconds),
        };
        self.metrics.epoch(&row)?;
        self.draw(&row)?;
        self.write_weights(row.epoch)?;
        self.state.epoch += 1;
        self.state.sums = Sums::default();
        self.save()?;
        self.watch.epoch(&row);
        Ok(())
    }

    /// Draws what is known after an epoch, with what comes of a few windows now.
    fn draw(&mut self, row: &EpochRow) -> Result<(), TrainingError> {
        let Some(view) = &mut self.view else { return Ok(()) };
        let parameters = &self.state.parameters;
        let ask = Ask::without_gradient(view.windows(), parameters, row.schedule.planning);
        let looks = match self.learner.step(&Ask { wants_looks: true, ..ask }) {
            Ok(answer) => answer.looks,
            Err(error) => {
                tracing::warn!("epoch {}: no windows are drawn: {error}", row.epoch);
                Vec::new()
            }
        };
        Ok(view.epoch(row.epoch, self.state.step, &looks)?)
    }

    fn write_weights(&self, epoch: usize) -> Result<(), TrainingError> {
        let folder = self.task.folder;
        let Task { settings, examples, .. } = &self.task;
        let weights = self.state.parameters.weights()?.with_cost_form(settings.cost.kind.form());
        let weights = weights.with_features(examples.features());
        let single = weights.write(Precision::Single)?;
        whole_file::write(&folder.join("weights.safetensors"), &single)?;
        if self.task.settings.keep_epochs {
            let kept = folder.join("weights");
            fs::create_dir_all(&kept).map_err(WriteError::at(&kept))?;
            whole_file::write(&kept.join(format!("epoch-{epoch:02}.f32.safetensors")), &single)?;
        }
        let path = folder.join("weights.f16.safetensors");
        match weights.write(Precision::Half) {
            Ok(half) => whole_file::write(&path, &half)?,
            Err(error) => {
                tracing::warn!("no {}: {error}", path.display());
                // One of an epoch before would be taken for this one's.
                match fs::remove_file(&path) {
                    Err(error) if error.kind() != io::ErrorKind::NotFound => Err(WriteError::at(&path)(error))?,
                    _ => {}
                }
            }
        }
        Ok(())
    }

    fn save(&self) -> Result<(), TrainingError> {
        self.metrics.sync()?;
        Ok(self.state.write(&self.task.folder.join(CHECKPOINT))?)
    }

    fn stopped(&self) -> Result<Ended, TrainingError> {
        self.save()?;
        Ok(Ended::Stopped)
    }

    fn refused(&self, source: StepError) -> TrainingError {
        TrainingError::Step { step: self.state.step + 1, epoch: self.state.epoch + 1, source }
    }

    fn not_finite(&self, what: &'static str, windows: &[Window]) -> TrainingError {
        let windows: Vec<String> = windows.iter().map(|window| format!("{}@{}", window.scene, window.step)).collect();
        let (step, epoch) = (self.state.step + 1, self.state.epoch + 1);
        TrainingError::NotFinite { step, epoch, what, windows: windows.join(" ") }
    }
}
