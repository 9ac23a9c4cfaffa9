//! What an input means: a file, a folder, a glob, a scene-set TOML, an index, or the word `demo`.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, ErrorKind, Read};
use std::path::{Path, PathBuf};

use super::file::SetFile;
use super::found::{Found, Note};
use super::{generate, index, pickles, scan, tables};
use crate::content::Content;
use crate::error::SetError;
use crate::tfrecord::{self, Packing, Restart, Unpack};

/// Appends what is found in `input`. The word `demo` is the built-in set; a path that exists is that path, whatever glob it
/// might also be.
pub(super) fn open(input: &str, found: &mut Found) -> Result<(), SetError> {
    let path = Path::new(input);
    if input == "demo" {
        if path.exists() {
            found.notes.push(Note::DemoIsBuiltIn);
        }
        return generate::demo(&mut found.entries);
    }
    match fs::metadata(path) {
        Ok(metadata) if metadata.is_dir() => open_folder(path, found),
        Ok(_) if path.extension().is_some_and(|extension| extension == "toml") => open_set_file(path, found),
        Ok(_) => open_file(path, found),
        Err(error) if error.kind() == ErrorKind::NotFound && input.contains(['*', '?', '[']) => open_glob(input, found),
        Err(source) => Err(unreadable(path, source)),
    }
}

fn unreadable(path: &Path, source: io::Error) -> SetError {
    if source.kind() != ErrorKind::NotFound {
        return SetError::Io { path: path.into(), source };
    }
    // How Waymo and TensorFlow write "all shards of".
    let sharded = path.to_str().and_then(|text| {
        let (name, count) = text.rsplit_once('@')?;
        Some(SetError::Sharded { path: path.into(), name: name.to_owned(), count: count.parse().ok()? })
    });
    sharded.unwrap_or_else(|| SetError::Missing { path: path.into() })
}

/// WOMD's files end in `-00014-of-01000`, so the name only contains `.tfrecord`.
fn has_tfrecord_name(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name.to_string_lossy().contains(".tfrecord"))
}

/// Endings of what lies beside shards and is not read with them: indices, checksums, downloads under way, and ScenarioNet's pickles,
/// which keep the shard's name in their own (`sd_training.tfrecord-....pkl`).
const SIDE_FILES: [&str; 20] = [
    ".index",
    ".idx",
    ".md5",
    ".sha1",
    ".sha256",
    ".sha512",
    ".crc32c",
    ".json",
    ".txt",
    ".log",
    ".pkl",
    ".gstmp",
    ".part",
    ".partial",
    ".tmp",
    ".temp",
    ".crdownload",
    ".download",
    ".aria2",
    "~",
];

/// What `scenarios generate` was asked for, beside the shards that it made.
pub const GENERATED_TOML: &str = "generated.toml";

/// Whether a file is passed over wherever it is not named itself. Hidden ones are those of the system, or of a copy under way.
fn is_side_file(name: &str) -> bool {
    name.starts_with('.') || SIDE_FILES.iter().any(|ending| name.ends_with(ending))
}

/// A file by another name goes by content.
fn open_file(path: &Path, found: &mut Found) -> Result<(), SetError> {
    if path.to_string_lossy().ends_with(pickles::ENDING) {
        return pickles::scan(path, found);
    }
    if path.to_string_lossy().ends_with(tables::ENDING) {
        return tables::scan(path, found);
    }
    if !has_tfrecord_name(path) {
        let start = start_of(path).map_err(|source| unreadable(path, source))?;
        if index::looks_like_index(&start) {
            return index::open(path, found);
        }
        if !holds_records(path, &start) {
            return Err(match Content::of(&start) {
                Some(Content::Pickle) => return pickles::scan(path, found),
                Some(Content::Parquet) => return tables::scan(path, found),
                Some(content) => SetError::Foreign { path: path.into(), content },
                None => SetError::NotRecognised { path: path.into() },
            });
        }
    }
    scan::scan(path, found)
}

fn start_of(path: &Path) -> io::Result<Vec<u8>> {
    let mut start = Vec::new();
    File::open(path)?.take(index::START_BYTES as u64).read_to_end(&mut start)?;
    Ok(start)
}

/// Whether the file that begins with `start` begins like TFRecords, or like packed ones.
fn holds_records(path: &Path, start: &[u8]) -> bool {
    let unpacked = || {
        let unpack = Unpack::from(File::open(path).ok()?, &Restart::beginning(Packing::of(start)?));
        let mut start = Vec::new();
        unpack.take(tfrecord::HEADER_BYTES as u64).read_to_end(&mut start).ok()?;
        Some(start)
    };
    tfrecord::looks_like_tfrecord(start) || unpacked().is_some_and(|start| tfrecord::looks_like_tfrecord(&start))
}

/// A folder's shards; where there are none at any depth, its pickles; where there are none of these either, Argoverse 2's scenes.
fn open_folder(folder: &Path, found: &mut Found) -> Result<(), SetError> {
    let mut inside = Inside::default();
    find_files(folder, &mut inside)?;
    let Inside { mut shards, mut tables, mut passed_over } = inside;
    passed_over.sort();
    if shards.is_empty() {
        if passed_over.iter().any(|name| name.ends_with(pickles::ENDING)) && pickles::open_folder(folder, found)? > 0 {
            passed_over.retain(|name| !name.ends_with(pickles::ENDING));
        } else if tables.is_empty() {
            return Err(SetError::EmptyFolder { path: folder.into(), passed_over });
        } else {
            tables.sort();
            std::mem::take(&mut tables).iter().try_for_each(|table| tables::scan(table, found))?;
        }
    }
    passed_over.extend(tables.iter().filter_map(|table| Some(table.file_name()?.to_string_lossy().into_owned())));
    pass_over(folder, passed_over, found);
    shards.sort();
    shards.iter().try_for_each(|file| scan::scan(file, found))
}

fn pass_over(input: &Path, files: Vec<String>, found: &mut Found) {
    if !files.is_empty() {
        found.notes.push(Note::PassedOver { input: input.into(), files });
    }
}

/// What a folder holds, at any depth.
#[derive(Default)]
struct Inside {
    shards: Vec<PathBuf>,
    /// Of Argoverse 2's scenes.
    tables: Vec<PathBuf>,
    /// Names of side files, pickles among them, and of data of other kinds.
    passed_over: Vec<String>,
}

/// Links to folders are not followed: they may lead in circles. What has another name than TFRecords is left alone; it is told
/// of side files, and of data of other kinds.
fn find_files(folder: &Path, inside: &mut Inside) -> Result<(), SetError> {
    let io = |source| SetError::Io { path: folder.into(), source };
    for entry in fs::read_dir(folder).map_err(io)? {
        let entry = entry.map_err(io)?;
        let path = entry.path();
        let name = entry.file_name().to_string_lossy().into_owned();
        if entry.file_type().map_err(io)?.is_dir() {
            find_files(&path, inside)?;
        } else if has_tfrecord_name(&path) && !is_side_file(&name) {
            inside.shards.extend(Some(path).filter(|path| path.is_file()));
        } else if tables::is_scene(&name) {
            inside.tables.extend(Some(path).filter(|path| path.is_file()));
        } else if has_tfrecord_name(&path) || [".pkl", ".db"].iter().any(|ending| name.ends_with(ending)) {
            inside.passed_over.push(name);
        }
    }
    Ok(())
}

/// A glob picks files and folders; among what it picks, side files are passed over, and files of other kinds are an error. Pickles are
/// side files where it picks shards too; a database's index always is.
fn open_glob(pattern: &str, found: &mut Found) -> Result<(), SetError> {
    let bad = |problem: glob::PatternError| SetError::BadGlob { pattern: pattern.into(), problem: problem.to_string() };
    let (mut any, mut passed_over) = (false, Vec::new());
    let paths = glob::glob(pattern).map_err(bad)?;
    let mut paths = paths
        .map(|path| path.map_err(|e| SetError::Io { path: e.path().into(), source: e.into() }))
        .collect::<Result<Vec<_>, _>>()?;
    let name = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let has_shards = paths.iter().any(|path| has_tfrecord_name(path) && !is_side_file(&name(path)) && path.is_file());
    let is_passed_over = |path: &Path| {
        let name = name(path);
        match name.ends_with(pickles::ENDING) {
            true => has_shards || pickles::is_index(&name),
            false => (has_tfrecord_name(path) && is_side_file(&name)) || tables::is_map(&name),
        }
    };
    paths.sort_by_cached_key(|path| pickles::order(path));
    for path in paths {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if path.is_dir() {
            open_folder(&path, found)?;
        } else if name == GENERATED_TOML {
            continue;
        } else if is_passed_over(&path) {
            passed_over.push(name.into_owned());
            continue;
        } else {
            open_file(&path, found)?;
        }
        any = true;
    }
    pass_over(Path::new(pattern), passed_over, found);
    if any { Ok(()) } else { Err(SetError::NoMatch { pattern: pattern.into() }) }
}

fn open_set_file(path: &Path, found: &mut Found) -> Result<(), SetError> {
    let text = fs::read_to_string(path).map_err(|source| SetError::Io { path: path.into(), source })?;
    let set = SetFile::parse(&text).map_err(|e| SetError::Toml { path: path.into(), problem: e.to_string() })?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut own = Found::default();
    let in_set = |problem| SetError::InSet { set: path.into(), problem: Box::new(problem) };
    for file in &set.files {
        let file = folder.join(file);
        let opened = if file.is_dir() { open_folder(&file, &mut own) } else { open_file(&file, &mut own) };
        opened.map_err(in_set)?;
    }
    for pattern in &set.globs {
        let folder = glob::Pattern::escape(&folder.to_string_lossy());
        open_glob(&Path::new(&folder).join(pattern).to_string_lossy(), &mut own).map_err(in_set)?;
    }
    for wish in &set.generate {
        generate::generate(path, wish, &mut own.entries)?;
    }
    if let Some(ids) = &set.scenes {
        keep(path, ids, &mut own)?;
    }
    exclude(path, &set.exclude, &mut own);
    found.entries.append(&mut own.entries);
    found.bad.append(&mut own.bad);
    found.notes.append(&mut own.notes);
    Ok(())
}

/// What does not tell its id is kept: it may be what is wanted, and is damaged.
fn keep(path: &Path, ids: &[String], found: &mut Found) -> Result<(), SetError> {
    let wanted: BTreeSet<&str> = ids.iter().map(String::as_str).collect();
    found.entries.retain(|entry| wanted.contains(entry.id.as_str()));
    found.bad.retain(|error| error.scene().is_none_or(|id| wanted.contains(id.as_str())));
    let missing = missing(&wanted, found);
    if missing.is_empty() || !found.bad.is_empty() {
        return Ok(());
    }
    Err(SetError::UnknownScenes { path: path.into(), ids: missing })
}

fn exclude(path: &Path, ids: &[String], found: &mut Found) {
    let unwanted: BTreeSet<&str> = ids.iter().map(String::as_str).collect();
    let missing = missing(&unwanted, found);
    if !missing.is_empty() {
        found.notes.push(Note::NothingExcluded { path: path.into(), ids: missing });
    }
    found.entries.retain(|entry| !unwanted.contains(entry.id.as_str()));
    found.bad.retain(|error| error.scene().is_none_or(|id| !unwanted.contains(id.as_str())));
}

/// Those of `ids` that nothing has.
fn missing(ids: &BTreeSet<&str>, found: &Found) -> Vec<String> {
    let entries = found.entries.iter().map(|entry| entry.id.as_str());
    let there: BTreeSet<&str> =
        entries.chain(found.bad.iter().filter_map(|e| e.scene()).map(|id| id.as_str())).collect();
    ids.difference(&there).map(ToString::to_string).collect()
}
