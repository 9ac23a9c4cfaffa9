//! Bytes from a file that may be anything.

use std::fs::File;
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};

use thiserror::Error;

/// The largest file that is read (bytes). The longest drives among a thousand agents come to some hundred megabytes.
const LIMIT: u64 = 1 << 30;

/// Why a file's bytes are not there.
#[derive(Debug, Error)]
pub enum LoadError {
    /// The system says so.
    #[error("cannot read {}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// It has no end, or is something else.
    #[error("{} is no recording: it has more than {} MiB\n  hint: recordings are the files <run>/episodes/<scene>.mcap", path.display(), LIMIT >> 20)]
    TooLarge {
        /// The file.
        path: PathBuf,
    },
}

/// Reads a file whole.
///
/// # Errors
/// [`LoadError`].
pub fn load(path: &Path) -> Result<Vec<u8>, LoadError> {
    let failed = |source| LoadError::Read { path: path.to_owned(), source };
    let file = File::open(path).map_err(failed)?;
    let length = file.metadata().map_err(failed)?.len();
    let mut bytes = Vec::new();
    if length <= LIMIT {
        // A device says that it is empty.
        file.take(LIMIT + 1).read_to_end(&mut bytes).map_err(failed)?;
    }
    if length.max(bytes.len() as u64) > LIMIT { Err(LoadError::TooLarge { path: path.to_owned() }) } else { Ok(bytes) }
}
