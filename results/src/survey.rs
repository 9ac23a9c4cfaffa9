//! How far a run is that is not complete: what can be merged, and what is missing.

use std::collections::BTreeSet;
use std::path::Path;

use rayon::prelude::*;
use shard::Shard;

use crate::files::FileError;
use crate::folder::{self, recording_of, scenes_of_parts};
use crate::part::Part;
use crate::settings::{RunFile, SceneLine};

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
    /// Of an episode that is stored in `folder`, in a run of this identity.
    #[must_use]
    pub fn of(folder: &Path, part: &Part, identity: &str) -> Self {
        let scene = part.end.as_ref().map_or("", |end| &end.scene);
        if part.run_sha256 != identity {
            Self::Foreign
        } else if !part.recording_error.is_empty() || part.recorded && !recording_of(folder, scene).is_file() {
            Self::Unrecorded
        } else if part.failed() {
            let detail = part.end.as_ref().map_or("", |end| &end.detail);
            Self::Done { failure: format!("{}: {detail}", crate::part::reason_name(part.reason())) }
        } else {
            Self::Done { failure: String::new() }
        }
    }

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
        let stored: Vec<bool> = file.scenes.iter().map(|line| strangers.remove(&line.id)).collect();
        let look = |(line, is_stored): (&SceneLine, bool)| {
            let part = if is_stored { folder::part_of(folder, &line.id)? } else { None };
            Ok(match part {
                None if is_stored => State::Damaged,
                None => State::Missing,
                Some(part) => State::of(folder, &part, &identity),
            })
        };
        let scenes: Result<_, FileError> = file.scenes.par_iter().zip(stored).map(look).collect();
        Ok(Self { scenes: scenes?, strangers: strangers.into_iter().collect() })
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
