//! What is in a file: each record's id, place and hash; and how one record is read again.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::Path;
use std::sync::Arc;

use sha2::{Digest, Sha256};

use super::entry::SceneEntry;
use super::found::Found;
use crate::content::Content;
use crate::error::{RecordError, RecordProblem, SetError};
use crate::source::{Place, Source};
use crate::tfrecord::{HEADER_BYTES, Packing, Records, Restart, Unpack, looks_like_tfrecord};
use crate::womd;

/// A packed file can be entered about every so many unpacked bytes: 4 MiB, some 10 ms of unpacking.
const RESTART_BYTES: u64 = 4 << 20;

/// Appends the scenes of the TFRecord file at `path` in their order, and the records that give none. After a damaged frame
/// nothing tells where the next record begins.
pub(super) fn scan(path: &Path, found: &mut Found) -> Result<(), SetError> {
    let io = |source| SetError::Io { path: path.into(), source };
    let mut file = File::open(path).map_err(|source| match source.kind() {
        io::ErrorKind::NotFound => SetError::Missing { path: path.into() },
        _ => io(source),
    })?;
    let mut start = Vec::new();
    file.by_ref().take(HEADER_BYTES as u64).read_to_end(&mut start).map_err(io)?;
    file.seek(SeekFrom::Start(0)).map_err(io)?;
    let foreign = Content::of(&start).filter(|content| !matches!(content, Content::Packed(_)));
    if let Some(content) = foreign.filter(|_| !looks_like_tfrecord(&start)) {
        let problem = RecordProblem::Foreign(content);
        found.bad.push(RecordError { path: path.into(), record: 0, offset: 0, packing: None, problem });
        return Ok(());
    }
    match Packing::of(&start) {
        None => scan_records(path, None, Records::new(BufReader::new(file)), |_| None, found),
        Some(packing) => {
            let mut restart = Arc::new(Restart::beginning(packing));
            let unpack = Unpack::from(file, &restart);
            let enter = |source: &Unpack<File>| {
                if source.unpacked() - restart.unpacked() >= RESTART_BYTES {
                    restart = Arc::new(source.restart());
                }
                Some(Arc::clone(&restart))
            };
            scan_records(path, Some(packing), Records::new(unpack), enter, found);
        }
    }
    Ok(())
}

/// `enter` says of a source that stands before a record how to come there again.
fn scan_records<R: Read>(
    path: &Path,
    packing: Option<Packing>,
    mut records: Records<R>,
    mut enter: impl FnMut(&R) -> Option<Arc<Restart>>,
    found: &mut Found,
) {
    let path: Arc<Path> = path.into();
    loop {
        let packed = enter(records.source());
        let record = match records.next_record() {
            Ok(Some(record)) => record,
            Ok(None) => return,
            Err(error) => return found.bad.push(RecordError::stream(&path, packing, error)),
        };
        let place = Place {
            path: Arc::clone(&path),
            record: record.index,
            offset: record.offset,
            bytes: record.payload.len() as u64,
            checksum: record.checksum,
            packed,
        };
        match womd::scene_id(record.payload) {
            Ok(id) => {
                let sha256 = sha256(record.payload);
                found.entries.push(SceneEntry { id, sha256, source: Source::File(place) });
            }
            Err(problem) => found.bad.push(RecordError::at(&place, RecordProblem::Womd(problem))),
        }
    }
}

/// SHA-256 of `bytes` in hex.
pub(super) fn sha256(bytes: &[u8]) -> String {
    use std::fmt::Write as _;
    Sha256::digest(bytes).iter().fold(String::with_capacity(64), |mut text, byte| {
        let _ = write!(text, "{byte:02x}"); // a String takes all
        text
    })
}
