//! Files, with the path in every error, and whole under their final name or not there at all.

use std::fs::{self, File};
use std::io::{self, BufRead as _, BufReader, Write};
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};
use thiserror::Error;

/// Bytes of a file that are read at a time to be summed up.
const READ_AT_ONCE: usize = 1 << 17;

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

/// A file on its way: after a crash there is all of it or nothing. It is called `.partial` until it is whole; dropped before that, it is gone:
/// on a full disk it would hold the room that the next attempt needs.
#[derive(Debug)]
pub struct WholeFile {
    file: File,
    path: PathBuf,
    partial: PathBuf,
    is_named: bool,
}

impl WholeFile {
    /// Begins the file `path`.
    ///
    /// # Errors
    /// [`FileError`].
    pub fn create(path: &Path) -> Result<Self, FileError> {
        let partial = partial_name(path);
        let file = File::create(&partial).map_err(at("create", &partial))?;
        Ok(Self { file, path: path.to_owned(), partial, is_named: false })
    }

    /// Gives it its name: fsync, rename, fsync of the folder.
    ///
    /// # Errors
    /// [`FileError`].
    pub fn commit(mut self) -> Result<(), FileError> {
        self.file.sync_all().map_err(at("write", &self.partial))?;
        fs::rename(&self.partial, &self.path).map_err(at("rename", &self.partial))?;
        self.is_named = true;
        let folder = folder_of(&self.path);
        File::open(folder).and_then(|folder| folder.sync_all()).map_err(at("write", folder))
    }
}

impl Write for WholeFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Drop for WholeFile {
    fn drop(&mut self) {
        if !self.is_named {
            let _ = fs::remove_file(&self.partial);
        }
    }
}

/// Writes a file whole, see [`WholeFile`].
///
/// # Errors
/// [`FileError`].
pub fn write_whole(path: &Path, write: impl FnOnce(&mut File) -> io::Result<()>) -> Result<(), FileError> {
    let mut whole = WholeFile::create(path)?;
    write(&mut whole.file).map_err(at("write", &whole.partial))?;
    whole.commit()
}

/// Where a file is.
pub(crate) fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
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
        let file = File::open(path).map_err(at("open", path))?;
        let mut reader = BufReader::with_capacity(READ_AT_ONCE, file);
        loop {
            let bytes = reader.fill_buf().map_err(at("read", path))?;
            let read = bytes.len();
            if read == 0 {
                break;
            }
            hash.update(bytes);
            reader.consume(read);
        }
    }
    Ok(hexadecimal(&hash.finalize()))
}

/// As lower-case digits, two a byte.
#[must_use]
pub fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
