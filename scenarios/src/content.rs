//! What a file is that is no TFRecord, by its first bytes.

use std::fmt;

use crate::tfrecord::Packing;

/// A kind of file that people take for scenes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Content {
    /// Of ScenarioNet or MetaDrive, as a rule.
    Pickle,
    /// A log of nuPlan, as a rule.
    Sqlite,
    /// Packed with gzip or zlib, with something else in it.
    Packed(Packing),
    /// A zip archive.
    Zip,
    /// A table, such as Argoverse 2 has.
    Parquet,
    /// A note of Git LFS in the place of a file.
    LfsPointer,
}

impl Content {
    /// What begins with `start`, if that tells.
    pub(crate) fn of(start: &[u8]) -> Option<Self> {
        match start {
            // The mark of a pickle and its version; those before 2 have no mark.
            [0x80, 2..=5, ..] => Some(Self::Pickle),
            _ if start.starts_with(b"SQLite form") => Some(Self::Sqlite),
            _ if start.starts_with(b"PK\x03\x04") => Some(Self::Zip),
            _ if start.starts_with(b"PAR1") => Some(Self::Parquet),
            _ if start.starts_with(b"version ") => Some(Self::LfsPointer),
            _ => Packing::of(start).map(Self::Packed),
        }
    }

    /// What the user can do.
    pub(crate) fn hint(self) -> &'static str {
        match self {
            Self::Pickle => "name it .pkl, to have it read as a scene of ScenarioNet's",
            Self::Sqlite => "nuPlan's logs are not read: give WOMD's TFRecord files, in scenario format",
            Self::Packed(_) => "unpack it (gzip -d FILE, tar -xzf FILE) and see what it is",
            Self::Zip => "unpack it: unzip FILE",
            Self::Parquet => {
                "name it scenario_ID.parquet, with its map beside it, to have it read as a scene of Argoverse 2's"
            }
            Self::LfsPointer => "fetch the data behind it: git lfs pull",
        }
    }
}

impl fmt::Display for Content {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Pickle => f.write_str("a Python pickle (of ScenarioNet?)"),
            Self::Sqlite => f.write_str("an SQLite database (a nuPlan log?)"),
            Self::Packed(packing) => write!(f, "something compressed with {packing}"),
            Self::Zip => f.write_str("a zip archive"),
            Self::Parquet => f.write_str("a Parquet table"),
            Self::LfsPointer => f.write_str("a Git LFS pointer"),
        }
    }
}
