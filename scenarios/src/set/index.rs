//! A set's index: a file that says where each of its scenes lies, so that nothing need be searched through, skimmed or unpacked for that
//! again.
//!
//! | bytes | what |
//! | --- | --- |
//! | 21 | `reloop scene index 1` and a line feed |
//! | n | the message [`Index`], protobuf |
//! | 4 | masked CRC32C of the message, as of a TFRecord |

use std::ffi::OsStr;
use std::fs;
use std::os::unix::ffi::OsStrExt;
use std::path::{self, Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, SystemTime};

use prost::Message;
use thiserror::Error;
use world::scene::{SceneError, SceneId};

use super::entry::SceneEntry;
use super::found::Found;
use super::whole::MAX_FILE_BYTES;
use crate::error::SetError;
use crate::generated::{Family, ParameterError, Parameters};
use crate::source::{Place, SceneFile, Source};
use crate::tfrecord::{Entrances, FOOTER_BYTES, HEADER_BYTES, MAX_PAYLOAD_BYTES, Packing, masked_crc32c};

/// How an index begins.
const MAGIC: &[u8] = b"reloop scene index 1\n";

/// So many bytes of a file tell whether it is an index, of this version or another.
pub(super) const START_BYTES: usize = MAGIC.len() - 2;

/// Stand for a pickle, and for a table and a map of Argoverse 2's, where others say how they are packed.
const PICKLE: u32 = 3;
const TABLE: u32 = 4;
const MAP: u32 = 5;

/// Why an index is of no use.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum IndexError {
    #[error("the index is of another version")]
    Version,
    #[error("the index is cut off or damaged")]
    Damaged,
    #[error("the index is no message: {0}")]
    Message(#[from] prost::DecodeError),
    #[error("the index names scene {scene} where none can be")]
    Place { scene: String },
    #[error(transparent)]
    Scene(#[from] SceneError),
    #[error(transparent)]
    Parameters(#[from] ParameterError),
    #[error("{} is not what it was when it was indexed", .0.display())]
    Stale(PathBuf),
}

#[derive(Clone, PartialEq, Message)]
struct Index {
    #[prost(message, repeated, tag = "1")]
    files: Vec<IndexedFile>,
    #[prost(message, repeated, tag = "2")]
    makings: Vec<Making>,
    #[prost(message, repeated, tag = "3")]
    scenes: Vec<IndexedScene>,
}

/// A TFRecord file, a pickle, a table or a map.
#[derive(Clone, PartialEq, Message)]
struct IndexedFile {
    /// Its path, from the index's folder on.
    #[prost(bytes = "vec", tag = "1")]
    path: Vec<u8>,
    /// Its length.
    #[prost(uint64, tag = "2")]
    bytes: u64,
    /// When it was changed last (ns since 1970).
    #[prost(uint64, optional, tag = "3")]
    modified: Option<u64>,
    /// 0 not packed, 1 gzip, 2 zlib, 3 a pickle, 4 a table, 5 a map.
    #[prost(uint32, tag = "4")]
    packing: u32,
}

/// What scenes of one family and seed are made of.
#[derive(Clone, PartialEq, Message)]
struct Making {
    #[prost(string, tag = "1")]
    family: String,
    #[prost(uint64, tag = "2")]
    seed: u64,
    /// As [`Parameters::read`] takes them.
    #[prost(string, repeated, tag = "3")]
    parameters: Vec<String>,
}

#[derive(Clone, PartialEq, Message)]
struct IndexedScene {
    #[prost(string, tag = "1")]
    id: String,
    /// Its file, from 1; 0 if it is made.
    #[prost(uint32, tag = "2")]
    file: u32,
    /// Its making, from 1.
    #[prost(uint32, tag = "3")]
    making: u32,
    /// The record in its file, or the scene of its making.
    #[prost(uint64, tag = "4")]
    number: u64,
    #[prost(uint64, tag = "5")]
    offset: u64,
    #[prost(uint64, tag = "6")]
    bytes: u64,
    #[prost(fixed32, tag = "7")]
    checksum: u32,
    /// The map of a table, from 1.
    #[prost(uint32, tag = "8")]
    map: u32,
}

/// Whether a file that begins with `start` is an index.
pub(super) fn looks_like_index(start: &[u8]) -> bool {
    start.len() >= START_BYTES && MAGIC.starts_with(&start[..START_BYTES])
}

/// Appends the scenes of the index at `path`, if their files are what they were.
pub(super) fn open(path: &Path, found: &mut Found) -> Result<(), SetError> {
    let bytes = fs::read(path).map_err(|source| SetError::Io { path: path.into(), source })?;
    let wrong = |problem| SetError::Index { path: path.into(), problem };
    let (files, mut entries) = read(&bytes, path.parent().unwrap_or(Path::new(""))).map_err(wrong)?;
    let is_stale = |file: &&Arc<SceneFile>| {
        fs::metadata(&file.path).map_or(true, |now| (now.len(), modified(&now)) != (file.bytes, file.modified))
    };
    if let Some(file) = files.iter().find(is_stale) {
        return Err(wrong(IndexError::Stale(file.path.clone())));
    }
    found.entries.append(&mut entries);
    Ok(())
}

/// When a file was changed last, as an index has room for it.
pub(super) fn modified(metadata: &fs::Metadata) -> Option<SystemTime> {
    let since = metadata.modified().ok()?.duration_since(SystemTime::UNIX_EPOCH).ok()?;
    u64::try_from(since.as_nanos()).ok().map(at)
}

fn at(nanoseconds: u64) -> SystemTime {
    SystemTime::UNIX_EPOCH + Duration::from_nanos(nanoseconds)
}

/// The index of `entries`, to be kept in `folder`: files within it may be moved together with it.
pub(crate) fn write(entries: &[SceneEntry], folder: &Path) -> Vec<u8> {
    let (mut files, mut makings) = (Vec::<(&Arc<SceneFile>, u32)>::new(), Vec::<Making>::new());
    let is_same = |one: &(&Arc<SceneFile>, u32), other: &(&Arc<SceneFile>, u32)| Arc::ptr_eq(one.0, other.0);
    let mut scenes = Vec::with_capacity(entries.len());
    for SceneEntry { id, source } in entries {
        let scene = IndexedScene { id: id.to_string(), ..IndexedScene::default() };
        scenes.push(match source {
            Source::File(Place { file, record, offset, bytes, checksum }) => {
                let (number, offset, bytes, checksum) = (*record, *offset, *bytes, *checksum);
                let file = place(&mut files, (file, packing(file)), is_same);
                IndexedScene { file, number, offset, bytes, checksum, ..scene }
            }
            Source::Pickle(file) => {
                let bytes = file.bytes;
                IndexedScene { file: place(&mut files, (file, PICKLE), is_same), bytes, ..scene }
            }
            Source::Table { table, map } => {
                let file = place(&mut files, (table, TABLE), is_same);
                IndexedScene { file, map: place(&mut files, (map, MAP), is_same), ..scene }
            }
            Source::Generated { family, seed, index, parameters } => {
                let (family, parameters) = (family.name.to_owned(), parameters.texts().collect());
                let making = Making { family, seed: *seed, parameters };
                let making = place(&mut makings, making, |one, other| one == other);
                IndexedScene { making, number: u64::from(*index), ..scene }
            }
        });
    }
    let files = files.into_iter().map(|(file, packing)| indexed(file, packing, folder)).collect();
    sealed(&Index { files, makings, scenes }.encode_to_vec())
}

/// The place of `one` among `known`, from 1; it is appended if it is not there. What stands together in a set is found at once.
fn place<T>(known: &mut Vec<T>, one: T, is_same: impl Fn(&T, &T) -> bool) -> u32 {
    let place = known.iter().rposition(|known| is_same(known, &one)).unwrap_or(known.len());
    if place == known.len() {
        known.push(one);
    }
    place as u32 + 1
}

fn indexed(file: &SceneFile, packing: u32, folder: &Path) -> IndexedFile {
    let absolute = |path: &Path| path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let full = absolute(&file.path);
    let path = full.strip_prefix(absolute(folder)).unwrap_or(&full).as_os_str().as_bytes().to_vec();
    let since = |modified: SystemTime| modified.duration_since(SystemTime::UNIX_EPOCH).ok();
    let modified = file.modified.and_then(since).and_then(|since| u64::try_from(since.as_nanos()).ok());
    IndexedFile { path, bytes: file.bytes, modified, packing }
}

fn packing(file: &SceneFile) -> u32 {
    match file.packing() {
        None => 0,
        Some(Packing::Gzip) => 1,
        Some(Packing::Zlib) => 2,
    }
}

/// A message as it stands in its file.
pub(crate) fn sealed(message: &[u8]) -> Vec<u8> {
    [MAGIC, message, &masked_crc32c(message).to_le_bytes()].concat()
}

/// The files and scenes of the index that is in `folder`.
pub(crate) fn read(bytes: &[u8], folder: &Path) -> Result<(Vec<Arc<SceneFile>>, Vec<SceneEntry>), IndexError> {
    let rest = bytes.strip_prefix(MAGIC).ok_or(IndexError::Version)?;
    let (message, sum) = rest.split_last_chunk().ok_or(IndexError::Damaged)?;
    if u32::from_le_bytes(*sum) != masked_crc32c(message) {
        return Err(IndexError::Damaged);
    }
    let Index { files, makings, scenes } = Index::decode(message)?;
    let file = |file: IndexedFile| {
        let packed = match file.packing {
            0 | PICKLE | TABLE | MAP => None,
            1 => Some(Entrances::of(Packing::Gzip)),
            2 => Some(Entrances::of(Packing::Zlib)),
            _ => return Err(IndexError::Version),
        };
        let path = folder.join(OsStr::from_bytes(&file.path));
        Ok(Arc::new(SceneFile { path, bytes: file.bytes, modified: file.modified.map(at), packed }))
    };
    let kinds: Vec<u32> = files.iter().map(|file| file.packing).collect();
    let files: Vec<Arc<SceneFile>> = files.into_iter().map(file).collect::<Result<_, _>>()?;
    let made = |making: Making| {
        let parameters = Parameters::read(&making.parameters)?;
        let Some(family) = Family::named(&making.family) else { return Ok(None) };
        parameters.check(family)?;
        Ok(Some((family, making.seed, Arc::new(parameters))))
    };
    let makings: Vec<Option<_>> = makings.into_iter().map(made).collect::<Result<_, IndexError>>()?;
    let entry = |scene: IndexedScene| {
        let of = |place: u32| (place as usize).checked_sub(1);
        let source = match of(scene.file) {
            Some(place) => match kinds.get(place) {
                Some(&PICKLE) => files.get(place).and_then(whole).map(Source::Pickle),
                Some(&TABLE) => {
                    let map = of(scene.map).filter(|map| kinds.get(*map) == Some(&MAP));
                    let both = files.get(place).zip(map.and_then(|map| files.get(map)));
                    both.and_then(|(table, map)| Some(Source::Table { table: whole(table)?, map: whole(map)? }))
                }
                Some(&MAP) | None => None,
                Some(_) => files.get(place).and_then(|file| in_file(file, &scene)),
            },
            None => of(scene.making).and_then(|place| makings.get(place)).and_then(|making| {
                let (family, seed, parameters) = making.as_ref()?;
                let index = u32::try_from(scene.number).ok()?;
                Some(Source::Generated { family, seed: *seed, index, parameters: Arc::clone(parameters) })
            }),
        };
        let source = source.ok_or_else(|| IndexError::Place { scene: scene.id.chars().take(140).collect() })?;
        Ok(SceneEntry { id: SceneId::new(scene.id)?, source })
    };
    let entries = scenes.into_iter().map(entry).collect::<Result<_, IndexError>>()?;
    Ok((files, entries))
}

/// A file that is read as a whole, if it may be so long.
fn whole(file: &Arc<SceneFile>) -> Option<Arc<SceneFile>> {
    (file.bytes <= MAX_FILE_BYTES).then(|| Arc::clone(file))
}

/// The place of a scene, if its file has room for it.
fn in_file(file: &Arc<SceneFile>, scene: &IndexedScene) -> Option<Source> {
    let IndexedScene { number: record, offset, bytes, checksum, .. } = *scene;
    let end = offset.checked_add(bytes)?.checked_add((HEADER_BYTES + FOOTER_BYTES) as u64)?;
    let fits = bytes <= MAX_PAYLOAD_BYTES && (file.packed.is_some() || end <= file.bytes);
    fits.then(|| Source::File(Place { file: Arc::clone(file), record, offset, bytes, checksum }))
}
