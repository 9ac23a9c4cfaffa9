//! What is in a file: each record's id, place and hash.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;
use std::sync::Arc;

use sha2::{Digest, Sha256};

use super::SceneEntry;
use crate::error::{RecordError, RecordProblem, SetError};
use crate::source::Source;
use crate::tfrecord::Records;
use crate::womd;

/// Appends the scenes of the TFRecord file at `path`, in their order.
pub(super) fn scan(path: &Path, entries: &mut Vec<SceneEntry>) -> Result<(), SetError> {
    let file = File::open(path).map_err(|source| SetError::Io { path: path.into(), source })?;
    let mut records = Records::new(BufReader::new(file));
    let path: Arc<Path> = path.into();
    while let Some(record) = records.next_record().map_err(|e| RecordError::stream(&*path, e))? {
        let id = womd::scene_id(record.payload).map_err(|problem| RecordError {
            path: path.to_path_buf(),
            record: record.index,
            offset: record.offset,
            problem: RecordProblem::Womd(problem),
        })?;
        entries.push(SceneEntry {
            id,
            sha256: sha256(record.payload),
            source: Source::File {
                path: Arc::clone(&path),
                record: record.index,
                offset: record.offset,
                bytes: record.payload.len() as u64,
                checksum: record.checksum,
            },
        });
    }
    Ok(())
}

/// SHA-256 of `bytes` in hex.
pub(super) fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().fold(String::with_capacity(64), |mut text, byte| {
        let _ = write!(text, "{byte:02x}"); // a String takes all
        text
    })
}

pub(super) fn refuse_duplicates(entries: &[SceneEntry]) -> Result<(), SetError> {
    let mut seen = BTreeMap::new();
    for entry in entries {
        if let Some(first) = seen.insert(&entry.id, &entry.source) {
            let (first, second) = (first.clone(), entry.source.clone());
            return Err(SetError::Duplicate { id: entry.id.clone(), first, second });
        }
    }
    Ok(())
}
