//! What can go wrong with scene sets. Every error says what to do next by its `hint`.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;
use world::scene::SceneId;

use crate::argoverse::ArgoverseError;
use crate::content::Content;
use crate::generated::GeneratedError;
use crate::scenarionet::ScenarioNetError;
use crate::set::IndexError;
use crate::source::{Place, Source};
use crate::tfrecord::{FrameError, FrameProblem, MAX_PAYLOAD_BYTES, PackedError, Packing, StreamError};
use crate::womd::WomdError;

/// A record that gives no scene: which, and why.
#[derive(Debug, Error)]
#[error("{}: {}{problem}", path.display(), InFile(self))]
pub struct RecordError {
    /// The file.
    pub path: PathBuf,
    /// The record's number in it, from 0.
    pub record: u64,
    /// Where the record begins in it, or in what it unpacks to.
    pub offset: u64,
    /// How the file is packed, if it is.
    pub packing: Option<Packing>,
    /// The file is not a row of records, but one scene: a pickle, or a table.
    pub whole: bool,
    /// What is wrong.
    pub problem: RecordProblem,
}

/// Where in its file a record is, if it is not the file.
struct InFile<'a>(&'a RecordError);

impl fmt::Display for InFile<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let RecordError { record, offset, packing, whole, .. } = self.0;
        if *whole { Ok(()) } else { write!(f, "record {record} at {}: ", Byte(*offset, *packing)) }
    }
}

/// A place in a file, or in what it unpacks to.
struct Byte(u64, Option<Packing>);

impl fmt::Display for Byte {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "byte {}{}", self.0, if self.1.is_some() { " unpacked" } else { "" })
    }
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
    /// The stream that the file is packed in is wrong.
    #[error("{0}")]
    Packed(PackedError),
    /// The file is something else.
    #[error("the file is {0}, not a TFRecord")]
    Foreign(Content),
    /// Its content is wrong.
    #[error("{0}")]
    Womd(WomdError),
    /// The pickle's content is wrong.
    #[error("{0}")]
    ScenarioNet(#[from] ScenarioNetError),
    /// The content of a table, or of the map beside it, is wrong.
    #[error("{0}")]
    Argoverse(#[from] ArgoverseError),
    /// The file is longer than what is read as a whole.
    #[error("the file has {0} bytes, more than the {MAX_PAYLOAD_BYTES} that are read")]
    TooLong(u64),
    /// It is not what it was when the set was opened.
    #[error("the file has changed since it was opened")]
    Changed,
}

impl RecordProblem {
    /// What went wrong in reading: the stream that the file is packed in, or the reading itself.
    pub(crate) fn io(error: io::Error) -> Self {
        match error.get_ref().and_then(|error| error.downcast_ref::<PackedError>()) {
            Some(packed) => Self::Packed(*packed),
            None => Self::Io(error),
        }
    }
}

impl RecordError {
    pub(crate) fn at(place: &Place, problem: RecordProblem) -> Self {
        let (path, packing) = (place.file.path.clone(), place.file.packing());
        Self { path, record: place.record, offset: place.offset, packing, whole: false, problem }
    }

    /// Of a file that is one scene.
    pub(crate) fn of_file(path: &Path, problem: RecordProblem) -> Self {
        Self { path: path.into(), record: 0, offset: 0, packing: None, whole: true, problem }
    }

    pub(crate) fn stream(path: &Path, packing: Option<Packing>, error: StreamError) -> Self {
        let (record, offset, problem) = match error {
            StreamError::Io { record, offset, source } => (record, offset, RecordProblem::io(source)),
            StreamError::Frame(FrameError { record, offset, problem }) => {
                let other =
                    matches!(problem, FrameProblem::HeaderChecksum { .. } | FrameProblem::TruncatedHeader { .. });
                match packing.filter(|_| offset == 0 && other) {
                    Some(packing) => (record, offset, RecordProblem::Foreign(Content::Packed(packing))),
                    None => (record, offset, RecordProblem::Frame(problem)),
                }
            }
        };
        Self { path: path.into(), record, offset, packing, whole: false, problem }
    }

    /// The scene that the record would be, where it tells.
    #[must_use]
    pub fn scene(&self) -> Option<&SceneId> {
        match &self.problem {
            RecordProblem::Womd(WomdError::LaserOnly { id }) => Some(id),
            _ => None,
        }
    }

    /// What the user can do.
    #[must_use]
    pub fn hint(&self) -> &'static str {
        match &self.problem {
            RecordProblem::Io(_) => "see that the file can be read and its disk is sound",
            RecordProblem::Frame(problem) => problem.hint(),
            RecordProblem::Packed(error) => error.problem.hint(),
            RecordProblem::Foreign(content) => content.hint(),
            RecordProblem::Womd(problem) => problem.hint(),
            RecordProblem::ScenarioNet(problem) => problem.hint(),
            RecordProblem::Argoverse(problem) => problem.hint(),
            RecordProblem::TooLong(_) => "cut it into shorter scenes or a smaller map when it is converted",
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
    #[error("there is no {}", path.display())]
    Missing { path: PathBuf },
    #[error("there is no {}: shards of that name are {name}-00000-of-{count:05} and so on", path.display())]
    Sharded { path: PathBuf, name: String, count: u32 },
    #[error("nothing matches {pattern}")]
    NoMatch { pattern: String },
    #[error("{pattern} is no glob: {problem}")]
    BadGlob { pattern: String, problem: String },
    #[error("the folder {} holds no scenes{}", path.display(), Among(passed_over))]
    EmptyFolder { path: PathBuf, passed_over: Vec<String> },
    #[error("{} holds no scenes, nor names any", path.display())]
    NotRecognised { path: PathBuf },
    #[error("{} is {content}, not a TFRecord", path.display())]
    Foreign { path: PathBuf, content: Content },
    #[error("{}: {problem}", path.display())]
    Database { path: PathBuf, problem: ScenarioNetError },
    #[error(transparent)]
    Record(#[from] RecordError),
    #[error("the scene {id} is there twice, with other bytes: in {} and in {}", places[0], places[1])]
    Duplicate { id: SceneId, places: Box<[Source; 2]> },
    #[error("{}: {problem}", set.display())]
    InSet { set: PathBuf, problem: Box<SetError> },
    #[error("{}: {problem}", path.display())]
    Toml { path: PathBuf, problem: String },
    #[error("{}: `scenes` names {}, which none of its files holds", path.display(), ids.join(", "))]
    UnknownScenes { path: PathBuf, ids: Vec<String> },
    #[error("there is no scene in {}", inputs.join(", "))]
    NoScenes { inputs: Vec<String> },
    #[error("there is no scene {index}: the set has {scenes}")]
    Number { index: usize, scenes: usize },
    #[error("{}: {problem}", path.display())]
    Index { path: PathBuf, problem: IndexError },
    #[error("the generated scene {id} cannot be used: {problem}")]
    Generated { id: String, problem: GeneratedError },
}

/// The files that a folder does hold, as far as they were looked at.
struct Among<'a>(&'a [String]);

impl fmt::Display for Among<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            [] => Ok(()),
            [one] => write!(f, ", but {one}"),
            [one, more @ ..] => write!(f, ", but {one} and {} more", more.len()),
        }
    }
}

impl SetError {
    /// What the user can do.
    #[must_use]
    pub fn hint(&self) -> &'static str {
        match self {
            Self::Io { .. } => "see that the path is right and can be read",
            Self::Missing { .. } => {
                "paths are relative to the folder that the command is called in; the word demo means the built-in scenes"
            }
            Self::Sharded { .. } => "give the shards by a glob, 'NAME-*-of-*', or their folder",
            Self::NoMatch { .. } | Self::BadGlob { .. } => {
                "quote globs, so that the shell leaves them alone: 'data/*.tfrecord*'"
            }
            Self::EmptyFolder { passed_over, .. } if passed_over.iter().any(|name| name.ends_with(".db")) => {
                Content::Sqlite.hint()
            }
            Self::Foreign { content, .. } => content.hint(),
            Self::EmptyFolder { passed_over, .. } if !passed_over.is_empty() => {
                "by their names these hold no scenes: fetch the shards that they belong to"
            }
            Self::EmptyFolder { .. } => {
                "TFRecord files are known by `.tfrecord` in their names, pickles by `.pkl` behind them, Argoverse 2's tables as scenario_ID.parquet: name others one by one"
            }
            Self::NotRecognised { .. } => {
                "give TFRecord files, pickles or Argoverse 2's tables, folders or globs of them, a scene-set TOML (*.toml), or the word demo"
            }
            Self::Record(error) => error.hint(),
            Self::Database { .. } => {
                "give the scenes' files themselves, by a glob, or make the index again by ScenarioNet"
            }
            Self::Duplicate { .. } => {
                "they differ: leave one of the files out, or keep other scenes alone by `scenes` in a scene-set TOML"
            }
            Self::InSet { problem, .. } => match **problem {
                Self::Io { .. } | Self::Missing { .. } | Self::NoMatch { .. } => {
                    "paths in a scene-set TOML are relative to its folder: see that this one is right"
                }
                ref problem => problem.hint(),
            },
            Self::Toml { .. } => "docs/scenes.md shows what a scene-set TOML may hold",
            Self::UnknownScenes { .. } => "`scenarios list` shows the ids that are there",
            Self::NoScenes { .. } => "the files are empty: `scenarios list` shows what is in others",
            Self::Number { .. } => "count from 0",
            Self::Index { .. } => "make it again: scenarios index PATH ... --out FILE",
            Self::Generated { .. } => "take another seed, or parameters that are less extreme",
        }
    }
}
