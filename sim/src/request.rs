//! A command line and what it means: settings for the run, and for the machine it runs on.

use std::collections::BTreeMap;
use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use episode::latency::Latency;
use episode::protocol::{Motion, Protocol, SettingError, StrictSettings};
use episode::traffic::TrafficSettings;
use network::features::Settings as Features;
use network::weights::features_of;
use results::drivers::{self, Driver, MotionName, Predictor};
use results::files::{self, FileError};
use results::settings::{Machine, Node, Planner, Settings, Traffic, ZenohConfig};
use results::weights;
use shard::{SchedulerError, Shard, ShardChoice};
use thiserror::Error;
use wire::session::{ZenohFile, ZenohFileError};

use crate::cli::{self, LatencyChoice, ProtocolName, Retry, RunArgs};
use crate::shards;

/// How long nodes that the sim starts may take to be there.
const PATIENCE_WITH_NODES: Duration = Duration::from_secs(20);

/// How long somebody may take to start a planner by hand.
const PATIENCE_WITH_PEOPLE: Duration = Duration::from_secs(600);

/// A run, as it was asked for.
#[derive(Clone, Debug)]
pub struct Request {
    /// Who drives, and by which rules.
    pub settings: Settings,
    /// Where and how.
    pub machine: Machine,
    /// The folder, if it was asked for.
    pub out: Option<PathBuf>,
    /// Which of its shards this is, if it is driven in some.
    pub shard: Option<Shard>,
    /// Which of its episodes are to be driven again, if they were driven.
    pub retry: Vec<Retry>,
    /// Whether every scene is read before the first is driven.
    pub verify: bool,
    /// Whether to say where the time went.
    pub timing: bool,
    /// Whether a viewer shows it while it is driven.
    pub view: bool,
}

/// A command line that cannot be meant.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum RequestError {
    #[error("the driver's label {0:?} is not 1 to 64 of A-Z a-z 0-9 _ . -")]
    Label(String),
    #[error("{0:?} is no driver\nhint: `sim run --help` lists them")]
    Driver(String),
    #[error(
        "{0} has no meaning under the protocol paper: the AV is put on the plan's first pose, and nothing else can be set\nhint: leave {0} out, or drive under --protocol strict"
    )]
    NotUnderPaper(&'static str),
    #[error(
        "--motion playback puts the AV wherever the plan says: it is for the driver human, who was there\nhint: leave --motion out"
    )]
    Playback,
    #[error("the driver {0} needs predictions\nhint: --predictor ctra, ctrv, oracle or network")]
    NeedsPredictor(&'static str),
    #[error(
        "the driver {0} needs the predictor network: no other says where its plans begin\nhint: leave --predictor out, or take another driver, as --driver idm"
    )]
    NeedsNetwork(&'static str),
    #[error(
        "the driver {name} needs weights, for only those of dipp are built in\nhint: --weights weights/{file}, a file of reloop's repository; docs/network.md tells of others"
    )]
    NeedsWeights { name: &'static str, file: &'static str },
    #[error(
        "--weights and --features are for the predictor network, and the driver {0} has another\nhint: --driver dipp, sep, il-pred or il, or --predictor network; --weights is for --driver cql too"
    )]
    NoNetwork(String),
    #[error("the driver {0} asks nobody what others will do\nhint: leave the predictor out")]
    DrivesAlone(&'static str),
    #[error("cannot read the weights: {0}")]
    Weights(#[from] FileError),
    #[error("cannot use the Zenoh configuration: {0}")]
    ZenohFile(#[from] ZenohFileError),
    #[error("cannot read the Zenoh configuration: {0}")]
    ZenohFileSum(FileError),
    #[error("cannot read the trace of latencies: {0}")]
    Trace(FileError),
    #[error(
        "--latency is for an AV that follows plans, and that of the driver human is played back\nhint: leave --latency out, or have it steer, with --motion bicycle"
    )]
    PlayedBackLate,
    #[error(
        "--traffic-seed and --traffic-set are for agents that react, and all are replayed\nhint: --traffic idm, or another; `sim run --help` names them"
    )]
    NobodyReacts,
    #[error(transparent)]
    Shard(#[from] SchedulerError),
    #[error(transparent)]
    Setting(#[from] SettingError),
}

impl Request {
    /// What `arguments` mean on a machine with so many cores.
    ///
    /// # Errors
    /// [`RequestError`].
    pub fn resolve(arguments: RunArgs, cores: u16) -> Result<Self, RequestError> {
        let row = drivers::find(&arguments.driver).ok_or_else(|| RequestError::Driver(arguments.driver.clone()))?;
        let traffic = traffic(&arguments)?;
        let own = arguments.planner.is_some() || arguments.planner_command.is_some();
        let (planner, name, wants, moves) = match (arguments.planner_command, arguments.planner) {
            (Some(command), _) => {
                let files = files_named_in(&command);
                (Planner::Command { command, files }, "command", Predictor::None, MotionName::Bicycle)
            }
            (None, Some(cli::Planner::External)) => {
                (Planner::External, "external", Predictor::None, MotionName::Bicycle)
            }
            (None, None) => {
                let options = row.planner_options.iter().map(|option| (*option).to_owned()).collect();
                let weights_sha256 = match row.weights.filter(|_| row.planner_has_weights()) {
                    Some(file) => Some(policy(row, file, arguments.weights.as_deref())?),
                    None => None,
                };
                let node = Node { options, weights_sha256, ..Node::named(row.planner, row.planner_reads_log) };
                (Planner::Node(node), row.name, row.predictor, row.motion)
            }
        };
        let has_policy = matches!(&planner, Planner::Node(node) if node.weights_sha256.is_some());
        if has_policy
            && (arguments.predictor_command.is_some() || arguments.predictor.is_some_and(|asked| asked != wants))
        {
            return Err(RequestError::DrivesAlone(name));
        }
        let predicts = arguments.predictor_command;
        let is_other = predicts.is_some() || arguments.predictor.is_some_and(|asked| asked != wants);
        if wants == Predictor::Network && is_other {
            return Err(RequestError::NeedsNetwork(name));
        }
        if wants != Predictor::None && arguments.predictor == Some(Predictor::None) {
            return Err(RequestError::NeedsPredictor(name));
        }
        let predictor = match (predicts, arguments.predictor.unwrap_or(wants)) {
            (Some(command), _) => {
                let files = files_named_in(&command);
                Some(Node { command: Some(command), files, ..Node::named("command", false) })
            }
            (None, Predictor::None) => None,
            (None, Predictor::Ctrv) => Some(Node::named("ctrv", false)),
            (None, Predictor::Ctra) => Some(Node::named("ctra", false)),
            (None, Predictor::Oracle) => Some(Node::named("oracle", true)),
            (None, Predictor::Network) => {
                Some(network(row, arguments.weights.as_deref(), arguments.features.as_deref())?)
            }
        };
        let has_network = predictor.as_ref().is_some_and(|node| node.weights_sha256.is_some());
        if !has_network && (arguments.weights.is_some() && !has_policy || arguments.features.is_some()) {
            return Err(RequestError::NoNetwork(name.to_owned()));
        }
        let driver = match (&arguments.label, &predictor) {
            (Some(label), _) => checked_label(label)?,
            // Another predictor than its own makes another driver: tables must not call both the same.
            (None, Some(node)) if own || is_other => {
                format!("{name}-{}", node.name)
            }
            (None, _) => name.to_owned(),
        };
        let protocol = match arguments.protocol {
            ProtocolName::Strict => {
                let motion = match arguments.motion.unwrap_or(moves) {
                    MotionName::Bicycle => Motion::Bicycle,
                    MotionName::Playback => Motion::Playback,
                };
                if motion == Motion::Playback && moves != MotionName::Playback {
                    return Err(RequestError::Playback);
                }
                Protocol::Strict(StrictSettings { motion, ..StrictSettings::default() }.with_changes(&arguments.set)?)
            }
            ProtocolName::Paper if arguments.motion.is_some() => return Err(RequestError::NotUnderPaper("--motion")),
            ProtocolName::Paper if !arguments.set.is_empty() => return Err(RequestError::NotUnderPaper("--set")),
            ProtocolName::Paper => Protocol::Paper,
        };
        protocol.check()?;
        let (latency, trace) = latency(arguments.latency)?;
        if let (Some(_), Protocol::Paper) = (&latency, &protocol) {
            return Err(RequestError::NotUnderPaper("--latency"));
        }
        if let (Some(_), Protocol::Strict(StrictSettings { motion: Motion::Playback, .. })) = (&latency, &protocol) {
            return Err(RequestError::PlayedBackLate);
        }
        if let (Some(_), Protocol::Paper) = (&traffic, &protocol) {
            return Err(SettingError::ReactivePaper.into());
        }
        let patience = if planner == Planner::External { PATIENCE_WITH_PEOPLE } else { PATIENCE_WITH_NODES };
        let settings = Settings {
            driver,
            deadline_s: arguments.deadline.as_secs_f64(),
            record: arguments.record,
            planner,
            predictor,
            protocol,
            latency,
            fork: None,
            traffic,
        };
        let shard = arguments.shard.map(ShardChoice::of_this_process).transpose()?;
        let machine = Machine {
            parallel: arguments.parallel.unwrap_or(cores),
            in_process: arguments.in_process,
            pin: arguments.pin,
            start_timeout_s: arguments.start_timeout.unwrap_or(patience).as_secs_f64(),
            endpoint: arguments.endpoint,
            weights: arguments.weights.map(|path| path.display().to_string()),
            latency_trace: trace.map(|path| path.display().to_string()),
            scenarios: if arguments.paths.is_empty() { arguments.scenarios } else { arguments.paths },
            planner_certificates: arguments.planner_certificate,
            zenoh_config: arguments.zenoh_config.as_deref().map(zenoh_config).transpose()?,
            shards: shard.map(|shard| shards::pinned(shard.of(), env::args_os())),
        };
        let RunArgs { out, retry, verify, timing, view, .. } = arguments;
        Ok(Self { settings, machine, out, shard, retry, verify, timing, view })
    }
}

/// Who drives the agents that react; none where all are replayed.
fn traffic(arguments: &RunArgs) -> Result<Option<Traffic>, RequestError> {
    let hand_over = TrafficSettings::default().with_changes(&arguments.traffic_set)?;
    let node = match (&arguments.traffic_command, arguments.traffic.as_str()) {
        (Some(command), _) => {
            let files = files_named_in(command);
            Node { command: Some(command.clone()), files, ..Node::named("command", false) }
        }
        (None, cli::NO_TRAFFIC) if arguments.traffic_seed.is_none() && arguments.traffic_set.is_empty() => {
            return Ok(None);
        }
        (None, cli::NO_TRAFFIC) => return Err(RequestError::NobodyReacts),
        (None, name) => {
            let seed = arguments.traffic_seed.unwrap_or(0);
            // The network of traffic is the one that is built in, whatever network drives the AV.
            let weights_sha256 = traffic_node::has_network(name).then(|| weights::built_in_sha256().to_owned());
            Node { options: vec!["--seed".to_owned(), seed.to_string()], weights_sha256, ..Node::named(name, false) }
        }
    };
    Ok(Some(Traffic { node, hand_over }))
}

/// When plans take effect; none where it is at once. And the file that says so, if one does.
fn latency(choice: Option<LatencyChoice>) -> Result<(Option<Latency>, Option<PathBuf>), RequestError> {
    Ok(match choice {
        None => (None, None),
        Some(LatencyChoice::Latency(latency)) => (Some(latency).filter(|latency| !latency.is_none()), None),
        Some(LatencyChoice::Trace(path)) => {
            let sha256 = files::sha256([&*path]).map_err(RequestError::Trace)?;
            (Some(Latency::Trace { sha256 }), Some(path))
        }
    })
}

/// The predictor `network` of a driver, with the weights in a file or those that are built in.
fn network(driver: &Driver, file: Option<&Path>, features: Option<&str>) -> Result<Node, RequestError> {
    let sha256 = match (file, driver.weights) {
        (Some(file), _) => files::sha256([file])?,
        (None, None | Some(weights::BUILT_IN)) => weights::built_in_sha256().to_owned(),
        (None, Some(file)) => return Err(RequestError::NeedsWeights { name: driver.name, file }),
    };
    // Those of the repository, whose files are older than the word in them, and the authors' do not say it.
    let said = file.and_then(|file| fs::read(file).ok()).and_then(|bytes| features_of(&bytes)).map(Features::name);
    let usual = if weights::is_ours(&sha256) { weights::FEATURES } else { "authors" };
    let options = vec!["--features".to_owned(), features.or(said).unwrap_or(usual).to_owned()];
    Ok(Node { options, weights_sha256: Some(sha256), ..Node::named("network", false) })
}

/// Who the weights of a planner are: those in a file.
fn policy(driver: &Driver, usual: &'static str, file: Option<&Path>) -> Result<String, RequestError> {
    let file = file.ok_or(RequestError::NeedsWeights { name: driver.name, file: usual })?;
    Ok(files::sha256([file])?)
}

/// A Zenoh configuration, if it can be used.
fn zenoh_config(path: &Path) -> Result<ZenohConfig, RequestError> {
    let file = ZenohFile::read(path)?;
    let sha256 = files::sha256([file.path()]).map_err(RequestError::ZenohFileSum)?;
    Ok(ZenohConfig { path: file.path().display().to_string(), sha256 })
}

/// The files among the words of a shell command, with their SHA-256. What they load themselves is not seen.
fn files_named_in(command: &str) -> BTreeMap<String, String> {
    let words = command.split_whitespace().map(|word| word.trim_matches(['\'', '"']));
    let files = words.filter(|word| Path::new(word).is_file());
    files.filter_map(|word| Some((word.to_owned(), files::sha256([Path::new(word)]).ok()?))).collect()
}

/// A driver's label, if it can be one.
pub(crate) fn checked_label(label: &str) -> Result<String, RequestError> {
    let allowed = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '.' | '-');
    if !(1..=64).contains(&label.len()) || !label.chars().all(allowed) || label.starts_with('.') {
        return Err(RequestError::Label(label.to_owned()));
    }
    Ok(label.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;
    use episode::protocol::{EndingCollision, Wheelbase};
    use network::weights::{Precision, Variant, Weights};
    use results::settings::{Build, RunFile, SceneLine};

    fn resolve(arguments: &[&str]) -> Request {
        let line = ["sim", "run"].iter().chain(arguments);
        let cli::Command::Run(arguments) = cli::Cli::parse_from(line).command else { panic!("not a run") };
        Request::resolve(*arguments, 2).unwrap()
    }

    fn refusal(arguments: &[&str]) -> RequestError {
        let line = ["sim", "run"].iter().chain(arguments);
        let cli::Command::Run(arguments) = cli::Cli::parse_from(line).command else { panic!("not a run") };
        Request::resolve(*arguments, 2).unwrap_err()
    }

    fn run_file(arguments: &[&str]) -> RunFile {
        let Request { settings, machine, .. } = resolve(arguments);
        let scenes = vec![SceneLine { id: "a".to_owned(), sha256: "00".to_owned(), fingerprint: None }];
        RunFile { settings, build: Build::this(), machine, scenes }
    }

    #[test]
    fn a_run_file_reads_back_as_it_was_written() {
        for arguments in [
            &[][..],
            &["--driver", "human", "--predictor", "oracle", "--record", "none", "--pin"],
            &["--planner-command", "python 'my planner.py' --fast", "--deadline", "250ms"],
            &["--planner", "external", "--endpoint", "tcp/127.0.0.1:7447", "--scenarios", "a", "b"],
            &["--protocol", "paper"],
            &["--planner-command", "cat Cargo.toml"],
            &["--latency", "dist:normal:80ms:20ms:loss=0.01"],
            &["--latency", concat!("trace:", env!("CARGO_MANIFEST_DIR"), "/Cargo.toml")],
            &["--set", "horizon=80", "--set", "wheelbase.of-length=0.6", "--set", "ending-collision=any"],
        ] {
            let file = run_file(arguments);
            let text = file.to_toml();
            assert_eq!(RunFile::parse(&text).unwrap(), file, "{text}");
        }
    }

    /// What names a driver; any file will do for weights, for they are not opened.
    fn with_weights<'a>(driver: &drivers::Driver, more: &[&'a str]) -> Vec<&'a str> {
        let weights: &[&str] = match driver.predictor {
            Predictor::None if !driver.planner_has_weights() => &[],
            Predictor::None | Predictor::Network => &["--weights", concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml")],
            _ => &[],
        };
        ["--driver", driver.name].iter().chain(weights).chain(more).copied().collect()
    }

    #[test]
    fn the_network_of_traffic_is_the_one_that_is_built_in_and_named_by_its_checksum() {
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml");
        let node = |line: &[&str]| resolve(line).settings.traffic.unwrap().node;
        for line in [&["--driver", "idm"][..], &["--driver", "dipp", "--weights", file]] {
            let network = node(&[line, &["--traffic", "network", "--traffic-seed", "4"]].concat());
            assert_eq!(network.weights_sha256.as_deref(), Some(weights::built_in_sha256()));
            assert_eq!(network.options, ["--seed", "4"]);
        }
        assert_eq!(node(&["--driver", "idm", "--traffic", "mixed"]).weights_sha256, None);
    }

    #[test]
    fn other_weights_make_another_run() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("x.safetensors");
        let line = ["--driver", "dipp", "--weights", file.to_str().unwrap()];
        std::fs::write(&file, "one").unwrap();
        let before = run_file(&line);
        std::fs::write(&file, "two").unwrap();
        let differences = before.differences(&run_file(&line));
        assert!(matches!(&differences[..], [one] if one.contains("weights-sha256")), "{differences:?}");
        assert_eq!(before.settings.driver, "dipp");
        let idm = resolve(&["--driver", "idm", "--predictor", "network", "--weights", file.to_str().unwrap()]);
        assert_eq!(idm.settings.driver, "idm-network");
    }

    #[test]
    fn the_weights_that_are_built_in_are_named_by_their_checksum() {
        let network = |arguments: &[&str]| resolve(arguments).settings.predictor.unwrap();
        let dipp = network(&["--driver", "dipp"]);
        assert_eq!(dipp.weights_sha256.as_deref(), Some(weights::built_in_sha256()));
        assert_eq!(dipp.options, ["--features", "mended"]);
        assert_eq!(network(&["--driver", "idm", "--predictor", "network"]), dipp);
        assert_eq!(network(&["--planner", "external", "--predictor", "network"]), dipp);
        assert_eq!(network(&["--driver", "dipp", "--features", "authors"]).options, ["--features", "authors"]);
        let other = concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml");
        assert_eq!(network(&["--driver", "dipp", "--weights", other]).options, ["--features", "authors"]);
        let folder = tempfile::tempdir().unwrap();
        let trained = folder.path().join("trained.safetensors");
        let weights = Weights::formula(Variant::Joint).with_features(Features::Mended);
        fs::write(&trained, weights.write(Precision::Half).unwrap()).unwrap();
        let trained = trained.to_str().unwrap();
        assert_eq!(network(&["--driver", "dipp", "--weights", trained]).options, ["--features", "mended"]);
        assert_eq!(
            network(&["--driver", "dipp", "--weights", trained, "--features", "authors"]).options,
            ["--features", "authors"]
        );
    }

    #[test]
    fn the_built_in_file_given_by_its_name_makes_the_same_run() {
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../weights/dipp.f16.safetensors");
        let (built_in, given) = (run_file(&["--driver", "dipp"]), run_file(&["--driver", "dipp", "--weights", file]));
        assert_eq!(built_in.differences(&given), Vec::<String>::new());
    }

    #[test]
    fn a_driver_whose_weights_are_not_built_in_says_which_file_they_are() {
        insta::assert_snapshot!(refusal(&["--driver", "sep"]), @"
        the driver sep needs weights, for only those of dipp are built in
        hint: --weights weights/il-pred.f16.safetensors, a file of reloop's repository; docs/network.md tells of others
        ");
        insta::assert_snapshot!(refusal(&["--driver", "il"]), @"
        the driver il needs weights, for only those of dipp are built in
        hint: --weights weights/il.f16.safetensors, a file of reloop's repository; docs/network.md tells of others
        ");
    }

    #[test]
    fn the_human_is_played_back_and_all_others_steer() {
        for driver in drivers::DRIVERS {
            let settings = resolve(&with_weights(driver, &[])).settings;
            let Protocol::Strict(strict) = settings.protocol else { panic!("strict is the default") };
            assert_eq!(strict.motion == Motion::Playback, driver.name == "human");
        }
    }

    #[test]
    fn under_paper_all_move_alike_and_motion_is_no_choice() {
        for driver in drivers::DRIVERS {
            let settings = resolve(&with_weights(driver, &["--protocol", "paper"])).settings;
            assert_eq!((&settings.protocol, settings.protocol.motion_name()), (&Protocol::Paper, "first-pose"));
        }
        let refused = refusal(&["--protocol", "paper", "--motion", "bicycle"]);
        assert!(matches!(refused, RequestError::NotUnderPaper("--motion")));
        let refused = refusal(&["--protocol", "paper", "--set", "horizon=80"]);
        assert!(matches!(refused, RequestError::NotUnderPaper("--set")));
    }

    #[test]
    fn a_latency_is_for_who_follows_plans_and_none_of_it_is_none() {
        let settings = |latency| resolve(&["--latency", latency]).settings;
        assert_eq!(settings("0ms"), resolve(&[]).settings);
        assert_eq!(settings("80ms").latency, Some(Latency::Fixed(80_000)));
        assert_eq!(resolve(&["--protocol", "paper", "--latency", "0"]).settings.latency, None);
        let refused = refusal(&["--protocol", "paper", "--latency", "80ms"]);
        assert!(matches!(refused, RequestError::NotUnderPaper("--latency")));
        let human = ["--driver", "human", "--latency", "80ms"];
        assert!(matches!(refusal(&human), RequestError::PlayedBackLate));
        assert!(resolve(&["--driver", "human", "--latency", "80ms", "--motion", "bicycle"]).settings.latency.is_some());
        let missing = refusal(&["--latency", "trace:nowhere.csv"]).to_string();
        assert!(missing.contains("trace of latencies") && missing.contains("nowhere.csv"), "{missing}");
    }

    #[test]
    fn only_the_human_is_played_back() {
        assert!(matches!(refusal(&["--motion", "playback"]), RequestError::Playback));
        let own = refusal(&["--planner", "external", "--motion", "playback"]);
        assert!(matches!(own, RequestError::Playback));
        let tracked = resolve(&["--driver", "human", "--motion", "bicycle"]).settings.protocol;
        assert_eq!(tracked, Protocol::default());
    }

    #[test]
    fn who_needs_predictions_is_not_left_without() {
        let refused = refusal(&["--driver", "gn-ctrv", "--predictor", "none"]);
        assert!(matches!(refused, RequestError::NeedsPredictor("gn-ctrv")));
        for other in ["none", "ctrv", "oracle"] {
            assert!(matches!(refusal(&["--driver", "dipp", "--predictor", other]), RequestError::NeedsNetwork("dipp")));
        }
    }

    #[test]
    fn a_setting_is_changed_by_its_name() {
        let changes = ["horizon=80", "wheelbase.of-length=0.6", "ending-collision = any", "max-acceleration=4"];
        let arguments: Vec<&str> = changes.iter().flat_map(|change| ["--set", change]).collect();
        let expected = StrictSettings {
            horizon: 80,
            wheelbase: Wheelbase::OfLength(0.6),
            ending_collision: EndingCollision::Any,
            max_acceleration: 4.0,
            ..StrictSettings::default()
        };
        assert_eq!(resolve(&arguments).settings.protocol, Protocol::Strict(expected));
        let wrong = |change| refusal(&["--set", change]).to_string();
        insta::assert_snapshot!(wrong("horizn=80"), @"
        --set horizn=80: unknown field `horizn`, expected one of `start`, `horizon`, `motion`, `wheelbase`, `max-acceleration`, `max-steering`, `max-steering-rate`, `off-route-distance`, `ending-collision`
        hint: docs/running.md lists what can be set
        ");
        insta::assert_snapshot!(wrong("horizon"), @"
        --set horizon: it is not KEY=VALUE
        hint: docs/running.md lists what can be set
        ");
        insta::assert_snapshot!(wrong("horizon=-3"), @"
        --set horizon=-3: invalid value: integer `-3`, expected u32
        hint: docs/running.md lists what can be set
        ");
        insta::assert_snapshot!(wrong("horizon=0"), @"horizon is 0, but it must be finite and above 0");
        insta::assert_snapshot!(wrong("motion=playback"), @"
        --set motion=playback: the motion has an option of its own: --motion
        hint: docs/running.md lists what can be set
        ");
        let slipped = ["\"motion\"=\"playback\"", " motion = playback", "horizon = 9\nmotion = \"playback\""];
        assert!(slipped.iter().all(|change| wrong(change).contains("--motion")));
        insta::assert_snapshot!(wrong("ending-collision=some"), @"
        --set ending-collision=some: unknown variant `some`, expected one of `at-fault`, `any`, `none`
        hint: docs/running.md lists what can be set
        ");
    }

    #[test]
    fn a_planner_whose_file_was_changed_makes_another_run() {
        let folder = tempfile::tempdir().unwrap();
        let script = folder.path().join("mine.py");
        let command = format!("python '{}' --fast", script.display());
        std::fs::write(&script, "one").unwrap();
        let before = run_file(&["--planner-command", &command]);
        assert_eq!(before.differences(&run_file(&["--planner-command", &command])), Vec::<String>::new());
        std::fs::write(&script, "two").unwrap();
        let differences = before.differences(&run_file(&["--planner-command", &command]));
        assert!(matches!(&differences[..], [one] if one.contains("mine.py")), "{differences:?}");
    }

    #[test]
    fn another_predictor_makes_another_driver() {
        assert_eq!(resolve(&[]).settings.driver, drivers::DEFAULT);
        assert_eq!(resolve(&["--driver", "idm"]).settings.driver, "idm");
        assert_eq!(resolve(&["--driver", "idm", "--predictor", "none"]).settings.driver, "idm");
        assert_eq!(resolve(&["--driver", "idm", "--predictor", "ctrv"]).settings.driver, "idm-ctrv");
        assert_eq!(resolve(&["--planner", "external", "--predictor", "ctrv"]).settings.driver, "external-ctrv");
        assert_eq!(resolve(&["--driver", "idm", "--predictor", "ctrv", "--label", "mine"]).settings.driver, "mine");
    }

    #[test]
    fn scenes_are_given_with_or_without_the_option() {
        let scenes = |arguments: &[&str]| resolve(arguments).machine.scenarios;
        assert_eq!(scenes(&["data/", "more.toml", "--driver", "idm"]), ["data/", "more.toml"]);
        assert_eq!(scenes(&["--driver", "idm", "data/"]), scenes(&["--scenarios", "data/"]));
        let both = ["sim", "run", "data/", "--scenarios", "more"];
        assert!(cli::Cli::try_parse_from(both).is_err());
    }

    #[test]
    fn a_label_is_a_file_name() {
        let with = |label: &str| {
            let line = ["sim", "run", "--label", label];
            let cli::Command::Run(arguments) = cli::Cli::parse_from(line).command else { panic!("not a run") };
            Request::resolve(*arguments, 2).is_ok()
        };
        assert!(with("dipp-2"));
        assert!(!with("../evil") && !with("a b") && !with(""));
    }
}
