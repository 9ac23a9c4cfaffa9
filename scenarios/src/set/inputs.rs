//! What an input means: a file, a folder, a glob, a scene-set TOML, or the word `demo`.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};

use super::file::SetFile;
use super::{SceneEntry, generate, scan};
use crate::error::SetError;
use crate::tfrecord;

/// Appends the scenes of `input`. A path that exists is that path, whatever glob it might also be.
pub(super) fn open(input: &str, entries: &mut Vec<SceneEntry>) -> Result<(), SetError> {
    let path = Path::new(input);
    match fs::metadata(path) {
        Ok(metadata) if metadata.is_dir() => open_folder(path, entries),
        Ok(_) if path.extension().is_some_and(|extension| extension == "toml") => open_set_file(path, entries),
        Ok(_) => open_file(path, entries),
        Err(_) if input == "demo" => generate::demo(entries),
        Err(error) if error.kind() == ErrorKind::NotFound && input.contains(['*', '?', '[']) => {
            open_glob(input, entries)
        }
        Err(source) => Err(SetError::Io { path: path.into(), source }),
    }
}

/// WOMD's files end in `-00014-of-01000`, so the name only contains `.tfrecord`.
fn has_tfrecord_name(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name.to_string_lossy().contains(".tfrecord"))
}

/// ScenarioNet keeps the file's name in those of the pickles that it makes: `sd_training.tfrecord-....pkl`.
fn is_pickle(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension == "pkl")
}

/// A file by another name goes by content.
fn open_file(path: &Path, entries: &mut Vec<SceneEntry>) -> Result<(), SetError> {
    if !has_tfrecord_name(path) {
        let io = |source| SetError::Io { path: path.into(), source };
        let mut start = Vec::new();
        File::open(path).map_err(io)?.take(tfrecord::HEADER_BYTES as u64).read_to_end(&mut start).map_err(io)?;
        if !tfrecord::looks_like_tfrecord(&start) {
            return Err(SetError::NotRecognised { path: path.into() });
        }
    }
    scan::scan(path, entries)
}

fn open_folder(folder: &Path, entries: &mut Vec<SceneEntry>) -> Result<(), SetError> {
    let mut files = Vec::new();
    find_files(folder, &mut files)?;
    if files.is_empty() {
        return Err(SetError::EmptyFolder { path: folder.into() });
    }
    files.sort();
    files.iter().try_for_each(|file| scan::scan(file, entries))
}

/// Links to folders are not followed: they may lead in circles.
fn find_files(folder: &Path, files: &mut Vec<PathBuf>) -> Result<(), SetError> {
    let io = |source| SetError::Io { path: folder.into(), source };
    for entry in fs::read_dir(folder).map_err(io)? {
        let entry = entry.map_err(io)?;
        let path = entry.path();
        if entry.file_type().map_err(io)?.is_dir() {
            find_files(&path, files)?;
        } else if has_tfrecord_name(&path) && !is_pickle(&path) && path.is_file() {
            files.push(path);
        }
    }
    Ok(())
}

/// A glob picks files and folders; among what it picks, files of other kinds are an error, not skipped in silence.
fn open_glob(pattern: &str, entries: &mut Vec<SceneEntry>) -> Result<(), SetError> {
    let bad = |problem: glob::PatternError| SetError::BadGlob { pattern: pattern.into(), problem: problem.to_string() };
    let mut any = false;
    for path in glob::glob(pattern).map_err(bad)? {
        let path = path.map_err(|e| SetError::Io { path: e.path().into(), source: e.into() })?;
        any = true;
        if path.is_dir() { open_folder(&path, entries)? } else { open_file(&path, entries)? }
    }
    if any { Ok(()) } else { Err(SetError::NoMatch { pattern: pattern.into() }) }
}

fn open_set_file(path: &Path, entries: &mut Vec<SceneEntry>) -> Result<(), SetError> {
    let text = fs::read_to_string(path).map_err(|source| SetError::Io { path: path.into(), source })?;
    let set = SetFile::parse(&text).map_err(|e| SetError::Toml { path: path.into(), problem: e.to_string() })?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut found = Vec::new();
    let in_set = |problem| SetError::InSet { set: path.into(), problem: Box::new(problem) };
    for file in &set.files {
        let file = folder.join(file);
        let opened = if file.is_dir() { open_folder(&file, &mut found) } else { open_file(&file, &mut found) };
        opened.map_err(in_set)?;
    }
    for pattern in &set.globs {
        let folder = glob::Pattern::escape(&folder.to_string_lossy());
        open_glob(&Path::new(&folder).join(pattern).to_string_lossy(), &mut found).map_err(in_set)?;
    }
    for wish in &set.generate {
        generate::generate(path, wish, &mut found)?;
    }
    if let Some(ids) = &set.scenes {
        keep(path, ids, &mut found)?;
    }
    entries.append(&mut found);
    Ok(())
}

fn keep(path: &Path, ids: &[String], entries: &mut Vec<SceneEntry>) -> Result<(), SetError> {
    let wanted: BTreeSet<&str> = ids.iter().map(String::as_str).collect();
    entries.retain(|entry| wanted.contains(entry.id.as_str()));
    let found: BTreeSet<&str> = entries.iter().map(|entry| entry.id.as_str()).collect();
    let missing: Vec<String> = wanted.difference(&found).map(ToString::to_string).collect();
    if missing.is_empty() { Ok(()) } else { Err(SetError::UnknownScenes { path: path.into(), ids: missing }) }
}
