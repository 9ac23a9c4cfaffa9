//! `trainer verify`.

use std::fs;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context;
use clap::Args;
use network::weights::{Variant, Weights};

use crate::parameters::Parameters;
use crate::verify::verify;

/// Arguments of `verify`.
#[derive(Debug, Args)]
pub struct Verify {
    /// Folder of training vectors: a batch, and what another implementation makes of it
    #[arg(long, value_name = "FOLDER")]
    vectors: PathBuf,

    /// Weights that the vectors were made with [default: those of the formula]
    #[arg(long, value_name = "FILE")]
    weights: Option<PathBuf>,
}

impl Verify {
    /// Compares.
    ///
    /// # Errors
    /// Files that cannot be used.
    pub fn run(self) -> anyhow::Result<ExitCode> {
        let weights = match &self.weights {
            None => Weights::formula(Variant::Joint),
            Some(path) => {
                let bytes = fs::read(path).with_context(|| path.display().to_string())?;
                Weights::read(&bytes).with_context(|| path.display().to_string())?
            }
        };
        let report = verify(&Parameters::of(&weights), &self.vectors)?;
        terminal::say(&format!("{report}\n"))?;
        Ok(if report.holds() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
    }
}
