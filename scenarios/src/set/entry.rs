//! A scene of a set: its name, what it was, and where it lies.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};

use world::scene::SceneId;

use crate::error::{RecordError, RecordProblem, SetError};
use crate::source::{Place, Source};
use crate::tfrecord::{Records, StreamError, Unpack};
use crate::womd::WomdError;

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

impl SceneEntry {
    pub(super) fn read<T>(&self, take: impl FnOnce(&[u8]) -> Result<T, WomdError>) -> Result<T, SetError> {
        match &self.source {
            Source::File(place) => Ok(read_at(place, take)?),
            Source::Generated { family, seed, index, parameters } => family
                .payload(self.id.as_str(), *seed, *index, parameters)
                .and_then(|payload| Ok(take(&payload)?))
                .map_err(|problem| SetError::Generated { id: self.id.to_string(), problem }),
        }
    }
}

/// Gives `take` the payload at `place`, and answers what it makes of it.
fn read_at<T>(place: &Place, take: impl FnOnce(&[u8]) -> Result<T, WomdError>) -> Result<T, RecordError> {
    let read = |source: &mut dyn Read| {
        let mut records = Records::starting_at(source, place.record, place.offset);
        match records.next_record() {
            Ok(Some(found)) if found.checksum == place.checksum => take(found.payload).map_err(RecordProblem::Womd),
            // It was sound when the set was opened.
            Ok(_) | Err(StreamError::Frame(_)) => Err(RecordProblem::Changed),
            Err(StreamError::Io { source, .. }) => Err(RecordProblem::io(source)),
        }
    };
    let open = |byte| -> io::Result<File> {
        let mut file = File::open(&place.path)?;
        file.seek(SeekFrom::Start(byte))?;
        Ok(file)
    };
    let read = || match &place.packed {
        None => read(&mut BufReader::new(open(place.offset).map_err(RecordProblem::Io)?)),
        Some(restart) => {
            let mut unpack = Unpack::from(open(restart.byte()).map_err(RecordProblem::Io)?, restart);
            let before = place.offset - restart.unpacked();
            io::copy(&mut unpack.by_ref().take(before), &mut io::sink()).map_err(RecordProblem::io)?;
            read(&mut unpack)
        }
    };
    read().map_err(|problem| RecordError::at(place, problem))
}
