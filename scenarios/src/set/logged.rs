//! Where a node that knows the future finds it.

use std::sync::Arc;

use world::scene::{Scene, SceneId};

use super::SceneSet;

/// Scenes with their whole log, by id.
pub trait Logs: Send + Sync {
    /// The scene of this id.
    ///
    /// # Errors
    /// Why there is none, as a sentence.
    fn scene(&self, id: &SceneId) -> Result<Arc<Scene>, String>;
}

impl Logs for SceneSet {
    fn scene(&self, id: &SceneId) -> Result<Arc<Scene>, String> {
        let index = self.entries().iter().position(|entry| entry.id == *id);
        let index = index.ok_or_else(|| format!("scene {id} is not in the scene set of this node"))?;
        self.load(index).map(|(scene, _)| scene).map_err(|e| e.to_string())
    }
}
