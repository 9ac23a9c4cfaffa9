//! Generated scenes as members of a set.

use std::path::Path;
use std::sync::Arc;

use rayon::prelude::*;
use world::scene::SceneId;

use super::entry::SceneEntry;
use super::file::Generate;
use super::scan;
use crate::error::SetError;
use crate::generated::GeneratedError;
use crate::generated::{ALL, FAMILIES, Family, Parameters};
use crate::source::Source;

/// A scene that is to be made: its family, its name, its number.
type Wished = (&'static Family, String, u32);

/// Appends the built-in demo set: the first scene of each family, called `demo-FAMILY`.
pub(super) fn demo(entries: &mut Vec<SceneEntry>) -> Result<(), SetError> {
    let wished = FAMILIES.iter().map(|family| (family, format!("demo-{}", family.name), 0)).collect();
    make(wished, 0, &Arc::default(), entries)
}

/// Appends what the scene-set TOML at `path` wishes for.
pub(super) fn generate(path: &Path, wish: &Generate, entries: &mut Vec<SceneEntry>) -> Result<(), SetError> {
    let toml = |problem: String| SetError::Toml { path: path.into(), problem };
    let families = Family::selected(&wish.family).ok_or_else(|| {
        let name = &wish.family;
        toml(format!("there is no family {name:?}; `scenarios families` shows those there are, and {ALL} means each"))
    })?;
    families.iter().try_for_each(|family| wish.parameters.check(family)).map_err(|error| toml(error.to_string()))?;
    let mut wished = Vec::new();
    for family in families {
        let id = |index| match &wish.name {
            None => family.scene_id(wish.seed, index),
            Some(name) if wish.family == ALL => format!("{name}-{}", family.scene_id(wish.seed, index)),
            Some(name) => format!("{name}-{}-{index}", wish.seed),
        };
        SceneId::new(id(wish.count).as_str()).map_err(|error| toml(format!("`name`: {error}")))?;
        wished.extend((0..wish.count).map(|index| (family, id(index), index)));
    }
    make(wished, wish.seed, &Arc::new(wish.parameters.clone()), entries)
}

/// Makes each scene once, on all cores, to know its hash.
fn make(
    wished: Vec<Wished>,
    seed: u64,
    parameters: &Arc<Parameters>,
    entries: &mut Vec<SceneEntry>,
) -> Result<(), SetError> {
    let made: Result<Vec<SceneEntry>, SetError> =
        wished.into_par_iter().map(|wished| entry(wished, seed, parameters)).collect();
    entries.append(&mut made?);
    Ok(())
}

fn entry((family, id, index): Wished, seed: u64, parameters: &Arc<Parameters>) -> Result<SceneEntry, SetError> {
    let make = || -> Result<_, GeneratedError> {
        let payload = family.payload(&id, seed, index, parameters)?;
        Ok((SceneId::new(id.as_str())?, scan::sha256(&payload)))
    };
    let (scene, sha256) = make().map_err(|problem| SetError::Generated { id: id.clone(), problem })?;
    let parameters = Arc::clone(parameters);
    Ok(SceneEntry { id: scene, sha256, source: Source::Generated { family, seed, index, parameters } })
}
