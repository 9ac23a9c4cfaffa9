//! The two index files of a database, which say where its scenes lie.

use std::path::{Component, Path, PathBuf};

use super::ScenarioNetError;
use super::layout::{Layout, Wrong};
use super::pickle::{Pickle, Value};

/// Which folder each scene's file is in: a dict of file names, with folders from its own on.
pub const MAPPING: &str = "dataset_mapping.pkl";

/// What each scene's metadata are: a dict of file names.
pub const SUMMARY: &str = "dataset_summary.pkl";

/// The files that a mapping names, from its own folder on, in its order.
///
/// # Errors
/// [`ScenarioNetError`] if it is none, or leads to somewhere else than a file beside, below or above it.
pub fn mapped(bytes: &[u8]) -> Result<Vec<PathBuf>, ScenarioNetError> {
    let pickle = Pickle::read(bytes)?;
    let layout = Layout::new(&pickle);
    let file = |(key, folder): &(Value<'_>, Value<'_>)| {
        let name = file_name(&layout, *key)?;
        let folder = pickle.text(*folder).ok_or_else(|| layout.kind(name, "a folder", *folder))?;
        let relative = |part| matches!(part, Component::Normal(_) | Component::CurDir | Component::ParentDir);
        if !Path::new(folder).components().all(relative) || folder.contains('\0') {
            return Err(Layout::wrong(name, Wrong::Kind { expected: "a relative folder", got: "another" }));
        }
        Ok(Path::new(folder).join(name))
    };
    pairs(&layout)?.iter().map(file).collect()
}

/// The files that a summary names, which lie beside it, in its order.
///
/// # Errors
/// [`ScenarioNetError`] if it is none.
pub fn summarised(bytes: &[u8]) -> Result<Vec<PathBuf>, ScenarioNetError> {
    let pickle = Pickle::read(bytes)?;
    let layout = Layout::new(&pickle);
    pairs(&layout)?.iter().map(|(key, _)| file_name(&layout, *key).map(PathBuf::from)).collect()
}

fn pairs<'p>(layout: &Layout<'p>) -> Result<&'p [(Value<'p>, Value<'p>)], ScenarioNetError> {
    let root = layout.pickle.root();
    layout.pickle.dict(root).ok_or_else(|| layout.kind("the index", "a dict of files", root))
}

fn file_name<'p>(layout: &Layout<'p>, key: Value<'p>) -> Result<&'p str, ScenarioNetError> {
    let name = layout.pickle.text(key).ok_or_else(|| layout.kind("the index", "a file's name", key))?;
    let is_plain = name.len() <= 255 && Path::new(name).file_name().is_some_and(|file| file == name);
    let other = || Layout::wrong(name, Wrong::Kind { expected: "a file's name", got: "another text" });
    if is_plain && !name.contains('\0') { Ok(name) } else { Err(other()) }
}
