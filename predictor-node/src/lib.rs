//! Predictors: each answers an observation with where the agents may be in the next five seconds. The binary
//! `predictor-node` serves one of them on the bus; all that is about the bus is in [`wire::node`].
//!
//! | predictor | file | what |
//! | --- | --- | --- |
//! | `ctrv` | `ctrv.rs` | every agent keeps its turn rate and speed |
//! | `ctra` | `ctra.rs` | every agent keeps its turn rate and acceleration of the last half second, both fading |
//! | `network` | `network.rs` | the prediction network of the DIPP paper; its mathematics is [`mod@::network`] |
//! | `oracle` | `oracle.rs` | what the log says; reads the scene set by itself |
//!
//! [`explain`](mod@explain) tells what the network was shown at a recorded step, and what agents attended to; [`verify`](mod@verify) holds the network to numbers of the authors' code.
//!
//! A predictor is pure: what it answers depends on its inputs alone. To add one: a file, a member of [`PredictorKind`], a
//! line in [`Choice::factory`].

mod ctra;
mod ctrv;
pub mod explain;
mod network;
mod oracle;
pub mod verify;

use std::path::PathBuf;
use std::sync::Arc;

use scenarios::{Logs, SceneSet, SetError};
use thiserror::Error;
use wire::node::PredictorFactory;

pub use ctra::Ctra;
pub use ctrv::{Ctrv, TurnRate};
pub use network::{FeatureStyle, Foresight, Network, NetworkError};
pub use oracle::Oracle;

/// The predictors by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum PredictorKind {
    /// Every agent keeps its turn rate and speed
    Ctrv,
    /// Every agent keeps turn rate and acceleration of its last half second, for a while
    Ctra,
    /// What the log says; needs --scenarios
    Oracle,
    /// The prediction network
    Network,
}

/// What predictors may need.
#[derive(Clone, Debug, Default, clap::Args)]
#[group(id = "predictor_options")]
pub struct Options {
    /// How ctrv takes an agent's turn rate [default: authors under the protocol paper, else wrapped]
    #[arg(long, value_enum)]
    pub turn_rate: Option<TurnRate>,
    /// Where the run's scenes are: files, folders, globs, scene sets; for predictors that read the log
    #[arg(long, value_name = "PATH", num_args = 1..)]
    pub scenarios: Vec<String>,
    /// The network's weights, a .safetensors file [default: those of dipp, built in]
    #[arg(long, value_name = "FILE")]
    pub weights: Option<PathBuf>,
    /// How the network's features are made [default: as the weights say, or else authors]
    #[arg(long, value_enum)]
    pub features: Option<FeatureStyle>,
    /// Whose futures the network tells [default: its own]; where the plan begins and what it costs stay the network's
    #[arg(long, value_enum)]
    pub futures: Option<Futures>,
}

/// Futures that are told in place of the network's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Futures {
    /// What the log says, as `oracle` does; needs --scenarios
    Log,
}

/// A predictor that cannot be had.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum PredictorError {
    #[error("cannot open the scenes: {0}\nhint: {hint}", hint = .0.hint())]
    Scenes(#[from] SetError),
    #[error(transparent)]
    Network(#[from] NetworkError),
}

/// Which predictor, and what it is told: all of a node's arguments that are not about the bus.
#[derive(Clone, Debug, clap::Args)]
#[group(id = "predictor_choice")]
pub struct Choice {
    /// Which predictor
    #[arg(long, value_enum)]
    pub predictor: PredictorKind,
    #[command(flatten)]
    #[allow(missing_docs, reason = "clap would show it")]
    pub options: Options,
}

impl Choice {
    /// The predictor's factory. `logs` is where predictors that read the log find it; without it they open what they are told.
    ///
    /// # Errors
    /// [`PredictorError`] where what it needs is not there.
    pub fn factory(&self, logs: Option<Arc<dyn Logs>>) -> Result<Arc<dyn PredictorFactory>, PredictorError> {
        let options = &self.options;
        let logs = || match logs {
            Some(logs) => Ok(logs),
            None => SceneSet::open(&options.scenarios).map(|set| Arc::new(set) as Arc<dyn Logs>),
        };
        Ok(match self.predictor {
            PredictorKind::Ctrv => Arc::new(Ctrv(options.turn_rate)),
            PredictorKind::Ctra => Arc::new(Ctra),
            PredictorKind::Oracle => Arc::new(Oracle(logs()?)),
            PredictorKind::Network => {
                let network = Network::open(options.weights.as_deref(), options.features)?;
                match options.futures {
                    None => Arc::new(network),
                    Some(Futures::Log) => Arc::new(network.with_futures(Oracle(logs()?))),
                }
            }
        })
    }
}
