//! Where a scene lies: in a file, or nowhere until it is made.

use std::fmt;
use std::path::Path;
use std::sync::Arc;

use crate::generated::Family;

/// Where a scene lies.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Source {
    /// In a TFRecord file.
    File {
        /// The file.
        path: Arc<Path>,
        /// The record's number in it, from 0.
        record: u64,
        /// Where the record begins in it.
        offset: u64,
        /// Length of the payload (bytes).
        bytes: u64,
        /// The masked CRC32C of the payload.
        checksum: u32,
    },
    /// Made when it is loaded.
    Generated {
        /// The family.
        family: &'static Family,
        /// Where its random numbers start.
        seed: u64,
        /// The scene's number among those of this seed.
        index: u32,
    },
}

impl fmt::Display for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File { path, record, .. } => write!(f, "{} (record {record})", path.display()),
            Self::Generated { family, seed, index } => {
                write!(f, "generated {}, seed {seed}, scene {index}", family.name)
            }
        }
    }
}
