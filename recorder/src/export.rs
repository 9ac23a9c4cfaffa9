//! A Rerun file from a recording: the same bytes as when it is recorded.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use thiserror::Error;

use crate::mcap::{Contents, read};
use crate::partial_file::{PartialFile, partial_name};
use crate::rrd::{Drawing, Side, beside};

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
    let Drawn { drawing, contents } = draw(mcap)?;
    refuse(mcap, rrd, force)?;
    let bytes = drawing.finish(run.unwrap_or(name(&contents)), &contents.settings);
    write(rrd, &bytes.with_context(|| format!("cannot draw {}", mcap.display()))?)?;
    Ok(contents.trouble())
}

/// Draws two recordings of one scene into `rrd`, side by side at the same time; a viewer plays from shortly before step `from`. A file that
/// is there is replaced with `force` alone. Says what is wrong with the recordings, if they are not drawn whole.
///
/// # Errors
/// As [`export`], and where they are of two scenes.
pub fn export_beside(mcaps: [&Path; 2], rrd: &Path, from: u32, force: bool) -> anyhow::Result<Vec<String>> {
    let [a, b] = [draw(mcaps[0])?, draw(mcaps[1])?];
    let scenes = [a.drawing.scene_name(), b.drawing.scene_name()];
    anyhow::ensure!(scenes[0] == scenes[1], "one is of the scene {}, the other of {}", scenes[0], scenes[1]);
    mcaps.iter().try_for_each(|mcap| refuse(mcap, rrd, force))?;
    let troubles = [(mcaps[0], &a), (mcaps[1], &b)]
        .into_iter()
        .filter_map(|(mcap, drawn)| Some(format!("{} is {}", mcap.display(), drawn.contents.trouble()?)))
        .collect();
    let side = |Drawn { drawing, contents }: Drawn| Side { drawing, name: name(&contents).to_owned() };
    write(rrd, &beside([side(a), side(b)], from).context("cannot draw them")?)?;
    Ok(troubles)
}

/// A recording, drawn.
struct Drawn {
    drawing: Drawing,
    contents: Contents,
}

fn draw(mcap: &Path) -> anyhow::Result<Drawn> {
    let recorded = recording::load(mcap)?;
    let mut drawing = Drawing::default();
    let contents = read(&recorded, |message| drawing.push(&message));
    let contents = contents.with_context(|| format!("cannot use {}", mcap.display()))?;
    Ok(Drawn { drawing, contents })
}

fn name(contents: &Contents) -> &str {
    if contents.run.is_empty() { UNNAMED } else { &contents.run }
}

fn write(rrd: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    let mut file = PartialFile::create(rrd)?;
    file.append(bytes)?;
    Ok(file.commit()?)
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
