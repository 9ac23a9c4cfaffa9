//! `trainer prepare`: cuts scenes into windows to learn from, and keeps them in a file.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::io::{self, IsTerminal};
use std::num::NonZeroU8;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::windows::{Cutting, Drawn, Order, PrepareError, Prepared, Recipe, Split, Whose, prepare};
use anyhow::{Result, anyhow};
use clap::Args;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use scenarios::{RecordError, SceneSet};

/// The exit code of an interrupted program.
const INTERRUPTED: u8 = 130;

/// Arguments of `prepare`.
#[derive(Debug, Args)]
pub struct Prepare {
    /// Files of WOMD, ScenarioNet or Argoverse 2, folders or globs of them, scene-set TOML files, or the word demo
    #[arg(value_name = "PATH", required = true)]
    paths: Vec<String>,

    /// The file of windows; it appears when it is whole, and replaces what is there. An interrupted command goes on from FILE.parts
    #[arg(long, value_name = "FILE")]
    out: PathBuf,

    /// Steps of 0.1 s from one window of a scene to the next
    #[arg(long, value_name = "STEPS", default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..))]
    stride: u32,

    /// Also make windows with each other vehicle as the AV that is seen throughout, moves 5 m, and keeps to its line
    #[arg(long)]
    others: bool,

    /// Whose features
    #[arg(long, value_enum, value_name = "WHOSE", default_value_t = Whose::Mended)]
    features: Whose,

    /// Instead of windows make transitions for `trainer cql`: what is seen from above at each step, and what the AV does
    #[arg(long, conflicts_with_all = ["stride", "others", "features"])]
    transitions: bool,

    /// Threads, one a core if left out; the bytes are the same for any number
    #[arg(long, value_name = "N")]
    jobs: Option<NonZeroU8>,

    /// Share of the scenes that validate, chosen by a hash of their ids: the same ones whatever others there are
    #[arg(long, value_name = "SHARE", default_value = "0.1", value_parser = share)]
    validation: f64,

    /// A list of the scenes to use and what for instead: CSV with the columns scenario_id and role, which is train or valid
    #[arg(long, value_name = "CSV", conflicts_with = "validation")]
    split: Option<PathBuf>,
}

fn share(text: &str) -> Result<f64, String> {
    let share: f64 = text.parse().map_err(|_| "it is no number".to_owned())?;
    if (0.0..=1.0).contains(&share) { Ok(share) } else { Err("it is not from 0 to 1".to_owned()) }
}

impl Prepare {
    /// Makes the file, and says what is in it and what is not.
    ///
    /// # Errors
    /// Where there is none.
    pub fn run(self) -> Result<ExitCode> {
        let split = match &self.split {
            Some(path) => Split::read(path)?,
            None => Split::Share(self.validation),
        };
        let survey = SceneSet::survey(&self.paths);
        let (set, bad) = survey.map_err(|error| anyhow!("{error}\nhint: {}", error.hint()))?;
        set.notes().iter().for_each(|note| eprintln!("note: {note}"));
        let jobs = self.jobs.map_or_else(default_jobs, |jobs| usize::from(jobs.get()));
        let Self { stride, others, features, .. } = self;
        let recipe = Recipe { features, stride, others };
        let recipe: &dyn Cutting = if self.transitions { &Drawn::default() } else { &recipe };
        let order = Order { set: &set, recipe, split: &split, out: &self.out, jobs };
        let stop = interrupts();
        let bar = bar(set.entries().iter().filter(|entry| split.role(entry.id.as_str()).is_some()).count());
        let prepared = prepare(&order, &stop, &|_, before| {
            bar.inc(1);
            if before {
                bar.reset_eta(); // what was there took no time of this run
            }
        });
        bar.finish_and_clear();
        let prepared = match prepared {
            Err(error @ PrepareError::Interrupted) => {
                eprintln!("error: {error}");
                return Ok(ExitCode::from(INTERRUPTED));
            }
            prepared => prepared?,
        };
        terminal::say(&summary(&self.out, &prepared, &set, &split))?;
        list_broken(&prepared, &bad);
        Ok(ExitCode::SUCCESS)
    }
}

fn summary(out: &Path, prepared: &Prepared, set: &SceneSet, split: &Split) -> String {
    let Prepared { scenes, windows: [training, validation], bytes, left_out, resumed, .. } = prepared;
    let mut text = String::new();
    // Writing into memory does not fail.
    let _ = writeln!(
        text,
        "{}: {} windows of {} ({:.1} MB): {training} to train, {validation} to validate",
        out.display(),
        training + validation,
        count(scenes.len(), "scene"),
        *bytes as f64 / 1e6
    );
    if *validation == 0 {
        let _ = writeln!(text, "none validates: give more scenes, or a greater --validation");
    }
    if *resumed > 0 {
        let _ = writeln!(text, "{} ready from before", count(*resumed, "scene"));
    }
    let mut skipped: BTreeMap<&str, u64> = BTreeMap::new();
    for skip in scenes.iter().flat_map(|scene| &scene.skipped) {
        *skipped.entry(&skip.reason).or_default() += u64::from(skip.windows);
    }
    for (reason, windows) in skipped {
        let _ = writeln!(text, "skipped {windows:>6}: {reason}");
    }
    if !left_out.is_empty() {
        let _ = writeln!(text, "left out {}: the split does not name them", some(left_out));
    }
    if let Split::List(list) = split {
        let is_there = |id: &str| set.entries().iter().any(|entry| entry.id.as_str() == id);
        let missing: Vec<String> = list.keys().filter(|id| !is_there(id)).cloned().collect();
        if !missing.is_empty() {
            let _ = writeln!(text, "not in the files, but in the split: {}", some(&missing));
        }
    }
    text
}

/// What cannot be read: on standard error, and no failure.
fn list_broken(prepared: &Prepared, bad: &[RecordError]) {
    let broken = prepared.broken.iter().map(|broken| format!("scene {}: {}", broken.scene, broken.reason));
    let bad = bad.iter().map(|error| format!("{error}\nhint: {}", error.hint()));
    let all: Vec<String> = broken.chain(bad).collect();
    if !all.is_empty() {
        eprintln!("{} not read, and left out:", count(all.len(), "record"));
    }
    all.iter().for_each(|reason| eprintln!("warning: {reason}"));
}

fn count(number: usize, what: &str) -> String {
    format!("{number} {what}{}", if number == 1 { "" } else { "s" })
}

/// How many, and the first names.
fn some(names: &[String]) -> String {
    const SHOWN: usize = 3;
    let shown = names[..names.len().min(SHOWN)].join(", ");
    let more = if names.len() > SHOWN { ", ..." } else { "" };
    format!("{} ({shown}{more})", count(names.len(), "scene"))
}

fn default_jobs() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// Says when to stop: after the first Ctrl-C. The second ends the program at once; what was not whole has no final name.
fn interrupts() -> Arc<AtomicBool> {
    let stop = Arc::new(AtomicBool::new(false));
    let pressed = Arc::clone(&stop);
    let handler = move || {
        if pressed.swap(true, Ordering::Relaxed) {
            std::process::exit(INTERRUPTED.into());
        }
    };
    if let Err(error) = ctrlc::set_handler(handler) {
        tracing::warn!("Ctrl-C ends the program at once: {error}");
    }
    stop
}

/// A bar of scenes, on a terminal alone.
fn bar(scenes: usize) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(scenes as u64), ProgressDrawTarget::hidden());
    let style = ProgressStyle::with_template("{bar:30} {pos}/{len} scenes, {per_sec}, {eta} to go");
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    if io::stderr().is_terminal() {
        bar.set_draw_target(ProgressDrawTarget::stderr());
    }
    bar
}
