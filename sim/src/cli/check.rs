//! What checks a node.

use std::path::PathBuf;
use std::time::Duration;

use clap::builder::NonEmptyStringValueParser;
use clap::{Args, ValueEnum};

use super::parse_duration;
use crate::check::rule::Rule;

/// `sim check-node`.
#[derive(Debug, Args)]
#[command(group = clap::ArgGroup::new("node").required(true))]
pub struct CheckNodeArgs {
    /// A planner of your own, as for `sim run`
    #[arg(long, value_parser = NonEmptyStringValueParser::new(), value_name = "COMMAND", group = "node")]
    pub planner_command: Option<String>,
    /// A predictor of your own, as for `sim run`
    #[arg(long, value_parser = NonEmptyStringValueParser::new(), value_name = "COMMAND", group = "node")]
    pub predictor_command: Option<String>,
    /// Traffic of your own, as for `sim run`
    #[arg(long, value_parser = NonEmptyStringValueParser::new(), value_name = "COMMAND", group = "node")]
    pub traffic_command: Option<String>,
    /// Who predicts for the planner [default: nobody]
    #[arg(long, value_enum, value_name = "NAME", conflicts_with_all = ["predictor_command", "traffic_command"])]
    pub predictor: Option<Companion>,
    /// Scenes of your own to drive beside the built-in ones, as for `sim run`
    #[arg(value_name = "PATH")]
    pub paths: Vec<String>,
    /// Its answers of before: they must be the same again. Written where there is no such file
    #[arg(long, value_name = "FILE")]
    pub golden: Option<PathBuf>,
    /// Write that file anew
    #[arg(long, requires = "golden")]
    pub bless: bool,
    /// Rules that are not to be looked at; those of the first drives always are
    #[arg(long, value_enum, value_name = "RULE", value_delimiter = ',')]
    pub skip: Vec<Rule>,
    /// How long an answer may take: 5s, 500ms
    #[arg(long, value_name = "TIME", default_value = "5s", value_parser = parse_duration)]
    pub deadline: Duration,
    /// How long it may take to start [default: 20s]
    #[arg(long, value_name = "TIME", value_parser = parse_duration)]
    pub start_timeout: Option<Duration>,
    /// How to print what was found
    #[arg(long, value_enum, value_name = "FORMAT", default_value_t)]
    pub format: CheckFormat,
}

/// Predictors of ours that need no log.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Companion {
    /// Constant turn rate and velocity
    Ctrv,
    /// Constant turn rate and acceleration, both fading
    Ctra,
    /// The prediction network, with the weights of dipp
    Network,
}

impl Companion {
    /// As `predictor-node` has it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Ctrv => "ctrv",
            Self::Ctra => "ctra",
            Self::Network => "network",
        }
    }
}

/// How findings are printed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum CheckFormat {
    /// A line a rule
    #[default]
    Text,
    /// For programs
    Json,
}
