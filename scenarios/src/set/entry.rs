//! A scene of a set: its name, and where it lies.

use std::fmt;
use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::time::SystemTime;

use sha2::{Digest, Sha256};
use world::scene::{Finding, Scene, SceneId};

use super::{pickles, tables};
use crate::argoverse::{self, ArgoverseError};
use crate::error::{RecordError, RecordProblem, SetError};
use crate::generated::GeneratedError;
use crate::scenarionet::{self, ScenarioNetError};
use crate::source::{Place, SceneFile, Source};
use crate::tfrecord::{Records, StreamError};
use crate::womd::{self, WomdError};

/// SHA-256 of a record's payload, or of the file or files that a scene is: which scene it is, whatever its file is called.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Hash([u8; 32]);

impl Hash {
    pub(super) fn of(payload: &[u8]) -> Self {
        Self(Sha256::digest(payload).into())
    }
}

impl fmt::Display for Hash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

/// A scene of a set, not yet loaded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SceneEntry {
    /// Its name, unique in the set.
    pub id: SceneId,
    /// Where it lies.
    pub source: Source,
}

impl SceneEntry {
    /// What tells this scene from others of its name without reading it: of a record its length and the checksum that is stored with it,
    /// of a file that is a scene its length and when it was changed last, of a generated scene what it is made of.
    #[must_use]
    pub fn fingerprint(&self) -> String {
        match &self.source {
            Source::File(place) => format!("{} bytes, CRC32C {:08x}", place.bytes, place.checksum),
            Source::Pickle(file) => state_of(file),
            Source::Table { table, map } => format!("{}; map {}", state_of(table), state_of(map)),
            made @ Source::Generated { .. } => made.to_string(),
        }
    }

    pub(super) fn hash(&self) -> Result<Hash, SetError> {
        self.read(Hash::of)
    }

    /// Whether it is the same scene as another of its name.
    pub(super) fn is_same(&self, other: &Self) -> Result<bool, SetError> {
        match (&self.source, &other.source) {
            (one, other) if one == other => Ok(true),
            (Source::File(one), Source::File(other)) if (one.bytes, one.checksum) != (other.bytes, other.checksum) => {
                Ok(false)
            }
            _ => Ok(self.hash()? == other.hash()?),
        }
    }

    /// Gives `take` the bytes that the scene is in: a record's payload, a whole pickle, or a table and behind it its map.
    pub(super) fn read<T>(&self, take: impl FnOnce(&[u8]) -> T) -> Result<T, SetError> {
        match &self.source {
            Source::File(place) => Ok(read_at(place, |payload| Ok(take(payload)))?),
            Source::Pickle(file) => Ok(take(&pickles::read(file)?)),
            Source::Table { table, map } => Ok(take(&tables::read(table, map)?)),
            Source::Generated { family, seed, index, parameters } => family
                .payload(self.id.as_str(), *seed, *index, parameters)
                .map(|payload| take(&payload))
                .map_err(|problem| self.not_made(problem)),
        }
    }

    /// The scene in `bytes`, which [`SceneEntry::read`] gave, if it is of the name under which the set has it.
    pub(super) fn decode(&self, bytes: &[u8]) -> Result<(Scene, Vec<Finding>), SetError> {
        match &self.source {
            Source::File(place) => {
                let is_other = |(scene, _): &(Scene, _)| scene.id() != &self.id;
                let decoded = womd::read(bytes).and_then(|loaded| match is_other(&loaded) {
                    true => Err(WomdError::TwoIds { first: self.id.to_string(), last: loaded.0.id().to_string() }),
                    false => Ok(loaded),
                });
                decoded.map_err(|problem| RecordError::at(place, RecordProblem::Womd(problem)).into())
            }
            Source::Pickle(file) => {
                let is_other = |(scene, _): &(Scene, _)| scene.id() != &self.id;
                let decoded = scenarionet::read(bytes).and_then(|loaded| match is_other(&loaded) {
                    true => {
                        Err(ScenarioNetError::TwoIds { first: self.id.to_string(), last: loaded.0.id().to_string() })
                    }
                    false => Ok(loaded),
                });
                decoded.map_err(|problem| RecordError::of_file(&file.path, problem.into()).into())
            }
            Source::Table { table, .. } => {
                let length = usize::try_from(table.bytes).unwrap_or(usize::MAX).min(bytes.len());
                let is_other = |(scene, _): &(Scene, _)| scene.id() != &self.id;
                let (states, map) = bytes.split_at(length);
                let decoded = argoverse::read(states, map).and_then(|loaded| match is_other(&loaded) {
                    true => Err(ArgoverseError::TwoIds { first: self.id.to_string(), last: loaded.0.id().to_string() }),
                    false => Ok(loaded),
                });
                decoded.map_err(|problem| RecordError::of_file(&table.path, problem.into()).into())
            }
            Source::Generated { .. } => womd::read(bytes).map_err(|problem| self.not_made(problem.into())),
        }
    }

    fn not_made(&self, problem: GeneratedError) -> SetError {
        SetError::Generated { id: self.id.to_string(), problem }
    }
}

/// What tells a file from another of its name.
fn state_of(file: &SceneFile) -> String {
    match file.modified.and_then(|time| time.duration_since(SystemTime::UNIX_EPOCH).ok()) {
        Some(since) => format!("{} bytes, of {}.{:09} s", file.bytes, since.as_secs(), since.subsec_nanos()),
        None => format!("{} bytes", file.bytes),
    }
}

/// Gives `take` the payload at `place`, and answers what it makes of it.
pub(super) fn read_at<T>(place: &Place, take: impl FnOnce(&[u8]) -> Result<T, WomdError>) -> Result<T, RecordError> {
    let read = |source: &mut dyn Read| {
        let mut records = Records::starting_at(source, place.record, place.offset);
        match records.next_record() {
            Ok(Some(found)) if (found.payload.len() as u64, found.checksum) == (place.bytes, place.checksum) => {
                take(found.payload).map_err(RecordProblem::Womd)
            }
            // Its checksum is the one that it had, and never was right.
            Err(StreamError::Frame(error)) if error.problem.stored_for_payload() == Some(place.checksum) => {
                Err(RecordProblem::Frame(error.problem))
            }
            // Its frame was sound when the set was opened.
            Ok(_) | Err(StreamError::Frame(_)) => Err(RecordProblem::Changed),
            Err(StreamError::Io { source, .. }) => Err(RecordProblem::io(source)),
        }
    };
    let path = &place.file.path;
    let plain = || -> io::Result<BufReader<File>> {
        let mut file = File::open(path)?;
        file.seek(SeekFrom::Start(place.offset))?;
        Ok(BufReader::new(file))
    };
    let read = match &place.file.packed {
        None => plain().map_err(RecordProblem::Io).and_then(|mut source| read(&mut source)),
        Some(packed) => {
            packed.enter(path, place.offset).map_err(RecordProblem::io).and_then(|mut source| read(&mut source))
        }
    };
    read.map_err(|problem| RecordError::at(place, problem))
}
