//! What can be typed.

use clap::Parser;
use predictor_node::{PredictorKind, TurnRate};

/// Serves a predictor on the bus of a run
#[derive(Debug, Parser)]
#[command(name = "predictor-node")]
pub struct Cli {
    /// Which predictor
    #[arg(long, value_enum)]
    pub predictor: PredictorKind,
    /// How ctrv takes an agent's turn rate [default: authors under the protocol paper, else wrapped]
    #[arg(long, value_enum)]
    pub turn_rate: Option<TurnRate>,
    /// Where the run's scenes are: files, folders, globs, scene sets; for predictors that read the log
    #[arg(long, value_name = "PATH", num_args = 1..)]
    pub scenarios: Vec<String>,
    #[command(flatten)]
    pub node: wire::node::Options,
}
