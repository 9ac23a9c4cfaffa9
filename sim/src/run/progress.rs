//! How far a run is: which of its episodes are done, and which are to be driven now.

use results::earlier::Earlier;
use results::folder::Folder;
use results::parquet::ParquetError;
use results::part::{Part, Standing};
use results::settings::RunFile;

use crate::cli::Retry;

/// How far a run is.
#[derive(Debug)]
pub struct Progress {
    /// The places of the scenes that are to be driven.
    pub pending: Vec<usize>,
    /// How many scenes there are, driven or not: those of the shard, if it is one.
    pub total: usize,
    /// Scenes whose episode was stored, and cannot be read any more, or is of another run; they are driven again.
    pub damaged: Vec<String>,
    /// What the run's files hold, if it was finished once.
    pub earlier: Option<Earlier>,
    /// SHA-256 of each scene as it was driven, in their order; empty where none was.
    pub hashes: Vec<String>,
}

impl Progress {
    /// How far the run `file` in `folder` is, if these episodes are to be driven again.
    ///
    /// In a run that was stopped, an episode whose recording is not whole is not done: most often the disk was full.
    ///
    /// # Errors
    /// [`ParquetError`] where what is there cannot be read.
    pub fn read(folder: &Folder, file: &RunFile, retry: &[Retry]) -> Result<Self, ParquetError> {
        let earlier = Earlier::read(folder)?;
        let stopped = !folder.is_finished();
        let again = |standing: Standing| {
            (standing.failed && retry.contains(&Retry::Failed))
                || (standing.unrecorded && (stopped || retry.contains(&Retry::Unrecorded)))
        };
        let mut progress = Self { pending: Vec::new(), total: 0, damaged: Vec::new(), earlier, hashes: Vec::new() };
        let (shard, identity) = (folder.shard(), file.identity());
        for (index, scene) in file.scenes.iter().enumerate() {
            if shard.is_some_and(|shard| !shard.holds(index)) {
                progress.hashes.push(String::new());
                continue;
            }
            progress.total += 1;
            let part = folder.part(&scene.id)?.filter(|part| part.run_sha256 == identity);
            let of_part = part.as_ref().map(Part::standing);
            progress.hashes.push(part.map(|part| part.scene_sha256).unwrap_or_default());
            if of_part.is_none() && folder.has_part(&scene.id) {
                progress.damaged.push(scene.id.clone());
            }
            let before = progress.earlier.as_ref().and_then(|earlier| earlier.standing(&scene.id));
            if of_part.or(before).is_none_or(again) {
                progress.pending.push(index);
            }
        }
        Ok(progress)
    }
}
