//! What came of driving a failure again with one thing changed.

use serde::Serialize;

use super::failure::Failure;
use crate::compare::outcome::Fault;

/// What came of a change.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case", tag = "came")]
pub enum Outcome {
    /// The drive passed.
    Saved,
    /// It failed.
    Failed {
        /// By this first.
        fault: Fault,
        /// At this step, counted as in the run.
        step: u32,
    },
    /// It was not driven.
    NotDriven {
        /// Why not.
        why: String,
    },
}

impl Outcome {
    /// Of the drive that begins `later` steps than the run's; `failure` is its first fault.
    #[must_use]
    pub fn of(failure: Option<&Failure>, later: u32) -> Self {
        failure.map_or(Self::Saved, |found| Self::Failed { fault: found.fault, step: found.step + later })
    }
}

/// What is changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Remedy {
    /// Nothing: the failure must come again.
    Nothing,
    /// Predictions are the log's own future.
    OraclePrediction,
    /// Another driver drives.
    OtherDriver,
    /// The AV is where the logged AV is then.
    HumanStart,
    /// Agents that are artefacts of the log are not there.
    NoArtefacts,
}

impl Remedy {
    /// All of them, in the order of the table.
    pub const ALL: [Self; 5] =
        [Self::Nothing, Self::OraclePrediction, Self::OtherDriver, Self::HumanStart, Self::NoArtefacts];

    /// As programs call it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Nothing => "nothing",
            Self::OraclePrediction => "oracle-prediction",
            Self::OtherDriver => "other-driver",
            Self::HumanStart => "human-start",
            Self::NoArtefacts => "no-artefacts",
        }
    }
}

/// A failure, and what came of each change; [`Remedy::ALL`] tells their order.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// The failure.
    #[serde(flatten)]
    pub failure: Failure,
    /// The first step that was driven anew.
    pub from: u32,
    /// What came of each.
    pub outcomes: [Outcome; 5],
}

impl Row {
    /// What came of `remedy`.
    #[must_use]
    pub fn outcome(&self, remedy: Remedy) -> &Outcome {
        &self.outcomes[remedy as usize]
    }

    /// Whether the failure came again, with nothing changed: the same fault at the same step.
    #[must_use]
    pub fn is_reproduced(&self) -> bool {
        let Failure { fault, step, .. } = self.failure;
        *self.outcome(Remedy::Nothing) == Outcome::Failed { fault, step }
    }
}

/// All failures of a run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Blamed {
    /// The run's folder, as it was given.
    pub run: String,
    /// What tables call its driver.
    pub driver: String,
    /// The other driver.
    pub other_driver: String,
    /// How many steps before the fault things were changed.
    pub before: u32,
    /// Episodes of the run, or those that were asked for.
    pub episodes: usize,
    /// The failures among them, in the run's order.
    pub failures: Vec<Row>,
}

/// How often a remedy helped.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Count {
    /// Failures that were driven so, of those that come again with nothing changed.
    pub driven: usize,
    /// Of them, drives that passed.
    pub saved: usize,
}

impl Blamed {
    /// How often `remedy` helped.
    #[must_use]
    pub fn count(&self, remedy: Remedy) -> Count {
        let reproduced = self.failures.iter().filter(|row| row.is_reproduced()).map(|row| row.outcome(remedy));
        reproduced.fold(Count::default(), |count, outcome| match outcome {
            Outcome::NotDriven { .. } => count,
            Outcome::Saved => Count { driven: count.driven + 1, saved: count.saved + 1 },
            Outcome::Failed { .. } => Count { driven: count.driven + 1, ..count },
        })
    }

    /// Failures that came again, and those of them that nothing saves.
    #[must_use]
    pub fn reproduced_and_hopeless(&self) -> (usize, usize) {
        let reproduced = || self.failures.iter().filter(|row| row.is_reproduced());
        let hopeless = reproduced().filter(|row| !row.outcomes.contains(&Outcome::Saved)).count();
        (reproduced().count(), hopeless)
    }

    /// What `remedy` is called in tables.
    #[must_use]
    pub fn name(&self, remedy: Remedy) -> String {
        match remedy {
            Remedy::Nothing => "again".to_owned(),
            Remedy::OraclePrediction => "oracle".to_owned(),
            Remedy::OtherDriver => self.other_driver.clone(),
            Remedy::HumanStart => "human's start".to_owned(),
            Remedy::NoArtefacts => "no artefacts".to_owned(),
        }
    }
}
