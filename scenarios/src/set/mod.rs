//! Scene sets: where the scenes of a run come from, in a fixed order, each loaded when it is needed.

mod entry;
mod file;
mod found;
mod generate;
mod inputs;
mod logged;
mod scan;

use std::sync::Arc;

use world::scene::{Finding, Scene};

use self::found::Found;
use crate::error::{RecordError, SetError};
use crate::womd;

pub use entry::SceneEntry;
pub use file::{SetFile, TomlProblem};
pub use found::Note;
pub use inputs::GENERATED_TOML;
pub use logged::Logs;

/// An ordered set of scenes with unique ids. Holds no scene; loads them from many threads.
#[derive(Clone, Debug)]
pub struct SceneSet {
    entries: Vec<SceneEntry>,
    notes: Vec<Note>,
}

impl SceneSet {
    /// The scenes of `inputs`: TFRecord files, packed or not, folders (searched through, in order of names), globs, scene-set
    /// TOML files ([`SetFile`]), or the word `demo`. Nothing means `demo`. Their order is that of the inputs, of the names within
    /// a folder or glob, and of the records within a file. A record that is there again with the same bytes counts once.
    ///
    /// Each file is read once: every checksum is verified, every scene's id and hash taken; scenes are decoded by
    /// [`SceneSet::load`] alone.
    ///
    /// # Errors
    /// [`SetError`], for the first thing that is wrong: a set is opened whole or not at all.
    pub fn open(inputs: &[String]) -> Result<Self, SetError> {
        let (set, bad) = Self::survey(inputs)?;
        match bad.into_iter().next() {
            Some(error) => Err(error.into()),
            None => Ok(set),
        }
    }

    /// As [`SceneSet::open`], but goes on past records that give no scene: the scenes, of which there may be none, and the errors.
    ///
    /// # Errors
    /// [`SetError`] where an input as a whole is of no use.
    pub fn survey(inputs: &[String]) -> Result<(Self, Vec<RecordError>), SetError> {
        let demo = ["demo".to_owned()];
        let inputs = if inputs.is_empty() { &demo } else { inputs };
        let mut found = Found::default();
        for input in inputs {
            inputs::open(input, &mut found)?;
        }
        found.settle()?;
        let Found { entries, bad, notes } = found;
        if entries.is_empty() && bad.is_empty() {
            return Err(SetError::NoScenes { inputs: inputs.to_vec() });
        }
        Ok((Self { entries, notes }, bad))
    }

    /// What was done about the inputs and should be told: files passed over, records that count once.
    #[must_use]
    pub fn notes(&self) -> &[Note] {
        &self.notes
    }

    /// The scenes, in order.
    #[must_use]
    pub fn entries(&self) -> &[SceneEntry] {
        &self.entries
    }

    /// The set of these scenes alone, by their places here, in the order given; places that are none are passed over.
    #[must_use]
    pub fn only(&self, places: &[usize]) -> Self {
        let entries = places.iter().filter_map(|place| self.entries.get(*place).cloned());
        Self { entries: entries.collect(), notes: Vec::new() }
    }

    /// Loads scene `index`: the checked scene, and what was found odd in it and mended.
    ///
    /// # Errors
    /// [`SetError`] if it cannot be read, has changed since the set was opened, or cannot be used.
    pub fn load(&self, index: usize) -> Result<(Arc<Scene>, Vec<Finding>), SetError> {
        let scenes = self.entries.len();
        let entry = self.entries.get(index).ok_or(SetError::Index { index, scenes })?;
        let (scene, findings) = entry.read(womd::read)?;
        Ok((Arc::new(scene), findings))
    }

    /// The payload of scene `index` as it lies in its file, to be copied to another.
    ///
    /// # Errors
    /// [`SetError`] if it cannot be read or has changed since the set was opened.
    pub fn payload(&self, index: usize) -> Result<Vec<u8>, SetError> {
        let scenes = self.entries.len();
        let entry = self.entries.get(index).ok_or(SetError::Index { index, scenes })?;
        entry.read(|payload| Ok(payload.to_vec()))
    }
}
