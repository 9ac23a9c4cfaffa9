//! Planners: each answers an observation with the AV's next five seconds. The binary `planner-node` serves one of them on
//! the bus; all that is about the bus is in [`wire::node`].
//!
//! | planner | file | what |
//! | --- | --- | --- |
//! | `idm` | `idm/` | follows the reference line; speed by the intelligent driver model |
//! | `human` | `human.rs` | what the logged AV did; reads the scene set by itself |
//! | `constant-velocity` | `constant_velocity.rs` | straight on |
//! | `network` | `network.rs` | what the prediction network would do itself |
//! | `gauss-newton` | `gauss_newton_planner/` | the differentiable planner; its mathematics is [`gauss_newton`] |
//!
//! [`explain`] tells why a recorded plan is what it is; [`verify`] holds the mathematics to numbers of other implementations.
//!
//! A planner is pure: what it answers depends on its inputs alone. To add one: a file, a member of [`PlannerKind`], a line
//! in [`PlannerKind::factory`].

mod constant_velocity;
pub mod explain;
mod gauss_newton_planner;
mod human;
mod idm;
mod network;
pub mod verify;

use std::sync::Arc;

use scenarios::SetError;
use wire::node::PlannerFactory;

pub use constant_velocity::ConstantVelocity;
pub use gauss_newton_planner::{
    GaussNewton, Init, Options as GaussNewtonOptions, Rules, Situation, Weights, WeightsError, one_step_on,
};
pub use human::Human;
pub use idm::Idm;
pub use network::Network;

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
}

impl PlannerKind {
    /// The planner's factory. `scenarios` is where planners that read the log find it; `gauss_newton` is for that planner.
    ///
    /// # Errors
    /// [`SetError`] where the planner needs the scene set and it cannot be opened.
    pub fn factory(
        self,
        scenarios: &[String],
        gauss_newton: &GaussNewtonOptions,
    ) -> Result<Arc<dyn PlannerFactory>, SetError> {
        Ok(match self {
            Self::Idm => Arc::new(Idm),
            Self::Human => Arc::new(Human::open(scenarios)?),
            Self::ConstantVelocity => Arc::new(ConstantVelocity),
            Self::GaussNewton => Arc::new(GaussNewton(gauss_newton.clone())),
            Self::Network => Arc::new(Network),
        })
    }
}
