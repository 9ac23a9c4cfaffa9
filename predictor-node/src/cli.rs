//! What can be typed.

use std::path::PathBuf;

use clap::{Parser, Subcommand};
use predictor_node::{Choice, FeatureStyle};

/// Serves a predictor on the bus of a run
#[derive(Debug, Parser)]
#[command(name = "predictor-node", args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub struct Cli {
    #[command(flatten)]
    pub serve: Option<Serve>,
    #[command(subcommand)]
    pub command: Option<Command>,
}

// The group says whether there is anything to serve; clap leaves it empty where a member is flattened.
#[derive(Debug, clap::Args)]
#[group(id = "serve", args = ["predictor"])]
pub struct Serve {
    #[command(flatten)]
    pub choice: Choice,
    #[command(flatten)]
    pub node: wire::node::Options,
}

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Say what the network was shown at a recorded step, and what each agent attended to
    Explain {
        /// The recording, an .mcap file
        recording: PathBuf,
        /// The step, from 0
        #[arg(long)]
        step: u32,
        /// A .safetensors file [default: those of dipp, built in]
        #[arg(long, value_name = "FILE")]
        weights: Option<PathBuf>,
        /// How the features are made [default: as the weights say, or else authors]
        #[arg(long, value_enum)]
        features: Option<FeatureStyle>,
    },
    /// Hold the prediction network to numbers of the authors' code
    ///
    /// Of the folder: the features of `feature-vectors`, if the scenes are given; the outputs of `network-vectors`, by the weights
    /// `formula`; each step of the drives in `trained/drives` by weights of their name. Prints the worst deviation of each quantity beside its
    /// tolerance. Exits with 1 when one is out.
    Verify {
        /// A .safetensors file, or formula: weights for tests, made by a formula
        #[arg(long, value_name = "FILE")]
        weights: PathBuf,
        /// The folder that holds `feature-vectors`, `network-vectors` and `trained`
        #[arg(long, value_name = "DIR")]
        vectors: PathBuf,
        /// Where the scenes of the vectors are: files, folders, globs, scene sets
        #[arg(long, value_name = "PATH", num_args = 1..)]
        scenarios: Vec<String>,
    },
}
