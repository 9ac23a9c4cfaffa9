//! `trainer ablate`.

use std::fs;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context;
use clap::Args;

use super::progress::Progress;
use super::{Drawing, INTERRUPTED, Means};
use crate::ablation;

/// Arguments of `ablate`.
#[derive(Debug, Args)]
pub struct Ablate {
    /// The list: a TOML file with a name and settings for each training (docs/learning.md)
    #[arg(value_name = "LIST")]
    list: PathBuf,

    #[command(flatten)]
    means: Means,

    /// Folder for the trainings, a folder each, and for the table; trainings that are there go on, finished ones stay
    #[arg(long, value_name = "FOLDER")]
    out: PathBuf,

    #[command(flatten)]
    drawing: Drawing,
}

impl Ablate {
    /// Trains all of the list, and prints the table.
    ///
    /// # Errors
    /// A list or windows that cannot be used, a folder that has another training.
    pub fn run(self) -> anyhow::Result<ExitCode> {
        let text = fs::read_to_string(&self.list).with_context(|| self.list.display().to_string())?;
        let runs = ablation::read(&text).with_context(|| self.list.display().to_string())?;
        let examples = self.means.examples()?;
        let mut progress = Progress::new();
        let learner = |settings: &_| self.means.learner(settings);
        let outcomes = ablation::run(&runs, &examples, &self.out, self.drawing.rerun, &learner, &mut progress);
        progress.end();
        let Some(outcomes) = outcomes? else {
            eprintln!("interrupted; the same command goes on from there");
            return Ok(ExitCode::from(INTERRUPTED));
        };
        terminal::say(&ablation::markdown(&outcomes))?;
        let failed = outcomes.iter().any(|outcome| outcome.failure.is_some());
        Ok(ExitCode::from(u8::from(failed)))
    }
}
