//! What the simulator computes under the paper's rules against what other implementations compute.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may panic, and prints its table")]

mod fixture;
mod planner;

use std::sync::Arc;

use scenarios::SceneSet;
use world::scene::Scene;

/// The twenty-second scenes that `wanted` takes, by name; `None`, with a word on it, where the shared data are missing.
fn scenes(wanted: impl Fn(&str) -> bool) -> Option<Vec<Arc<Scene>>> {
    let folder = vectors::shared("data/womd-derived/20s")?;
    let set = SceneSet::open(&[folder.display().to_string()]).unwrap();
    let indices = (0..set.entries().len()).filter(|index| wanted(set.entries()[*index].id.as_str()));
    Some(indices.map(|index| set.load(index).unwrap().0).collect())
}
