//! What drives finished runs again.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use evaluation::blame::BlameFormat;
use results::drivers::Predictor;
use results::settings::Record;

use super::{Entrant, driver_names, parse_duration};

/// `sim replay`.
#[derive(Debug, Args)]
pub struct ReplayArgs {
    /// Folders of finished runs
    #[arg(required = true, value_name = "DIR")]
    pub runs: Vec<PathBuf>,
    /// Where the scenes are [default: where the run has them from]
    #[arg(long, value_name = "PATH", num_args = 1..)]
    pub scenarios: Vec<String>,
    /// These episodes alone
    #[arg(long, visible_alias = "episode", value_name = "ID", value_delimiter = ',')]
    pub episodes: Vec<String>,
    /// Let the run's own nodes drive them again, over the bus, and hold every message to the recording
    #[arg(long, group = "anew")]
    pub live: bool,
    /// Take the drives over at this step, from 0: recorded plans are driven before it
    #[arg(long, value_name = "STEP", group = "anew")]
    pub from: Option<u32>,
    /// Episodes at a time, with either; results do not depend on it [default: the cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256), requires = "anew")]
    pub parallel: Option<u16>,
    /// Drive in this process, with either: without nodes and bus, for drivers of ours
    #[arg(long, requires = "anew", conflicts_with = "planner_command")]
    pub in_process: bool,
    /// How long nodes may take to start, with either [default: 20s, or as the run's own]
    #[arg(long, value_name = "TIME", value_parser = parse_duration, requires = "anew")]
    pub start_timeout: Option<Duration>,
    /// Who takes over.
    #[command(flatten)]
    pub fork: ForkArgs,
}

/// Who takes drives over, and where what comes of it goes.
#[derive(Debug, Args)]
#[command(next_help_heading = "Who takes over, with --from")]
pub struct ForkArgs {
    /// The driver [default: the run's own]
    #[arg(long, value_name = "NAME", value_parser = driver_names(), requires = "from", conflicts_with = "planner_command")]
    pub driver: Option<String>,
    /// A planner of your own, as for `sim run`
    #[arg(long, value_name = "COMMAND", requires = "from")]
    pub planner_command: Option<String>,
    /// Where its predictions come from [default: what the driver wants]
    #[arg(long, value_name = "NAME", requires = "from")]
    pub predictor: Option<Predictor>,
    /// Weights of its prediction network; without --driver, with --live too: where the run's own are now
    #[arg(long, value_name = "FILE", requires = "anew")]
    pub weights: Option<PathBuf>,
    /// How the network's features are made, as for `sim run`
    #[arg(long, value_name = "STYLE", value_parser = ["authors", "mended"], requires = "from")]
    pub features: Option<String>,
    /// What tables call it [default: DRIVER-from-STEP]
    #[arg(long, value_name = "NAME", requires = "from")]
    pub label: Option<String>,
    /// The new run's folder [default: runs/LABEL-PROTOCOL-N]
    #[arg(long, value_name = "DIR", requires = "from")]
    pub out: Option<PathBuf>,
    /// Which episodes to keep a recording of [default: all]
    #[arg(long, value_enum, requires = "from")]
    pub record: Option<Record>,
    /// How long an answer may take [default: 5s, or as the run's own]
    #[arg(long, value_name = "TIME", value_parser = parse_duration, requires = "from")]
    pub deadline: Option<Duration>,
}

/// `sim blame`.
#[derive(Debug, Args)]
pub struct BlameArgs {
    /// Folder of a finished run
    #[arg(value_name = "DIR")]
    pub run: PathBuf,
    /// Where the scenes are [default: where the run has them from]
    #[arg(long, value_name = "PATH", num_args = 1..)]
    pub scenarios: Vec<String>,
    /// These failures alone
    #[arg(long, visible_alias = "episode", value_name = "ID", value_delimiter = ',')]
    pub episodes: Vec<String>,
    /// From so many steps before the fault things are changed
    #[arg(long, value_name = "STEPS", default_value_t = 30)]
    pub before: u32,
    /// Who else drives: a driver of `sim run`, `[LABEL:]DRIVER[=WEIGHTS]`
    #[arg(long, value_name = "NAME", default_value = "idm")]
    pub driver: Entrant,
    /// Where the weights of the run are now, if not where they were
    #[arg(long, value_name = "FILE")]
    pub weights: Option<PathBuf>,
    /// Drive in this process, without nodes and bus; for drivers of ours
    #[arg(long)]
    pub in_process: bool,
    /// How to print
    #[arg(long, value_enum, default_value_t)]
    pub format: BlameFormat,
    /// Episodes at a time; results do not depend on it [default: the cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    pub parallel: Option<u16>,
}
