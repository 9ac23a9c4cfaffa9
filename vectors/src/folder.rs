//! Folders of vectors.

use std::path::{Path, PathBuf};

use thiserror::Error;

/// Why a folder cannot be used.
#[derive(Debug, Error)]
pub enum FolderError {
    /// It cannot be listed.
    #[error("cannot list {path}")]
    List {
        /// The folder.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// There is nothing in it.
    #[error("{0} holds no .npz file\nhint: give a folder of vectors")]
    Empty(PathBuf),
}

/// The `.npz` files of a folder, by name; one at least.
///
/// # Errors
/// [`FolderError`].
pub fn npz_files(folder: &Path) -> Result<Vec<PathBuf>, FolderError> {
    let error = |source| FolderError::List { path: folder.to_owned(), source };
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(error)? {
        let path = entry.map_err(error)?.path();
        if path.extension().is_some_and(|extension| extension == "npz") {
            paths.push(path);
        }
    }
    paths.sort();
    if paths.is_empty() { Err(FolderError::Empty(folder.to_owned())) } else { Ok(paths) }
}

/// For tests: a folder of the data that is no part of the repository, in `RELOOP_SHARED` or in `shared` beside the checkout. Says
/// on standard error that the test is skipped where there is none.
#[must_use]
pub fn shared(folder: &str) -> Option<PathBuf> {
    let beside = |up: &str| Path::new(env!("CARGO_MANIFEST_DIR")).join(up).join("shared");
    let places = std::env::var_os("RELOOP_SHARED").map(PathBuf::from).into_iter();
    let found = places.chain([beside("../.."), beside("../../..")]).map(|place| place.join(folder));
    let found = found.into_iter().find(|path| path.is_dir());
    if found.is_none() {
        eprintln!("skipped: no shared/{folder} beside the repository, and RELOOP_SHARED names none");
    }
    found
}
