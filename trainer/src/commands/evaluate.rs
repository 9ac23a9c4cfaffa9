//! `trainer evaluate`.

use std::fs;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, bail};
use clap::Args;
use network::features::Settings as Features;
use network::weights::Weights;

use super::{Chosen, Means};
use crate::parameters::Parameters;
use crate::settings::Mode;
use crate::step::{Ask, Sums};
use crate::training::VALIDATION_BATCH;
use crate::windows::Window;

/// Arguments of `evaluate`.
#[derive(Debug, Args)]
pub struct Evaluate {
    #[command(flatten)]
    means: Means,

    /// Weights, as `trainer train` writes them
    #[arg(long, value_name = "FILE")]
    weights: PathBuf,

    #[command(flatten)]
    chosen: Chosen,

    /// The windows to train on, not those to validate with
    #[arg(long)]
    training: bool,

    /// Leave the planner out
    #[arg(long)]
    no_planner: bool,
}

impl Evaluate {
    /// Prints losses and displacement errors, a name and a number a line.
    ///
    /// # Errors
    /// Settings, weights or windows that cannot be used, a loss that is no number.
    pub fn run(self) -> anyhow::Result<ExitCode> {
        let settings = self.chosen.settings()?;
        let bytes = fs::read(&self.weights).with_context(|| self.weights.display().to_string())?;
        let weights = Weights::read(&bytes).with_context(|| self.weights.display().to_string())?;
        if weights.variant() != settings.variant() || weights.cost_form() != settings.cost.kind.form() {
            bail!(
                "{} is of another network than the settings speak of\nhint: --settings takes the settings.toml of its training",
                self.weights.display()
            );
        }
        let examples = self.means.examples()?;
        let shown: Features = examples.recipe().features.into();
        if let Some(trained_on) = weights.features().filter(|features| *features != shown) {
            let (path, trained_on, shown) = (self.weights.display(), trained_on.name(), shown.name());
            bail!(
                "{path} was trained on {trained_on} features, and the windows have {shown} ones\nhint: trainer prepare --features {trained_on}"
            );
        }
        let indices = if self.training { examples.training() } else { examples.validation() };
        let mut learner = self.means.learner(&settings)?;
        let planning = settings.mode == Mode::Dipp && !self.no_planner;
        let parameters = Parameters::of(&weights);
        let mut sums = Sums::default();
        for batch in indices.chunks(VALIDATION_BATCH) {
            let windows =
                batch.iter().map(|index| Ok(examples.get(*index)?)).collect::<anyhow::Result<Vec<Window>>>()?;
            let ask = Ask::without_gradient(&windows, &parameters, planning);
            sums.add(&learner.step(&ask)?.terms, 0.0);
        }
        let Some((terms, _)) = sums.means() else {
            bail!("there are no such windows\nhint: --training takes the others")
        };
        let numbers = [
            ("windows", indices.len() as f64),
            ("loss", terms.total),
            ("prediction", terms.prediction),
            ("score", terms.score),
            ("plan", terms.plan),
            ("cost", terms.cost),
            ("planner_ade_m", terms.planner_ade),
            ("planner_fde_m", terms.planner_fde),
            ("predictor_ade_m", terms.predictor_ade),
            ("predictor_fde_m", terms.predictor_fde),
        ];
        let lines: String = numbers.iter().map(|(name, number)| format!("{name:<16}{number:>12.5}\n")).collect();
        terminal::say(&lines)?;
        Ok(ExitCode::SUCCESS)
    }
}
