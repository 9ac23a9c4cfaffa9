//! The drivers: a planner with its predictor and settings, by one name. A new driver is a row here.

use clap::ValueEnum;

use crate::weights;

/// Predictors that the sim can start.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Predictor {
    /// Nobody predicts
    None,
    /// Everybody keeps turn rate and speed
    Ctrv,
    /// Everybody keeps turn rate and acceleration for a while
    Ctra,
    /// The log's own future
    Oracle,
    /// The prediction network
    Network,
}

/// Ways for the AV to follow its plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum MotionName {
    /// By the kinematic bicycle model
    Bicycle,
    /// It is put on the plan's first state
    Playback,
}

/// A row of the table.
#[derive(Clone, Copy, Debug)]
pub struct Driver {
    /// What is typed and what tables say.
    pub name: &'static str,
    /// In a few words, for `--help`.
    pub about: &'static str,
    /// The planner, as `planner-node` calls it.
    pub planner: &'static str,
    /// What the planner is told beside.
    pub planner_options: &'static [&'static str],
    /// Whether the planner reads the log itself, so that it must be told the scene set.
    pub planner_reads_log: bool,
    /// The predictor it wants.
    pub predictor: Predictor,
    /// The repository's file of weights for it, in the folder `weights`: the network's, or else the planner's.
    pub weights: Option<&'static str>,
    /// How the AV follows its plans under `strict`, unless asked otherwise.
    pub motion: MotionName,
}

/// Who drives where nobody else is asked for.
pub const DEFAULT: &str = "proposals";

/// All of them.
pub const DRIVERS: &[Driver] = &[
    Driver {
        name: "idm",
        about: "Intelligent driver model along the route",
        planner: "idm",
        planner_options: &[],
        planner_reads_log: false,
        predictor: Predictor::None,
        weights: None,
        motion: MotionName::Bicycle,
    },
    Driver {
        name: "human",
        about: "The logged AV itself",
        planner: "human",
        planner_options: &[],
        planner_reads_log: true,
        predictor: Predictor::None,
        weights: None,
        // So that the log itself is judged, and not how well it can be tracked.
        motion: MotionName::Playback,
    },
    Driver {
        name: "constant-velocity",
        about: "Straight on at the speed it has",
        planner: "constant-velocity",
        planner_options: &[],
        planner_reads_log: false,
        predictor: Predictor::None,
        weights: None,
        motion: MotionName::Bicycle,
    },
    Driver {
        name: "gn-ctrv",
        about: "Gauss-Newton over DIPP's cost terms, others at constant turn rate",
        planner: "gauss-newton",
        planner_options: &[],
        planner_reads_log: false,
        predictor: Predictor::Ctrv,
        weights: None,
        motion: MotionName::Bicycle,
    },
    Driver {
        name: "gn-oracle",
        about: "The same with everybody's true future",
        planner: "gauss-newton",
        planner_options: &[],
        planner_reads_log: false,
        predictor: Predictor::Oracle,
        weights: None,
        motion: MotionName::Bicycle,
    },
    Driver {
        name: "proposals",
        about: "The best of many ways along the route, each tried in a small simulation; others go on as they move",
        planner: "proposals",
        planner_options: &[],
        planner_reads_log: false,
        predictor: Predictor::Ctra,
        weights: None,
        motion: MotionName::Bicycle,
    },
    Driver {
        name: "contingency",
        about: "The same among the three futures of the network of dipp, with a branch for each",
        planner: "proposals",
        planner_options: &[],
        planner_reads_log: false,
        predictor: Predictor::Network,
        weights: Some(weights::BUILT_IN),
        motion: MotionName::Bicycle,
    },
    Driver {
        name: "dipp",
        about: "The paper's own: Gauss-Newton from the network's plan, with the cost that it learned",
        planner: "gauss-newton",
        planner_options: &["--init", "network", "--weights", "learned"],
        planner_reads_log: false,
        predictor: Predictor::Network,
        weights: Some(weights::BUILT_IN),
        motion: MotionName::Bicycle,
    },
    Driver {
        name: "sep",
        about: "The same planner with hand-tuned cost, over a network that was trained without it; needs --weights",
        planner: "gauss-newton",
        planner_options: &["--init", "network"],
        planner_reads_log: false,
        predictor: Predictor::Network,
        weights: Some(weights::IL_PRED),
        motion: MotionName::Bicycle,
    },
    Driver {
        name: "il-pred",
        about: "The network's own plan, without a planner; needs --weights",
        planner: "network",
        planner_options: &[],
        planner_reads_log: false,
        predictor: Predictor::Network,
        weights: Some(weights::IL_PRED),
        motion: MotionName::Bicycle,
    },
    Driver {
        name: "il",
        about: "The plan of a network that predicts nobody; needs --weights",
        planner: "network",
        planner_options: &[],
        planner_reads_log: false,
        predictor: Predictor::Network,
        weights: Some(weights::IL),
        motion: MotionName::Bicycle,
    },
    Driver {
        name: "cql",
        about: "A policy learned by conservative Q-learning that sees the scene from above; needs --weights",
        planner: "cql",
        planner_options: &[],
        planner_reads_log: false,
        predictor: Predictor::None,
        weights: Some(weights::CQL),
        motion: MotionName::Bicycle,
    },
];

impl Driver {
    /// Whether the weights are the planner's own, and not a network's that predicts.
    #[must_use]
    pub fn planner_has_weights(&self) -> bool {
        self.weights.is_some() && self.predictor == Predictor::None
    }
}

/// The row of `name`.
#[must_use]
pub fn find(name: &str) -> Option<&'static Driver> {
    DRIVERS.iter().find(|driver| driver.name == name)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;

    #[test]
    fn who_drives_by_default_is_a_driver_that_needs_no_file() {
        let file = find(DEFAULT).unwrap().weights;
        assert!(file.is_none_or(|file| file == weights::BUILT_IN));
    }

    #[test]
    fn driver_names_are_unique() {
        for (index, driver) in DRIVERS.iter().enumerate() {
            assert!(DRIVERS[..index].iter().all(|other| other.name != driver.name), "{} twice", driver.name);
        }
    }
}
