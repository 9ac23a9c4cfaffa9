//! A Rerun file from a recording: the same bytes as when it is recorded.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use thiserror::Error;

use crate::mcap::{Break, Contents, read};
use crate::partial_file::{FileError, PartialFile, partial_name};
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

/// Reads the recording at `path`.
///
/// # Errors
/// Where it cannot be read, or is none.
pub fn open(path: &Path) -> anyhow::Result<Contents> {
    let bytes = fs::read(path).map_err(FileError::at("read", path))?;
    read(&bytes).with_context(|| format!("cannot use {}", path.display()))
}

/// Draws the recording at `mcap` into `rrd`, under the name `run` or that of its own run. A file that is there is replaced
/// with `force` alone. Says why the recording is not drawn to its end, if it is not.
///
/// # Errors
/// [`Refused`], or where one cannot be read or the other not be written.
pub fn export(mcap: &Path, rrd: &Path, run: Option<&str>, force: bool) -> anyhow::Result<Option<Break>> {
    let contents = open(mcap)?;
    refuse(mcap, rrd, force)?;
    let mut drawing = Drawing::default();
    contents.messages.iter().for_each(|message| drawing.push(message));
    let own = if contents.run.is_empty() { UNNAMED } else { &contents.run };
    let bytes = drawing.finish(run.unwrap_or(own), &contents.settings);
    let bytes = bytes.with_context(|| format!("cannot draw {}", mcap.display()))?;
    let mut file = PartialFile::create(rrd)?;
    file.append(&bytes)?;
    file.commit()?;
    Ok(contents.broken)
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
