//! What can be typed.

use std::path::PathBuf;

use clap::{Parser, Subcommand};
use planner_node::{Choice, CqlOptions, GaussNewtonOptions, ProposalsOptions, Weights};

/// Serves a planner on the bus of a run
#[derive(Debug, Parser)]
#[command(name = "planner-node", args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub struct Cli {
    #[command(flatten)]
    pub serve: Option<Serve>,
    #[command(subcommand)]
    pub command: Option<Command>,
}

// The group says whether there is anything to serve; clap leaves it empty where a member is flattened.
#[derive(Debug, clap::Args)]
#[group(id = "serve", args = ["planner"])]
pub struct Serve {
    #[command(flatten)]
    pub choice: Choice,
    #[command(flatten)]
    pub node: wire::node::Options,
    #[command(flatten)]
    pub gauss_newton: GaussNewtonOptions,
    #[command(flatten)]
    pub proposals: ProposalsOptions,
    #[command(flatten)]
    pub cql: CqlOptions,
}

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Hold the Gauss-Newton planner to numbers of other implementations
    ///
    /// Those of the authors' code, in a folder; without one those of an implementation in Python, which are built in. Prints the
    /// worst deviation of each quantity, by each of the two linear solvers, beside its tolerance. Exits with 1 when one is out.
    Verify {
        /// Folder of the authors' .npz files; the built-in vectors without it
        folder: Option<PathBuf>,
    },
    /// Say why the plan of a recorded step is what it is
    ///
    /// The cost of each term over time, the neighbors that bind, and what the search would come to without each term. A plan of
    /// proposals: what each proposal was worth, what is against it, and what keeps the AV from coming farther.
    Explain {
        /// The recording, an .mcap file
        recording: PathBuf,
        /// The step, from 0
        #[arg(long)]
        step: u32,
        /// Weights of the cost terms: hand-tuned, learned (they came with the prediction), or a TOML file; without it those of the
        /// first two that the plan was made with. None for a plan of proposals
        #[arg(long, value_name = "WEIGHTS")]
        weights: Option<Weights>,
    },
}
