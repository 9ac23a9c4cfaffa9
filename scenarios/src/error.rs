//! What can go wrong with scene sets. Every error says what to do next by its `hint`.

use std::io;
use std::path::PathBuf;

use thiserror::Error;
use world::scene::SceneId;

use crate::source::Source;
use crate::tfrecord::{FrameError, FrameProblem, StreamError};
use crate::womd::WomdError;

/// A record that gives no scene: which, and why.
#[derive(Debug, Error)]
#[error("{}: record {record} at byte {offset}: {problem}", path.display())]
pub struct RecordError {
    /// The file.
    pub path: PathBuf,
    /// The record's number in it, from 0.
    pub record: u64,
    /// Where the record begins in it.
    pub offset: u64,
    /// What is wrong.
    pub problem: RecordProblem,
}

/// What is wrong with a record.
#[derive(Debug, Error)]
pub enum RecordProblem {
    /// It could not be read.
    #[error("{0}")]
    Io(io::Error),
    /// Its frame is wrong.
    #[error("{0}")]
    Frame(FrameProblem),
    /// Its content is wrong.
    #[error("{0}")]
    Womd(WomdError),
    /// It is not what it was when the set was opened.
    #[error("the file has changed since it was opened")]
    Changed,
}

impl RecordError {
    pub(crate) fn stream(path: impl Into<PathBuf>, error: StreamError) -> Self {
        let path = path.into();
        match error {
            StreamError::Io { record, offset, source } => {
                Self { path, record, offset, problem: RecordProblem::Io(source) }
            }
            StreamError::Frame(FrameError { record, offset, problem }) => {
                Self { path, record, offset, problem: RecordProblem::Frame(problem) }
            }
        }
    }

    /// What the user can do.
    #[must_use]
    pub fn hint(&self) -> &'static str {
        match &self.problem {
            RecordProblem::Io(_) => "see that the file can be read and its disk is sound",
            RecordProblem::Frame(problem) => problem.hint(),
            RecordProblem::Womd(problem) => problem.hint(),
            RecordProblem::Changed => "leave scene files alone while they are being driven",
        }
    }
}

/// Why there is no scene set, or no scene of it.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum SetError {
    #[error("{}: {source}", path.display())]
    Io { path: PathBuf, source: io::Error },
    #[error("nothing matches {pattern}")]
    NoMatch { pattern: String },
    #[error("{pattern} is no glob: {problem}")]
    BadGlob { pattern: String, problem: String },
    #[error("the folder {} holds no TFRecord file", path.display())]
    EmptyFolder { path: PathBuf },
    #[error("{} is neither a TFRecord file nor a scene-set TOML", path.display())]
    NotRecognised { path: PathBuf },
    #[error(transparent)]
    Record(#[from] RecordError),
    #[error("the scene {id} is there twice: in {first} and in {second}")]
    Duplicate { id: SceneId, first: Source, second: Source },
    #[error("{}: {problem}", set.display())]
    InSet { set: PathBuf, problem: Box<SetError> },
    #[error("{}: {problem}", path.display())]
    Toml { path: PathBuf, problem: String },
    #[error("{}: `scenes` names {}, which none of its files holds", path.display(), ids.join(", "))]
    UnknownScenes { path: PathBuf, ids: Vec<String> },
    #[error("there is no scene in {}", inputs.join(", "))]
    NoScenes { inputs: Vec<String> },
    #[error("there is no scene {index}: the set has {scenes}")]
    Index { index: usize, scenes: usize },
    #[error("the generated scene {id} cannot be used: {problem}")]
    Generated { id: String, problem: WomdError },
}

impl SetError {
    /// What the user can do.
    #[must_use]
    pub fn hint(&self) -> &'static str {
        match self {
            Self::Io { .. } => "see that the path is right and can be read",
            Self::NoMatch { .. } | Self::BadGlob { .. } => {
                "quote globs, so that the shell leaves them alone: 'data/*.tfrecord*'"
            }
            Self::EmptyFolder { .. } => {
                "TFRecord files are known by `.tfrecord` in their names: name others one by one"
            }
            Self::NotRecognised { .. } => {
                "give TFRecord files, folders or globs of them, a scene-set TOML (*.toml), or the word demo"
            }
            Self::Record(error) => error.hint(),
            Self::Duplicate { .. } => "name each file once, or keep some scenes by `scenes` in a scene-set TOML",
            Self::InSet { problem, .. } => match **problem {
                Self::Io { .. } | Self::NoMatch { .. } => {
                    "paths in a scene-set TOML are relative to its folder: see that this one is right"
                }
                ref problem => problem.hint(),
            },
            Self::Toml { .. } => "docs/scenes.md shows what a scene-set TOML may hold",
            Self::UnknownScenes { .. } => "`scenarios list` shows the ids that are there",
            Self::NoScenes { .. } => "the files are empty: `scenarios list` shows what is in others",
            Self::Index { .. } => "count from 0",
            Self::Generated { .. } => "take another seed, and tell us of this one: it is a fault of ours",
        }
    }
}
