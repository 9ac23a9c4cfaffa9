//! How far a run is that is not complete: what can be merged, and what is missing.

use std::collections::BTreeSet;
use std::path::Path;

use shard::Shard;

use crate::files::FileError;
use crate::folder::{self, recording_of, scenes_of_parts};
use crate::part::Part;
use crate::settings::RunFile;

/// What is known of the episode of a scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum State {
    /// It is stored.
    Done {
        /// Why it has no result; empty where it has one.
        failure: String,
    },
    /// It is stored, and its recording is not whole or not there: it is driven again.
    Unrecorded,
    /// It is stored, and cannot be read any more: it is driven again.
    Damaged,
    /// What is stored is of another run.
    Foreign,
    /// Nothing is stored.
    Missing,
}

impl State {
    /// Whether it can be merged.
    #[must_use]
    pub fn is_done(&self) -> bool {
        matches!(self, Self::Done { .. })
    }
}

/// How far a run is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Survey {
    /// Of each scene, in the order of the run.
    pub scenes: Vec<State>,
    /// SHA-256 of each scene as it was driven, in hexadecimal digits; empty where it was not.
    pub hashes: Vec<String>,
    /// Episodes that are stored of scenes which the run has not.
    pub strangers: Vec<String>,
}

impl Survey {
    /// Of the run `file` in `folder`, which is not complete.
    ///
    /// # Errors
    /// [`FileError`] where the disk fails.
    pub fn of(folder: &Path, file: &RunFile) -> Result<Self, FileError> {
        let identity = file.identity();
        let mut strangers: BTreeSet<String> = scenes_of_parts(folder).into_iter().collect();
        let (mut scenes, mut hashes) = (Vec::new(), Vec::new());
        for line in &file.scenes {
            let is_stored = strangers.remove(&line.id);
            let part = if is_stored { folder::part_of(folder, &line.id)? } else { None };
            scenes.push(match &part {
                None if is_stored => State::Damaged,
                None => State::Missing,
                Some(part) => state(folder, part, &identity),
            });
            hashes.push(part.map(|part| part.scene_sha256).unwrap_or_default());
        }
        Ok(Self { scenes, hashes, strangers: strangers.into_iter().collect() })
    }

    /// Whether all can be merged.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        self.strangers.is_empty() && self.scenes.iter().all(State::is_done)
    }

    /// The places of the scenes of a shard, with what is known of each.
    pub fn of_shard(&self, shard: Shard) -> impl Iterator<Item = (usize, &State)> {
        self.scenes.iter().enumerate().filter(move |(place, _)| shard.holds(*place))
    }
}

fn state(folder: &Path, part: &Part, identity: &str) -> State {
    let scene = part.end.as_ref().map_or("", |end| &end.scene);
    if part.run_sha256 != identity {
        State::Foreign
    } else if !part.recording_error.is_empty() || part.recorded && !recording_of(folder, scene).is_file() {
        State::Unrecorded
    } else if part.failed() {
        let detail = part.end.as_ref().map_or("", |end| &end.detail);
        State::Done { failure: format!("{}: {detail}", crate::part::reason_name(part.reason())) }
    } else {
        State::Done { failure: String::new() }
    }
}
