//! Files, with the path in every error, and whole under their final name or not there at all.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};
use thiserror::Error;

/// Something could not be done with a file.
#[derive(Debug, Error)]
#[error("cannot {doing} {}: {source}", path.display())]
pub struct FileError {
    /// What was being done.
    pub doing: &'static str,
    /// With which file or folder.
    pub path: PathBuf,
    /// Why not.
    pub source: io::Error,
}

/// Puts the path into an error.
pub fn at<'p>(doing: &'static str, path: &'p Path) -> impl FnOnce(io::Error) -> FileError + 'p {
    move |source| FileError { doing, path: path.to_owned(), source }
}

/// The bytes of a file; `None` if there is none.
///
/// # Errors
/// [`FileError`] when it is there and cannot be read.
pub fn read(path: &Path) -> Result<Option<Vec<u8>>, FileError> {
    match fs::read(path) {
        Ok(bytes) => Ok(Some(bytes)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(at("read", path)(error)),
    }
}

/// Writes a file so that after a crash there is all of it or nothing: `.partial`, fsync, rename, fsync of the folder.
///
/// # Errors
/// [`FileError`].
pub fn write_whole(path: &Path, write: impl FnOnce(&mut File) -> io::Result<()>) -> Result<(), FileError> {
    let partial = partial_name(path);
    let mut file = File::create(&partial).map_err(at("create", &partial))?;
    let written = write(&mut file).and_then(|()| file.flush()).and_then(|()| file.sync_all());
    drop(file);
    if let Err(error) = written {
        // On a full disk it would hold the room that the next attempt needs.
        let _ = fs::remove_file(&partial);
        return Err(at("write", &partial)(error));
    }
    fs::rename(&partial, path).map_err(at("rename", &partial))?;
    path.parent().map_or(Ok(()), sync_folder)
}

/// Makes the names in a folder survive a crash.
fn sync_folder(folder: &Path) -> Result<(), FileError> {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    File::open(folder).and_then(|file| file.sync_all()).map_err(at("write", folder))
}

/// The name that a file has until it is whole.
fn partial_name(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".partial");
    PathBuf::from(name)
}

/// SHA-256 of these files, one after the other, in hexadecimal digits.
///
/// # Errors
/// [`FileError`] where one cannot be read.
pub fn sha256<'p>(paths: impl IntoIterator<Item = &'p Path>) -> Result<String, FileError> {
    let mut hash = Sha256::new();
    for path in paths {
        let mut file = File::open(path).map_err(at("open", path))?;
        io::copy(&mut file, &mut HashWriter(&mut hash)).map_err(at("read", path))?;
    }
    Ok(hexadecimal(&hash.finalize()))
}

/// As lower-case digits, two a byte.
#[must_use]
pub fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

struct HashWriter<'a>(&'a mut Sha256);

impl Write for HashWriter<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.update(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
