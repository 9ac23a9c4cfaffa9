//! Every key of the bus, built and parsed in this one file.
//!
//! | key | what |
//! | --- | --- |
//! | `reloop/{run}/{worker}/{scene}/{channel}` | a message of an episode between the sim and its nodes, see [`Channel`] |
//! | `reloop/{run}/@tape/{worker}/{scene}/{channel}` | all that is said in an episode, told again by the sim in order, for whoever listens in |
//! | `reloop/{run}/info` | the settings of the run |
//! | `reloop/{run}/@node/{role}/{worker}/{name}/{version}` | liveliness of a node; `all` is the worker of a node that serves all |

use std::fmt;
use std::str::FromStr;

use thiserror::Error;
use world::scene::SceneId;

use crate::WIRE_VERSION;

const ROOT: &str = "reloop";
const NODES: &str = "@node";
const TAPE: &str = "@tape";
const ALL: &str = "all";

/// Why a text cannot be part of a key.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{what} {text:?} cannot be part of a bus key: use 1 to 128 of A-Z a-z 0-9 _ . -, not beginning with a dot")]
pub struct KeyError {
    what: &'static str,
    text: String,
}

fn check(what: &'static str, text: &str) -> Result<String, KeyError> {
    // A scene's name obeys the same rule, so that it is a key as it is.
    match SceneId::new(text) {
        Ok(_) => Ok(text.to_owned()),
        Err(_) => Err(KeyError { what, text: text.chars().take(140).collect() }),
    }
}

/// The name of a run.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct RunName(String);

impl FromStr for RunName {
    type Err = KeyError;
    fn from_str(text: &str) -> Result<Self, KeyError> {
        check("run name", text).map(Self)
    }
}

impl fmt::Display for RunName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&self.0)
    }
}

/// One of the lines on which a run drives its episodes, one after the other: `w0`, `w1` ...
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Worker(String);

impl Worker {
    /// Worker `number`.
    #[must_use]
    pub fn numbered(number: usize) -> Self {
        Self(format!("w{number}"))
    }
}

impl FromStr for Worker {
    type Err = KeyError;
    fn from_str(text: &str) -> Result<Self, KeyError> {
        if text == ALL {
            return Err(KeyError { what: "worker", text: text.to_owned() });
        }
        check("worker", text).map(Self)
    }
}

impl fmt::Display for Worker {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&self.0)
    }
}

/// The workers that a node serves.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Workers {
    /// Every worker: a node that somebody started by hand.
    All,
    /// One worker.
    One(Worker),
}

impl Workers {
    /// Whether `worker` is one of them.
    #[must_use]
    pub fn serve(&self, worker: &Worker) -> bool {
        match self {
            Self::All => true,
            Self::One(own) => own == worker,
        }
    }

    fn selector(&self) -> &str {
        match self {
            Self::All => "*",
            Self::One(worker) => &worker.0,
        }
    }
}

impl FromStr for Workers {
    type Err = KeyError;
    fn from_str(text: &str) -> Result<Self, KeyError> {
        if text == "*" || text == ALL { Ok(Self::All) } else { text.parse().map(Self::One) }
    }
}

impl fmt::Display for Workers {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::All => f.pad("*"),
            Self::One(worker) => worker.fmt(f),
        }
    }
}

/// What a message of an episode is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Channel {
    /// `Scene`, from the sim.
    Scene,
    /// `Observation`, from the sim.
    Observation,
    /// `Prediction`, from a predictor.
    Prediction,
    /// `Plan`, from a planner.
    Plan,
    /// `StepRecord`, from the sim.
    Record,
    /// `Event`, from the sim.
    Event,
    /// `EpisodeEnd`, from the sim.
    End,
    /// `Recorded`, from the recorder.
    Recorded,
}

impl Channel {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::Scene,
        Self::Observation,
        Self::Prediction,
        Self::Plan,
        Self::Record,
        Self::Event,
        Self::End,
        Self::Recorded,
    ];

    /// Its name in keys.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Scene => "scene",
            Self::Observation => "observation",
            Self::Prediction => "prediction",
            Self::Plan => "plan",
            Self::Record => "record",
            Self::Event => "event",
            Self::End => "end",
            Self::Recorded => "recorded",
        }
    }
}

/// What a node does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Role {
    /// The simulator itself: its token tells nodes that the run is on.
    Sim,
    /// Answers observations with plans.
    Planner,
    /// Answers observations with predictions.
    Predictor,
    /// Writes episodes down.
    Recorder,
}

impl Role {
    const ALL: [Self; 4] = [Self::Sim, Self::Planner, Self::Predictor, Self::Recorder];
}

impl fmt::Display for Role {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Sim => "sim",
            Self::Planner => "planner",
            Self::Predictor => "predictor",
            Self::Recorder => "recorder",
        })
    }
}

/// Where a message belongs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Address {
    /// The worker that drives the episode.
    pub worker: Worker,
    /// The episode.
    pub scene: SceneId,
    /// What it is.
    pub channel: Channel,
}

impl Address {
    /// The key of this message in `run`.
    #[must_use]
    pub fn key(&self, run: &RunName) -> String {
        format!("{ROOT}/{run}/{}/{}/{}", self.worker, self.scene, self.channel.name())
    }

    /// The key under which the sim tells this message to whoever listens in.
    #[must_use]
    pub fn tape_key(&self, run: &RunName) -> String {
        format!("{ROOT}/{run}/{TAPE}/{}/{}/{}", self.worker, self.scene, self.channel.name())
    }

    /// What `key` means, if it is a message of an episode.
    #[must_use]
    pub fn parse(key: &str) -> Option<Self> {
        let mut chunks = key.split('/').peekable();
        let (root, _run) = (chunks.next()?, chunks.next()?);
        let _tape = chunks.next_if_eq(&TAPE);
        let (worker, scene, channel) = (chunks.next()?, chunks.next()?, chunks.next()?);
        if root != ROOT || chunks.next().is_some() {
            return None;
        }
        let channel = Channel::ALL.into_iter().find(|known| known.name() == channel)?;
        Some(Self { worker: worker.parse().ok()?, scene: SceneId::new(scene).ok()?, channel })
    }
}

/// Selects the messages of one channel, of every episode of these workers.
#[must_use]
pub fn channel(run: &RunName, workers: &Workers, channel: Channel) -> String {
    format!("{ROOT}/{run}/{}/*/{}", workers.selector(), channel.name())
}

/// Selects what is told of one channel to whoever listens in.
#[must_use]
pub fn tape(run: &RunName, workers: &Workers, channel: Channel) -> String {
    format!("{ROOT}/{run}/{TAPE}/{}/*/{}", workers.selector(), channel.name())
}

/// The key of the run's settings.
#[must_use]
pub fn info(run: &RunName) -> String {
    format!("{ROOT}/{run}/info")
}

/// Who a node is, as its liveliness token says.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct NodeId {
    /// What it does.
    pub role: Role,
    /// Whom it serves.
    pub workers: Workers,
    /// Its own name, for people; and to tell a restarted node from the one before.
    pub name: String,
    /// The version of the messages it speaks, see [`WIRE_VERSION`].
    pub version: u32,
}

impl NodeId {
    /// A node of this build.
    ///
    /// # Errors
    /// [`KeyError`] where `name` cannot be part of a key.
    pub fn new(role: Role, workers: Workers, name: &str) -> Result<Self, KeyError> {
        Ok(Self { role, workers, name: check("node name", name)?, version: WIRE_VERSION })
    }

    /// The key of its liveliness token.
    #[must_use]
    pub fn key(&self, run: &RunName) -> String {
        let worker = match &self.workers {
            Workers::All => ALL,
            Workers::One(worker) => &worker.0,
        };
        format!("{ROOT}/{run}/{NODES}/{}/{worker}/{}/{}", self.role, self.name, self.version)
    }

    /// Who `key` is the token of.
    #[must_use]
    pub fn parse(key: &str) -> Option<Self> {
        let mut chunks = key.split('/');
        let (root, _run, nodes) = (chunks.next()?, chunks.next()?, chunks.next()?);
        let (role, worker, name, version) = (chunks.next()?, chunks.next()?, chunks.next()?, chunks.next()?);
        if root != ROOT || nodes != NODES || chunks.next().is_some() {
            return None;
        }
        Some(Self {
            role: Role::ALL.into_iter().find(|known| known.to_string() == role)?,
            workers: worker.parse().ok()?,
            name: check("node name", name).ok()?,
            version: version.parse().ok()?,
        })
    }
}

impl fmt::Display for NodeId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {} (worker {})", self.role, self.name, self.workers)
    }
}

/// Selects the liveliness tokens of all nodes, or of one role.
#[must_use]
pub fn nodes(run: &RunName, role: Option<Role>) -> String {
    let role = role.map_or_else(|| "*".to_owned(), |role| role.to_string());
    format!("{ROOT}/{run}/{NODES}/{role}/*/*/*")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run() -> RunName {
        "demo-1".parse().unwrap()
    }

    #[test]
    fn an_address_survives_its_key() {
        for channel in Channel::ALL {
            let address = Address { worker: Worker::numbered(3), scene: SceneId::new("a.b-C_1").unwrap(), channel };
            assert_eq!(Address::parse(&address.key(&run())), Some(address.clone()));
            assert_eq!(Address::parse(&address.tape_key(&run())), Some(address));
        }
    }

    #[test]
    fn a_node_survives_its_key() {
        for workers in [Workers::All, Workers::One(Worker::numbered(0))] {
            let node = NodeId::new(Role::Planner, workers, "idm-0").unwrap();
            assert_eq!(NodeId::parse(&node.key(&run())), Some(node));
        }
    }

    #[test]
    fn foreign_keys_are_nobodys() {
        for key in [
            "",
            "reloop",
            "reloop/r/w0/s",
            "reloop/r/w0/s/plan/x",
            "other/r/w0/s/plan",
            "reloop/r/w0/s/poem",
            "reloop/r/w0//plan",
        ] {
            assert_eq!(Address::parse(key), None, "{key}");
        }
        for key in ["reloop/r/@node/planner/w0/n/x", "reloop/r/@node/cook/w0/n/1", "reloop/r/node/planner/w0/n/1"] {
            assert_eq!(NodeId::parse(key), None, "{key}");
        }
    }

    #[test]
    fn wildcards_and_slashes_are_no_names() {
        for text in ["", "a/b", "*", "a*", "@x", "a?b", "a#", ".x", "all"] {
            assert!(text.parse::<Worker>().is_err(), "{text}");
        }
        assert_eq!("*".parse::<Workers>(), Ok(Workers::All));
    }

    #[test]
    fn the_selectors_match_what_they_should() {
        use zenoh::key_expr::KeyExpr;
        let matches = |selector: &str, key: &str| {
            KeyExpr::try_from(selector).unwrap().intersects(&KeyExpr::try_from(key).unwrap())
        };
        let address =
            Address { worker: Worker::numbered(0), scene: SceneId::new("s").unwrap(), channel: Channel::Plan };
        let node = NodeId::new(Role::Sim, Workers::All, "sim").unwrap();
        assert!(matches(&channel(&run(), &Workers::All, Channel::Plan), &address.key(&run())));
        assert!(!matches(&channel(&run(), &Workers::One(Worker::numbered(1)), Channel::Plan), &address.key(&run())));
        assert!(!matches(&channel(&run(), &Workers::All, Channel::Plan), &node.key(&run())));
        assert!(!matches(&channel(&run(), &Workers::All, Channel::Plan), &address.tape_key(&run())));
        assert!(matches(&tape(&run(), &Workers::All, Channel::Plan), &address.tape_key(&run())));
        assert!(!matches("reloop/**", &address.tape_key(&run())));
        assert!(matches(&nodes(&run(), None), &node.key(&run())));
        assert!(!matches(&nodes(&run(), Some(Role::Planner)), &node.key(&run())));
    }
}
