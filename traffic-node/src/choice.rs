//! Which traffic, as it is typed.

use std::sync::Arc;

use clap::Args;
use wire::node::TrafficFactory;

use crate::{Cast, Characters};

/// Which traffic drives, and what it draws from.
#[derive(Clone, Copy, Debug, Args)]
pub struct Choice {
    /// Who drives: idm, waymax, cautious, assertive, distracted or mixed
    #[arg(long, value_name = "NAME")]
    pub traffic: Cast,
    /// What is drawn about them is drawn from this
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
}

impl Choice {
    /// What makes it.
    #[must_use]
    pub fn factory(&self) -> Arc<dyn TrafficFactory> {
        Arc::new(Characters { cast: self.traffic, seed: self.seed })
    }
}
