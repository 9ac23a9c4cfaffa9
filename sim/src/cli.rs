//! What can be typed. What it means is decided in [`crate::request`].
//!
//! | module | what |
//! | --- | --- |
//! | here | what drives |
//! | `check` | what checks a node |
//! | `again` | what drives finished runs again |
//! | `reading` | what reads finished runs |
//! | `pictures` | what draws them |
//! | `service` | what is a service, and what asks one |

mod again;
mod check;
mod pictures;
mod reading;
mod service;

use std::path::PathBuf;
use std::str::FromStr;
use std::time::Duration;

use clap::builder::{NonEmptyStringValueParser, PossibleValue, PossibleValuesParser};
use clap::{Args, Parser, Subcommand, ValueEnum};
use episode::latency::{Latency, LatencyError};
use evaluation::open_loop::{Definitions, table};
use evaluation::table::TableFormat;
use results::drivers::{self, DRIVERS, MotionName, Predictor};
use results::settings::Record;
use shard::ShardChoice;

pub use again::{BlameArgs, ForkArgs, ReplayArgs};
pub use check::{CheckFormat, CheckNodeArgs};
pub use pictures::{PictureStep, RenderArgs, Size};
pub use reading::{CompareArgs, PredictionsArgs, ReportArgs, ScoreArgs, TableArgs, ValidityArgs};
pub use service::{CancelArgs, ServeArgs, ServiceArgs, SessionArgs, SettingsArgs, StatusArgs, SubmitArgs, WatchArgs};

/// Drives an autonomous vehicle through logged traffic in closed loop, and tells how well it drove.
#[derive(Debug, Parser)]
#[command(name = "sim", about, arg_required_else_help = true, max_term_width = 110)]
pub struct Cli {
    /// Say more on standard error; twice for everything
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    pub verbose: u8,
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Drive scenes and write a run folder
    Run(Box<RunArgs>),
    /// Drive scenes with several drivers, and print one table
    ///
    /// A run for each driver and protocol, in a folder of its own. The same command goes on where it was stopped, and drives nothing twice.
    Matrix(MatrixArgs),
    /// Ask drivers for plans at frames of the log and judge them, without driving
    ///
    /// The paper's Table I: a line a driver and one of the human; docs/open-loop.md defines each figure. Exits with 1 when a driver had
    /// no plan at some frame. With --traffic finished runs are read instead: were the agents believable that reacted? docs/traffic.md has the figures.
    Evaluate(Box<EvaluateArgs>),
    /// Make runs of what shards have driven
    ///
    /// Nothing may be missing, and all must be of one run by one build. The files are the bytes of a run that one process drove. docs/shards.md tells of shards.
    Merge(MergeArgs),
    /// Say what a run would take in time, memory and room, from a sample of its episodes
    ///
    /// Takes the options of `sim run`, and drives the sample as they say, into a folder that goes again.
    Plan(Box<PlanArgs>),
    /// Print the tables of finished runs
    Table(TableArgs),
    /// Compare two finished runs: what flipped, what moved, what may be chance
    ///
    /// A is the baseline, B the candidate. Exits with 1 when a --fail-on rule is broken. docs/compare.md defines every figure.
    Compare(CompareArgs),
    /// Score finished runs by other tools' definitions, without driving again
    ///
    /// Every score from one drive: from its steps and its scenes. docs/scores/README.md says which to use when, and has a page on each.
    Score(ScoreArgs),
    /// Score the predictions of recorded drives against what the agents then did
    Predictions(PredictionsArgs),
    /// Drive recorded episodes again: is all the same, and what if another takes over?
    ///
    /// Each recorded episode is driven in process by the plans of its recording. Scene, observations, steps, events and end must be the same to the
    /// byte, and the figures those of results.parquet. Names the first step and field that differ; exits with 1 where one does.
    /// With --live its nodes drive it again, and the process that made the difference is named too. With --from STEP recorded plans lead up to a
    /// step, then another driver takes over, and a new run is written. docs/replay.md tells of all three.
    Replay(Box<ReplayArgs>),
    /// Drive failures again, each time with one thing changed: what would have saved them?
    ///
    /// Each is driven again from shortly before the fault: by the same driver with nothing changed, with predictions of the log's own future, from where the human was, and without agents that
    /// are artefacts of the log; and another driver. docs/blame.md defines each.
    Blame(BlameArgs),
    /// Say where replayed agents would have had to react to the AV, and what the figures are without those steps
    ///
    /// Agents of a log do what they did, whatever the AV does. docs/validity.md defines who would have had to react.
    Validity(ValidityArgs),
    /// Write runs as one page to send to somebody, with failed drives to be played
    ///
    /// Figures, distributions, every scene and a player are in one HTML file, which loads nothing. Of two runs over the same scenes the first is
    /// A, the baseline, and the page compares them as `sim compare` does. docs/report.md shows what is in it.
    Report(ReportArgs),
    /// Draw a drive from above: a picture of a step, or a clip
    ///
    /// A step shows what came of it, as the tables number them. Plans and predictions are drawn where the episode is recorded. An MP4 takes `ffmpeg`.
    Render(RenderArgs),
    /// Check a planner, a predictor or traffic of your own against the rules of the bus, and say what to do
    ///
    /// Drives short scenes with it, twice and in other orders; tells it odd scenes and what cannot be read; kills it, ends its input, takes its seat. A line a
    /// rule: it holds, is in doubt, or is broken, with what was seen. Exits with 1 when one is broken. docs/check-node.md has a page of them.
    CheckNode(CheckNodeArgs),
    /// Drive what others ask for: runs in a fair queue, and sessions step by step
    ///
    /// Runs are folders, as those of `sim run`; when the service is started again it goes on where it was, even after a power cut. Clients ask with `sim submit`, `status`, `watch`, `cancel`
    /// and `session`, or from Python. docs/serve.md tells of it, and of who may ask.
    Serve(ServeArgs),
    /// Have a service drive a run
    Submit(Box<SubmitArgs>),
    /// Say how far a run in a folder is, or how the runs of a service are, or what that offers
    ///
    /// Of a run in a folder: what is missing or failed, shard by shard, and the commands that drive it. Exits with 1 where anything is.
    Status(StatusArgs),
    /// Show how a run of a service goes, and its table at the end
    Watch(WatchArgs),
    /// Stop runs of a service
    Cancel(CancelArgs),
    /// Drive one scene of a service step by step, and let another driver take over
    ///
    /// Commands are read from standard input: `step 10`, `run`, `state`, `plan`, `fork 40 idm`, `use s1`, `close`, `help`. Ctrl-C pauses a drive.
    Session(Box<SessionArgs>),
    /// Hold the protocol `paper` to vectors of the authors' simulator
    ///
    /// Drives the episodes that the folder holds and prints the worst deviation of each quantity beside its tolerance. Exits with
    /// 1 when one is out.
    Verify(VerifyArgs),
}

impl Command {
    /// Whether it may drive by nodes.
    #[must_use]
    pub fn is_on_the_bus(&self) -> bool {
        match self {
            Self::Run(arguments) => !arguments.in_process,
            Self::Matrix(arguments) => !arguments.in_process,
            Self::Plan(arguments) => !arguments.run.in_process,
            Self::Evaluate(arguments) => !arguments.in_process,
            Self::Replay(arguments) => !arguments.in_process && (arguments.live || arguments.from.is_some()),
            Self::Blame(arguments) => !arguments.in_process,
            Self::CheckNode(_) => true,
            Self::Serve(_) => true,
            _ => false,
        }
    }

    /// Where others come in, if they do.
    #[must_use]
    pub fn endpoint(&self) -> Option<&str> {
        match self {
            Self::Run(arguments) => arguments.endpoint.as_deref(),
            Self::Serve(arguments) => Some(&arguments.endpoint),
            _ => None,
        }
    }
}

/// How long an answer may take unless somebody says otherwise: what `--deadline` has as its default.
const DEADLINE: Duration = Duration::from_secs(5);

/// `sim run`.
#[derive(Debug, Args)]
pub struct RunArgs {
    /// Scenes: files of WOMD, ScenarioNet or Argoverse 2, folders, globs, or scene-set TOML files [default: the built-in demo set]
    #[arg(value_name = "PATH", help_heading = "What to drive")]
    pub paths: Vec<String>,

    /// Scenes, as PATH is; takes all that follows up to the next option
    #[arg(long, value_name = "PATH", num_args = 1.., conflicts_with = "paths", help_heading = "What to drive")]
    pub scenarios: Vec<String>,

    /// Who drives
    #[arg(long, value_name = "NAME", default_value = drivers::DEFAULT, value_parser = driver_names(),
          conflicts_with_all = ["planner", "planner_command"], help_heading = "What to drive")]
    pub driver: String,

    /// Where predictions come from [default: what the driver wants]
    #[arg(long, value_name = "NAME", help_heading = "What to drive")]
    pub predictor: Option<Predictor>,

    /// A predictor of your own: a shell command, as --planner-command
    #[arg(long, value_parser = NonEmptyStringValueParser::new(), value_name = "COMMAND", conflicts_with_all = ["predictor", "weights", "features"], help_heading = "What to drive")]
    pub predictor_command: Option<String>,

    /// Weights of the prediction network, a .safetensors file [default: those of dipp, built in; sep, il-pred, il and cql have none]
    #[arg(long, value_name = "FILE", help_heading = "What to drive")]
    pub weights: Option<PathBuf>,

    /// How the network's features are made: authors, for weights of theirs, or mended [default: as the weights say, or else
    /// authors]
    #[arg(long, value_name = "STYLE", value_parser = ["authors", "mended"], help_heading = "What to drive")]
    pub features: Option<String>,

    /// A planner of your own: a shell command, told where to connect by RELOOP_* variables and by arguments
    #[arg(long, value_parser = NonEmptyStringValueParser::new(), value_name = "COMMAND", conflicts_with = "planner", help_heading = "What to drive")]
    pub planner_command: Option<String>,

    /// A planner that you start yourself, with --worker '*' and the endpoint, run and secret that the sim prints
    #[arg(long, value_name = "WHICH", help_heading = "What to drive")]
    pub planner: Option<Planner>,

    /// Agents that react under `strict`, instead of doing what they did in the log (docs/traffic.md)
    #[arg(long, value_name = "NAME", default_value = NO_TRAFFIC, value_parser = traffic_names(), help_heading = "What to drive")]
    pub traffic: String,

    /// Traffic of your own: a shell command, as --planner-command, that says where the agents are next that react
    #[arg(long, value_parser = NonEmptyStringValueParser::new(), value_name = "COMMAND", conflicts_with = "traffic", help_heading = "What to drive")]
    pub traffic_command: Option<String>,

    /// What is drawn about agents that react is drawn from this [default: 0]
    #[arg(long, value_name = "N", conflicts_with = "traffic_command", help_heading = "What to drive")]
    pub traffic_seed: Option<u64>,

    /// Who is taken over from the log: radius=60 or left-log=1 (m), or pedestrians=replayed or stop
    #[arg(long, value_name = "KEY=VALUE", num_args = 1, help_heading = "What to drive")]
    pub traffic_set: Vec<String>,

    /// What tables call the driver [default: its name]
    #[arg(long, value_name = "NAME", help_heading = "What to drive")]
    pub label: Option<String>,

    /// The rules of an episode
    #[arg(long, value_enum, default_value_t, help_heading = "What to drive")]
    pub protocol: ProtocolName,

    /// A setting of `strict`, as horizon=100 or ending-collision=any; docs/running.md lists them
    #[arg(long, value_name = "KEY=VALUE", num_args = 1, help_heading = "What to drive")]
    pub set: Vec<String>,

    /// How the AV follows its plan under `strict` [default: bicycle; playback for the driver `human`, and for it alone]
    #[arg(long, value_enum, help_heading = "What to drive")]
    pub motion: Option<MotionName>,

    /// When plans take effect under `strict`: 80ms, measured, trace:FILE, dist:normal:80ms:20ms, ... (docs/latency.md) [default: at once]
    #[arg(long, value_name = "HOW", help_heading = "What to drive")]
    pub latency: Option<LatencyChoice>,

    /// The run's folder [default: runs/DRIVER-PROTOCOL-N]; an unfinished run in it is continued
    #[arg(long, value_name = "DIR", help_heading = "How to run")]
    pub out: Option<PathBuf>,

    /// Drive a share of the scenes, the I-th of N, beside other processes in the same --out; `sim merge` then makes it a run (docs/shards.md).
    /// auto or auto/N: as HyperQueue, Slurm or Kubernetes says
    #[arg(long, value_name = "I/N", requires = "out", help_heading = "How to run")]
    pub shard: Option<ShardChoice>,

    /// Drive episodes of this run again: those that failed, those whose recording is not whole, or failed,unrecorded
    #[arg(long, value_enum, value_name = "WHICH", value_delimiter = ',', help_heading = "How to run")]
    pub retry: Vec<Retry>,

    /// Read every scene before the first is driven, so that damaged ones are found then, and not when their turn comes
    #[arg(long, help_heading = "How to run")]
    pub verify: bool,

    /// Which episodes to keep a recording of
    #[arg(long, value_enum, default_value_t = Record::All, help_heading = "How to run")]
    pub record: Record,

    /// Episodes driven at a time; results do not depend on it [default: the cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256), help_heading = "How to run")]
    pub parallel: Option<u16>,

    /// Drive in this process, without nodes and bus: the same results and recordings at less cost; for drivers of ours
    #[arg(long, conflicts_with_all = ["planner", "planner_command", "predictor_command", "endpoint", "zenoh_config"], help_heading = "How to run")]
    pub in_process: bool,

    /// Keep each worker with its nodes on a core of its own: faster, where nothing else wants the cores
    #[arg(long, help_heading = "How to run")]
    pub pin: bool,

    /// How long an answer may take: 5s, 500ms
    #[arg(long, value_name = "TIME", default_value = "5s", value_parser = parse_duration, help_heading = "How to run")]
    pub deadline: Duration,

    /// How long nodes may take to start [default: 20s; 10m for a planner that you start yourself]
    #[arg(long, value_name = "TIME", value_parser = parse_duration, help_heading = "How to run")]
    pub start_timeout: Option<Duration>,

    /// Where to listen for nodes of others: tcp/HOST:PORT, or tls/HOST:PORT with --zenoh-config [default: nowhere but at a socket of
    /// your own]
    #[arg(long, value_name = "WHERE", help_heading = "How to run")]
    pub endpoint: Option<String>,

    /// Show the run in the Rerun viewer while it is driven: in one that is open, else `rerun` is started. The run never waits for it
    #[arg(long, help_heading = "How to run")]
    pub view: bool,
    /// A Zenoh configuration (JSON5) with the sim's certificate, to listen to other hosts by TLS; docs/hosts.md has examples
    #[arg(long, value_name = "FILE", help_heading = "How to run")]
    pub zenoh_config: Option<PathBuf>,

    /// Whose certificate a planner that you start yourself must have, by its common name; several, with commas between [default: any]
    #[arg(long, value_name = "NAMES", value_delimiter = ',', requires_all = ["planner", "endpoint", "zenoh_config"], help_heading = "How to run")]
    pub planner_certificate: Vec<String>,

    /// Say on standard error where the time went
    #[arg(long, help_heading = "How to run")]
    pub timing: bool,

    /// Stop when standard input ends, as at Ctrl-C: whoever started this is gone
    #[arg(long, hide = true)]
    pub exit_with_parent: bool,
}

impl RunArgs {
    /// A run of this driver as it is left to itself, with nothing recorded.
    #[must_use]
    pub fn of(entrant: &Entrant) -> Self {
        let Entrant { label, driver, weights, predictor, planner_command } = entrant.clone();
        Self {
            label: (label != driver).then_some(label),
            driver,
            weights,
            predictor,
            predictor_command: None,
            planner_command,
            record: Record::None,
            paths: Vec::new(),
            scenarios: Vec::new(),
            features: None,
            planner: None,
            traffic: NO_TRAFFIC.to_owned(),
            traffic_command: None,
            traffic_seed: None,
            traffic_set: Vec::new(),
            protocol: ProtocolName::default(),
            set: Vec::new(),
            motion: None,
            latency: None,
            out: None,
            shard: None,
            retry: Vec::new(),
            verify: false,
            parallel: None,
            in_process: false,
            pin: false,
            deadline: DEADLINE,
            start_timeout: None,
            endpoint: None,
            zenoh_config: None,
            planner_certificate: Vec::new(),
            timing: false,
            view: false,
            exit_with_parent: false,
        }
    }
}

/// `sim merge`.
#[derive(Debug, Args)]
pub struct MergeArgs {
    /// Folders of runs that were driven in shards
    #[arg(value_name = "RUN", required = true)]
    pub runs: Vec<PathBuf>,
    /// Other folders with shards of the same run, where they had none in common: their episodes are copied into RUN first
    #[arg(long, value_name = "DIR", num_args = 1..)]
    pub from: Vec<PathBuf>,
}

/// `sim plan`.
#[derive(Debug, Args)]
pub struct PlanArgs {
    /// What each of so many shards would take, as 16,100,1000 [default: 1, 2, 4 ... 128]
    #[arg(long, value_name = "N", value_delimiter = ',', value_parser = clap::value_parser!(u32).range(1..), help_heading = "What to say")]
    pub shards: Vec<u32>,
    /// Episodes that are driven for it, spread evenly over the list
    #[arg(long, value_name = "N", default_value = "24", value_parser = clap::value_parser!(u32).range(1..), help_heading = "What to say")]
    pub sample: u32,
    /// What is driven, and how.
    #[command(flatten)]
    pub run: RunArgs,
}

/// `sim matrix`.
#[derive(Debug, Args)]
pub struct MatrixArgs {
    /// Scenes, as for `sim run` [default: the built-in demo set]
    #[arg(value_name = "PATH", help_heading = "What to drive")]
    pub paths: Vec<String>,

    /// Scenes, as PATH is; takes all that follows up to the next option
    #[arg(long, value_name = "PATH", num_args = 1.., conflicts_with = "paths", help_heading = "What to drive")]
    pub scenarios: Vec<String>,

    /// Who drives: drivers of `sim run`, each `[LABEL:]DRIVER[=WEIGHTS]`, as idm,sep=weights/il-pred.f16.safetensors
    #[arg(
        long,
        required_unless_present = "entrants",
        value_delimiter = ',',
        value_name = "NAMES",
        help_heading = "What to drive"
    )]
    pub drivers: Vec<Entrant>,

    /// More who drive, from a TOML file: planners of your own too, or the trainings of `trainer ablate` (docs/running.md)
    #[arg(long, value_name = "FILE", help_heading = "What to drive")]
    pub entrants: Option<PathBuf>,

    /// The rules of an episode, one table each
    #[arg(long, value_enum, value_delimiter = ',', default_value = "strict", help_heading = "What to drive")]
    pub protocols: Vec<ProtocolName>,

    /// A setting of `strict`, as for `sim run`
    #[arg(long, value_name = "KEY=VALUE", num_args = 1, help_heading = "What to drive")]
    pub set: Vec<String>,

    /// When plans take effect, as for `sim run`: a run each. Of several, score against latency is drawn into DIR/latency.svg
    #[arg(long, value_name = "HOW", value_delimiter = ',', help_heading = "What to drive")]
    pub latency: Vec<LatencyChoice>,

    /// Agents that react, as for `sim run`: a run each
    #[arg(long, value_name = "NAME", value_delimiter = ',', default_value = NO_TRAFFIC, value_parser = traffic_names(), help_heading = "What to drive")]
    pub traffic: Vec<String>,

    /// The folder of all runs, DIR/LABEL-PROTOCOL each, with latency and traffic behind it if there are any
    #[arg(long, value_name = "DIR", default_value = "runs/matrix", help_heading = "How to run")]
    pub out: PathBuf,

    /// Which episodes to keep a recording of
    #[arg(long, value_enum, default_value_t = Record::None, help_heading = "How to run")]
    pub record: Record,

    /// Drive a share of the scenes, the I-th of N, beside other processes in the same --out; `sim merge` then makes it a run (docs/shards.md).
    /// auto or auto/N: as HyperQueue, Slurm or Kubernetes says
    #[arg(long, value_name = "I/N", help_heading = "How to run")]
    pub shard: Option<ShardChoice>,

    /// Drive episodes again, as for `sim run`
    #[arg(long, value_enum, value_name = "WHICH", value_delimiter = ',', help_heading = "How to run")]
    pub retry: Vec<Retry>,

    /// Episodes driven at a time; results do not depend on it [default: the cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256), help_heading = "How to run")]
    pub parallel: Option<u16>,

    /// Have drivers of ours in this process, without nodes and bus: the same figures at less cost
    #[arg(long, help_heading = "How to run")]
    pub in_process: bool,

    /// Keep each worker with its nodes on a core of its own
    #[arg(long, help_heading = "How to run")]
    pub pin: bool,

    /// How long an answer may take: 5s, 500ms
    #[arg(long, value_name = "TIME", default_value = "5s", value_parser = parse_duration, help_heading = "How to run")]
    pub deadline: Duration,

    /// How to print
    #[arg(long, value_enum, default_value_t, help_heading = "How to run")]
    pub format: TableFormat,
}

/// When plans take effect, as it is typed.
#[derive(Clone, Debug, PartialEq)]
pub enum LatencyChoice {
    /// As this says.
    Latency(Latency),
    /// As a file says.
    Trace(PathBuf),
}

impl FromStr for LatencyChoice {
    type Err = LatencyError;

    fn from_str(text: &str) -> Result<Self, LatencyError> {
        match text.strip_prefix("trace:") {
            Some(path) => Ok(Self::Trace(PathBuf::from(path))),
            None => text.parse().map(Self::Latency),
        }
    }
}

/// Who drives or is asked beside others: `[LABEL:]DRIVER[=WEIGHTS]`, or an entry of a file of entrants.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Entrant {
    /// What tables call it.
    pub label: String,
    /// The driver.
    pub driver: String,
    /// The network's weights, if they are not those that are built in.
    pub weights: Option<PathBuf>,
    /// Where predictions come from, if not from where the driver wants them.
    pub predictor: Option<Predictor>,
    /// The command of a planner that is no driver of ours.
    pub planner_command: Option<String>,
}

impl FromStr for Entrant {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (name, weights) = text.split_once('=').map_or((text, None), |(name, file)| (name, Some(file)));
        let (label, driver) = name.split_once(':').unwrap_or((name, name));
        if drivers::find(driver).is_none() {
            let known: Vec<&str> = DRIVERS.iter().map(|driver| driver.name).collect();
            return Err(format!("{driver:?} is no driver; there are {}", known.join(", ")));
        }
        let weights = weights.map(PathBuf::from);
        Ok(Self { label: label.to_owned(), driver: driver.to_owned(), weights, ..Self::default() })
    }
}

/// `sim evaluate`.
#[derive(Debug, Args)]
pub struct EvaluateArgs {
    /// Plans are asked for once a second of the log, and never driven
    #[arg(long, required_unless_present = "traffic")]
    pub open_loop: bool,

    /// Nobody is asked: are the agents believable that reacted in finished runs, each PATH a run's folder?
    #[arg(
        long,
        requires = "paths",
        conflicts_with_all = [
            "open_loop", "drivers", "planner_command", "predictor", "features", "definitions", "out", "parallel", "in_process", "pin",
            "deadline", "start_timeout",
        ]
    )]
    pub traffic: bool,

    /// Scenes, as for `sim run` [default: the built-in demo set]
    #[arg(value_name = "PATH", help_heading = "What to ask")]
    pub paths: Vec<String>,

    /// Scenes, as PATH is; takes all that follows up to the next option. With --traffic, where the runs' scenes are now
    #[arg(long, value_name = "PATH", num_args = 1.., help_heading = "What to ask")]
    pub scenarios: Vec<String>,

    /// Who is asked, a line of the table each: drivers of `sim run`, each `[LABEL:]DRIVER[=WEIGHTS]`
    #[arg(long, value_name = "NAMES", value_delimiter = ',', help_heading = "What to ask")]
    pub drivers: Vec<Entrant>,

    /// A planner of your own, as for `sim run`, a line more
    #[arg(long, value_parser = NonEmptyStringValueParser::new(), value_name = "COMMAND", help_heading = "What to ask")]
    pub planner_command: Option<String>,

    /// What the table calls your own planner [default: command]
    #[arg(long, value_name = "NAME", requires = "planner_command", help_heading = "What to ask")]
    pub label: Option<String>,

    /// Where predictions come from [default: what each driver wants]
    #[arg(long, value_name = "NAME", help_heading = "What to ask")]
    pub predictor: Option<Predictor>,

    /// How the network's features are made, as for `sim run`
    #[arg(long, value_name = "STYLE", value_parser = ["authors", "mended"], help_heading = "What to ask")]
    pub features: Option<String>,

    /// By whose definitions plans are judged, and under whose protocol drivers are asked
    #[arg(long, value_enum, default_value_t, help_heading = "What to ask")]
    pub definitions: Definitions,

    /// How to print the table
    #[arg(long, value_enum, default_value_t, help_heading = "What to tell")]
    pub format: table::Format,

    /// Keep a row a frame: FILE.parquet, or a new folder, with the drivers' settings beside it
    #[arg(long, value_name = "FILE|DIR", help_heading = "What to tell")]
    pub out: Option<PathBuf>,

    /// Scenes at a time; results do not depend on it [default: the cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256), help_heading = "How to run")]
    pub parallel: Option<u16>,

    /// Have drivers of ours in this process, without nodes and bus: the same figures at less cost
    #[arg(long, help_heading = "How to run")]
    pub in_process: bool,

    /// Keep each worker with its nodes on a core of its own
    #[arg(long, help_heading = "How to run")]
    pub pin: bool,

    /// How long an answer may take: 5s, 500ms
    #[arg(long, value_name = "TIME", default_value = "5s", value_parser = parse_duration, help_heading = "How to run")]
    pub deadline: Duration,

    /// How long nodes may take to start [default: 20s]
    #[arg(long, value_name = "TIME", value_parser = parse_duration, help_heading = "How to run")]
    pub start_timeout: Option<Duration>,
}

impl EvaluateArgs {
    /// The scenes, given with or without the option.
    #[must_use]
    pub fn scenes(&self) -> &[String] {
        if self.paths.is_empty() { &self.scenarios } else { &self.paths }
    }
}

/// `sim verify`.
#[derive(Debug, Args)]
pub struct VerifyArgs {
    /// Scenes, as for `sim run`; vectors of others are left aside
    #[arg(long, required = true, value_name = "PATH", num_args = 1..)]
    pub scenarios: Vec<String>,
    /// Folder of the vectors: SCENE__route.npz, SCENE__human.npz, ...
    #[arg(long, value_name = "DIR")]
    pub vectors: PathBuf,
}

/// Episodes that are driven again.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Retry {
    /// Those without a result
    Failed,
    /// Those whose recording is not whole
    Unrecorded,
}

/// Planners that the sim does not start.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Planner {
    /// Started by hand
    External,
}

/// Protocols.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum ProtocolName {
    /// What an evaluator should believe
    #[default]
    Strict,
    /// The simulator of the DIPP paper, quirk for quirk
    Paper,
}

impl ProtocolName {
    /// As it is typed.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Strict => "strict",
            Self::Paper => "paper",
        }
    }
}

/// What `--driver` takes.
fn driver_names() -> PossibleValuesParser {
    DRIVERS.iter().map(|driver| PossibleValue::new(driver.name).help(driver.about)).collect::<Vec<_>>().into()
}

/// What `--traffic` takes, beside who drives: that all are replayed.
pub(crate) const NO_TRAFFIC: &str = "none";

/// What `--traffic` takes.
fn traffic_names() -> PossibleValuesParser {
    std::iter::once(NO_TRAFFIC).chain(traffic_node::names()).collect::<Vec<_>>().into()
}

/// `5s`, `500ms`, `2m`; above zero.
fn parse_duration(text: &str) -> Result<Duration, String> {
    let digits = text.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(text.len());
    let (number, unit) = text.split_at(digits);
    let scale = match unit {
        "ms" => 1e-3,
        "s" => 1.0,
        "m" => 60.0,
        _ => return Err("write it with its unit: 500ms, 5s or 2m".to_owned()),
    };
    let seconds = number.parse::<f64>().map_err(|error| error.to_string())? * scale;
    if !(1e-3..=86_400.0).contains(&seconds) {
        return Err("it must lie between 1ms and a day".to_owned());
    }
    Ok(Duration::from_secs_f64(seconds))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_well_formed() {
        <Cli as clap::CommandFactory>::command().debug_assert();
    }

    #[test]
    fn entrants_have_a_driver_and_may_have_a_label_and_weights() {
        let entrant = |label: &str, driver: &str, weights: Option<&str>| Entrant {
            label: label.to_owned(),
            driver: driver.to_owned(),
            weights: weights.map(PathBuf::from),
            ..Entrant::default()
        };
        assert_eq!("idm".parse(), Ok(entrant("idm", "idm", None)));
        assert_eq!("sep=a/b=c".parse(), Ok(entrant("sep", "sep", Some("a/b=c"))));
        assert_eq!("seed-43:dipp=x:y".parse(), Ok(entrant("seed-43", "dipp", Some("x:y"))));
        assert!("nobody".parse::<Entrant>().unwrap_err().contains("idm"));
    }

    #[test]
    fn a_run_of_an_entrant_is_that_of_the_command_line() {
        let Command::Run(typed) = Cli::parse_from(["sim", "run", "--driver", "idm", "--record", "none"]).command else {
            panic!("not a run")
        };
        assert_eq!(format!("{typed:?}"), format!("{:?}", RunArgs::of(&"idm".parse().unwrap())));
    }

    #[test]
    fn pictures_have_a_step_and_a_size() {
        assert_eq!(("7".parse(), "last".parse()), (Ok(PictureStep::Step(7)), Ok(PictureStep::Last)));
        assert_eq!("960x540".parse(), Ok(Size([960, 540])));
        assert!("-1".parse::<PictureStep>().is_err() && "first".parse::<PictureStep>().is_err());
        assert!(
            "960".parse::<Size>().is_err() && "960x".parse::<Size>().is_err() && "960X540".parse::<Size>().is_err()
        );
    }

    #[test]
    fn durations_need_a_unit_and_a_sensible_size() {
        assert_eq!(parse_duration("500ms"), Ok(Duration::from_millis(500)));
        assert_eq!(parse_duration("1.5s"), Ok(Duration::from_millis(1500)));
        assert_eq!(parse_duration("2m"), Ok(Duration::from_secs(120)));
        for bad in ["5", "0s", "s", "-1s", "1e9s", "5 s", "1..2s", ""] {
            assert!(parse_duration(bad).is_err(), "{bad}");
        }
    }
}
