//! The scenes that a command is about.

use scenarios::{SceneEntry, SceneSet};

use super::Failure;
use crate::cli::Inputs;

/// Opened scenes, those that were asked for alone.
pub struct Scenes {
    pub set: SceneSet,
    chosen: Vec<usize>,
}

impl Scenes {
    pub fn open(inputs: &Inputs) -> Result<Self, Failure> {
        let set = SceneSet::open(&inputs.paths)?;
        let place = |id: &String| {
            let found = set.entries().iter().position(|entry| entry.id.as_str() == id);
            found.ok_or_else(|| Failure::NoScene(id.clone()))
        };
        let mut chosen = inputs.scene.iter().map(place).collect::<Result<Vec<usize>, Failure>>()?;
        if chosen.is_empty() {
            chosen = (0..set.entries().len()).collect();
        }
        tracing::debug!("{} scenes opened, {} chosen", set.entries().len(), chosen.len());
        Ok(Self { set, chosen })
    }

    /// The chosen scenes and their places in the set.
    pub fn iter(&self) -> impl Iterator<Item = (usize, &SceneEntry)> {
        self.chosen.iter().map(|index| (*index, &self.set.entries()[*index]))
    }

    pub fn len(&self) -> usize {
        self.chosen.len()
    }
}
