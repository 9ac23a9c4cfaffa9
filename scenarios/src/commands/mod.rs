//! The subcommands, a file each. Each answers whether something is gravely wrong with a scene.

pub mod export;
pub mod inspect;
pub mod lint;
pub mod list;
mod scenes;
mod table;

use std::io;
use std::path::PathBuf;

use scenarios::SetError;
use thiserror::Error;

/// Why a command could not do its work.
#[derive(Debug, Error)]
pub enum Failure {
    /// The scenes are not to be had.
    #[error(transparent)]
    Set(#[from] SetError),
    /// There is no such scene among them.
    #[error("there is no scene {0}")]
    NoScene(String),
    /// Standard output does not take more.
    #[error("standard output: {0}")]
    Output(io::Error),
    /// A file is there already.
    #[error("{} is there already", .0.display())]
    Exists(PathBuf),
    /// Files cannot be put there.
    #[error("{} is no folder", .0.display())]
    NoFolder(PathBuf),
    /// A file cannot be written.
    #[error("{}: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
}

impl Failure {
    /// What the user can do.
    pub fn hint(&self) -> &'static str {
        match self {
            Self::Set(error) => error.hint(),
            Self::NoScene(_) => "`scenarios list` shows the ids that are there",
            Self::Output(_) => "see that there is room where the output goes",
            Self::Exists(_) => "give another folder, or --force to replace it",
            Self::NoFolder(_) => "it is a file; give a folder",
            Self::Write { .. } => "see that the folder can be written and has room",
        }
    }
}
