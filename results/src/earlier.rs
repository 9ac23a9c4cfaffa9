//! The rows of a run that was finished once. When some of its episodes are driven again, those of the others are kept.

use std::collections::BTreeMap;
use std::iter::Peekable;
use std::path::PathBuf;

use arrow_array::RecordBatch;

use crate::folder::Folder;
use crate::parquet::{ByScene, ParquetError, Table};
use crate::part::Standing;

/// A run's files.
pub(crate) const FILES: [&str; 3] = ["steps.parquet", "timing.parquet", "results.parquet"];

/// How the episodes came out; their rows stay in their files.
#[derive(Debug)]
pub struct Earlier {
    standings: BTreeMap<String, Standing>,
}

impl Earlier {
    /// What `folder` holds; none where it has no results.
    ///
    /// # Errors
    /// [`ParquetError`] where they cannot be read.
    pub fn read(folder: &Folder) -> Result<Option<Self>, ParquetError> {
        if FILES.iter().any(|name| !folder.file(name).exists()) {
            return Ok(None);
        }
        let results = Table::read(&folder.file("results.parquet"))?;
        let (failed, errors) = (results.flags("failed")?, results.text("recording_error")?);
        let standing = |(failed, error): (bool, String)| Standing { failed, unrecorded: !error.is_empty() };
        let standings = results.text("scene")?.into_iter().zip(failed.into_iter().zip(errors).map(standing));
        Ok(Some(Self { standings: standings.collect() }))
    }

    /// How the episode of `scene` came out; none where it has no row.
    #[must_use]
    pub fn standing(&self, scene: &str) -> Option<Standing> {
        self.standings.get(scene).copied()
    }
}

/// The rows of one file, scene by scene.
pub(crate) struct EarlierRows {
    path: PathBuf,
    scenes: Peekable<ByScene>,
}

impl EarlierRows {
    /// Those of the file `name`, which may be written anew meanwhile.
    pub fn open(folder: &Folder, name: &str) -> Result<Self, ParquetError> {
        let path = folder.file(name);
        Ok(Self { scenes: ByScene::open_whole(&path)?.peekable(), path })
    }

    /// The rows of `scene`, if it is the next that has any: a file has its scenes in the order of the run.
    pub fn take(&mut self, scene: &str) -> Result<Option<RecordBatch>, ParquetError> {
        match self.scenes.next_if(|next| next.as_ref().map_or(true, |(next, _)| next == scene)) {
            Some(next) => next?.1.whole(),
            None => Ok(None),
        }
    }

    /// That all were asked for.
    pub fn end(mut self) -> Result<(), ParquetError> {
        match self.scenes.next().transpose()? {
            Some((scene, _)) => Err(ParquetError::Order { path: self.path, scene }),
            None => Ok(()),
        }
    }
}
