//! `explain x.mcap --step N`: why the plan of that step is what it is.
//!
//! The situation is built again from the recording. The files:
//!
//! | file | what |
//! | --- | --- |
//! | `recording.rs` | the step as it was recorded, and what the planner had seen before |
//! | `run.rs` | what the run's settings say of its planner |
//! | `costs.rs` | plans of controls: what each term costs, and what the search would come to without it |
//! | `weights.rs` | which weights these costs have |
//! | `proposals.rs` | plans chosen among proposals: what each was worth, and what is against those that lost |

mod costs;
mod proposals;
mod recording;
mod run;
#[cfg(test)]
mod tests;
mod weights;

use std::fmt;
use std::path::Path;

use thiserror::Error;

pub use costs::Costs;
pub use proposals::Trials;
pub use recording::{RecordedStep, RecordingError, read_step, step_of};
pub use run::PlannerOfRun;

use crate::Weights;

/// Why there is no explanation.
#[derive(Debug, Error)]
pub enum ExplainError {
    /// The recording.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// The plan of the step has states alone.
    #[error(
        "the plan of step {0} has no controls, and only controls have a cost\nhint: gauss-newton and idm plan controls"
    )]
    NoControls(u32),
    /// The step makes no problem.
    #[error("step {step}: {what}")]
    Problem {
        /// The step.
        step: u32,
        /// Why.
        what: String,
    },
    /// The plan was made with weights that are neither given nor recorded.
    #[error("step {step}: {what}\nhint: give the weights of its run by --weights FILE")]
    OtherWeights {
        /// The step.
        step: u32,
        /// How that shows.
        what: String,
    },
    /// The plan was chosen among proposals, and weights are given.
    #[error(
        "the plan of step {0} was chosen among proposals, and their score has no weights to be given\nhint: leave --weights out"
    )]
    NoWeights(u32),
    /// The options of the run's planner cannot be understood.
    #[error("step {step}: its run has {option} {value}, and that is none of {allowed}")]
    Options {
        /// The step.
        step: u32,
        /// Which option.
        option: &'static str,
        /// What it is there.
        value: String,
        /// What it may be.
        allowed: &'static str,
    },
}

/// Why a plan is what it is.
#[derive(Clone, Debug)]
pub enum Explanation {
    /// What its controls cost.
    Costs(Box<Costs>),
    /// Among which proposals it was chosen.
    Trials(Trials),
}

impl fmt::Display for Explanation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Costs(costs) => costs.fmt(f),
            Self::Trials(trials) => trials.fmt(f),
        }
    }
}

/// Explains a step of a recording, under these weights; without any, under those that it was made with.
///
/// # Errors
/// [`ExplainError`].
pub fn explain(path: &Path, step: u32, weights: Option<&Weights>) -> Result<Explanation, ExplainError> {
    explain_step(step, &read_step(path, step)?, weights)
}

/// Explains a step that is read already: by its own account, for a run may be forked, and a planner be anybody's.
///
/// # Errors
/// [`ExplainError`].
pub fn explain_step(
    step: u32,
    recorded: &RecordedStep,
    weights: Option<&Weights>,
) -> Result<Explanation, ExplainError> {
    if proposals::is_chosen(recorded.plan.diagnostics()) {
        return match weights {
            Some(_) => Err(ExplainError::NoWeights(step)),
            None => Ok(Explanation::Trials(Trials::of(step, recorded)?)),
        };
    }
    Ok(Explanation::Costs(Box::new(Costs::of(step, recorded, weights)?)))
}
