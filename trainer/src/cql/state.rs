//! All that a training is at a moment, in one safetensors file, as [`crate::checkpoint`] does it.
//!
//! | tensor | what |
//! | --- | --- |
//! | `policy.NAME`, `critic.0.NAME`, `critic.1.NAME`, `log_temperature`, `log_alpha` | what is learned |
//! | `exp_avg.` and `exp_avg_sq.` of each | its moments, as PyTorch calls them |
//! | `target.0.NAME`, `target.1.NAME` | the critics that targets are of |
//! | `epoch.sums` | sums over the batches of the epoch that runs |

use std::collections::HashMap;
use std::fs;
use std::io;
use std::path::Path;

use network::cql::{Shape, write};
use network::weights::{Precision, WeightsError};
use safetensors::SafeTensors;
use safetensors::tensor::Dtype;
use serde::{Deserialize, Serialize};
use toml::Table;

use super::learner::Report;
use super::networks::{Networks, Tensor};
use super::settings::Settings;
use crate::checkpoint::{CheckpointError, FIRST, Numbers, SECOND, SUMS, data, fill};
use crate::optimiser::adam;
use crate::whole_file::{WriteError, write_by};

const KEY: &str = "cql";

/// Numbers that Adam moves.
#[derive(Clone, Debug, PartialEq)]
pub struct Learned {
    /// They.
    pub values: Vec<f32>,
    /// Running means of the gradient.
    pub first: Vec<f32>,
    /// Running means of its squares.
    pub second: Vec<f32>,
}

/// All that a training is at a moment.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// Steps that are done.
    pub step: u64,
    /// The epoch that runs, from 0.
    pub epoch: usize,
    /// Batches of it that are done.
    pub position: usize,
    /// The digest of the transitions.
    pub transitions: String,
    /// All settings.
    pub settings: Settings,
    /// The policy.
    pub policy: Learned,
    /// Both critics.
    pub critics: Learned,
    /// Those that targets are of.
    pub targets: Vec<f32>,
    /// What entropy is worth, its logarithm.
    pub temperature: Learned,
    /// How much the conservative term counts, its logarithm.
    pub alpha: Learned,
    /// Over the batches of the epoch that runs.
    pub sums: Report,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    step: u64,
    epoch: usize,
    position: usize,
    transitions: String,
    settings: Table,
}

impl Learned {
    /// These, before the first step.
    #[must_use]
    pub fn new(values: Vec<f32>) -> Self {
        Self { first: vec![0.0; values.len()], second: vec![0.0; values.len()], values }
    }

    /// One step of Adam, the `number`th, against the gradient.
    pub fn step(&mut self, gradient: &[f32], rate: f64, settings: &Settings, number: u64) {
        adam(&settings.adam, rate, number, [&mut self.values, &mut self.first, &mut self.second], gradient);
    }
}

impl State {
    /// Before the first step.
    #[must_use]
    pub fn first(networks: &Networks, settings: &Settings, transitions: String) -> Self {
        let critics = networks.first(&networks.critics, settings.seed, 1);
        let logarithm = |value: f64| Learned::new(vec![libm::log(value) as f32]);
        Self {
            step: 0,
            epoch: 0,
            position: 0,
            transitions,
            policy: Learned::new(networks.first(&networks.policy, settings.seed, 0)),
            targets: critics.clone(),
            critics: Learned::new(critics),
            temperature: logarithm(settings.initial_temperature),
            alpha: logarithm(settings.initial_alpha),
            sums: Report::default(),
            settings: settings.clone(),
        }
    }

    /// The policy as the driver reads it.
    ///
    /// # Errors
    /// [`WeightsError`] where a number cannot be written.
    pub fn weights(&self, networks: &Networks, precision: Precision) -> Result<Vec<u8>, WeightsError> {
        let parts: Vec<&[f32]> =
            networks.policy.iter().map(|tensor| &self.policy.values[tensor.place.clone()]).collect();
        write(&networks.shape, &parts, precision)
    }

    /// Writes it, whole or not at all.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn write(&self, networks: &Networks, path: &Path) -> Result<(), WriteError> {
        let header = Header {
            step: self.step,
            epoch: self.epoch,
            position: self.position,
            transitions: self.transitions.clone(),
            settings: self.settings.table(),
        };
        let mut entries = Vec::new();
        let rows = [&self.policy, &self.critics, &self.temperature, &self.alpha];
        for (name, tensor, row) in learned(networks) {
            let Learned { values, first, second } = rows[row];
            for (start, row) in [("", values), (FIRST, first), (SECOND, second)] {
                let numbers = Numbers::F32(tensor.shape.clone(), &row[tensor.place.clone()]);
                entries.push((format!("{start}{name}"), numbers));
            }
        }
        for tensor in &networks.critics {
            entries.push((target(tensor), Numbers::F32(tensor.shape.clone(), &self.targets[tensor.place.clone()])));
        }
        let sums = self.sums.0.iter().flat_map(|sum| sum.to_le_bytes()).collect();
        entries.push((SUMS.to_owned(), Numbers::Bytes(Dtype::F64, [self.sums.0.len()], sums)));
        write_by(path, |path| {
            // One key: more would be written in the order of a hash.
            let text = toml::to_string(&header).map_err(io::Error::other)?;
            let metadata = HashMap::from([(KEY.to_owned(), text)]);
            safetensors::serialize_to_file(entries, Some(metadata), path).map_err(io::Error::other)
        })
    }

    /// Reads one, of networks of these layers.
    ///
    /// # Errors
    /// [`CheckpointError`] tells what is wrong with the file.
    pub fn read(shape: &Shape, path: &Path) -> Result<Self, CheckpointError> {
        let bytes = fs::read(path).map_err(|source| CheckpointError::Read { path: path.to_owned(), source })?;
        Self::of_bytes(shape, &bytes).map_err(|problem| CheckpointError::Format { path: path.to_owned(), problem })
    }

    fn of_bytes(shape: &Shape, bytes: &[u8]) -> Result<Self, String> {
        let (_, metadata) = SafeTensors::read_metadata(bytes).map_err(|error| error.to_string())?;
        let text = metadata.metadata().as_ref().and_then(|metadata| metadata.get(KEY));
        let text = text.ok_or("it is of no training of cql")?;
        let header: Header = toml::from_str(text).map_err(|error| error.message().to_owned())?;
        let settings = Settings::of_table(header.settings).map_err(|error| error.to_string())?;
        let file = SafeTensors::deserialize(bytes).map_err(|error| error.to_string())?;
        let networks = Networks::new(shape.clone());
        let mut state = Self::first(&networks, &settings, header.transitions);
        (state.step, state.epoch, state.position) = (header.step, header.epoch, header.position);
        let rows = [&mut state.policy, &mut state.critics, &mut state.temperature, &mut state.alpha];
        for (name, tensor, row) in learned(&networks) {
            let Learned { values, first, second } = &mut *rows[row];
            for (start, row) in [("", values), (FIRST, first), (SECOND, second)] {
                fill(&file, &format!("{start}{name}"), &tensor.shape, &mut row[tensor.place.clone()])?;
            }
        }
        for tensor in &networks.critics {
            fill(&file, &target(tensor), &tensor.shape, &mut state.targets[tensor.place.clone()])?;
        }
        let sums = data(&file, SUMS, Dtype::F64, &[state.sums.0.len()])?;
        for (sum, bytes) in state.sums.0.iter_mut().zip(sums.as_chunks::<8>().0) {
            *sum = f64::from_le_bytes(*bytes);
        }
        Ok(state)
    }
}

fn target(tensor: &Tensor) -> String {
    tensor.name.replacen("critic.", "target.", 1)
}

/// All that is learned: its name, where it is in its row, and which row that is.
fn learned(networks: &Networks) -> Vec<(String, Tensor, usize)> {
    let one = Tensor { name: String::new(), shape: vec![1], place: 0..1 };
    let policy = networks.policy.iter().map(|tensor| (format!("policy.{}", tensor.name), tensor.clone(), 0));
    let critics = networks.critics.iter().map(|tensor| (tensor.name.clone(), tensor.clone(), 1));
    let both = [("log_temperature".to_owned(), one.clone(), 2), ("log_alpha".to_owned(), one, 3)];
    policy.chain(critics).chain(both).collect()
}
