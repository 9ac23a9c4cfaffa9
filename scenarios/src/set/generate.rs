//! Generated scenes as members of a set.

use std::path::Path;

use world::scene::SceneId;

use super::entry::SceneEntry;
use super::file::Generate;
use super::scan;
use crate::error::SetError;
use crate::generated::{FAMILIES, Family};
use crate::source::Source;
use crate::womd::WomdError;

/// Appends the built-in demo set: the first scene of each family, called `demo-FAMILY`.
pub(super) fn demo(entries: &mut Vec<SceneEntry>) -> Result<(), SetError> {
    FAMILIES.iter().try_for_each(|family| {
        entries.push(entry(family, format!("demo-{}", family.name), 0, 0)?);
        Ok(())
    })
}

/// Appends what the scene-set TOML at `path` wishes for.
pub(super) fn generate(path: &Path, wish: &Generate, entries: &mut Vec<SceneEntry>) -> Result<(), SetError> {
    let family = Family::named(&wish.family).ok_or_else(|| {
        let names: Vec<&str> = FAMILIES.iter().map(|family| family.name).collect();
        let problem = format!("there is no family {:?}; there are {}", wish.family, names.join(", "));
        SetError::Toml { path: path.into(), problem }
    })?;
    for index in 0..wish.count {
        let id = format!("{}-{}-{index}", family.name, wish.seed);
        entries.push(entry(family, id, wish.seed, index)?);
    }
    Ok(())
}

fn entry(family: &'static Family, id: String, seed: u64, index: u32) -> Result<SceneEntry, SetError> {
    let make = || -> Result<_, WomdError> {
        let payload = family.payload(&id, seed, index)?;
        Ok((SceneId::new(id.as_str())?, scan::sha256(&payload)))
    };
    let (scene, sha256) = make().map_err(|problem| SetError::Generated { id: id.clone(), problem })?;
    Ok(SceneEntry { id: scene, sha256, source: Source::Generated { family, seed, index } })
}
