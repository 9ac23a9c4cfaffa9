//! Planners: each answers an observation with the AV's next five seconds. The binary `planner-node` serves one of them on
//! the bus; all that is about the bus is in [`wire::node`].
//!
//! | planner | file | what |
//! | --- | --- | --- |
//! | `idm` | `idm/` | follows the reference line; speed by the intelligent driver model |
//! | `human` | `human.rs` | what the logged AV did; reads the scene set by itself |
//! | `constant-velocity` | `constant_velocity.rs` | straight on |
//! | `network` | `network.rs` | what the prediction network would do itself |
//! | `cql` | `cql.rs` | where a policy that sees the scene from above goes next |
//! | `proposals` | `proposals/` | the best of many ways, each tried among the predicted futures |
//! | `gauss-newton` | `gauss_newton_planner/` | the differentiable planner; its mathematics is [`gauss_newton`] |
//!
//! [`explain`] tells why a recorded plan is what it is; [`verify`] holds the mathematics to numbers of other implementations.
//!
//! A planner is pure: what it answers depends on its inputs alone. To add one: a file, a member of [`PlannerKind`], a line
//! in [`Choice::factory`].

mod constant_velocity;
mod cql;
pub mod explain;
mod gauss_newton_planner;
mod human;
mod idm;
mod network;
mod proposals;
pub mod verify;

use std::sync::Arc;

use scenarios::{Logs, SceneSet, SetError};
use thiserror::Error;
use wire::node::PlannerFactory;

pub use constant_velocity::ConstantVelocity;
pub use cql::{Cql, Options as CqlOptions, PolicyError};
pub use gauss_newton_planner::{
    GaussNewton, Init, Options as GaussNewtonOptions, Rules, Situation, Weights, WeightsError, one_step_on,
};
pub use human::Human;
pub use idm::Idm;
pub use network::Network;
pub use proposals::{Contingency, Options as ProposalsOptions, Proposals};

/// The planners by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum PlannerKind {
    /// Follows the reference line; speed by the intelligent driver model
    Idm,
    /// What the logged AV did; needs --scenarios
    Human,
    /// Straight on at the present speed
    ConstantVelocity,
    /// Minimizes the cost terms of DIPP; needs a predictor
    GaussNewton,
    /// What the prediction network would do itself; needs the predictor network
    Network,
    /// The best of many ways to drive along the route, each tried among the predicted futures; needs a predictor
    Proposals,
    /// Where a policy that sees the scene from above goes next; needs --policy
    Cql,
}

/// A planner that cannot be had.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum PlannerError {
    #[error("cannot open the scenes: {0}")]
    Scenes(#[from] SetError),
    #[error(transparent)]
    Policy(#[from] PolicyError),
}

/// Which planner, and where the log is.
#[derive(Clone, Debug, clap::Args)]
#[group(id = "planner_choice")]
pub struct Choice {
    /// Which planner
    #[arg(long, value_enum)]
    pub planner: PlannerKind,
    /// Where the run's scenes are: files, folders, globs, scene sets; for planners that read the log
    #[arg(long, value_name = "PATH", num_args = 1..)]
    pub scenarios: Vec<String>,
}

impl Choice {
    /// The planner's factory. `gauss_newton`, `proposals` and `cql` are for these planners, `logs` is where planners that read the log find it; without it they open what they are told.
    ///
    /// # Errors
    /// [`PlannerError`] where the planner needs the scene set or a policy, and it cannot be opened.
    pub fn factory(
        &self,
        gauss_newton: &GaussNewtonOptions,
        proposals: ProposalsOptions,
        cql: &CqlOptions,
        logs: Option<Arc<dyn Logs>>,
    ) -> Result<Arc<dyn PlannerFactory>, PlannerError> {
        let logs = || match logs {
            Some(logs) => Ok(logs),
            None => SceneSet::open(&self.scenarios).map(|set| Arc::new(set) as Arc<dyn Logs>),
        };
        Ok(match self.planner {
            PlannerKind::Idm => Arc::new(Idm),
            PlannerKind::Human => Arc::new(Human(logs()?)),
            PlannerKind::ConstantVelocity => Arc::new(ConstantVelocity),
            PlannerKind::GaussNewton => Arc::new(GaussNewton(gauss_newton.clone())),
            PlannerKind::Network => Arc::new(Network),
            PlannerKind::Proposals => Arc::new(Proposals(proposals)),
            PlannerKind::Cql => Arc::new(Cql::open(cql)?),
        })
    }
}
