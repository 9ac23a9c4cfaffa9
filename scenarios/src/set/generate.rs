//! Generated scenes as members of a set.

use std::path::Path;
use std::sync::Arc;

use world::scene::SceneId;

use super::entry::SceneEntry;
use super::file::Generate;
use super::scan;
use crate::error::SetError;
use crate::generated::{FAMILIES, Family, Parameters};
use crate::source::Source;
use crate::womd::WomdError;

/// Appends the built-in demo set: the first scene of each family, called `demo-FAMILY`.
pub(super) fn demo(entries: &mut Vec<SceneEntry>) -> Result<(), SetError> {
    let parameters = Arc::default();
    FAMILIES.iter().try_for_each(|family| {
        entries.push(entry(family, format!("demo-{}", family.name), 0, 0, &parameters)?);
        Ok(())
    })
}

/// Appends what the scene-set TOML at `path` wishes for.
pub(super) fn generate(path: &Path, wish: &Generate, entries: &mut Vec<SceneEntry>) -> Result<(), SetError> {
    let toml = |problem: String| SetError::Toml { path: path.into(), problem };
    let families = families(&wish.family).map_err(toml)?;
    families.iter().try_for_each(|family| wish.parameters.check(family)).map_err(|error| toml(error.to_string()))?;
    let parameters = Arc::new(wish.parameters.clone());
    for family in families {
        let name = match &wish.name {
            None => family.name.to_owned(),
            Some(name) if wish.family == ALL => format!("{name}-{}", family.name),
            Some(name) => name.clone(),
        };
        let id = |index| format!("{name}-{}-{index}", wish.seed);
        SceneId::new(id(wish.count).as_str()).map_err(|error| toml(format!("`name` {name:?}: {error}")))?;
        for index in 0..wish.count {
            entries.push(entry(family, id(index), wish.seed, index, &parameters)?);
        }
    }
    Ok(())
}

/// The word for all families.
const ALL: &str = "all";

fn families(name: &str) -> Result<Vec<&'static Family>, String> {
    if name == ALL {
        return Ok(FAMILIES.iter().collect());
    }
    let none =
        || format!("there is no family {name:?}; `scenarios families` shows those there are, and {ALL} means each");
    Family::named(name).map(|family| vec![family]).ok_or_else(none)
}

fn entry(
    family: &'static Family,
    id: String,
    seed: u64,
    index: u32,
    parameters: &Arc<Parameters>,
) -> Result<SceneEntry, SetError> {
    let make = || -> Result<_, WomdError> {
        let payload = family.payload(&id, seed, index, parameters)?;
        Ok((SceneId::new(id.as_str())?, scan::sha256(&payload)))
    };
    let (scene, sha256) = make().map_err(|problem| SetError::Generated { id: id.clone(), problem })?;
    let parameters = Arc::clone(parameters);
    Ok(SceneEntry { id: scene, sha256, source: Source::Generated { family, seed, index, parameters } })
}
