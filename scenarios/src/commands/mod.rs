//! The subcommands, a file each. Each answers whether something is gravely wrong with a scene.

pub mod export;
pub mod families;
pub mod fetch;
pub mod generate;
pub mod index;
pub mod inspect;
pub mod lint;
pub mod list;
mod parquet;
pub mod render;
mod scenes;
pub mod stats;
mod table;
mod whole_file;

use std::io;
use std::path::{Path, PathBuf};

use scenarios::SetError;
use scenarios::generated::GeneratedError;
use scenarios::generated::ParameterError;
use scenarios::picture::{NoStep, PngError};
use thiserror::Error;

/// The exit code of an interrupted program.
pub const INTERRUPTED: u8 = 130;

/// Why a command could not do its work.
#[derive(Debug, Error)]
pub enum Failure {
    /// The scenes are not to be had.
    #[error(transparent)]
    Set(#[from] SetError),
    /// There is no such scene among them.
    #[error("there is no scene {0}")]
    NoScene(String),
    /// There is no such family.
    #[error("there is no family {0:?}")]
    NoFamily(String),
    /// The parameters are none.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// The folder holds shards of other settings.
    #[error("{} holds scenes of other settings: {}", folder.display(), differences.join("; "))]
    OtherSettings {
        /// The folder.
        folder: PathBuf,
        /// What is there, and what was asked for.
        differences: Vec<String>,
    },
    /// The settings in the folder cannot be understood.
    #[error("{}: {problem}", path.display())]
    BadSettings {
        /// The file.
        path: PathBuf,
        /// Why.
        problem: String,
    },
    /// Another process generates there.
    #[error("somebody else generates scenes in {}", .0.display())]
    Busy(PathBuf),
    /// A family made no scene.
    #[error("the scene {id} cannot be made: {problem}")]
    Scene {
        /// Its name.
        id: String,
        /// Why.
        problem: GeneratedError,
    },
    /// Ctrl-C.
    #[error("interrupted; the files that are there are whole")]
    Interrupted,
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
    /// Pictures are not drawn in this format.
    #[error("{}: a picture ends in .png or .svg", .0.display())]
    NoPictureFormat(PathBuf),
    /// A file is wanted in a folder that is not there.
    #[error("there is no folder {}", .0.display())]
    MissingFolder(PathBuf),
    /// A scene has no such step.
    #[error(transparent)]
    NoStep(#[from] NoStep),
    /// A sheet does not take so many scenes.
    #[error("{scenes} scenes are too many for one sheet: at most {most}")]
    TooManyTiles {
        /// As many were asked for.
        scenes: usize,
        /// As many fit.
        most: usize,
    },
    /// Samples are not to be had.
    #[error(transparent)]
    Fetch(#[from] fetch::FetchError),
    /// A picture cannot be a PNG.
    #[error(transparent)]
    Png(#[from] PngError),
}

impl Failure {
    fn write(path: &Path, source: io::Error) -> Self {
        Self::Write { path: path.into(), source }
    }

    /// What the user can do.
    pub fn hint(&self) -> &'static str {
        match self {
            Self::Set(error) => error.hint(),
            Self::NoScene(_) => "`scenarios list` shows the ids that are there",
            Self::NoFamily(_) => "`scenarios families` lists them",
            Self::Parameter(error) => error.hint(),
            Self::OtherSettings { .. } => "give another folder, or --force to remove its shards and start anew",
            Self::BadSettings { .. } => "give another folder, or --force to start anew",
            Self::Busy(_) => "wait for it, or give another folder",
            Self::Scene { .. } => "take another seed, or parameters that are less extreme",
            Self::Interrupted => "the same command goes on from there",
            Self::Output(_) => "see that there is room where the output goes",
            Self::Exists(_) => "give another folder, or --force to replace it",
            Self::NoFolder(_) => "it is a file; give a folder",
            Self::Write { .. } => "see that the folder can be written and has room",
            Self::NoPictureFormat(_) => {
                "name the file so: --out scene.png, or --out scene.svg for a drawing that stays sharp"
            }
            Self::MissingFolder(_) => "make it first, or name a file in a folder that is there",
            Self::NoStep(_) => "steps count from 0; without --step each scene is shown where drives begin",
            Self::TooManyTiles { .. } => "name fewer by --scene, and draw several sheets",
            Self::Fetch(error) => error.hint(),
            Self::Png(PngError::TooLarge { .. }) => "give a smaller --width, or draw an .svg",
            Self::Png(PngError::Drawing(_)) => "draw an .svg instead, and please report this with the scene",
        }
    }
}
