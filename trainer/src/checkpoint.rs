//! All that a training is at a moment, in one safetensors file: what goes on from it ends as if it had never stopped.
//!
//! | tensor | type | what |
//! | --- | --- | --- |
//! | NAME | F32 | a parameter, under PyTorch's name |
//! | `exp_avg.NAME`, `exp_avg_sq.NAME` | F32 | its moments, as PyTorch calls them |
//! | `adam.steps` | U64 | steps by tensor, in the order of the layout |
//! | `epoch.sums` | F64 | sums over the batches of the epoch that runs: losses and metrics ([`Terms`]), then the gradient's norm |
//!
//! The metadata has one key, `checkpoint`: [`Header`] as TOML.

use std::borrow::Cow;
use std::collections::HashMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use safetensors::SafeTensors;
use safetensors::tensor::{Dtype, View};
use serde::{Deserialize, Serialize};
use thiserror::Error;
use toml::Table;

use crate::optimiser::Adam;
use crate::parameters::{Parameters, tensors};
use crate::settings::Settings;
use crate::step::{Sums, Terms};
use crate::whole_file::{self, WriteError};

/// The form of file that is written, and read.
const FORMAT: u32 = 1;
const KEY: &str = "checkpoint";
pub(crate) const FIRST: &str = "exp_avg.";
pub(crate) const SECOND: &str = "exp_avg_sq.";
const STEPS: &str = "adam.steps";
pub(crate) const SUMS: &str = "epoch.sums";

/// Where a training is, and of what.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Header {
    /// The form of the file.
    pub format: u32,
    /// Steps that are done.
    pub step: u64,
    /// The epoch that runs, from 0; after the last one, their number.
    pub epoch: usize,
    /// Batches of it that are done.
    pub position: u64,
    /// The digest of the windows.
    pub windows: String,
    /// All settings.
    pub settings: Table,
}

/// All that a training is at a moment.
#[derive(Clone, Debug, PartialEq)]
pub struct Checkpoint {
    /// Steps that are done.
    pub step: u64,
    /// The epoch that runs, from 0.
    pub epoch: usize,
    /// The digest of the windows.
    pub windows: String,
    /// All settings.
    pub settings: Settings,
    /// What is learned.
    pub parameters: Parameters,
    /// The optimiser.
    pub adam: Adam,
    /// Over the batches of the epoch that runs.
    pub sums: Sums,
}

/// Why a file is no checkpoint.
#[derive(Debug, Error)]
pub enum CheckpointError {
    /// It cannot be read.
    #[error("{}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// It is none.
    #[error("{} is no checkpoint: {problem}\nhint: a training writes one as checkpoint.safetensors into its folder", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        problem: String,
    },
}

impl Checkpoint {
    /// Before the first step.
    #[must_use]
    pub fn first(settings: &Settings, windows: String, parameters: Parameters) -> Self {
        let adam = Adam::new(parameters.variant());
        Self { step: 0, epoch: 0, windows, settings: settings.clone(), parameters, adam, sums: Sums::default() }
    }

    /// Writes it, whole or not at all.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn write(&self, path: &Path) -> Result<(), WriteError> {
        let header = Header {
            format: FORMAT,
            step: self.step,
            epoch: self.epoch,
            position: self.sums.batches,
            windows: self.windows.clone(),
            settings: self.settings.table(),
        };
        let mut entries = Vec::new();
        for (name, shape, range) in tensors(self.parameters.variant()) {
            entries.push((format!("{FIRST}{name}"), Numbers::F32(shape.clone(), &self.adam.first[range.clone()])));
            entries.push((format!("{SECOND}{name}"), Numbers::F32(shape.clone(), &self.adam.second[range.clone()])));
            entries.push((name, Numbers::F32(shape, &self.parameters.values()[range])));
        }
        let steps = self.adam.steps.iter().flat_map(|step| step.to_le_bytes()).collect();
        entries.push((STEPS.to_owned(), Numbers::Bytes(Dtype::U64, [self.adam.steps.len()], steps)));
        let sums = self.sums.terms.iter().chain([&self.sums.gradient_norm]);
        let sums = sums.flat_map(|sum| sum.to_le_bytes()).collect();
        entries.push((SUMS.to_owned(), Numbers::Bytes(Dtype::F64, [Terms::COUNT + 1], sums)));
        whole_file::write_by(path, |path| {
            // One key: more would be written in the order of a hash.
            let text = toml::to_string(&header).map_err(io::Error::other)?;
            let metadata = HashMap::from([(KEY.to_owned(), text)]);
            safetensors::serialize_to_file(entries, Some(metadata), path).map_err(io::Error::other)
        })
    }

    /// Reads one.
    ///
    /// # Errors
    /// [`CheckpointError`] tells what is wrong with the file.
    pub fn read(path: &Path) -> Result<Self, CheckpointError> {
        let bytes = fs::read(path).map_err(|source| CheckpointError::Read { path: path.to_owned(), source })?;
        Self::of_bytes(&bytes).map_err(|problem| CheckpointError::Format { path: path.to_owned(), problem })
    }

    fn of_bytes(bytes: &[u8]) -> Result<Self, String> {
        let (_, metadata) = SafeTensors::read_metadata(bytes).map_err(|error| error.to_string())?;
        let text = metadata.metadata().as_ref().and_then(|metadata| metadata.get(KEY));
        let text = text.ok_or("it has weights, but not where their training was")?;
        let format: Table = toml::from_str(text).map_err(|error| error.message().to_owned())?;
        if format.get("format").and_then(toml::Value::as_integer) != Some(FORMAT.into()) {
            return Err("it is of another version of this program".to_owned());
        }
        let header: Header = format.try_into().map_err(|error| error.message().to_owned())?;
        let settings = Settings::of_table(header.settings).map_err(|error| error.to_string())?;
        let file = SafeTensors::deserialize(bytes).map_err(|error| error.to_string())?;
        let variant = settings.variant();
        let mut parameters = Parameters::zeros(variant);
        let mut adam = Adam::new(variant);
        for (name, shape, range) in tensors(variant) {
            fill(&file, &name, &shape, &mut parameters.values_mut()[range.clone()])?;
            fill(&file, &format!("{FIRST}{name}"), &shape, &mut adam.first[range.clone()])?;
            fill(&file, &format!("{SECOND}{name}"), &shape, &mut adam.second[range])?;
        }
        let steps = data(&file, STEPS, Dtype::U64, &[adam.steps.len()])?;
        for (step, bytes) in adam.steps.iter_mut().zip(steps.as_chunks::<8>().0) {
            *step = u64::from_le_bytes(*bytes);
        }
        let numbers = data(&file, SUMS, Dtype::F64, &[Terms::COUNT + 1])?;
        let mut numbers = numbers.as_chunks::<8>().0.iter().map(|bytes| f64::from_le_bytes(*bytes));
        let mut sums = Sums { batches: header.position, ..Sums::default() };
        sums.terms.fill_with(|| numbers.next().unwrap_or_default());
        sums.gradient_norm = numbers.next().unwrap_or_default();
        let Header { step, epoch, windows, .. } = Header { settings: Table::new(), ..header };
        Ok(Self { step, epoch, windows, settings, parameters, adam, sums })
    }
}

/// The numbers of a tensor as the file has them.
pub(crate) enum Numbers<'a> {
    F32(Vec<usize>, &'a [f32]),
    Bytes(Dtype, [usize; 1], Vec<u8>),
}

impl View for Numbers<'_> {
    fn dtype(&self) -> Dtype {
        match self {
            Self::F32(..) => Dtype::F32,
            Self::Bytes(dtype, ..) => *dtype,
        }
    }

    fn shape(&self) -> &[usize] {
        match self {
            Self::F32(shape, _) => shape,
            Self::Bytes(_, shape, _) => shape,
        }
    }

    fn data(&self) -> Cow<'_, [u8]> {
        match self {
            Self::F32(_, values) => {
                let mut bytes = vec![0; 4 * values.len()];
                for (bytes, value) in bytes.as_chunks_mut::<4>().0.iter_mut().zip(*values) {
                    *bytes = value.to_le_bytes();
                }
                bytes.into()
            }
            Self::Bytes(.., bytes) => bytes.into(),
        }
    }

    fn data_len(&self) -> usize {
        match self {
            Self::F32(_, values) => 4 * values.len(),
            Self::Bytes(.., bytes) => bytes.len(),
        }
    }
}

pub(crate) fn data<'a>(file: &SafeTensors<'a>, name: &str, dtype: Dtype, shape: &[usize]) -> Result<&'a [u8], String> {
    let view = file.tensor(name).map_err(|_| format!("tensor {name} is missing"))?;
    if (view.dtype(), view.shape()) != (dtype, shape) {
        let (got, of) = (view.dtype(), view.shape());
        return Err(format!("tensor {name} is {got:?} of shape {of:?}: {dtype:?} of {shape:?} is expected"));
    }
    Ok(view.data())
}

pub(crate) fn fill(file: &SafeTensors<'_>, name: &str, shape: &[usize], values: &mut [f32]) -> Result<(), String> {
    let bytes = data(file, name, Dtype::F32, shape)?;
    for (value, bytes) in values.iter_mut().zip(bytes.as_chunks::<4>().0) {
        *value = f32::from_le_bytes(*bytes);
    }
    match values.iter().find(|value| !value.is_finite()) {
        Some(value) => Err(format!("tensor {name} holds {value}")),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use network::weights::{Precision, Weights};

    use super::*;
    use crate::settings::Mode;

    fn example() -> Checkpoint {
        let settings = Settings { mode: Mode::Il, ..Settings::default() };
        let parameters = Parameters::of(&Weights::formula(settings.variant()));
        let mut checkpoint = Checkpoint::first(&settings, "abc".to_owned(), parameters);
        (checkpoint.step, checkpoint.epoch) = (45, 1);
        for (index, (first, second)) in checkpoint.adam.first.iter_mut().zip(&mut checkpoint.adam.second).enumerate() {
            (*first, *second) = (-(index as f32), 1.0 / (1.0 + index as f32));
        }
        checkpoint.adam.steps[3] = 45;
        checkpoint.sums.add(&Terms { total: 0.1, cost_weights: [0.3; 9], ..Terms::default() }, 7.0);
        checkpoint
    }

    #[test]
    fn what_is_written_is_read_again_and_gives_the_same_bytes() {
        let folder = tempfile::tempdir().unwrap();
        let (one, two) = (folder.path().join("one"), folder.path().join("two"));
        let checkpoint = example();
        checkpoint.write(&one).unwrap();
        let read = Checkpoint::read(&one).unwrap();
        assert_eq!(read, checkpoint);
        read.write(&two).unwrap();
        assert!(fs::read(&one).unwrap() == fs::read(&two).unwrap());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2, "nothing is left behind");
    }

    #[test]
    fn what_is_no_checkpoint_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        let told = |bytes: &[u8]| {
            fs::write(&path, bytes).unwrap();
            Checkpoint::read(&path).unwrap_err().to_string()
        };
        let weights = Weights::formula(Settings::default().variant()).write(Precision::Half).unwrap();
        assert!(told(&weights).contains("it has weights, but not where their training was"));
        assert!(told(b"{}").contains("is no checkpoint"));
        example().write(&path).unwrap();
        let mut bytes = fs::read(&path).unwrap();
        let end = bytes.len();
        bytes[end - 4..].copy_from_slice(&f32::NAN.to_le_bytes());
        assert!(told(&bytes).contains("holds NaN"));
        assert!(told(&bytes[..end - 1]).contains("is no checkpoint"));
        assert!(Checkpoint::read(&folder.path().join("none")).unwrap_err().to_string().contains("none"));
    }
}
