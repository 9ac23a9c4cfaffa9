//! Files that have their name only when they are whole: written as `<name>.partial`, synced, renamed.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use thiserror::Error;

/// A file could not be written.
#[derive(Debug, Error)]
#[error("cannot {action} {path}: {reason}")]
pub struct FileError {
    action: &'static str,
    path: PathBuf,
    reason: io::Error,
}

impl FileError {
    /// Says what was tried, and where.
    pub fn at(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        let path = path.to_owned();
        move |reason| Self { action, path, reason }
    }
}

/// A file that is being written. Dropped, it stays under its partial name.
///
/// A device or a pipe (`/dev/null`) has no partial name: it is written to as it is, for a rename would put a file in its place.
pub struct PartialFile {
    file: File,
    partial: PathBuf,
    path: PathBuf,
}

/// What the file `path` is called while it is written.
pub(crate) fn partial_name(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".partial");
    name.into()
}

impl PartialFile {
    /// Begins the file `path`, over whatever an earlier attempt left.
    ///
    /// # Errors
    /// [`FileError`].
    pub fn create(path: &Path) -> Result<Self, FileError> {
        let takes_a_name = fs::metadata(path).map_or(true, |there| there.is_file() || there.is_dir());
        let partial = if takes_a_name { partial_name(path) } else { path.to_owned() };
        let file = File::create(&partial).map_err(FileError::at("create", &partial))?;
        Ok(Self { file, partial, path: path.to_owned() })
    }

    /// Appends `bytes`; they are with the operating system when this returns, so a killed process does not lose them.
    ///
    /// # Errors
    /// [`FileError`].
    pub fn append(&mut self, bytes: &[u8]) -> Result<(), FileError> {
        self.file.write_all(bytes).map_err(FileError::at("write", &self.partial))
    }

    /// Gives the file its name.
    ///
    /// # Errors
    /// [`FileError`].
    pub fn commit(self) -> Result<(), FileError> {
        if self.partial == self.path {
            return Ok(());
        }
        self.file.sync_all().map_err(FileError::at("sync", &self.partial))?;
        fs::rename(&self.partial, &self.path).map_err(FileError::at("rename", &self.partial))?;
        // The name itself must survive a power cut too.
        if let Some(folder) = self.path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
            let synced = File::open(folder).and_then(|folder| folder.sync_all());
            synced.map_err(FileError::at("sync", folder))?;
        }
        Ok(())
    }

    /// Where the file is to be.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_has_its_name_when_it_is_whole() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.rrd");
        let mut file = PartialFile::create(&path).unwrap();
        file.append(b"whole").unwrap();
        assert!(!path.exists());
        file.commit().unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"whole");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[cfg(unix)]
    #[test]
    fn a_device_is_written_to_and_not_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("null");
        std::os::unix::fs::symlink("/dev/null", &path).unwrap();
        let mut file = PartialFile::create(&path).unwrap();
        file.append(b"nothing").unwrap();
        file.commit().unwrap();
        assert!(path.is_symlink());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
