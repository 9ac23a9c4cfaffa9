//! `trainer inspect`.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use gauss_newton::constants::Term;

use crate::checkpoint::Checkpoint;
use crate::cost;
use crate::parameters::tensors;
use crate::schedule::Schedule;
use crate::settings::CostKind;

/// Arguments of `inspect`.
#[derive(Debug, Args)]
pub struct Inspect {
    /// A checkpoint, as a training writes it: FOLDER/checkpoint.safetensors
    #[arg(value_name = "CHECKPOINT")]
    checkpoint: PathBuf,

    /// A row for each tensor
    #[arg(long)]
    tensors: bool,
}

impl Inspect {
    /// Prints what is in it.
    ///
    /// # Errors
    /// It cannot be read, or is none.
    pub fn run(self) -> anyhow::Result<ExitCode> {
        let checkpoint = Checkpoint::read(&self.checkpoint)?;
        // Writing into memory does not fail.
        let mut text = String::new();
        let _ = told(&checkpoint, self.tensors, &mut text);
        terminal::say(&text)?;
        Ok(ExitCode::SUCCESS)
    }
}

fn told(checkpoint: &Checkpoint, by_tensor: bool, out: &mut String) -> std::fmt::Result {
    let Checkpoint { step, epoch, windows, settings, parameters, adam, sums } = checkpoint;
    let epochs = settings.epochs;
    let schedule = Schedule::of(settings, *epoch);
    writeln!(out, "steps          {step}")?;
    writeln!(out, "epochs         {epoch} of {epochs} done, and {} steps of the next", sums.batches)?;
    writeln!(out, "learning rate  {:e}, of the cost {:e}", schedule.learning_rate, schedule.cost_learning_rate)?;
    writeln!(out, "planner        {}", if schedule.planning { "on" } else { "off" })?;
    writeln!(out, "windows        {windows}")?;
    if let Some((means, norm)) = sums.means() {
        writeln!(out, "this epoch     loss {:.4}, gradient norm {norm:.4}", means.total)?;
    }
    let all = 0..parameters.values().len();
    let [values, first, second] = [parameters.values(), &adam.first, &adam.second].map(|row| norm(&row[all.clone()]));
    writeln!(out, "norms          parameters {values:.4e}, first moments {first:.4e}, second moments {second:.4e}")?;
    if let Some(weights) = cost::weights(parameters, settings.cost.kind) {
        let kind = if settings.cost.kind == CostKind::Softmax { "softmax" } else { "exp" };
        writeln!(out, "\nweights of the planner's cost ({kind})")?;
        for (term, weight) in Term::ALL.iter().zip(weights) {
            writeln!(out, "  {:<16}{weight:.6}", term.name())?;
        }
    }
    writeln!(out, "\nsettings\n{}", settings.text())?;
    if by_tensor {
        let name = "tensor";
        writeln!(
            out,
            "{name:<58} {:>12} {:>8} {:>11} {:>11} {:>11}",
            "shape", "steps", "|value|", "|first|", "|second|"
        )?;
        for ((name, shape, range), steps) in tensors(parameters.variant()).zip(&adam.steps) {
            let shape = shape.iter().map(usize::to_string).collect::<Vec<_>>().join("x");
            let rows = [parameters.values(), &adam.first, &adam.second];
            let [value, first, second] = rows.map(|row| norm(&row[range.clone()]));
            writeln!(out, "{name:<58} {shape:>12} {steps:>8} {value:>11.4e} {first:>11.4e} {second:>11.4e}")?;
        }
    }
    Ok(())
}

fn norm(values: &[f32]) -> f64 {
    values.iter().map(|value| f64::from(*value) * f64::from(*value)).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::initial::initial;
    use crate::settings::Settings;
    use crate::step::Terms;

    #[test]
    fn all_is_told_that_a_training_is() {
        let settings = Settings::default();
        let mut checkpoint = Checkpoint::first(&settings, "abc".to_owned(), initial(&settings));
        (checkpoint.step, checkpoint.epoch) = (201, 5);
        checkpoint.sums.add(&Terms { total: 2.5, ..Terms::default() }, 3.0);
        let mut text = String::new();
        told(&checkpoint, true, &mut text).unwrap();
        for part in [
            "steps          201",
            "epochs         5 of 20 done, and 1 steps of the next",
            "learning rate  1e-4, of the cost 1e-4",
            "planner        on",
            "loss 2.5000, gradient norm 3.0000",
            "  lane_heading    ",
            "batch = 32",
            "agent_agent.interaction_net.layers.1.linear2.weight",
        ] {
            assert!(text.contains(part), "{part}\n{text}");
        }
        assert!(text.lines().filter(|line| line.contains(".weight")).count() > 60);
    }
}
