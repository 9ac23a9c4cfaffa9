//! What is meant by a command line, fully resolved: this is what `run.toml` holds.
//!
//! [`Settings`], [`Build`] and the scenes decide the results: a run is only continued where they are the same.
//! [`Machine`] does not touch a byte of them.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use thiserror::Error;

use crate::cli::{self, MotionName, Predictor, ProtocolName, Record, RunArgs};
use crate::drivers;
use crate::protocol::{Motion, Protocol, SettingError, StrictSettings};
use crate::version;

/// How long nodes that the sim starts may take to be there.
const PATIENCE_WITH_NODES: Duration = Duration::from_secs(20);

/// How long somebody may take to start a planner by hand.
const PATIENCE_WITH_PEOPLE: Duration = Duration::from_secs(600);

/// `run.toml`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub struct RunFile {
    /// Who drives, and by which rules.
    pub settings: Settings,
    /// Which build drives.
    pub build: Build,
    /// Where and how it was run.
    pub machine: Machine,
    /// What is driven, in the order of the tables.
    #[serde(default)]
    pub scenes: Vec<SceneLine>,
}

/// Who drives, and by which rules.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Settings {
    /// What tables call the driver.
    pub driver: String,
    /// How long an answer may take (s).
    pub deadline_s: f64,
    /// Which episodes are recorded.
    pub record: Record,
    /// Where plans come from.
    pub planner: Planner,
    /// Where predictions come from.
    pub predictor: Option<Node>,
    /// The rules of an episode.
    pub protocol: Protocol,
}

/// Where plans come from.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "from")]
pub enum Planner {
    /// A member of `planner-node`.
    Node(Node),
    /// A command of the user's.
    Command {
        /// For the shell; a node's arguments are appended.
        command: String,
        /// SHA-256, in hexadecimal digits, of the files that it names: a planner that was changed makes another run.
        #[serde(default)]
        files: BTreeMap<String, String>,
    },
    /// A process that the user starts.
    External,
}

/// A member of `planner-node` or `predictor-node`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub struct Node {
    /// Its name there.
    pub name: String,
    /// Whether it reads the log itself.
    pub reads_log: bool,
}

/// Which build drives.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub struct Build {
    /// The package's version.
    pub version: String,
    /// The revision it was built from.
    pub git_revision: String,
    /// The version of the messages.
    pub wire_version: u32,
}

/// A scene of the run.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub struct SceneLine {
    /// Its name.
    pub id: String,
    /// SHA-256 of its record, in hexadecimal digits.
    pub sha256: String,
}

/// Where and how a run was run: nothing in its results depends on it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub struct Machine {
    /// Episodes driven at a time.
    pub parallel: u16,
    /// Whether each worker and its nodes are kept on one core.
    #[serde(default)]
    pub pin: bool,
    /// How long nodes may take to start (s).
    pub start_timeout_s: f64,
    /// Where nodes connect, if it was asked for.
    pub endpoint: Option<String>,
    /// The scenes, as they were asked for; none for the built-in demo set.
    pub scenarios: Vec<String>,
}

/// A run, as it was asked for.
#[derive(Clone, Debug)]
pub struct Request {
    /// Who drives, and by which rules.
    pub settings: Settings,
    /// Where and how.
    pub machine: Machine,
    /// The folder, if it was asked for.
    pub out: Option<PathBuf>,
    /// Whether to say where the time went.
    pub timing: bool,
}

/// A command line that cannot be meant.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum SettingsError {
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
    #[error("the driver {0} needs predictions\nhint: --predictor ctrv or oracle")]
    NeedsPredictor(&'static str),
    #[error("--set {change}: {reason}\nhint: docs/running.md lists what can be set")]
    Change { change: String, reason: String },
    #[error(transparent)]
    Setting(#[from] SettingError),
    #[error("run.toml cannot be read: {0}\nhint: give another folder with --out, or remove this one")]
    Parse(#[from] toml::de::Error),
}

impl Request {
    /// What `arguments` mean on a machine with so many cores.
    ///
    /// # Errors
    /// [`SettingsError`].
    pub fn resolve(arguments: RunArgs, cores: u16) -> Result<Self, SettingsError> {
        let row = drivers::find(&arguments.driver).ok_or_else(|| SettingsError::Driver(arguments.driver.clone()))?;
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
                let node = Node { name: row.planner.to_owned(), reads_log: row.planner_reads_log };
                (Planner::Node(node), row.name, row.predictor, row.motion)
            }
        };
        if wants != Predictor::None && arguments.predictor == Some(Predictor::None) {
            return Err(SettingsError::NeedsPredictor(name));
        }
        let predictor = match arguments.predictor.unwrap_or(wants) {
            Predictor::None => None,
            Predictor::Ctrv => Some(Node { name: "ctrv".to_owned(), reads_log: false }),
            Predictor::Oracle => Some(Node { name: "oracle".to_owned(), reads_log: true }),
        };
        let driver = match (&arguments.label, &predictor) {
            (Some(label), _) => checked_label(label)?,
            // Another predictor than its own makes another driver: tables must not call both the same.
            (None, Some(node)) if own || arguments.predictor.is_some_and(|p| p != wants) => {
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
                    return Err(SettingsError::Playback);
                }
                Protocol::Strict(changed(&StrictSettings { motion, ..StrictSettings::default() }, &arguments.set)?)
            }
            ProtocolName::Paper if arguments.motion.is_some() => return Err(SettingsError::NotUnderPaper("--motion")),
            ProtocolName::Paper if !arguments.set.is_empty() => return Err(SettingsError::NotUnderPaper("--set")),
            ProtocolName::Paper => Protocol::Paper,
        };
        protocol.check()?;
        let patience = if planner == Planner::External { PATIENCE_WITH_PEOPLE } else { PATIENCE_WITH_NODES };
        let settings = Settings {
            driver,
            deadline_s: arguments.deadline.as_secs_f64(),
            record: arguments.record,
            planner,
            predictor,
            protocol,
        };
        let machine = Machine {
            parallel: arguments.parallel.unwrap_or(cores),
            pin: arguments.pin,
            start_timeout_s: arguments.start_timeout.unwrap_or(patience).as_secs_f64(),
            endpoint: arguments.endpoint,
            scenarios: arguments.scenarios,
        };
        Ok(Self { settings, machine, out: arguments.out, timing: arguments.timing })
    }
}

/// `settings` with changes `KEY=VALUE`; a value is TOML, a word needs no quotes.
fn changed(settings: &StrictSettings, changes: &[String]) -> Result<StrictSettings, SettingsError> {
    let mut settings = settings.clone();
    for change in changes {
        let wrong = |reason: &str| SettingsError::Change { change: change.clone(), reason: reason.trim().to_owned() };
        let (key, value) = change.split_once('=').ok_or_else(|| wrong("it is not KEY=VALUE"))?;
        let (key, value) = (key.trim(), value.trim());
        if key == "motion" {
            return Err(wrong("the motion has an option of its own: --motion"));
        }
        let parsed: Result<toml::Table, _> = toml::from_str(&format!("{key} = {value}"));
        let parsed = parsed.or_else(|_| toml::from_str(&format!("{key} = {value:?}")));
        let mut table = toml::Table::try_from(&settings).map_err(|error| wrong(&error.to_string()))?;
        table.extend(parsed.map_err(|error| wrong(error.message()))?);
        settings = table.try_into().map_err(|error: toml::de::Error| wrong(error.message()))?;
    }
    Ok(settings)
}

/// The files among the words of a shell command, with their SHA-256. What they load themselves is not seen.
fn files_named_in(command: &str) -> BTreeMap<String, String> {
    let words = command.split_whitespace().map(|word| word.trim_matches(['\'', '"']));
    let hashed = |word: &str| {
        let bytes = fs::read(word).ok()?;
        Some((word.to_owned(), Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()))
    };
    words.filter(|word| Path::new(word).is_file()).filter_map(hashed).collect()
}

fn checked_label(label: &str) -> Result<String, SettingsError> {
    let allowed = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '.' | '-');
    if !(1..=64).contains(&label.len()) || !label.chars().all(allowed) || label.starts_with('.') {
        return Err(SettingsError::Label(label.to_owned()));
    }
    Ok(label.to_owned())
}

impl Settings {
    /// How long an answer may take.
    #[must_use]
    pub fn deadline(&self) -> Duration {
        Duration::from_secs_f64(self.deadline_s)
    }
}

impl Machine {
    /// How long nodes may take to start.
    #[must_use]
    pub fn start_timeout(&self) -> Duration {
        Duration::from_secs_f64(self.start_timeout_s)
    }
}

impl Build {
    /// This build.
    #[must_use]
    pub fn this() -> Self {
        Self {
            version: version::VERSION.to_owned(),
            git_revision: version::GIT_REVISION.to_owned(),
            wire_version: wire::WIRE_VERSION,
        }
    }
}

impl RunFile {
    /// As the text of `run.toml`.
    #[must_use]
    pub fn to_toml(&self) -> String {
        // Plain data with text keys: TOML holds all of it.
        toml::to_string(self).unwrap_or_default()
    }

    /// From the text of `run.toml`.
    ///
    /// # Errors
    /// [`SettingsError::Parse`].
    pub fn parse(text: &str) -> Result<Self, SettingsError> {
        Ok(toml::from_str(text)?)
    }

    /// What recordings carry: what decides the results, but not the list of scenes.
    #[must_use]
    pub fn to_recorded_toml(&self) -> String {
        #[derive(Serialize)]
        struct Recorded<'a> {
            settings: &'a Settings,
            build: &'a Build,
        }
        toml::to_string(&Recorded { settings: &self.settings, build: &self.build }).unwrap_or_default()
    }

    /// What differs between two runs that must be one: a line each, `field: there, here`. Empty where nothing does.
    #[must_use]
    pub fn differences(&self, here: &Self) -> Vec<String> {
        let mut lines = Vec::new();
        let value = |file: &Self| {
            let comparable = Self { scenes: Vec::new(), machine: here.machine.clone(), ..file.clone() };
            toml::Value::try_from(comparable).unwrap_or(toml::Value::Boolean(false))
        };
        compare("", Some(&value(self)), Some(&value(here)), &mut lines);
        if self.scenes != here.scenes {
            lines.push(compare_scenes(&self.scenes, &here.scenes));
        }
        lines
    }
}

fn compare(path: &str, there: Option<&toml::Value>, here: Option<&toml::Value>, lines: &mut Vec<String>) {
    match (there, here) {
        (Some(toml::Value::Table(there)), Some(toml::Value::Table(here))) => {
            let extra = here.keys().filter(|key| !there.contains_key(*key));
            for key in there.keys().chain(extra) {
                let path = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
                compare(&path, there.get(key), here.get(key), lines);
            }
        }
        _ if there == here => {}
        _ => {
            let text = |value: Option<&toml::Value>| value.map_or_else(|| "nothing".to_owned(), ToString::to_string);
            lines.push(format!("{path}: {} there, {} here", text(there), text(here)));
        }
    }
}

fn compare_scenes(there: &[SceneLine], here: &[SceneLine]) -> String {
    if there.len() != here.len() {
        return format!("scenes: {} there, {} here", there.len(), here.len());
    }
    let pairs = there.iter().zip(here);
    match pairs.filter(|(there, here)| there != here).map(|(there, here)| (&there.id, &here.id)).next() {
        Some((there, here)) if there == here => format!("scenes: {there} has other content"),
        Some((there, here)) => format!("scenes: {there} there, {here} here"),
        None => "scenes".to_owned(),
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::protocol::{EndingCollision, Wheelbase};
    use clap::Parser;

    fn resolve(arguments: &[&str]) -> Request {
        let line = ["sim", "run"].iter().chain(arguments);
        let cli::Command::Run(arguments) = cli::Cli::parse_from(line).command else { panic!("not a run") };
        Request::resolve(*arguments, 2).unwrap()
    }

    fn refusal(arguments: &[&str]) -> SettingsError {
        let line = ["sim", "run"].iter().chain(arguments);
        let cli::Command::Run(arguments) = cli::Cli::parse_from(line).command else { panic!("not a run") };
        Request::resolve(*arguments, 2).unwrap_err()
    }

    pub(crate) fn run_file(arguments: &[&str]) -> RunFile {
        let Request { settings, machine, .. } = resolve(arguments);
        let scenes = vec![SceneLine { id: "a".to_owned(), sha256: "00".to_owned() }];
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
            &["--set", "horizon=80", "--set", "wheelbase.of-length=0.6", "--set", "ending-collision=any"],
        ] {
            let file = run_file(arguments);
            let text = file.to_toml();
            assert_eq!(RunFile::parse(&text).unwrap(), file, "{text}");
        }
    }

    #[test]
    fn the_human_is_played_back_and_all_others_steer() {
        for driver in drivers::DRIVERS {
            let settings = resolve(&["--driver", driver.name]).settings;
            let Protocol::Strict(strict) = settings.protocol else { panic!("strict is the default") };
            assert_eq!(strict.motion == Motion::Playback, driver.name == "human");
        }
    }

    #[test]
    fn under_paper_all_move_alike_and_motion_is_no_choice() {
        for driver in drivers::DRIVERS {
            let settings = resolve(&["--driver", driver.name, "--protocol", "paper"]).settings;
            assert_eq!((&settings.protocol, settings.protocol.motion_name()), (&Protocol::Paper, "first-pose"));
        }
        let refused = refusal(&["--protocol", "paper", "--motion", "bicycle"]);
        assert!(matches!(refused, SettingsError::NotUnderPaper("--motion")));
        let refused = refusal(&["--protocol", "paper", "--set", "horizon=80"]);
        assert!(matches!(refused, SettingsError::NotUnderPaper("--set")));
    }

    #[test]
    fn only_the_human_is_played_back() {
        assert!(matches!(refusal(&["--motion", "playback"]), SettingsError::Playback));
        let own = refusal(&["--planner", "external", "--motion", "playback"]);
        assert!(matches!(own, SettingsError::Playback));
        let tracked = resolve(&["--driver", "human", "--motion", "bicycle"]).settings.protocol;
        assert_eq!(tracked, Protocol::default());
    }

    #[test]
    fn who_needs_predictions_is_not_left_without() {
        let refused = refusal(&["--driver", "gn-ctrv", "--predictor", "none"]);
        assert!(matches!(refused, SettingsError::NeedsPredictor("gn-ctrv")));
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
        assert_eq!(resolve(&[]).settings.driver, "idm");
        assert_eq!(resolve(&["--predictor", "none"]).settings.driver, "idm");
        assert_eq!(resolve(&["--predictor", "ctrv"]).settings.driver, "idm-ctrv");
        assert_eq!(resolve(&["--planner", "external", "--predictor", "ctrv"]).settings.driver, "external-ctrv");
        assert_eq!(resolve(&["--predictor", "ctrv", "--label", "mine"]).settings.driver, "mine");
    }

    #[test]
    fn differences_name_the_field_and_both_values() {
        let there = run_file(&["--deadline", "5s"]);
        assert_eq!(there.differences(&run_file(&["--parallel", "7"])), Vec::<String>::new());
        let here = run_file(&["--deadline", "3s", "--predictor", "ctrv"]);
        insta::assert_debug_snapshot!(there.differences(&here), @r#"
        [
            "settings.deadline-s: 5.0 there, 3.0 here",
            "settings.driver: \"idm\" there, \"idm-ctrv\" here",
            "settings.predictor: nothing there, { name = \"ctrv\", reads-log = false } here",
        ]
        "#);
        let mut other_scene = there.clone();
        other_scene.scenes[0].sha256 = "11".to_owned();
        assert_eq!(there.differences(&other_scene), ["scenes: a has other content"]);
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
