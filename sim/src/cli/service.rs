//! What is a service, and what asks one.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use clap::builder::NonEmptyStringValueParser;
use episode::latency::Latency;
use evaluation::table::TableFormat;
use results::drivers::{self, MotionName, Predictor};
use results::settings::Record;

use super::{NO_TRAFFIC, ProtocolName, driver_names, parse_duration, traffic_names};

/// Where a service is, unless somebody says otherwise.
pub const ENDPOINT: &str = "tcp/127.0.0.1:7461";

/// `sim serve`.
#[derive(Debug, Args)]
pub struct ServeArgs {
    /// The folder of all runs, and of the queue
    #[arg(long, value_name = "DIR", default_value = "runs")]
    pub runs: PathBuf,
    /// What clients may drive, beside the built-in demo set: scene-set TOML files, files or folders of scenes, each by the name of its file, or NAME=PATH; a folder of scene-set files offers each
    #[arg(long, value_name = "PATH", num_args = 1..)]
    pub sets: Vec<String>,
    /// Weights that clients may name, each by the name of its file without its endings, or NAME=FILE
    #[arg(long, value_name = "FILE", num_args = 1..)]
    pub weights: Vec<String>,
    /// Start planners, predictors and traffic by commands of clients: whoever knows the secret can then run anything as you
    #[arg(long)]
    pub allow_commands: bool,
    /// Where to listen for clients: tcp/HOST:PORT, or tls/HOST:PORT with --zenoh-config
    #[arg(long, value_name = "WHERE", default_value = ENDPOINT)]
    pub endpoint: String,
    /// A Zenoh configuration (JSON5) with the service's certificate; docs/hosts.md has examples
    #[arg(long, value_name = "FILE")]
    pub zenoh_config: Option<PathBuf>,
    /// Episodes driven at a time, by all runs together [default: the cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    pub workers: Option<u16>,
    /// Runs driven at a time; each has an equal share of the workers
    #[arg(long, value_name = "N", default_value = "2", value_parser = clap::value_parser!(u16).range(1..=64))]
    pub runs_at_once: u16,
    /// Runs that may wait
    #[arg(long, value_name = "N", default_value = "256", value_parser = clap::value_parser!(u16).range(1..=1000))]
    pub most_queued: u16,
    /// Interactive sessions at a time
    #[arg(long, value_name = "N", default_value = "4", value_parser = clap::value_parser!(u16).range(0..=64))]
    pub most_sessions: u16,
    /// A session that nobody asks anything for so long is closed
    #[arg(long, value_name = "TIME", default_value = "10m", value_parser = parse_duration)]
    pub session_idle: Duration,
}

/// Which service.
#[derive(Debug, Args)]
#[command(next_help_heading = "Which service")]
pub struct ServiceArgs {
    /// Where the service is
    #[arg(long, value_name = "WHERE", env = "RELOOP_SERVICE", default_value = ENDPOINT)]
    pub endpoint: String,
    /// A Zenoh configuration (JSON5) with your certificate, for a service that listens by TLS
    #[arg(long, value_name = "FILE", env = "RELOOP_ZENOH_CONFIG")]
    pub zenoh_config: Option<PathBuf>,
    /// Who you are: the queue is fair between clients [default: your name]
    #[arg(long, value_name = "NAME")]
    pub client: Option<String>,
}

/// How a service is to drive: options of `sim run`, and with their meaning.
#[derive(Debug, Args)]
#[command(next_help_heading = "What to drive, as for `sim run`")]
pub struct SettingsArgs {
    /// Scene sets that the service offers, by name [default: demo]
    #[arg(long, value_name = "NAME", num_args = 1.., visible_alias = "scenarios")]
    pub sets: Vec<String>,
    /// Who drives
    #[arg(long, value_name = "NAME", default_value = drivers::DEFAULT, value_parser = driver_names(), conflicts_with = "planner_command")]
    pub driver: String,
    /// Where predictions come from
    #[arg(long, value_name = "NAME")]
    pub predictor: Option<Predictor>,
    /// Weights that the service offers, by name
    #[arg(long, value_name = "NAME")]
    pub weights: Option<String>,
    /// How the network's features are made
    #[arg(long, value_name = "STYLE", value_parser = ["authors", "mended"])]
    pub features: Option<String>,
    /// A planner of your own, which lies where the service is; only a service with --allow-commands starts it
    #[arg(long, value_parser = NonEmptyStringValueParser::new(), value_name = "COMMAND")]
    pub planner_command: Option<String>,
    /// A predictor of your own, likewise
    #[arg(long, value_parser = NonEmptyStringValueParser::new(), value_name = "COMMAND")]
    pub predictor_command: Option<String>,
    /// What tables call the driver
    #[arg(long, value_name = "NAME")]
    pub label: Option<String>,
    /// The rules of an episode
    #[arg(long, value_enum, default_value_t)]
    pub protocol: ProtocolName,
    /// A setting of `strict`
    #[arg(long, value_name = "KEY=VALUE", num_args = 1)]
    pub set: Vec<String>,
    /// How the AV follows its plan under `strict`
    #[arg(long, value_enum)]
    pub motion: Option<MotionName>,
    /// Drive without nodes and bus: for drivers of ours
    #[arg(long)]
    pub in_process: bool,
    /// How long an answer may take
    #[arg(long, value_name = "TIME", default_value = "5s", value_parser = parse_duration)]
    pub deadline: Duration,
    /// How long nodes may take to start
    #[arg(long, value_name = "TIME", value_parser = parse_duration)]
    pub start_timeout: Option<Duration>,
}

/// `sim submit`.
#[derive(Debug, Args)]
pub struct SubmitArgs {
    /// How to drive.
    #[command(flatten)]
    pub settings: SettingsArgs,
    /// Which episodes to keep a recording of
    #[arg(long, value_enum, default_value_t = Record::All, help_heading = "How to run")]
    pub record: Record,
    /// When plans take effect, as for `sim run`, but from no file
    #[arg(long, value_name = "WHEN", help_heading = "What to drive, as for `sim run`")]
    pub latency: Option<Latency>,
    /// Agents that react, as for `sim run`
    #[arg(long, value_name = "NAME", default_value = NO_TRAFFIC, value_parser = traffic_names(), help_heading = "What to drive, as for `sim run`")]
    pub traffic: String,
    /// Traffic of your own, which lies where the service is; only a service with --allow-commands starts it
    #[arg(long, value_parser = NonEmptyStringValueParser::new(), value_name = "COMMAND", conflicts_with = "traffic", help_heading = "What to drive, as for `sim run`")]
    pub traffic_command: Option<String>,
    /// What is drawn about agents that react is drawn from this [default: 0]
    #[arg(
        long,
        value_name = "N",
        conflicts_with = "traffic_command",
        help_heading = "What to drive, as for `sim run`"
    )]
    pub traffic_seed: Option<u64>,
    /// Who is taken over from the log, as radius=80
    #[arg(long, value_name = "KEY=VALUE", num_args = 1, help_heading = "What to drive, as for `sim run`")]
    pub traffic_set: Vec<String>,
    /// Read every scene before the first is driven
    #[arg(long, help_heading = "How to run")]
    pub verify: bool,
    /// Episodes at a time; results do not depend on it [default, and at most: a run's share of the workers]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256), help_heading = "How to run")]
    pub parallel: Option<u16>,
    /// The run's name, and that of its folder there; one that failed or was cancelled goes on [default: DRIVER-PROTOCOL-N]
    #[arg(long, value_name = "NAME", help_heading = "How to run")]
    pub name: Option<String>,
    /// Stay, and show how the run goes
    #[arg(long, help_heading = "How to run")]
    pub watch: bool,
    /// Which service.
    #[command(flatten)]
    pub service: ServiceArgs,
}

/// `sim status`.
#[derive(Debug, Args)]
pub struct StatusArgs {
    /// This run alone: its folder, as runs/big, for which no service is asked; or its name at a service
    #[arg(value_name = "RUN")]
    pub run: Option<String>,
    /// Say what can be driven there: drivers, scene sets, weights, versions, capacity
    #[arg(long, conflicts_with = "run")]
    pub offer: bool,
    /// For programs
    #[arg(long)]
    pub json: bool,
    /// Which service.
    #[command(flatten)]
    pub service: ServiceArgs,
}

/// `sim watch`.
#[derive(Debug, Args)]
pub struct WatchArgs {
    /// The run
    #[arg(value_name = "RUN")]
    pub run: String,
    /// Print each episode's end
    #[arg(long)]
    pub ends: bool,
    /// How to print the table
    #[arg(long, value_enum, default_value_t)]
    pub format: TableFormat,
    /// Which service.
    #[command(flatten)]
    pub service: ServiceArgs,
}

/// `sim cancel`.
#[derive(Debug, Args)]
pub struct CancelArgs {
    /// The runs; what they have driven is kept, and the same `sim submit` with the same --name goes on
    #[arg(required = true, value_name = "RUN")]
    pub runs: Vec<String>,
    /// Which service.
    #[command(flatten)]
    pub service: ServiceArgs,
}

/// `sim session`.
#[derive(Debug, Args)]
pub struct SessionArgs {
    /// The scene
    #[arg(long, value_name = "ID")]
    pub scene: String,
    /// How to drive.
    #[command(flatten)]
    pub settings: SettingsArgs,
    /// Which service.
    #[command(flatten)]
    pub service: ServiceArgs,
}
