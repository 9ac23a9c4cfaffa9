//! Why there is nothing to verify.

use std::path::PathBuf;

use scenarios::SetError;
use thiserror::Error;
use vectors::{FolderError, NpzError};

/// Why there is nothing to verify.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum VerifyError {
    #[error(transparent)]
    Folder(#[from] FolderError),
    // It names its cause itself.
    #[error("{0}")]
    Set(SetError),
    #[error(transparent)]
    Npz(#[from] NpzError),
    #[error("cannot read {path}")]
    Json { path: PathBuf, source: std::io::Error },
    #[error("{path} is not what it should be")]
    JsonContent { path: PathBuf, source: serde_json::Error },
    #[error(
        "{0} has no vectors of any of these scenes\nhint: they are named SCENE__route.npz, SCENE__human.npz, SCENE__constant-velocity.npz, SCENE__planner.npz"
    )]
    NoScene(PathBuf),
}
