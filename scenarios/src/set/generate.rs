//! Generated scenes as members of a set.

use std::path::Path;
use std::sync::Arc;

use world::scene::SceneId;

use super::entry::SceneEntry;
use super::file::Generate;
use crate::error::SetError;
use crate::generated::{ALL, FAMILIES, Family};
use crate::source::Source;

/// Appends the built-in demo set: the first scene of each family, called `demo-FAMILY`.
pub(super) fn demo(entries: &mut Vec<SceneEntry>) -> Result<(), SetError> {
    let parameters = Arc::default();
    FAMILIES.iter().try_for_each(|family| {
        let id = format!("demo-{}", family.name);
        let id = SceneId::new(&*id).map_err(|problem| SetError::Generated { id, problem: problem.into() })?;
        let source = Source::Generated { family, seed: 0, index: 0, parameters: Arc::clone(&parameters) };
        entries.push(SceneEntry { id, source });
        Ok(())
    })
}

/// Appends what the scene-set TOML at `path` wishes for. Nothing is made yet.
pub(super) fn generate(path: &Path, wish: &Generate, entries: &mut Vec<SceneEntry>) -> Result<(), SetError> {
    let toml = |problem: String| SetError::Toml { path: path.into(), problem };
    let families = Family::selected(&wish.family).ok_or_else(|| {
        let name = &wish.family;
        toml(format!("there is no family {name:?}; `scenarios families` shows those there are, and {ALL} means each"))
    })?;
    families.iter().try_for_each(|family| wish.parameters.check(family)).map_err(|error| toml(error.to_string()))?;
    let parameters = Arc::new(wish.parameters.clone());
    entries.reserve(families.len() * wish.count as usize);
    for family in families {
        let id = |index| match &wish.name {
            None => family.scene_id(wish.seed, index),
            Some(name) if wish.family == ALL => format!("{name}-{}", family.scene_id(wish.seed, index)),
            Some(name) => format!("{name}-{}-{index}", wish.seed),
        };
        for index in 0..wish.count {
            let id = SceneId::new(id(index)).map_err(|error| toml(format!("`name`: {error}")))?;
            let source = Source::Generated { family, seed: wish.seed, index, parameters: Arc::clone(&parameters) };
            entries.push(SceneEntry { id, source });
        }
    }
    Ok(())
}
