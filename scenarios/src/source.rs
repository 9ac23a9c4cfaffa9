//! Where a scene lies: in a file, or nowhere until it is made.

use std::fmt;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::SystemTime;

use crate::generated::{Family, Parameters};
use crate::tfrecord::{Entrances, Packing};

/// A file with scenes, as it was when it was opened.
#[derive(Debug)]
pub struct SceneFile {
    /// Its path.
    pub path: PathBuf,
    /// Its length (bytes).
    pub bytes: u64,
    /// When it was changed last, where the file system tells.
    pub modified: Option<SystemTime>,
    /// Of a packed file, where it can be entered.
    pub packed: Option<Entrances>,
}

impl SceneFile {
    /// How it is packed, if it is.
    #[must_use]
    pub fn packing(&self) -> Option<Packing> {
        self.packed.as_ref().map(Entrances::packing)
    }
}

impl PartialEq for SceneFile {
    fn eq(&self, other: &Self) -> bool {
        (&self.path, self.bytes, self.modified) == (&other.path, other.bytes, other.modified)
    }
}

impl Eq for SceneFile {}

/// A record's place.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// The file.
    pub file: Arc<SceneFile>,
    /// The record's number in it, from 0.
    pub record: u64,
    /// Where the record begins in it, or in what it unpacks to.
    pub offset: u64,
    /// Length of the payload (bytes).
    pub bytes: u64,
    /// The masked CRC32C that is stored for the payload.
    pub checksum: u32,
}

/// Where a scene lies.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Source {
    /// In a TFRecord file.
    File(Place),
    /// A pickle of ScenarioNet's, as a whole.
    Pickle(Arc<SceneFile>),
    /// A table of Argoverse 2's, and the map beside it.
    Table {
        /// The states.
        table: Arc<SceneFile>,
        /// The map.
        map: Arc<SceneFile>,
    },
    /// Made when it is loaded.
    Generated {
        /// The family.
        family: &'static Family,
        /// Where its random numbers start.
        seed: u64,
        /// The scene's number among those of this seed.
        index: u32,
        /// What was given for its family.
        parameters: Arc<Parameters>,
    },
}

impl fmt::Display for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File(Place { file, record, .. }) => write!(f, "{} (record {record})", file.path.display()),
            Self::Pickle(file) | Self::Table { table: file, .. } => write!(f, "{}", file.path.display()),
            Self::Generated { family, seed, index, parameters } => {
                write!(f, "generated {}, seed {seed}, scene {index}", family.name)?;
                if parameters.is_empty() { Ok(()) } else { write!(f, ", {parameters}") }
            }
        }
    }
}
