//! A run from several folders, where its shards have no folder that all of them see.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::files::{self, FileError, at, write_whole};
use crate::folder::{Folder, FolderError, read_run_file, recording_of, scenes_of_parts, stored};
use crate::settings::RunFile;

/// Folders that are not of one run.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum GatherError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error(transparent)]
    Folder(#[from] FolderError),
    #[error("{} holds another run than {}:\n  {}\nhint: only shards of one run, by one build, are merged", other.display(), run.display(), differences.join("\n  "))]
    OtherRun { run: PathBuf, other: PathBuf, differences: Vec<String> },
    #[error("the episode of {scene} is in {} and in {}, and they are not the same\nhint: shards of one run have no scene in common: were both driven with the same --shard?", one.display(), other.display())]
    Overlap { scene: String, one: PathBuf, other: PathBuf },
}

/// Brings the episodes of the run `file` that are in other folders into `run`, with their recordings. All is looked at before anything is copied; what is there is not
/// copied again. How many were.
///
/// # Errors
/// [`GatherError`] where one is of another run, or two hold different episodes of a scene.
pub fn gather(run: &Folder, file: &RunFile, others: &[PathBuf]) -> Result<usize, GatherError> {
    let mut from: BTreeMap<String, &Path> =
        scenes_of_parts(run.path()).into_iter().map(|it| (it, run.path())).collect();
    let mut copied = Vec::new();
    for other in others {
        let there = read_run_file(other)?.ok_or_else(|| FolderError::NoRun(other.clone()))?;
        let differences = file.differences(&there);
        if !differences.is_empty() {
            return Err(GatherError::OtherRun { run: run.path().to_owned(), other: other.clone(), differences });
        }
        for scene in scenes_of_parts(other) {
            match from.get(&scene) {
                None => {
                    from.insert(scene.clone(), other);
                    copied.push((scene, other));
                }
                Some(one) if files::read(&stored(one, &scene))? == files::read(&stored(other, &scene))? => {}
                Some(one) => {
                    return Err(GatherError::Overlap { scene, one: (*one).to_owned(), other: other.clone() });
                }
            }
        }
    }
    for (scene, other) in &copied {
        let recordings = ["mcap", "rrd"].map(|kind| {
            let of = |folder: &Path| recording_of(folder, scene).with_file_name(format!("{scene}.{kind}"));
            (of(other), of(run.path()))
        });
        // The episode last: where it is, its recording is.
        let recordings = recordings.into_iter().filter(|(there, _)| there.exists());
        for (there, here) in recordings.chain([(stored(other, scene), stored(run.path(), scene))]) {
            copy(&there, &here)?;
        }
    }
    Ok(copied.len())
}

fn copy(from: &Path, to: &Path) -> Result<(), FileError> {
    let mut file = File::open(from).map_err(at("open", from))?;
    if let Some(folder) = to.parent() {
        fs::create_dir_all(folder).map_err(at("create", folder))?;
    }
    write_whole(to, |out| io::copy(&mut file, out).map(drop))
}
