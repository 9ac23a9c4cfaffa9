//! What can be typed.

use clap::Parser;
use predictor_node::{Options, PredictorKind};

/// Serves a predictor on the bus of a run
#[derive(Debug, Parser)]
#[command(name = "predictor-node")]
pub struct Cli {
    /// Which predictor
    #[arg(long, value_enum)]
    pub predictor: PredictorKind,
    #[command(flatten)]
    pub options: Options,
    #[command(flatten)]
    pub node: wire::node::Options,
}
