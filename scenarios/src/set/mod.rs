//! Scene sets: where the scenes of a run come from, in a fixed order, each loaded when it is needed.

mod file;
mod generate;
mod inputs;
mod scan;

use std::fs::File;
use std::io::{BufReader, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use world::scene::{Finding, Scene, SceneId};

use crate::error::{RecordError, RecordProblem, SetError};
use crate::source::Source;
use crate::tfrecord::{Records, StreamError};
use crate::womd::{self, WomdError};

pub use file::{SetFile, TomlProblem};

/// A scene of a set, not yet loaded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SceneEntry {
    /// Its name, unique in the set.
    pub id: SceneId,
    /// SHA-256 of the record's payload, in hex: which scene it was, whatever its file is called.
    pub sha256: String,
    /// Where it lies.
    pub source: Source,
}

/// An ordered set of scenes with unique ids. Holds no scene; loads them from many threads.
#[derive(Clone, Debug)]
pub struct SceneSet {
    entries: Vec<SceneEntry>,
}

impl SceneSet {
    /// The scenes of `inputs`: TFRecord files, folders (searched through, in order of names), globs, scene-set TOML files
    /// ([`SetFile`]), or the word `demo`. Nothing means `demo`. Their order is that of the inputs, of the names within a
    /// folder or glob, and of the records within a file.
    ///
    /// Each file is read once: every checksum is verified, every scene's id and hash taken; scenes are decoded by
    /// [`SceneSet::load`] alone.
    ///
    /// # Errors
    /// [`SetError`], for the first thing that is wrong: a set is opened whole or not at all.
    pub fn open(inputs: &[String]) -> Result<Self, SetError> {
        let demo = ["demo".to_owned()];
        let inputs = if inputs.is_empty() { &demo } else { inputs };
        let mut entries = Vec::new();
        for input in inputs {
            inputs::open(input, &mut entries)?;
        }
        scan::refuse_duplicates(&entries)?;
        if entries.is_empty() {
            return Err(SetError::NoScenes { inputs: inputs.to_vec() });
        }
        Ok(Self { entries })
    }

    /// The scenes, in order.
    #[must_use]
    pub fn entries(&self) -> &[SceneEntry] {
        &self.entries
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

impl SceneEntry {
    fn read<T>(&self, take: impl FnOnce(&[u8]) -> Result<T, WomdError>) -> Result<T, SetError> {
        match &self.source {
            Source::File { path, record, offset, checksum, .. } => {
                Ok(read_record(path, *record, *offset, *checksum, take)?)
            }
            Source::Generated { family, seed, index } => family
                .payload(self.id.as_str(), *seed, *index)
                .map_err(WomdError::from)
                .and_then(|payload| take(&payload))
                .map_err(|problem| SetError::Generated { id: self.id.to_string(), problem }),
        }
    }
}

fn read_record<T>(
    path: &Path,
    record: u64,
    offset: u64,
    checksum: u32,
    take: impl FnOnce(&[u8]) -> Result<T, WomdError>,
) -> Result<T, RecordError> {
    let error = |problem| RecordError { path: PathBuf::from(path), record, offset, problem };
    let open = || -> std::io::Result<File> {
        let mut file = File::open(path)?;
        file.seek(SeekFrom::Start(offset))?;
        Ok(file)
    };
    let file = open().map_err(|e| error(RecordProblem::Io(e)))?;
    let mut records = Records::starting_at(BufReader::new(file), record, offset);
    match records.next_record() {
        Ok(Some(found)) if found.checksum == checksum => take(found.payload).map_err(|e| error(RecordProblem::Womd(e))),
        // It was sound when the set was opened.
        Ok(_) | Err(StreamError::Frame(_)) => Err(error(RecordProblem::Changed)),
        Err(StreamError::Io { source, .. }) => Err(error(RecordProblem::Io(source))),
    }
}
