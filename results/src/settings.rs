//! What a run is, every default filled in: this is what `run.toml` holds.
//!
//! [`Settings`], [`Build`] and the scenes decide the results: a run is only continued where they are the same.
//! [`Machine`] does not touch a byte of them.

use std::collections::BTreeMap;
use std::time::Duration;

use clap::ValueEnum;
use episode::latency::Latency;
use episode::protocol::Protocol;
use episode::traffic::TrafficSettings;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use thiserror::Error;

use crate::files::hexadecimal;
use crate::version;

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

/// A `run.toml` that is none.
#[derive(Debug, Error)]
#[error("run.toml cannot be read: {0}\nhint: give another folder with --out, or remove this one")]
pub struct SettingsError(#[from] toml::de::Error);

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
    /// When plans take effect; none: at once.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub latency: Option<Latency>,
    /// Set where another run's drives were taken over.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fork: Option<Fork>,
    /// Agents that react; none: all do what they did in the log.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub traffic: Option<Traffic>,
}

/// Agents that react.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Traffic {
    /// Who drives them: a member of `traffic-node`, or a process of the user's.
    pub node: Node,
    /// Who is taken over from the log.
    pub hand_over: TrafficSettings,
}

/// All that tells one traffic from another: a setting that is as usual is left out.
impl std::fmt::Display for Traffic {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Node { name, command, options, .. } = &self.node;
        let who = command.as_ref().map_or_else(|| name.clone(), |command| format!("{name} `{command}`"));
        let seed = options.iter().skip_while(|option| *option != "--seed").nth(1).filter(|seed| *seed != "0");
        let all = std::iter::once(who).chain(seed.map(|seed| format!("seed {seed}"))).chain(self.hand_over.changes());
        f.write_str(&all.collect::<Vec<_>>().join(", "))
    }
}

/// From where drives were taken over: up to a step they are those of another run.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Fork {
    /// What the other run calls its driver.
    pub driver: String,
    /// The other run's digest.
    pub digest: String,
    /// The first step that is this driver's; before it the other run's recorded plans are driven.
    pub step: u32,
}

impl std::fmt::Display for Fork {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "forked at step {} of {}", self.step, self.driver)
    }
}

/// Which episodes are recorded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Record {
    /// Every one
    #[default]
    All,
    /// Those that end in a collision, off the route, without a route or with a failed driver
    Failures,
    /// None
    None,
}

/// Where plans come from.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "from")]
pub enum Planner {
    /// A member of `planner-node`.
    Node(Node),
    /// A command of the user's.
    Command {
        /// For the shell; a node's arguments are its `$@`.
        command: String,
        /// SHA-256, in hexadecimal digits, of the files that it names: a planner that was changed makes another run.
        #[serde(default)]
        files: BTreeMap<String, String>,
    },
    /// A process that the user starts.
    External,
}

/// A member of `planner-node`, `predictor-node` or `traffic-node`, or a process of the user's in such a place.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub struct Node {
    /// Its name there.
    pub name: String,
    /// Whether it reads the log itself.
    pub reads_log: bool,
    /// What it is told beside.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub options: Vec<String>,
    /// SHA-256, in hexadecimal digits, of the weights that it has.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub weights_sha256: Option<String>,
    /// For the shell, where it is no member but a command of the user's; a node's arguments are its `$@`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub command: Option<String>,
    /// SHA-256, in hexadecimal digits, of the files that the command names: a predictor that was changed makes another run.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub files: BTreeMap<String, String>,
}

impl Node {
    /// The member of that name, with nothing beside.
    #[must_use]
    pub fn named(name: &str, reads_log: bool) -> Self {
        Self {
            name: name.to_owned(),
            reads_log,
            options: Vec::new(),
            weights_sha256: None,
            command: None,
            files: BTreeMap::new(),
        }
    }
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
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub struct SceneLine {
    /// Its name.
    pub id: String,
    /// SHA-256 of its record, in hexadecimal digits; empty before it was driven, and where its record is damaged.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub sha256: String,
    /// What tells it from others of its name until all are driven.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fingerprint: Option<String>,
}

/// Where and how a run was run: nothing in its results depends on it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub struct Machine {
    /// Episodes driven at a time.
    pub parallel: u16,
    /// Whether the driver is in the sim's own process, in the place of nodes.
    #[serde(default)]
    pub in_process: bool,
    /// Whether each worker and its nodes are kept on one core.
    #[serde(default)]
    pub pin: bool,
    /// How long nodes may take to start (s).
    pub start_timeout_s: f64,
    /// Where nodes connect, if it was asked for.
    pub endpoint: Option<String>,
    /// Where the network's weights are, if not built in.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub weights: Option<String>,
    /// Where the trace is by which plans take effect.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub latency_trace: Option<String>,
    /// The scenes, as they were asked for; none for the built-in demo set.
    pub scenarios: Vec<String>,
    /// Common names of the certificates that the planner of other hosts may have; none where it needs none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub planner_certificates: Vec<String>,
    /// The user's Zenoh configuration, if there was one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub zenoh_config: Option<ZenohConfig>,
    /// In which shards it is driven, if it is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shards: Option<Shards>,
}

/// What pins a run that is driven in shards.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Shards {
    /// How many there are.
    pub count: u32,
    /// [`RunFile::identity`] as the run was begun; every episode has it too.
    pub sha256: String,
    /// What was typed, but for which shard: who drives what is missing types it again.
    pub command: Vec<String>,
}

/// A Zenoh configuration that was used. What it says stays where it is: there may be secrets.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ZenohConfig {
    /// The file, from the root.
    pub path: String,
    /// SHA-256 of its bytes, in hexadecimal digits.
    pub sha256: String,
}

impl Settings {
    /// Whether predictions are the log's own future.
    #[must_use]
    pub fn predicts_by_the_log(&self) -> bool {
        self.predictor.as_ref().is_some_and(|predictor| predictor.reads_log)
    }

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
    /// [`SettingsError`].
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

    /// What makes it this run and no other: SHA-256 of its settings, its build and the names of its scenes, in hexadecimal digits. Each episode
    /// has it, so that those of another run are not taken for its own.
    #[must_use]
    pub fn identity(&self) -> String {
        let mut hash = Sha256::new();
        hash.update(self.to_recorded_toml());
        // No name has a line's end in it.
        self.scenes.iter().for_each(|line| hash.update(format!("\n{}", line.id)));
        hexadecimal(&hash.finalize())
    }

    /// The same once its scenes were read: with their SHA-256, in their order.
    #[must_use]
    pub fn with_hashes(&self, hashes: impl IntoIterator<Item = String>) -> Self {
        let line = |(line, sha256): (&SceneLine, String)| SceneLine { id: line.id.clone(), sha256, fingerprint: None };
        Self { scenes: self.scenes.iter().zip(hashes).map(line).collect(), ..self.clone() }
    }

    /// Whether its scenes have been read: all had been when it was finished.
    #[must_use]
    pub fn has_hashes(&self) -> bool {
        self.scenes.iter().all(|line| line.fingerprint.is_none())
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
#[allow(clippy::unwrap_used, reason = "a test may panic")]
pub(crate) mod tests {
    use super::*;

    /// A run of one scene under the usual settings.
    pub(crate) fn run_file() -> RunFile {
        let planner = Planner::Node(Node::named("idm", false));
        RunFile {
            settings: Settings {
                driver: "idm".to_owned(),
                deadline_s: 5.0,
                record: Record::All,
                planner,
                predictor: None,
                protocol: Protocol::default(),
                latency: None,
                fork: None,
                traffic: None,
            },
            build: Build::this(),
            machine: Machine {
                parallel: 2,
                in_process: false,
                pin: false,
                start_timeout_s: 20.0,
                endpoint: None,
                weights: None,
                latency_trace: None,
                scenarios: Vec::new(),
                planner_certificates: Vec::new(),
                zenoh_config: None,
                shards: None,
            },
            scenes: vec![SceneLine { id: "a".to_owned(), sha256: "00".to_owned(), fingerprint: None }],
        }
    }

    #[test]
    fn a_traffic_is_named_with_all_that_tells_it_from_others() {
        let named = |node: Node| Traffic { node, hand_over: TrafficSettings::default() }.to_string();
        let seeded =
            |seed: &str| Node { options: ["--seed", seed].map(str::to_owned).into(), ..Node::named("mixed", false) };
        assert_eq!((named(seeded("0")), named(seeded("7"))), ("mixed".to_owned(), "mixed, seed 7".to_owned()));
        let own = Node { command: Some("mine --fast".to_owned()), ..Node::named("command", false) };
        assert_eq!(named(own.clone()), "command `mine --fast`");
        let hand_over = TrafficSettings { radius: 80.0, ..TrafficSettings::default() };
        assert_eq!(Traffic { node: own, hand_over }.to_string(), "command `mine --fast`, radius = 80.0");
    }

    #[test]
    fn differences_name_the_field_and_both_values() {
        let there = run_file();
        let mut here = run_file();
        here.machine.parallel = 7;
        assert_eq!(there.differences(&here), Vec::<String>::new());
        here.settings.deadline_s = 3.0;
        here.settings.driver = "idm-ctrv".to_owned();
        here.settings.predictor = Some(Node::named("ctrv", false));
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
}
