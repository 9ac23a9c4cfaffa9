//! Where nodes that read the log find the scenes of a run: in an index of the set, which the sim has open already.

use std::io::{self, Write};
use std::path::Path;
use std::sync::OnceLock;

use scenarios::SceneSet;
use tempfile::NamedTempFile;

/// An index in a temporary file, made for the first node that needs it, and gone with this.
#[derive(Debug, Default)]
pub struct SceneIndex(OnceLock<Result<NamedTempFile, String>>);

impl SceneIndex {
    /// The path of the index of `scenes`.
    ///
    /// # Errors
    /// Why there is none, as a sentence.
    pub fn path(&self, scenes: &SceneSet) -> Result<String, String> {
        let place = std::env::temp_dir();
        let write = || -> io::Result<NamedTempFile> {
            let mut file = tempfile::Builder::new().prefix("reloop-scenes-").tempfile()?;
            let index = scenes.index(file.path().parent().unwrap_or(Path::new("/")));
            file.write_all(&index)?;
            Ok(file)
        };
        let made = self.0.get_or_init(|| {
            write().map_err(|error| format!("an index of the scenes cannot be written to {}: {error}", place.display()))
        });
        made.as_ref().map(|file| file.path().display().to_string()).map_err(Clone::clone)
    }
}
