//! ScenarioNet's pickles as members of a set: a file is a scene, and a database's index says which files belong to it.

use std::fs::{self, File};
use std::io::Read;
use std::path::{Path, PathBuf};

use super::entry::SceneEntry;
use super::found::{Found, Note};
use super::whole;
use crate::error::{RecordError, RecordProblem, SetError};
use crate::scenarionet::database::{MAPPING, SUMMARY, mapped, summarised};
use crate::scenarionet::{self, MAX_FILE_BYTES, ScenarioNetError};
use crate::source::{SceneFile, Source};

/// The ending by which pickles are known.
pub(super) const ENDING: &str = ".pkl";

/// So many bytes of a file tell its scene's id, as a rule.
const START_BYTES: u64 = 512;

/// Whether a file of this name is a database's index, and no scene.
pub(super) fn is_index(name: &str) -> bool {
    name == MAPPING || name == SUMMARY
}

/// Appends the scene of the pickle at `path`, or why it gives none. As little of it is read as tells its id.
pub(super) fn scan(path: &Path, found: &mut Found) -> Result<(), SetError> {
    let file = File::open(path).map_err(|source| whole::unopened(path, source))?;
    match entry(path, &file) {
        Ok(entry) => found.entries.push(entry),
        Err(problem) => found.bad.push(RecordError::of_file(path, problem)),
    }
    Ok(())
}

fn entry(path: &Path, file: &File) -> Result<SceneEntry, RecordProblem> {
    let metadata = file.metadata().map_err(RecordProblem::Io)?;
    let mut bytes = Vec::new();
    file.take(START_BYTES).read_to_end(&mut bytes).map_err(RecordProblem::Io)?;
    let start = bytes.clone();
    let id = scenarionet::scene_id(&start, || -> Result<Vec<u8>, RecordProblem> {
        whole::read_on(file, metadata.len(), &mut bytes)?;
        Ok(bytes)
    })?;
    Ok(SceneEntry { id, source: Source::Pickle(whole::described(path, &metadata)) })
}

/// The bytes of the pickle `file`, if it is what it was.
pub(super) fn read(file: &SceneFile) -> Result<Vec<u8>, RecordError> {
    let mut bytes = Vec::new();
    whole::read(file, &mut bytes).map_err(|problem| RecordError::of_file(&file.path, problem))?;
    Ok(bytes)
}

/// Appends the scenes of a folder: where it is a database, those of its index; else all its pickles, and those of its folders. Files in the
/// order of their numbers, where their names are such, then of their names; folders behind them. Answers how many files there were.
pub(super) fn open_folder(folder: &Path, found: &mut Found) -> Result<usize, SetError> {
    let io = |source| SetError::Io { path: folder.into(), source };
    let (mut files, mut folders, mut index) = (Vec::new(), Vec::new(), None);
    for entry in fs::read_dir(folder).map_err(io)? {
        let entry = entry.map_err(io)?;
        let (path, name) = (entry.path(), entry.file_name().to_string_lossy().into_owned());
        if entry.file_type().map_err(io)?.is_dir() {
            folders.push(path);
        } else if name == MAPPING || (name == SUMMARY && index.is_none()) {
            index = Some(path);
        } else if name.ends_with(ENDING) && !is_index(&name) && !name.starts_with('.') && path.is_file() {
            files.push(path);
        }
    }
    if let Some(index) = index {
        let indexed = indexed(&index)?;
        let (there, missing): (Vec<PathBuf>, Vec<PathBuf>) =
            indexed.into_iter().map(|file| folder.join(file)).partition(|path| path.is_file());
        let is_useless = there.is_empty() && !(files.is_empty() && folders.is_empty());
        if !missing.is_empty() && !is_useless {
            let names = missing.iter().map(|path| path.strip_prefix(folder).unwrap_or(path).display().to_string());
            found.notes.push(Note::NotThere { index: index.clone(), files: names.collect() });
        }
        if is_useless {
            found.notes.push(Note::UselessIndex { index });
        } else {
            (files, folders) = (there, Vec::new());
        }
    }
    files.sort_by_cached_key(|path| order(path));
    folders.sort();
    files.iter().try_for_each(|path| scan(path, found))?;
    folders.iter().try_fold(files.len(), |sum, folder| Ok(sum + open_folder(folder, found)?))
}

/// `2.pkl` before `10.pkl`, both before `sd_....pkl`. Files of other kinds go by name alone.
pub(super) fn order(path: &Path) -> (bool, u64, PathBuf) {
    let stem = path.to_str().and_then(|path| Path::new(path.strip_suffix(ENDING)?).file_name()?.to_str());
    let number = stem.and_then(|stem| stem.parse::<u64>().ok());
    (number.is_none(), number.unwrap_or(0), path.into())
}

fn indexed(path: &Path) -> Result<Vec<PathBuf>, SetError> {
    let io = |source| SetError::Io { path: path.into(), source };
    let database = |problem| SetError::Database { path: path.into(), problem };
    let file = File::open(path).map_err(io)?;
    let length = file.metadata().map_err(io)?.len();
    if length > MAX_FILE_BYTES {
        return Err(database(ScenarioNetError::TooLong(length)));
    }
    let mut bytes = Vec::new();
    file.take(MAX_FILE_BYTES).read_to_end(&mut bytes).map_err(io)?;
    let files = if path.ends_with(MAPPING) { mapped(&bytes) } else { summarised(&bytes) };
    files.map_err(database)
}
