//! What can be typed.

use clap::Parser;
use planner_node::PlannerKind;

/// Serves a planner on the bus of a run
#[derive(Debug, Parser)]
#[command(name = "planner-node", version)]
pub struct Cli {
    /// Which planner
    #[arg(long, value_enum)]
    pub planner: PlannerKind,
    /// Where the run's scenes are: files, folders, globs, scene sets; for planners that read the log
    #[arg(long, value_name = "PATH", num_args = 1..)]
    pub scenarios: Vec<String>,
    #[command(flatten)]
    pub node: wire::node::Options,
}
