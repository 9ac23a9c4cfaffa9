//! Files that are there whole or not at all: written under another name, brought to the disk, renamed.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use thiserror::Error;

/// Why a file was not written.
#[derive(Debug, Error)]
#[error("{}: {source}\nhint: see that the folder can be written and has room", path.display())]
pub struct WriteError {
    /// The file.
    pub path: PathBuf,
    /// Why.
    pub source: io::Error,
}

impl WriteError {
    /// An error at `path`, for `map_err`.
    pub fn at(path: &Path) -> impl FnOnce(io::Error) -> Self {
        move |source| Self { path: path.to_owned(), source }
    }
}

/// Writes a file by `fill`, which is given the path to write to. One at a time writes a file: what a killed program left is written over.
///
/// # Errors
/// [`WriteError`].
pub fn write_by(path: &Path, fill: impl FnOnce(&Path) -> io::Result<()>) -> Result<(), WriteError> {
    let mut partial = path.as_os_str().to_owned();
    partial.push(".partial");
    let partial = PathBuf::from(partial);
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let write = || {
        fill(&partial)?;
        File::open(&partial)?.sync_all()?;
        fs::rename(&partial, path)?;
        // The name too.
        File::open(folder)?.sync_all()
    };
    write().map_err(WriteError::at(path))
}

/// Writes `bytes`.
///
/// # Errors
/// [`WriteError`].
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), WriteError> {
    write_by(path, |path| File::create(path)?.write_all(bytes))
}
