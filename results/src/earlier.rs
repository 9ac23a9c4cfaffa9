//! The rows of a run that was finished once. When some of its episodes are driven again, those of the others are kept.

use std::collections::BTreeMap;

use arrow_array::RecordBatch;

use crate::folder::Folder;
use crate::parquet::{ParquetError, Table};
use crate::part::Standing;

/// A run's files.
pub(crate) const FILES: [&str; 3] = ["steps.parquet", "timing.parquet", "results.parquet"];

/// The rows of each episode, file by file.
#[derive(Debug)]
pub struct Earlier {
    standings: BTreeMap<String, Standing>,
    files: BTreeMap<&'static str, BTreeMap<String, RecordBatch>>,
}

impl Earlier {
    /// The rows in `folder`; none where it has no results.
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
        let standings = standings.collect();
        let mut files = BTreeMap::new();
        for name in FILES {
            files.insert(name, by_scene(&Table::read(&folder.file(name))?)?);
        }
        Ok(Some(Self { standings, files }))
    }

    /// How the episode of `scene` came out; none where it has no row.
    #[must_use]
    pub fn standing(&self, scene: &str) -> Option<Standing> {
        self.standings.get(scene).copied()
    }

    /// The rows of `scene` in the file `name`; none where it has none.
    pub(crate) fn rows(&self, name: &str, scene: &str) -> Option<RecordBatch> {
        self.files.get(name)?.get(scene).cloned()
    }
}

/// The rows of each scene. They stand together: a file is written episode by episode.
fn by_scene(table: &Table) -> Result<BTreeMap<String, RecordBatch>, ParquetError> {
    let mut scenes = BTreeMap::new();
    let names = table.text("scene")?;
    let Some(rows) = table.whole()? else { return Ok(scenes) };
    let mut begin = 0;
    for run in names.chunk_by(|one, next| one == next) {
        scenes.insert(run[0].clone(), rows.slice(begin, run.len()));
        begin += run.len();
    }
    Ok(scenes)
}
