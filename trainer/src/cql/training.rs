//! The loop: epochs of shuffled batches, and after each how far the policy is from what was driven in transitions that it has not learned from.
//!
//! ```text
//! FOLDER/settings.toml            all settings, resolved
//!        checkpoint.safetensors   all that goes on
//!        metrics.csv, steps.csv   a row an epoch, a row a step
//!        weights.safetensors      the policy after the last epoch that is done, and weights.f16.safetensors
//! ```
//!
//! A step depends on the checkpoint before it and on its number alone: order and noise are drawn anew from seed and number. So it does not matter where a
//! training is stopped, or how.

use std::path::Path;
use std::time::Instant;

use network::cql::Shape;
use network::weights::Precision;
use rayon::prelude::*;

use super::learner::{Batch, Noise, Report, greedy, step};
use super::networks::Networks;
use super::settings::Settings;
use super::state::State;
use crate::metrics::{Rows, number};
use crate::order::shuffled;
use crate::training::{CHECKPOINT, Ended, TrainingError, lock};
use crate::whole_file::{self, WriteError};
use crate::windows::{Experience, Transition};

/// Pictures of validation at a time.
const AT_A_TIME: usize = 16;

/// What is to be trained.
#[derive(Clone, Copy)]
pub struct Task<'a> {
    /// The layers.
    pub shape: &'a Shape,
    /// How.
    pub settings: &'a Settings,
    /// On what.
    pub experience: &'a dyn Experience,
    /// Where to; made if it is not there.
    pub folder: &'a Path,
    /// Whether to go on from the checkpoint that is there, if there is one.
    pub resume: bool,
}

/// What an epoch comes to.
#[derive(Clone, Debug, PartialEq)]
pub struct EpochMeans {
    /// Which, from 1.
    pub epoch: usize,
    /// Means over its steps.
    pub report: Report,
    /// Mean distances of the policy's actions from those of validation, number by number; none where there is no validation.
    pub errors: Vec<f64>,
    /// Transitions a second; none where no step was made since the program began.
    pub speed: Option<f64>,
}

/// Who looks on.
pub trait Watch {
    /// It begins: of so many epochs and steps so many steps are done.
    fn begin(&mut self, _name: &str, _epochs: usize, _steps: u64, _done: u64) {}
    /// A step is done, of the epoch from 1, at so many transitions a second.
    fn step(&mut self, _epoch: usize, _report: &Report, _speed: f64) {}
    /// An epoch is done.
    fn epoch(&mut self, _row: &EpochMeans) {}
    /// Whether to stop here, with a checkpoint.
    fn stop(&self) -> bool {
        false
    }
}

/// Trains, from the beginning or from a checkpoint.
///
/// # Errors
/// [`TrainingError`].
pub fn train(task: Task<'_>, watch: &mut dyn Watch) -> Result<Ended, TrainingError> {
    std::fs::create_dir_all(task.folder).map_err(WriteError::at(task.folder))?;
    let _lock = lock(task.folder)?;
    let networks = Networks::new(task.shape.clone());
    let steps = task.experience.training().len() / task.settings.batch_size;
    if steps == 0 {
        return Err(TrainingError::NoTransitions(task.experience.training().len(), task.settings.batch_size));
    }
    let state = begin(&task, &networks)?;
    let text = toml::to_string(task.settings).unwrap_or_default();
    whole_file::write(&task.folder.join("settings.toml"), text.as_bytes())?;
    let names = Report::NAMES.join(",");
    let errors: String = (0..task.shape.actions).map(|number| format!(",error_{number}")).collect();
    let rows = |name: &str, header: String, last| Rows::open(task.folder.join(name), &header, 0, last);
    let step_rows = rows("steps.csv", format!("step,epoch,{names},seconds"), state.step)?;
    let epoch_rows = rows("metrics.csv", format!("epoch,{names}{errors},transitions_per_second"), state.epoch as u64)?;
    let name = task.folder.file_name().unwrap_or(task.folder.as_os_str()).to_string_lossy().into_owned();
    watch.begin(&name, task.settings.epochs, (steps * task.settings.epochs) as u64, state.step);
    Training { task, networks, state, watch, step_rows, epoch_rows, done: (0, 0.0) }.run()
}

/// The state to begin from.
fn begin(task: &Task<'_>, networks: &Networks) -> Result<State, TrainingError> {
    let path = task.folder.join(CHECKPOINT);
    let digest = task.experience.digest();
    if !path.exists() {
        return Ok(State::first(networks, task.settings, digest));
    }
    if !task.resume {
        return Err(TrainingError::Exists(task.folder.to_owned()));
    }
    let mut found = State::read(task.shape, &path)?;
    let mut differences = task.settings.differences(&found.settings.table());
    if found.transitions != digest {
        differences.push(format!("the transitions are {digest} here and {} there", found.transitions));
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
    networks: Networks,
    state: State,
    watch: &'a mut dyn Watch,
    step_rows: Rows,
    epoch_rows: Rows,
    /// Transitions and seconds since the program began this epoch.
    done: (usize, f64),
}

impl Training<'_> {
    fn run(&mut self) -> Result<Ended, TrainingError> {
        let Settings { epochs, batch_size, checkpoint_every, seed, .. } = *self.task.settings;
        while self.state.epoch < epochs {
            let order = shuffled(self.task.experience.training(), seed, self.state.epoch);
            for indices in order.chunks_exact(batch_size).skip(self.state.position) {
                self.step(indices)?;
                if self.watch.stop() {
                    self.save()?;
                    return Ok(Ended::Stopped);
                }
                if checkpoint_every > 0 && self.state.step.is_multiple_of(checkpoint_every) {
                    self.save()?;
                }
            }
            self.end_epoch()?;
        }
        Ok(Ended::Finished)
    }

    fn step(&mut self, indices: &[usize]) -> Result<(), TrainingError> {
        let started = Instant::now();
        let batch = Batch { transitions: transitions(self.task.experience, indices)? };
        let actions = self.networks.shape.actions;
        let noise = Noise::draw(self.task.settings, indices.len(), actions, self.state.step + 1);
        let report = step(&self.networks, self.task.settings, &mut self.state, &batch, &noise);
        if !report.is_finite() {
            return Err(TrainingError::NotFinite {
                step: self.state.step,
                epoch: self.state.epoch + 1,
                what: "what a step reports",
                windows: format!("transitions {indices:?}"),
            });
        }
        self.state.position += 1;
        self.state.sums.0.iter_mut().zip(report.0).for_each(|(sum, value)| *sum += value);
        let seconds = started.elapsed().as_secs_f64();
        self.done = (self.done.0 + indices.len(), self.done.1 + seconds);
        let (number, epoch) = (self.state.step, self.state.epoch + 1);
        self.step_rows.add(&format!("{number},{epoch},{},{seconds:.4}", numbers(&report.0)))?;
        self.watch.step(epoch, &report, indices.len() as f64 / seconds);
        Ok(())
    }

    fn end_epoch(&mut self) -> Result<(), TrainingError> {
        let steps = self.state.position as f64;
        let speed = (self.done.0 > 0).then(|| self.done.0 as f64 / self.done.1);
        let errors = errors(self.task.experience, &self.networks, &self.state)?;
        let row = EpochMeans {
            epoch: self.state.epoch + 1,
            report: Report(self.state.sums.0.map(|sum| sum / steps)),
            errors,
            speed,
        };
        let errors = if row.errors.is_empty() {
            vec![String::new(); self.networks.shape.actions].join(",")
        } else {
            numbers(&row.errors)
        };
        let speed = speed.map_or_else(String::new, |speed| format!("{speed:.2}"));
        self.epoch_rows.add(&format!("{},{},{errors},{speed}", row.epoch, numbers(&row.report.0)))?;
        for (name, precision) in
            [("weights.safetensors", Precision::Single), ("weights.f16.safetensors", Precision::Half)]
        {
            let bytes = self.state.weights(&self.networks, precision)?;
            whole_file::write(&self.task.folder.join(name), &bytes)?;
        }
        self.state.epoch += 1;
        (self.state.position, self.state.sums, self.done) = (0, Report::default(), (0, 0.0));
        self.save()?;
        self.watch.epoch(&row);
        Ok(())
    }

    fn save(&self) -> Result<(), TrainingError> {
        self.step_rows.sync()?;
        self.epoch_rows.sync()?;
        Ok(self.state.write(&self.networks, &self.task.folder.join(CHECKPOINT))?)
    }
}

fn transitions(experience: &dyn Experience, indices: &[usize]) -> Result<Vec<Transition>, TrainingError> {
    let get = |index: &usize| {
        let index = *index;
        experience.get(index).map_err(|source| TrainingError::Window { index, source })
    };
    indices.par_iter().map(get).collect()
}

/// Mean distances of the policy's actions from those of validation, number by number; none where there is no validation.
fn errors(experience: &dyn Experience, networks: &Networks, state: &State) -> Result<Vec<f64>, TrainingError> {
    let (validation, actions) = (experience.validation(), networks.shape.actions);
    let one = |indices: &[usize]| -> Result<Vec<f64>, TrainingError> {
        let transitions = transitions(experience, indices)?;
        let pictures: Vec<&[u8]> = transitions.iter().map(|transition| &*transition.state).collect();
        let done = greedy(networks, &state.policy, &pictures);
        let mut sums = vec![0.0; actions];
        for (transition, done) in transitions.iter().zip(done.chunks_exact(actions)) {
            for (sum, (own, done)) in sums.iter_mut().zip(transition.action.iter().zip(done)) {
                *sum += f64::from(own - done).abs();
            }
        }
        Ok(sums)
    };
    let all: Vec<Vec<f64>> = validation.par_chunks(AT_A_TIME).map(one).collect::<Result<_, _>>()?;
    if validation.is_empty() {
        return Ok(Vec::new());
    }
    let mean = |number: usize| all.iter().map(|sums| sums[number]).sum::<f64>() / validation.len() as f64;
    Ok((0..actions).map(mean).collect())
}

fn numbers(values: &[f64]) -> String {
    values.iter().map(|value| number(*value)).collect::<Vec<_>>().join(",")
}
