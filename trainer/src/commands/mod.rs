//! The subcommands, a file each: what can be typed, and what it does.
//!
//! Each has `run(self)`, which answers the program's exit code: 0 done; 1 done, and something did not succeed; 130 interrupted. An error
//! is told by whoever calls, with exit code 2.

mod ablate;
mod bench;
mod cql;
mod evaluate;
mod inspect;
mod prepare;
mod progress;
mod train;
mod verify;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context;
use clap::{Args, Subcommand, ValueEnum};

use crate::learner::Reckoner;
use crate::settings::Settings;
use crate::step::Learner;
use crate::training::Ended;
use crate::windows::Windows;

pub use ablate::Ablate;
pub use bench::Bench;
pub use cql::Cql;
pub use evaluate::Evaluate;
pub use inspect::Inspect;
pub use prepare::Prepare;
pub use train::Train;
pub use verify::Verify;

/// The exit code of an interrupted program.
const INTERRUPTED: u8 = 130;

/// What can be done.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Cut scenes into windows to train on, and keep them in one file
    Prepare(Prepare),
    /// Train a network on windows, from the beginning or from where it stopped
    Train(Train),
    /// Train the policy of the driver cql on transitions, from the beginning or from where it stopped
    Cql(Cql),
    /// Losses and displacement errors of weights on windows
    Evaluate(Evaluate),
    /// What a checkpoint holds: settings, how far it is, norms, the learned cost
    Inspect(Inspect),
    /// Train a list of settings, each into its folder, and tabulate what came out
    Ablate(Ablate),
    /// Hold a step of learning to the numbers of another implementation; exits with 1 where it is out
    Verify(Verify),
    /// Time steps of learning
    Bench(Bench),
}

impl Command {
    /// Does it.
    ///
    /// # Errors
    /// Those of the subcommand.
    pub fn run(self) -> anyhow::Result<ExitCode> {
        match self {
            Self::Prepare(prepare) => prepare.run(),
            Self::Train(train) => train.run(),
            Self::Cql(cql) => cql.run(),
            Self::Evaluate(evaluate) => evaluate.run(),
            Self::Inspect(inspect) => inspect.run(),
            Self::Ablate(ablate) => ablate.run(),
            Self::Verify(verify) => verify.run(),
            Self::Bench(bench) => bench.run(),
        }
    }
}

/// Tells how a training ended.
fn told(ended: Ended, folder: &Path) -> anyhow::Result<ExitCode> {
    match ended {
        Ended::Finished => {
            terminal::say(&format!("{}\n", folder.join("weights.safetensors").display()))?;
            Ok(ExitCode::SUCCESS)
        }
        Ended::Stopped => {
            eprintln!("interrupted; the same command with --resume goes on from there");
            Ok(ExitCode::from(INTERRUPTED))
        }
    }
}

/// How it is done.
#[derive(Debug, Args)]
struct Chosen {
    /// Settings, a TOML file; a training's folder has its own [default: those of the paper]
    #[arg(long, value_name = "FILE")]
    settings: Option<PathBuf>,

    /// A setting, over the file's: --set epochs=10, --set cost.kind=exp; may be given several times
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
}

impl Chosen {
    /// The file's, with the changes.
    fn settings(&self) -> anyhow::Result<Settings> {
        let Some(path) = &self.settings else { return Ok(Settings::read("", &self.set)?) };
        let text = fs::read_to_string(path).with_context(|| path.display().to_string())?;
        Settings::read(&text, &self.set).with_context(|| path.display().to_string())
    }
}

/// What is drawn of a training.
#[derive(Debug, Args)]
struct Drawing {
    /// Draw each training into training.rrd in its folder, for the Rerun viewer: losses, gradient norms, the learned cost, and four
    /// windows of validation with plans and predictions after each epoch
    #[arg(long)]
    rerun: bool,
}

/// What training is done on.
#[derive(Debug, Args)]
struct Means {
    /// Windows, as `trainer prepare` writes them; several files are taken as one
    #[arg(long, value_name = "FILE", required = true, num_args = 1..)]
    windows: Vec<PathBuf>,

    /// What reckons
    #[arg(long, value_enum, default_value_t = Device::Cpu)]
    device: Device,
}

/// What reckons.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Device {
    /// All cores of this machine
    Cpu,
}

impl Means {
    /// All windows as one set.
    fn examples(&self) -> anyhow::Result<Windows> {
        Ok(Windows::open_all(&self.windows)?)
    }

    /// Network, losses and planner by these settings.
    fn learner(&self, settings: &Settings) -> anyhow::Result<Box<dyn Learner>> {
        match self.device {
            Device::Cpu => Ok(Box::new(Reckoner::new(settings)?)),
        }
    }
}
