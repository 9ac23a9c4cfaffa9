//! Files that are read as a whole, because they are a scene, or half of one.

use std::fs::{File, Metadata};
use std::io::{self, Read};
use std::path::Path;
use std::sync::Arc;

use super::index;
use crate::error::{RecordProblem, SetError};
use crate::source::SceneFile;
use crate::tfrecord::MAX_PAYLOAD_BYTES;

/// The longest of such files: 64 MiB, as of a record.
pub(super) const MAX_FILE_BYTES: u64 = MAX_PAYLOAD_BYTES;

/// Why the file at `path`, which was named, cannot be opened.
pub(super) fn unopened(path: &Path, source: io::Error) -> SetError {
    match source.kind() {
        io::ErrorKind::NotFound => SetError::Missing { path: path.into() },
        _ => SetError::Io { path: path.into(), source },
    }
}

/// A file as it is now.
pub(super) fn described(path: &Path, metadata: &Metadata) -> Arc<SceneFile> {
    let modified = index::modified(metadata);
    Arc::new(SceneFile { path: path.into(), bytes: metadata.len(), modified, packed: None })
}

/// Appends all that is left of `file`, which has so many bytes.
pub(super) fn read_on(file: &File, length: u64, bytes: &mut Vec<u8>) -> Result<(), RecordProblem> {
    if length > MAX_FILE_BYTES {
        return Err(RecordProblem::TooLong(length));
    }
    file.take(MAX_FILE_BYTES).read_to_end(bytes).map_err(RecordProblem::Io)?;
    Ok(())
}

/// Appends the bytes of `file`, if it is what it was.
pub(super) fn read(file: &SceneFile, bytes: &mut Vec<u8>) -> Result<(), RecordProblem> {
    let opened = File::open(&file.path).map_err(RecordProblem::Io)?;
    let now = opened.metadata().map_err(RecordProblem::Io)?;
    if (now.len(), index::modified(&now)) != (file.bytes, file.modified) {
        return Err(RecordProblem::Changed);
    }
    let before = bytes.len();
    read_on(&opened, now.len(), bytes)?;
    if (bytes.len() - before) as u64 == file.bytes { Ok(()) } else { Err(RecordProblem::Changed) }
}
