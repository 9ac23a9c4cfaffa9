//! `trainer ablate`.

use std::fs;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context;
use clap::Args;
use shard::ShardChoice;

use super::progress::Progress;
use super::{Drawing, INTERRUPTED, Means};
use crate::ablation::{self, List};

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

    /// Train a share of the list, the I-th of N, beside other processes in the same --out; the same command without it then writes the table of all.
    /// auto or auto/N: as HyperQueue, Slurm or Kubernetes says
    #[arg(long, value_name = "I/N")]
    shard: Option<ShardChoice>,

    #[command(flatten)]
    drawing: Drawing,
}

impl Ablate {
    /// Trains all of the list or a share, and prints the table.
    ///
    /// # Errors
    /// A list or windows that cannot be used, a folder that has another training.
    pub fn run(self) -> anyhow::Result<ExitCode> {
        let text = fs::read_to_string(&self.list).with_context(|| self.list.display().to_string())?;
        let mut runs = ablation::read(&text).with_context(|| self.list.display().to_string())?;
        let shard = self.shard.map(ShardChoice::of_this_process).transpose()?;
        if let Some(shard) = shard {
            let mut place = 0..;
            runs.retain(|_| place.next().is_some_and(|place| shard.holds(place)));
        }
        let examples = self.means.examples()?;
        let mut progress = Progress::new();
        let learner = |settings: &_| self.means.learner(settings);
        let task = List { runs: &runs, folder: &self.out, writes_tables: shard.is_none(), rerun: self.drawing.rerun };
        let outcomes = ablation::run(&task, &examples, &learner, &mut progress);
        progress.end();
        let Some(outcomes) = outcomes? else {
            eprintln!("interrupted; the same command goes on from there");
            return Ok(ExitCode::from(INTERRUPTED));
        };
        terminal::say(&ablation::markdown(&outcomes))?;
        if let Some(shard) = shard {
            eprintln!("shard {shard} is trained; when all are, the same command without --shard writes the table");
        }
        let failed = outcomes.iter().any(|outcome| outcome.failure.is_some());
        Ok(ExitCode::from(u8::from(failed)))
    }
}
