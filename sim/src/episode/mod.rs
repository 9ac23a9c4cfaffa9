//! One drive through one scene.
