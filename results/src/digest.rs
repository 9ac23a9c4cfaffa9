//! What names the content of a finished run, and tells when it was changed since.

use std::io::Write;
use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::files::{self, FileError};

/// The file that holds it; written last: a run with it is complete.
pub const DIGEST: &str = "digest";

/// What it is over.
const FILES: [&str; 2] = ["results.parquet", "steps.parquet"];

/// A finished run whose content cannot be vouched for.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum DigestError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error("{} was changed since the run was finished: its digest is another\nhint: take it from a copy, or drive the run again into another folder with --out", .0.display())]
    Changed(PathBuf),
    #[error("{} is not the digest of a run: three lines were expected\nhint: take it from a copy, or remove it and repeat the command that the run was begun with", .0.display())]
    NoDigest(PathBuf),
}

/// SHA-256 of a run's files, in hexadecimal digits.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Sums {
    /// Over all of them, one after the other.
    all: String,
    /// Over each.
    each: [String; FILES.len()],
}

impl Sums {
    fn of(folder: &Path) -> Result<Self, FileError> {
        let paths = FILES.map(|name| folder.join(name));
        let all = || files::sha256(paths.iter().map(PathBuf::as_path));
        let each = || paths.each_ref().map(|path| files::sha256([path.as_path()]));
        let (all, [results, steps]) = rayon::join(all, each);
        Ok(Self { all: all?, each: [results?, steps?] })
    }

    /// The digest, and below it what `sha256sum` prints of each file.
    fn to_text(&self) -> String {
        let each = FILES.iter().zip(&self.each).map(|(name, sum)| format!("{sum}  {name}\n"));
        format!("{}\n{}", self.all, each.collect::<String>())
    }

    fn parse(text: &str) -> Option<Self> {
        let mut lines = text.lines();
        let all = lines.next()?.to_owned();
        let mut each = [const { String::new() }; FILES.len()];
        for (sum, name) in each.iter_mut().zip(FILES) {
            *sum = lines.next()?.strip_suffix(name)?.strip_suffix("  ")?.to_owned();
        }
        Some(Self { all, each })
    }
}

/// Writes the digest of a run whose files are there.
///
/// # Errors
/// [`FileError`] where the disk fails.
pub(crate) fn write(folder: &Path) -> Result<(), FileError> {
    let text = Sums::of(folder)?.to_text();
    files::write_whole(&folder.join(DIGEST), |out| out.write_all(text.as_bytes()))
}

/// The digest of a finished run: SHA-256 over `results.parquet` and then `steps.parquet`, as
/// `cat results.parquet steps.parquet | sha256sum` prints it. The files are held to it.
///
/// # Errors
/// [`DigestError`] names the file that was changed.
pub fn digest(folder: &Path) -> Result<String, DigestError> {
    let path = folder.join(DIGEST);
    let text = files::read(&path)?.unwrap_or_default();
    let stored = Sums::parse(&String::from_utf8_lossy(&text)).ok_or_else(|| DigestError::NoDigest(path.clone()))?;
    let found = Sums::of(folder)?;
    let changed = (0..FILES.len()).find(|file| stored.each[*file] != found.each[*file]);
    match changed {
        Some(file) => Err(DigestError::Changed(folder.join(FILES[file]))),
        None if stored.all != found.all => Err(DigestError::Changed(path)),
        None => Ok(found.all),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use std::fs;

    use super::*;

    fn finished() -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("results.parquet"), "rows").unwrap();
        fs::write(folder.path().join("steps.parquet"), "more rows").unwrap();
        write(folder.path()).unwrap();
        folder
    }

    #[test]
    fn the_digest_is_that_of_both_files_one_after_the_other() {
        let folder = finished();
        fs::write(folder.path().join("both"), "rowsmore rows").unwrap();
        assert_eq!(digest(folder.path()).unwrap(), files::sha256([&*folder.path().join("both")]).unwrap());
    }

    #[test]
    fn a_file_that_was_changed_is_named() {
        for name in FILES.into_iter().chain([DIGEST]) {
            let folder = finished();
            let path = folder.path().join(name);
            let mut bytes = fs::read(&path).unwrap();
            bytes[0] ^= 1;
            fs::write(&path, bytes).unwrap();
            let error = digest(folder.path()).unwrap_err().to_string();
            assert!(error.contains(&format!("{name} was changed")), "{error}");
        }
    }

    #[test]
    fn a_digest_that_is_none_is_named_too() {
        let folder = finished();
        fs::write(folder.path().join(DIGEST), "abc\n").unwrap();
        let error = digest(folder.path()).unwrap_err().to_string();
        assert!(error.contains("digest is not the digest of a run"), "{error}");
    }
}
