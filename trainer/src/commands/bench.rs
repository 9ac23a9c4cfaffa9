//! `trainer bench`.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use clap::Args;
use network::weights::{Variant, Weights};
use vectors::Npz;

use crate::learner::Reckoner;
use crate::optimiser::{self, Adam};
use crate::parameters::{Parameters, tensors};
use crate::schedule::Schedule;
use crate::settings::Settings;
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
        let settings = Settings::default();
        let mut learner = Reckoner::new(&settings)?;
        let mut parameters = Parameters::of(&Weights::formula(Variant::Joint));
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
                dropout: Some(step),
                wants_gradient: true,
                wants_looks: false,
            };
            let mut answer = pool.install(|| learner.step(&ask))?;
            pool.install(|| {
                optimiser::clip(&mut answer.gradient, &places, &answer.has_gradient, settings.clip);
                adam.step(&mut parameters, &answer.gradient, &answer.has_gradient, &schedule, &settings.adam);
            });
            learner.take_back(answer.gradient);
            terminal::say(&format!("step {:.4} s\n", begun.elapsed().as_secs_f64()))?;
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
