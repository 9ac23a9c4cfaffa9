//! `trainer bench`.

use std::fs;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use anyhow::Context;
use clap::Args;
use network::weights::{Variant, Weights};
use vectors::Npz;

use super::Chosen;
use crate::learner::Reckoner;
use crate::optimiser::{self, Adam};
use crate::parameters::{Parameters, tensors};
use crate::schedule::Schedule;
use crate::step::{Ask, Learner};
use crate::verify::windows;
use crate::windows::Window;

/// Arguments of `bench`.
#[derive(Debug, Args)]
pub struct Bench {
    /// Folder of training vectors: its batch, as often as it takes
    #[arg(long, value_name = "FOLDER")]
    vectors: PathBuf,

    /// Windows in a step
    #[arg(long, value_name = "N", default_value_t = 32)]
    batch: usize,

    /// How many steps
    #[arg(long, value_name = "N", default_value_t = 5)]
    steps: u64,

    /// Leave the planner out
    #[arg(long)]
    no_planner: bool,

    /// Weights to begin with, of the network that predicts and plans [default: made by a formula]
    #[arg(long, value_name = "FILE")]
    weights: Option<PathBuf>,

    #[command(flatten)]
    chosen: Chosen,

    /// Threads [default: one a core]
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
}

impl Bench {
    /// Times whole steps of learning: forward, planner, losses, backward, clipping, Adam.
    ///
    /// # Errors
    /// Vectors that cannot be used.
    pub fn run(self) -> anyhow::Result<ExitCode> {
        let few = windows(&Npz::read(&self.vectors.join("batch.npz"))?)?;
        let batch: Vec<Window> = few.iter().cycle().take(self.batch).cloned().collect();
        let settings = self.chosen.settings()?;
        let weights = match &self.weights {
            None => Weights::formula(settings.variant()),
            Some(path) => {
                let read = fs::read(path).with_context(|| path.display().to_string())?;
                Weights::read(&read).with_context(|| path.display().to_string())?
            }
        };
        anyhow::ensure!(
            weights.variant() == Variant::Joint,
            "steps are timed of the mode dipp, whose network has all heads"
        );
        let mut learner = Reckoner::new(&settings)?;
        let mut parameters = Parameters::of(&weights);
        let mut adam = Adam::new(Variant::Joint);
        let places: Vec<_> = tensors(Variant::Joint).map(|(_, _, place)| place).collect();
        let schedule = Schedule::of(&settings, 0);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(self.threads.unwrap_or(0)).build()?;
        for step in 0..self.steps {
            let begun = Instant::now();
            let ask = Ask {
                windows: &batch,
                parameters: &parameters,
                planning: !self.no_planner,
                dropout: (settings.dropout > 0.0).then_some(step),
                wants_gradient: true,
                wants_looks: false,
            };
            let mut answer = pool.install(|| learner.step(&ask))?;
            pool.install(|| {
                optimiser::clip(&mut answer.gradient, &places, &answer.has_gradient, settings.clip);
                adam.step(&mut parameters, &answer.gradient, &answer.has_gradient, &schedule, &settings.adam);
            });
            learner.take_back(answer.gradient);
            let (seconds, loss) = (begun.elapsed().as_secs_f64(), answer.terms.total);
            terminal::say(&format!("step {seconds:.4} s, loss {loss:.6}\n"))?;
        }
        if let Some(peak) = peak_memory() {
            terminal::say(&format!("peak memory {peak:.0} MB\n"))?;
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// What the process has had at most (MB), where the system says so.
fn peak_memory() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(line.trim().strip_suffix("kB")?.trim().parse::<f64>().ok()? / 1e3)
}
