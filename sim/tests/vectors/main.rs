//! What the simulator computes under the paper's rules against what other implementations compute.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may panic, and prints its table")]

mod fixture;
mod open_loop;
mod planner;

use std::path::Path;
use std::sync::Arc;

use scenarios::SceneSet;
use world::scene::Scene;

/// The twenty-second scenes that `wanted` takes, by name; none, with a word on it, where the shared data are missing.
fn scenes(wanted: impl Fn(&str) -> bool) -> Vec<Arc<Scene>> {
    vectors::shared("data/womd-derived/20s").map_or_else(Vec::new, |folder| load(&folder, wanted))
}

fn load(folder: &Path, wanted: impl Fn(&str) -> bool) -> Vec<Arc<Scene>> {
    let set = SceneSet::open(&[folder.display().to_string()]).unwrap();
    let indices = (0..set.entries().len()).filter(|index| wanted(set.entries()[*index].id.as_str()));
    indices.map(|index| set.load(index).unwrap().0).collect()
}
