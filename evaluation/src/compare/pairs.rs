//! Which episodes are set side by side: those of one scene under one set of rules.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use episode::protocol::Protocol;
use results::parquet::ParquetError;
use results::summary::SummaryError;
use serde::Serialize;
use thiserror::Error;

use super::run::{Episode, Run};

/// Two runs that cannot be compared.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum CompareError {
    #[error(transparent)]
    Run(#[from] SummaryError),
    #[error(transparent)]
    Parquet(#[from] ParquetError),
    #[error(
        "the protocols differ: {a} in A, {b} in B; numbers of one are never held to the other's\nhint: drive one of them again with --protocol"
    )]
    Protocols { a: &'static str, b: &'static str },
    #[error("the rules of strict differ:\n  {}\nhint: drive one of them again with the other's --set", .0.join("\n  "))]
    Settings(Vec<String>),
    #[error("{}: the scene {scene} is in results.parquet twice\nhint: drive the run again into another folder with --out", folder.display())]
    Twice { folder: PathBuf, scene: String },
    #[error(
        "no scene can be paired: {only_a} in A alone, {only_b} in B alone, {other_content} with other content, {undrivable} not drivable\n\
             hint: drive both over the same --scenarios"
    )]
    NoPair { only_a: usize, only_b: usize, other_content: usize, undrivable: usize },
}

/// Scenes that are left out, by name, each kind in the order of its run.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct LeftOut {
    /// In A and not in B.
    pub only_a: Vec<String>,
    /// In B and not in A.
    pub only_b: Vec<String>,
    /// In both by name, but the records' hashes differ.
    pub other_content: Vec<String>,
    /// Not drivable in one of them or both: that is the scene's fault.
    pub undrivable: Vec<String>,
}

impl LeftOut {
    /// How many scenes of A have no partner in B.
    #[must_use]
    pub fn missing(&self) -> usize {
        self.only_a.len() + self.other_content.len()
    }
}

/// The episodes of A and of B in a scene.
pub(crate) type Pair<'a> = (&'a Episode, &'a Episode);

/// The paired episodes, in A's order, and what is left out.
///
/// # Errors
/// [`CompareError`] where the rules differ or nothing is left.
pub(crate) fn pair<'a>(a: &'a Run, b: &'a Run) -> Result<(Vec<Pair<'a>>, LeftOut), CompareError> {
    refuse_other_rules(&a.protocol, &b.protocol)?;
    let (in_a, in_b) = (by_scene(a)?, by_scene(b)?);
    let (mut pairs, mut left) = (Vec::new(), LeftOut::default());
    for episode in &a.episodes {
        let scene = episode.scene.clone();
        match in_b.get(&*episode.scene) {
            None => left.only_a.push(scene),
            Some(other) if other.sha256 != episode.sha256 => left.other_content.push(scene),
            Some(other) if !episode.is_drivable() || !other.is_drivable() => left.undrivable.push(scene),
            Some(other) => pairs.push((episode, *other)),
        }
    }
    let only_b = b.episodes.iter().map(|episode| &episode.scene).filter(|scene| !in_a.contains_key(scene.as_str()));
    left.only_b = only_b.cloned().collect();
    if pairs.is_empty() {
        let LeftOut { only_a, only_b, other_content, undrivable } = &left;
        let [only_a, only_b] = [only_a, only_b].map(Vec::len);
        return Err(CompareError::NoPair {
            only_a,
            only_b,
            other_content: other_content.len(),
            undrivable: undrivable.len(),
        });
    }
    Ok((pairs, left))
}

fn by_scene(run: &Run) -> Result<BTreeMap<&str, &Episode>, CompareError> {
    let mut episodes = BTreeMap::new();
    for episode in &run.episodes {
        if episodes.insert(&*episode.scene, episode).is_some() {
            return Err(twice(&run.folder, &episode.scene));
        }
    }
    Ok(episodes)
}

fn twice(folder: &Path, scene: &str) -> CompareError {
    CompareError::Twice { folder: folder.to_owned(), scene: scene.to_owned() }
}

/// The motion may differ: who plays the log back is no bicycle, and reports say so.
fn refuse_other_rules(a: &Protocol, b: &Protocol) -> Result<(), CompareError> {
    let (Protocol::Strict(strict_a), Protocol::Strict(strict_b)) = (a, b) else {
        let [a, b] = [a, b].map(Protocol::name);
        return if a == b { Ok(()) } else { Err(CompareError::Protocols { a, b }) };
    };
    let table = |settings| match serde_json::to_value(settings) {
        Ok(serde_json::Value::Object(table)) => table,
        _ => serde_json::Map::new(),
    };
    let (there, here) = (table(strict_a), table(strict_b));
    let differ = there.iter().filter(|(key, value)| *key != "motion" && here.get(*key) != Some(value));
    let text = |value: Option<&serde_json::Value>| value.map_or_else(|| "nothing".to_owned(), ToString::to_string);
    let lines = differ.map(|(key, value)| format!("{key}: {} in A, {} in B", text(Some(value)), text(here.get(key))));
    let lines: Vec<String> = lines.collect();
    if lines.is_empty() { Ok(()) } else { Err(CompareError::Settings(lines)) }
}
