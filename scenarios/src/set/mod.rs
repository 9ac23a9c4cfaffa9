//! Scene sets: where the scenes of a run come from, in a fixed order, each loaded when it is needed.

mod entry;
mod file;
mod found;
mod generate;
pub(crate) mod index;
mod inputs;
mod logged;
mod pickles;
mod scan;
mod tables;
mod whole;

use std::path::Path;
use std::sync::{Arc, OnceLock};

use rayon::prelude::*;
use world::scene::{Finding, Scene};

use self::entry::Hash;
use self::found::Found;
use crate::error::{RecordError, SetError};
use crate::source::Source;
use crate::{tf_example, womd};

pub use entry::SceneEntry;
pub use file::{SetFile, TomlProblem};
pub use found::Note;
pub use index::IndexError;
pub use inputs::GENERATED_TOML;
pub use logged::Logs;

/// An ordered set of scenes with unique ids. Holds no scene; loads them from many threads.
#[derive(Clone, Debug)]
pub struct SceneSet {
    entries: Vec<SceneEntry>,
    /// Of each entry, once its bytes were seen.
    hashes: Vec<OnceLock<Hash>>,
    notes: Vec<Note>,
}

impl SceneSet {
    /// The scenes of `inputs`: TFRecord files, packed or not, ScenarioNet's pickles, Argoverse 2's tables, folders (searched through, in order of
    /// names), globs, scene-set TOML files ([`SetFile`]), indices ([`SceneSet::index`]), or the word `demo`. Nothing means `demo`. Their order is that
    /// of the inputs, of the names within a folder or glob, and of the records within a file. A record that is there again with the same bytes counts once.
    ///
    /// Of each record of a plain file the length and its checksum are read, and as much as it takes to come to its id; a packed file is
    /// unpacked, and its payloads' checksums verified too. A damaged payload of a plain file, and a generated scene that cannot be made,
    /// are found by [`SceneSet::load`], or for all scenes by [`SceneSet::verify`].
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
        let Found { mut entries, bad, notes } = found;
        if entries.is_empty() && bad.is_empty() {
            return Err(SetError::NoScenes { inputs: inputs.to_vec() });
        }
        entries.shrink_to_fit();
        Ok((Self { hashes: vec![OnceLock::new(); entries.len()], entries, notes }, bad))
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
        let of = |place: &usize| Some((self.entries.get(*place)?.clone(), self.hashes[*place].clone()));
        let (entries, hashes) = places.iter().filter_map(of).unzip();
        Self { entries, hashes, notes: Vec::new() }
    }

    /// Loads scene `index`: the checked scene, and what was found odd in it and mended.
    ///
    /// # Errors
    /// [`SetError`] if it cannot be read, is damaged, has changed since the set was opened, or cannot be used.
    pub fn load(&self, index: usize) -> Result<(Arc<Scene>, Vec<Finding>), SetError> {
        let entry = self.entry(index)?;
        let (scene, findings) = entry.read(|bytes| entry.decode(bytes))??;
        Ok((Arc::new(scene), findings))
    }

    /// As [`SceneSet::load`], and takes the hash of what it reads, for [`SceneSet::sha256`] to tell.
    ///
    /// # Errors
    /// As [`SceneSet::load`].
    pub fn load_hashed(&self, index: usize) -> Result<(Arc<Scene>, Vec<Finding>), SetError> {
        let entry = self.entry(index)?;
        let (scene, findings) = entry.read(|bytes| {
            self.hashes[index].get_or_init(|| Hash::of(bytes));
            entry.decode(bytes)
        })??;
        Ok((Arc::new(scene), findings))
    }

    /// SHA-256 of the payload of scene `index`, of the whole pickle, or of the table and the map behind it, in hexadecimal digits: which scene it is,
    /// whatever its file is called. It is read for that, unless it was before.
    ///
    /// # Errors
    /// [`SetError`] if it cannot be read, is damaged, or has changed since the set was opened.
    pub fn sha256(&self, index: usize) -> Result<String, SetError> {
        if let Some(hash) = self.known_sha256(index) {
            return Ok(hash);
        }
        let hash = self.entry(index)?.hash()?;
        Ok(self.hashes[index].get_or_init(|| hash).to_string())
    }

    /// The same as far as it is known without reading.
    #[must_use]
    pub fn known_sha256(&self, index: usize) -> Option<String> {
        self.hashes.get(index)?.get().map(ToString::to_string)
    }

    /// Reads every scene's bytes, on all cores: verifies their checksums, and takes their hashes. Scenes are not decoded.
    ///
    /// # Errors
    /// [`SetError`] of the first that is damaged or cannot be made.
    pub fn verify(&self) -> Result<(), SetError> {
        let wrong = (0..self.entries.len()).into_par_iter().map(|index| self.sha256(index).err());
        wrong.find_map_first(|error| error).map_or(Ok(()), Err)
    }

    /// The payload of scene `index` as it lies in its file, to be copied to another; of what lies in another format the scene as WOMD's message.
    ///
    /// # Errors
    /// [`SetError`] if it cannot be read, is damaged, or has changed since the set was opened.
    pub fn payload(&self, index: usize) -> Result<Vec<u8>, SetError> {
        let entry = self.entry(index)?;
        let made = || self.load(index).map(|(scene, _)| womd::write(&scene));
        match entry.source {
            Source::Pickle(_) | Source::Table { .. } => made(),
            _ => {
                let payload = entry.read(<[u8]>::to_vec)?;
                if tf_example::looks_like_example(&payload) { made() } else { Ok(payload) }
            }
        }
    }

    /// The set's index, to be written to a file in `folder`: an input that stands for this set and is opened without searching, skimming or
    /// unpacking, as long as the scenes' files stay what they are.
    #[must_use]
    pub fn index(&self, folder: &Path) -> Vec<u8> {
        index::write(&self.entries, folder)
    }

    fn entry(&self, index: usize) -> Result<&SceneEntry, SetError> {
        let scenes = self.entries.len();
        self.entries.get(index).ok_or(SetError::Number { index, scenes })
    }
}
