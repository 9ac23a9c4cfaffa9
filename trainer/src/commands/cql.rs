//! `trainer cql`.

use std::fs;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context;
use clap::Args;
use network::cql::Shape;

use super::progress::Progress;
use crate::cql::{Settings, Task, train};
use crate::windows::Transitions;

/// Arguments of `cql`.
#[derive(Debug, Args)]
pub struct Cql {
    /// Transitions, as `trainer prepare --transitions` writes them; several files are taken as one
    #[arg(long, value_name = "FILE", required = true, num_args = 1..)]
    transitions: Vec<PathBuf>,

    /// Settings, a TOML file; a training's folder has its own [default: those of d3rlpy]
    #[arg(long, value_name = "FILE")]
    settings: Option<PathBuf>,

    /// A setting, over the file's: --set epochs=20; may be given several times
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,

    /// Folder for checkpoint, weights and metrics; made if it is not there
    #[arg(long, value_name = "FOLDER")]
    out: PathBuf,

    /// Go on from the checkpoint in the folder; from the beginning where there is none yet
    #[arg(long)]
    resume: bool,
}

impl Cql {
    /// Trains.
    ///
    /// # Errors
    /// Settings or transitions that cannot be used, a folder that has another training, a loss that is no number.
    pub fn run(self) -> anyhow::Result<ExitCode> {
        let text = match &self.settings {
            Some(path) => fs::read_to_string(path).with_context(|| path.display().to_string())?,
            None => String::new(),
        };
        let settings = Settings::read(&text, &self.set)?;
        let experience = Transitions::open(&self.transitions)?;
        let shape = Shape::driver();
        let task = Task {
            shape: &shape,
            settings: &settings,
            experience: &experience,
            folder: &self.out,
            resume: self.resume,
        };
        let mut progress = Progress::new();
        let ended = train(task, &mut progress);
        progress.end();
        super::told(ended?, &self.out)
    }
}
