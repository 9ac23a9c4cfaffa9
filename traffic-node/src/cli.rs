//! What can be typed.

use clap::Parser;
use traffic_node::Choice;

/// Serves who drives the agents that react, on the bus of a run
#[derive(Debug, Parser)]
#[command(name = "traffic-node")]
pub struct Cli {
    #[command(flatten)]
    pub choice: Choice,
    #[command(flatten)]
    pub node: wire::node::Options,
}
