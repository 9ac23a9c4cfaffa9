//! Where a scene lies: in a file, or nowhere until it is made.

use std::fmt;
use std::path::Path;
use std::sync::Arc;

use crate::generated::{Family, Parameters};
use crate::tfrecord::Restart;

/// A record's place.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// The file.
    pub path: Arc<Path>,
    /// The record's number in it, from 0.
    pub record: u64,
    /// Where the record begins in it, or in what it unpacks to.
    pub offset: u64,
    /// Length of the payload (bytes).
    pub bytes: u64,
    /// The masked CRC32C of the payload.
    pub checksum: u32,
    /// For a packed file, a place before the record from which it can be unpacked.
    pub packed: Option<Arc<Restart>>,
}

/// Where a scene lies.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Source {
    /// In a TFRecord file.
    File(Place),
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
            Self::File(Place { path, record, .. }) => write!(f, "{} (record {record})", path.display()),
            Self::Generated { family, seed, index, parameters } => {
                write!(f, "generated {}, seed {seed}, scene {index}", family.name)?;
                if parameters.is_empty() { Ok(()) } else { write!(f, ", {parameters}") }
            }
        }
    }
}
