//! Predictors: each answers an observation with where the agents may be in the next five seconds. The binary
//! `predictor-node` serves one of them on the bus; all that is about the bus is in [`wire::node`].
//!
//! | predictor | file | what |
//! | --- | --- | --- |
//! | `ctrv` | `ctrv.rs` | every agent keeps its turn rate and speed |
//! | `oracle` | `oracle.rs` | what the log says; reads the scene set by itself |
//!
//! A predictor is pure: what it answers depends on its inputs alone. To add one: a file, a member of [`PredictorKind`], a
//! line in [`PredictorKind::factory`].

mod ctrv;
mod oracle;

use std::sync::Arc;

use scenarios::SetError;
use wire::node::PredictorFactory;

pub use ctrv::{Ctrv, TurnRate};
pub use oracle::Oracle;

/// The predictors by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum PredictorKind {
    /// Every agent keeps its turn rate and speed
    Ctrv,
    /// What the log says; needs --scenarios
    Oracle,
}

impl PredictorKind {
    /// The predictor's factory. `scenarios` is where predictors that read the log find it; `turn_rate` is for `ctrv`, see there.
    ///
    /// # Errors
    /// [`SetError`] where the predictor needs the scene set and it cannot be opened.
    pub fn factory(
        self,
        scenarios: &[String],
        turn_rate: Option<TurnRate>,
    ) -> Result<Arc<dyn PredictorFactory>, SetError> {
        Ok(match self {
            Self::Ctrv => Arc::new(Ctrv(turn_rate)),
            Self::Oracle => Arc::new(Oracle::open(scenarios)?),
        })
    }
}
