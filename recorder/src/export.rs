//! A Rerun file from a recording: the same bytes as when it is recorded.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use thiserror::Error;

use crate::mcap::read;
use crate::partial_file::{PartialFile, partial_name};
use crate::rrd::Drawing;

/// The run of recordings that do not name theirs.
const UNNAMED: &str = "unnamed";

/// A file that must not be written.
#[derive(Debug, Error)]
pub enum Refused {
    /// Writing would destroy what is read.
    #[error(
        "{} would be written over the recording itself\n  hint: name another file with --rrd, or leave it out for one beside the recording", .0.display()
    )]
    Itself(PathBuf),
    /// It may be of use to somebody.
    #[error("{} is there already\n  hint: name another file with --rrd, or --force to replace it", .0.display())]
    Exists(PathBuf),
}

/// Draws the recording at `mcap` into `rrd`, under the name `run` or that of its own run. A file that is there is replaced
/// with `force` alone. Says what is wrong with the recording, if it is not drawn whole.
///
/// # Errors
/// [`Refused`], or where one cannot be read or the other not be written.
pub fn export(mcap: &Path, rrd: &Path, run: Option<&str>, force: bool) -> anyhow::Result<Option<String>> {
    let recorded = recording::load(mcap)?;
    let mut drawing = Drawing::default();
    let contents = read(&recorded, |message| drawing.push(&message));
    let contents = contents.with_context(|| format!("cannot use {}", mcap.display()))?;
    refuse(mcap, rrd, force)?;
    let own = if contents.run.is_empty() { UNNAMED } else { &contents.run };
    let bytes = drawing.finish(run.unwrap_or(own), &contents.settings);
    let bytes = bytes.with_context(|| format!("cannot draw {}", mcap.display()))?;
    let mut file = PartialFile::create(rrd)?;
    file.append(&bytes)?;
    file.commit()?;
    Ok(contents.trouble())
}

fn refuse(mcap: &Path, rrd: &Path, force: bool) -> Result<(), Refused> {
    let source = mcap.canonicalize().ok();
    // The name it has while it is written counts too: `a.mcap.partial` must not be drawn into `a.mcap`.
    let is_source = |path: &Path| source.is_some() && path.canonicalize().ok() == source;
    if is_source(rrd) || is_source(&partial_name(rrd)) {
        return Err(Refused::Itself(rrd.to_owned()));
    }
    // A device or a pipe takes what comes. What is unfinished may still be written by a live recorder.
    match [rrd.to_owned(), partial_name(rrd)].into_iter().find(|path| path.is_file()) {
        Some(there) if !force => Err(Refused::Exists(there)),
        _ => Ok(()),
    }
}
