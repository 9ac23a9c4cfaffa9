//! Planners: each answers an observation with the AV's next five seconds. The binary `planner-node` serves one of them on
//! the bus; all that is about the bus is in [`wire::node`].
//!
//! | planner | file | what |
//! | --- | --- | --- |
//! | `idm` | `idm/` | follows the reference line; speed by the intelligent driver model |
//! | `human` | `human.rs` | what the logged AV did; reads the scene set by itself |
//! | `constant-velocity` | `constant_velocity.rs` | straight on |
//!
//! A planner is pure: what it answers depends on its inputs alone. To add one: a file, a member of [`PlannerKind`], a line
//! in [`PlannerKind::factory`].

mod constant_velocity;
mod human;
mod idm;

use std::sync::Arc;

use scenarios::SetError;
use wire::node::PlannerFactory;

pub use constant_velocity::ConstantVelocity;
pub use human::Human;
pub use idm::Idm;

/// The planners by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum PlannerKind {
    /// Follows the reference line; speed by the intelligent driver model
    Idm,
    /// What the logged AV did; needs --scenarios
    Human,
    /// Straight on at the present speed
    ConstantVelocity,
}

impl PlannerKind {
    /// The planner's factory. `scenarios` is where planners that read the log find it.
    ///
    /// # Errors
    /// [`SetError`] where the planner needs the scene set and it cannot be opened.
    pub fn factory(self, scenarios: &[String]) -> Result<Arc<dyn PlannerFactory>, SetError> {
        Ok(match self {
            Self::Idm => Arc::new(Idm),
            Self::Human => Arc::new(Human::open(scenarios)?),
            Self::ConstantVelocity => Arc::new(ConstantVelocity),
        })
    }
}
