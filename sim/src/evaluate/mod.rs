//! `sim evaluate`: drivers side by side, on frames of the log.
//!
//! | module | what |
//! | --- | --- |
//! | [`request`] | a command line and what it means: a run a driver |
//! | here | all of them, the table, the file of frames |

pub mod request;

use std::collections::BTreeSet;
use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use evaluation::open_loop::table::{Driven, render};
use evaluation::open_loop::{row, table};
use results::files::{at, write_whole};
use scenarios::SceneSet;
use thiserror::Error;

use self::request::Evaluation;
use crate::run::RunError;
use crate::run::clock::WallClock;
use crate::run::console::Console;
use crate::run::frames::{self, Judged};
use crate::run::interrupt::Interrupts;

/// An output that cannot be.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum OutError {
    #[error("{} is there already\nhint: give another name with --out", .0.display())]
    Exists(PathBuf),
    #[error("{} is no folder, and its name does not end in .parquet\nhint: --out FILE.parquet, or a new folder", .0.display())]
    NoFolder(PathBuf),
    #[error(
        "no scene is long enough: a frame needs {needed} logged steps at least\nhint: scenes of 20 s have thirteen frames"
    )]
    NoFrames { needed: usize },
}

/// What was found.
#[derive(Debug)]
pub struct Evaluated {
    /// The table.
    pub table: String,
    /// Whether every driver had a plan at every frame.
    pub clean: bool,
}

/// Asks every driver for plans at the frames of the log and judges them.
///
/// # Errors
/// Where a driver cannot be asked, or what was found cannot be written.
pub fn evaluate(
    evaluation: &Evaluation,
    width: usize,
    clock: WallClock,
    console: &Console,
    interrupts: &Interrupts,
) -> anyhow::Result<Evaluated> {
    let out = evaluation.out.as_deref();
    out.map_or(Ok(()), refuse_what_is_there)?;
    let scenes = SceneSet::open(&evaluation.scenarios).map_err(RunError::from)?;
    for note in scenes.notes() {
        console.line(&format!("note: {note}"));
    }
    let mut all: Vec<Judged> = Vec::new();
    for request in &evaluation.requests {
        all.push(frames::judge(request, evaluation.definitions, &scenes, clock, console, interrupts)?);
    }
    if all.iter().all(|judged| judged.rows.is_empty()) {
        let needed = evaluation::open_loop::FIRST + world::plan::PLAN_STEPS + 1;
        return Err(OutError::NoFrames { needed }.into());
    }
    if let Some(out) = out {
        write(out, evaluation, &all)?;
    }
    let judged_scenes: BTreeSet<&str> = all.iter().flat_map(|judged| &judged.rows).map(|row| &*row.scene).collect();
    let short = scenes.entries().len() - judged_scenes.len();
    if short > 0 {
        console.line(&format!("note: {short} of {} scenes are too short for a frame", scenes.entries().len()));
    }
    let drivers: Vec<Driven<'_>> =
        all.iter().map(|judged| Driven { driver: &judged.file.settings.driver, rows: &judged.rows }).collect();
    let format: table::Format = evaluation.format;
    Ok(Evaluated {
        table: render(&drivers, evaluation.definitions, judged_scenes.len(), format, width),
        clean: all.iter().flat_map(|judged| &judged.rows).all(|row| !row.failed()),
    })
}

fn is_file(out: &Path) -> bool {
    out.extension().is_some_and(|extension| extension == "parquet")
}

/// Said before anything is done.
fn refuse_what_is_there(out: &Path) -> Result<(), OutError> {
    let is_empty_folder = || fs::read_dir(out).is_ok_and(|mut entries| entries.next().is_none());
    match (is_file(out), out.exists()) {
        (_, false) => Ok(()),
        (false, true) if is_empty_folder() => Ok(()),
        (false, true) if !out.is_dir() => Err(OutError::NoFolder(out.to_owned())),
        _ => Err(OutError::Exists(out.to_owned())),
    }
}

/// The file of frames; in a folder also who was asked, a file a driver.
fn write(out: &Path, evaluation: &Evaluation, all: &[Judged]) -> anyhow::Result<()> {
    let rows = || all.iter().map(|judged| (&*judged.file.settings.driver, &*judged.rows));
    if is_file(out) {
        return Ok(row::write(out, evaluation.definitions, rows())?);
    }
    fs::create_dir_all(out).map_err(at("create", out))?;
    for judged in all {
        let text = judged.file.to_toml();
        let path = out.join(format!("{}.toml", judged.file.settings.driver));
        write_whole(&path, |file| file.write_all(text.as_bytes()))?;
    }
    Ok(row::write(&out.join("frames.parquet"), evaluation.definitions, rows())?)
}
