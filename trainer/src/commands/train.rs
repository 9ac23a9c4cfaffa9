//! `trainer train`.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;

use super::progress::Progress;
use super::{Chosen, Drawing, Means};
use crate::training::{Task, train};

/// Arguments of `train`.
#[derive(Debug, Args)]
pub struct Train {
    #[command(flatten)]
    means: Means,

    #[command(flatten)]
    chosen: Chosen,

    /// Folder for checkpoint, weights and metrics; made if it is not there
    #[arg(long, value_name = "FOLDER")]
    out: PathBuf,

    /// Go on from the checkpoint in the folder; from the beginning where there is none yet
    #[arg(long)]
    resume: bool,

    #[command(flatten)]
    drawing: Drawing,
}

impl Train {
    /// Trains.
    ///
    /// # Errors
    /// Settings or windows that cannot be used, a folder that has another training, a loss that is no number.
    pub fn run(self) -> anyhow::Result<ExitCode> {
        let settings = self.chosen.settings()?;
        let examples = self.means.examples()?;
        let mut learner = self.means.learner(&settings)?;
        let mut progress = Progress::new();
        let Self { resume, drawing: Drawing { rerun }, .. } = self;
        let task = Task { settings: &settings, examples: &examples, folder: &self.out, resume, rerun };
        let ended = train(task, learner.as_mut(), &mut progress);
        progress.end();
        super::told(ended?, &self.out)
    }
}
