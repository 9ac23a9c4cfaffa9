//! What can be wrong with a file of windows.

use std::io;
use std::path::PathBuf;

use thiserror::Error;

/// What is wrong with bytes that should be windows.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum FileProblem {
    #[error("it is no file of windows")]
    Foreign,
    #[error("it is of version {found}, and this program reads version {known}")]
    Version { found: u32, known: u32 },
    #[error("it ends too early")]
    CutShort,
    #[error("its checksum is wrong")]
    Checksum,
    #[error("it holds {0}")]
    Impossible(&'static str),
    #[error("its settings cannot be read: {0}")]
    Settings(String),
}

impl FileProblem {
    fn hint(&self) -> &'static str {
        match self {
            Self::Foreign => "give a file that `trainer prepare` wrote",
            _ => "make it anew: trainer prepare PATH... --out FILE",
        }
    }
}

/// Why windows cannot be had.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum WindowsError {
    #[error("{}: {source}\nhint: see that the path is right and can be read", path.display())]
    Io { path: PathBuf, source: io::Error },
    #[error("{}: {problem}\nhint: {}", path.display(), problem.hint())]
    File { path: PathBuf, problem: FileProblem },
    #[error("{}: window {index} (scene {scene}, step {step}): {problem}\nhint: {}", path.display(), problem.hint())]
    Window { path: PathBuf, index: usize, scene: String, step: u32, problem: FileProblem },
    #[error("there is no window {index}: there are {windows}\nhint: count from 0")]
    Index { index: usize, windows: usize },
    #[error("no file of windows is given\nhint: make one: trainer prepare PATH... --out FILE")]
    NoFile,
    #[error(
        "the features of {} are not whose those of {} are\nhint: prepare both with the same --features",
        paths[0].display(), paths[1].display()
    )]
    OtherFeatures { paths: Box<[PathBuf; 2]> },
    #[error(
        "the scene {scene} trains in one file and validates in another, {}\nhint: prepare both with the same split", path.display()
    )]
    BothRoles { scene: String, path: PathBuf },
}
