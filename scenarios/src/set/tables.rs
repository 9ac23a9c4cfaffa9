//! Argoverse 2's scenes as members of a set: a table, and the map beside it.

use std::fs::{self, File};
use std::path::{Path, PathBuf};

use world::scene::SceneId;

use super::entry::SceneEntry;
use super::found::Found;
use super::whole;
use crate::argoverse::{self, ArgoverseError};
use crate::error::{RecordError, RecordProblem, SetError};
use crate::source::{SceneFile, Source};

/// The ending by which tables are known.
pub(super) const ENDING: &str = ".parquet";

/// How a scene's table is called, before its id.
const TABLE: &str = "scenario_";

/// How its map is called, before its id, and how that ends.
const MAP: &str = "log_map_archive_";
const MAP_ENDING: &str = ".json";

/// Whether a file of this name is a scene's table, and not any.
pub(super) fn is_scene(name: &str) -> bool {
    name_of(name).is_some()
}

/// Whether a file of this name is a scene's map.
pub(super) fn is_map(name: &str) -> bool {
    name.starts_with(MAP) && name.ends_with(MAP_ENDING)
}

/// The id in a table's name.
fn name_of(name: &str) -> Option<&str> {
    name.strip_prefix(TABLE)?.strip_suffix(ENDING)
}

/// Appends the scene of the table at `path`, or why it gives none. Where its name has the scene's id, nothing is read.
pub(super) fn scan(path: &Path, found: &mut Found) -> Result<(), SetError> {
    let metadata = fs::metadata(path).map_err(|source| whole::unopened(path, source))?;
    let table = whole::described(path, &metadata);
    let entry = || -> Result<SceneEntry, RecordProblem> {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let id = match name_of(&name) {
            Some(id) => SceneId::new(id).map_err(ArgoverseError::from)?,
            None => {
                let mut bytes = Vec::new();
                whole::read_on(&File::open(path).map_err(RecordProblem::Io)?, table.bytes, &mut bytes)?;
                argoverse::scene_id(&bytes)?
            }
        };
        let map = map_beside(path, &id)?;
        let map = whole::described(&map, &fs::metadata(&map).map_err(RecordProblem::Io)?);
        Ok(SceneEntry { id, source: Source::Table { table, map } })
    };
    match entry() {
        Ok(entry) => found.entries.push(entry),
        Err(problem) => found.bad.push(RecordError::of_file(path, problem)),
    }
    Ok(())
}

/// The map of the scene whose table is at `path`: that of its id, or the only one that is there.
fn map_beside(path: &Path, id: &SceneId) -> Result<PathBuf, RecordProblem> {
    let expected = format!("{MAP}{id}{MAP_ENDING}");
    let map = path.with_file_name(&expected);
    if map.is_file() {
        return Ok(map);
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut maps = Vec::new();
    for entry in fs::read_dir(folder).map_err(RecordProblem::Io)? {
        let entry = entry.map_err(RecordProblem::Io)?;
        maps.extend(is_map(&entry.file_name().to_string_lossy()).then(|| entry.path()));
    }
    match maps.pop() {
        Some(map) if maps.is_empty() => Ok(map),
        _ => Err(ArgoverseError::NoMap { expected }.into()),
    }
}

/// The bytes of a table and behind them those of its map, if both are what they were.
pub(super) fn read(table: &SceneFile, map: &SceneFile) -> Result<Vec<u8>, RecordError> {
    let mut bytes = Vec::new();
    for file in [table, map] {
        whole::read(file, &mut bytes).map_err(|problem| RecordError::of_file(&file.path, problem))?;
    }
    Ok(bytes)
}
