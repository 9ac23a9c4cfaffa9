//! What is in a file: each record's id and place. A plain file is skimmed; a packed one has to be unpacked whole.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;
use std::sync::Arc;

use world::scene::SceneId;

use super::entry::{SceneEntry, read_at};
use super::found::Found;
use super::index;
use crate::content::Content;
use crate::error::{RecordError, RecordProblem, SetError};
use crate::source::{Place, SceneFile, Source};
use crate::tfrecord::{Entrances, Frame, Frames, HEADER_BYTES, Packing, Records, Restart, Unpack, looks_like_tfrecord};
use crate::womd::{self, Skim, Skimmed};

/// Appends the scenes of the TFRecord file at `path` in their order, and the records that give none. Where the length of one is damaged,
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
        found.bad.push(RecordError { path: path.into(), record: 0, offset: 0, packing: None, whole: false, problem });
        return Ok(());
    }
    let metadata = file.metadata().map_err(io)?;
    let packed = Packing::of(&start).map(Entrances::of);
    let described =
        SceneFile { path: path.into(), bytes: metadata.len(), modified: index::modified(&metadata), packed };
    let described = Arc::new(described);
    let ended = match &described.packed {
        None => skim(&described, Frames::new(file, described.bytes), found),
        Some(entrances) => unpack(&described, entrances, file, found),
    };
    found.bad.extend(ended.err());
    Ok(())
}

fn skim<R: Read + Seek>(file: &Arc<SceneFile>, mut frames: Frames<R>, found: &mut Found) -> Result<(), RecordError> {
    loop {
        let Some(frame) = frames.next_frame().map_err(|error| RecordError::stream(&file.path, None, error))? else {
            return Ok(());
        };
        let Frame { index: record, offset, bytes, checksum } = frame;
        let place = Place { file: Arc::clone(file), record, offset, bytes, checksum };
        let skimmed =
            skim_id(&mut frames, &frame).map_err(|error| RecordError::at(&place, RecordProblem::Io(error)))?;
        match skimmed.map_or_else(|| read_at(&place, womd::scene_id), Ok) {
            Ok(id) => found.entries.push(SceneEntry { id, source: Source::File(place) }),
            Err(error) => found.bad.push(error),
        }
    }
}

fn skim_id<R: Read + Seek>(frames: &mut Frames<R>, frame: &Frame) -> io::Result<Option<SceneId>> {
    let mut skim = Skim::new(frame.bytes);
    loop {
        match skim.take(frames.at(frame.payload() + skim.offset())?) {
            Skimmed::More => {}
            Skimmed::Id(id) => return Ok(Some(id)),
            Skimmed::Untold => return Ok(None),
        }
    }
}

fn unpack(file: &Arc<SceneFile>, entrances: &Entrances, source: File, found: &mut Found) -> Result<(), RecordError> {
    let packing = entrances.packing();
    let mut records = Records::new(Unpack::from(source, &Restart::beginning(packing)));
    loop {
        entrances.pass(records.source());
        let next = records.next_record().map_err(|error| RecordError::stream(&file.path, Some(packing), error))?;
        let Some(record) = next else { return Ok(()) };
        let place = Place {
            file: Arc::clone(file),
            record: record.index,
            offset: record.offset,
            bytes: record.payload.len() as u64,
            checksum: record.checksum,
        };
        match womd::scene_id(record.payload) {
            Ok(id) => found.entries.push(SceneEntry { id, source: Source::File(place) }),
            Err(problem) => found.bad.push(RecordError::at(&place, RecordProblem::Womd(problem))),
        }
    }
}
