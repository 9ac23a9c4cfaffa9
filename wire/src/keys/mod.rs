//! Every key of the bus, built and parsed in this one module.
//!
//! | key | what |
//! | --- | --- |
//! | `reloop/{run}/info` | the settings of the run |
//! | `reloop/{run}/@node/sim/all/sim/{version}` | liveliness of the sim |
//! | `reloop/{run}/@tape/{worker}/{scene}/{channel}` | all that is said in an episode, told again by the sim in order, for whoever listens in |
//! | `{seat}/@node/{role}/{worker}/{name}/{session}/{version}` | liveliness of a node; `all` is the worker of a node that serves all |
//! | `{seat}/@door/{session}` | whether the sim lets a node in |
//! | `{seat}/{worker}/told` | all that the sim tells the node of a worker's episodes, in order |
//! | `{seat}/{worker}/{channel}/{session}` | what the node of that session answers |
//! | `{seat}/@tape/{worker}/{scene}/{channel}` | the tape, for the recorder |
//!
//! | `reloop/@service-{secret}/{version}/ask` | what a service is asked |
//!
//! A `{seat}` is `reloop/{run}/@seat-{secret}`: see [`Place`].
//!
//! | file | what |
//! | --- | --- |
//! | `mod.rs` | the parts of keys: runs, workers, channels, roles |
//! | `place.rs` | seats and their secrets, and what is said there |
//! | `address.rs` | where a message of the tape belongs |
//! | `node.rs` | who a node is |
//! | `service.rs` | where a service is asked |

mod address;
mod node;
mod place;
mod service;

use std::fmt;
use std::str::FromStr;

use thiserror::Error;
use world::scene::SceneId;

pub use address::Address;
pub use node::NodeId;
pub use place::{Answering, Place, Secret, info};
pub use service::{SERVICE_VERSION, ServiceKey};

const ROOT: &str = "reloop";
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

    /// As a token says it: a key with a wildcard is no token.
    fn in_token(&self) -> &str {
        match self {
            Self::All => ALL,
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
    /// `TrafficMoves`, from who drives agents that react.
    Moves,
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
    pub const ALL: [Self; 9] = [
        Self::Scene,
        Self::Observation,
        Self::Prediction,
        Self::Plan,
        Self::Moves,
        Self::Record,
        Self::Event,
        Self::End,
        Self::Recorded,
    ];

    fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|known| known.name() == name)
    }

    /// Its name in keys.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Scene => "scene",
            Self::Observation => "observation",
            Self::Prediction => "prediction",
            Self::Plan => "plan",
            Self::Moves => "moves",
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
    /// Answers observations with where the agents are next that react.
    Traffic,
    /// Writes episodes down.
    Recorder,
}

impl Role {
    const ALL: [Self; 5] = [Self::Sim, Self::Planner, Self::Predictor, Self::Traffic, Self::Recorder];

    /// What a node of this role answers with; none for the sim.
    #[must_use]
    pub fn answers_with(self) -> Option<Channel> {
        match self {
            Self::Sim => None,
            Self::Planner => Some(Channel::Plan),
            Self::Predictor => Some(Channel::Prediction),
            Self::Traffic => Some(Channel::Moves),
            Self::Recorder => Some(Channel::Recorded),
        }
    }
}

impl fmt::Display for Role {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Sim => "sim",
            Self::Planner => "planner",
            Self::Predictor => "predictor",
            Self::Traffic => "traffic",
            Self::Recorder => "recorder",
        })
    }
}

#[cfg(test)]
mod tests {
    use zenoh::key_expr::KeyExpr;

    use super::*;

    fn run() -> RunName {
        "demo-1".parse().unwrap()
    }

    fn places() -> [Place; 2] {
        [Place::open_floor(&run()), Place::seat(&run(), &Secret::random().unwrap()).unwrap()]
    }

    fn address(channel: Channel) -> Address {
        Address { worker: Worker::numbered(3), scene: SceneId::new("a.b-C_1").unwrap(), channel }
    }

    fn matches(selector: &str, key: &str) -> bool {
        KeyExpr::try_from(selector).unwrap().intersects(&KeyExpr::try_from(key).unwrap())
    }

    #[test]
    fn what_is_told_and_answered_survives_its_key() {
        for place in places() {
            for channel in Channel::ALL {
                let address = address(channel);
                assert_eq!(Address::parse(&place.tape(&address)), Some(address));
                let answer = Answering { worker: Worker::numbered(0), channel, session: "4f".to_owned() };
                assert_eq!(Answering::parse(&place.answer(&answer)), Some(answer));
            }
            let workers = Workers::One(Worker::numbered(7));
            assert_eq!(Place::told_of(&place.told(&workers)), Some(Worker::numbered(7)));
        }
    }

    #[test]
    fn a_node_survives_its_key() {
        for place in places() {
            for workers in [Workers::All, Workers::One(Worker::numbered(0))] {
                let node = NodeId::new(Role::Planner, workers, "idm-0", "a1b2").unwrap();
                assert_eq!(NodeId::parse(&node.key(&place)), Some(node));
            }
            assert_eq!(NodeId::parse(&NodeId::sim().key(&place)), Some(NodeId::sim()));
        }
    }

    #[test]
    fn foreign_keys_are_nobodys() {
        for key in [
            "",
            "reloop",
            "reloop/r/w0/s",
            "reloop/r/w0/s/plan",
            "other/r/@tape/w0/s/plan",
            "reloop/r/@tape/w0/s/poem",
            "reloop/r/@tape/w0//plan",
            "reloop/r/@tape/w0/s/plan/x",
            "reloop/r/@seat-/@tape/w0/s/plan",
        ] {
            assert_eq!(Address::parse(key), None, "{key}");
        }
        for key in [
            "reloop/r/@node/planner/w0/n/s/x",
            "reloop/r/@node/cook/w0/n/s/1",
            "reloop/r/node/planner/w0/n/s/1",
            "reloop/r/@node/planner/w0/n/s/t/1",
        ] {
            assert_eq!(NodeId::parse(key), None, "{key}");
        }
        for key in ["reloop/r/w0/plan", "reloop/r/w0/poem/s", "reloop/r/all/plan/s", "reloop/r/w0/plan/"] {
            assert_eq!(Answering::parse(key), None, "{key}");
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
    fn a_secret_that_is_no_key_is_refused_and_never_shown() {
        let secret = Secret::from("sword/fish");
        let error = Place::seat(&run(), &secret).unwrap_err();
        assert!(!error.to_string().contains("sword"), "{error}");
        assert_eq!(format!("{secret:?}"), "Secret(..)");
    }

    #[test]
    fn the_selectors_match_what_they_should() {
        let [open, seat] = places();
        let w0 = Workers::One(Worker::numbered(0));
        let plan = Answering { worker: Worker::numbered(0), channel: Channel::Plan, session: "4f".to_owned() };
        let node = NodeId::new(Role::Planner, Workers::All, "n", "4f").unwrap();
        assert!(matches(&seat.told(&Workers::All), &seat.told(&w0)));
        assert!(!matches(&seat.told(&Workers::One(Worker::numbered(1))), &seat.told(&w0)));
        let tape = seat.tape(&address(Channel::Plan));
        assert!(matches(&seat.tape_channel(&Workers::All, Channel::Plan), &tape));
        assert!(!matches(&seat.tape_channel(&Workers::All, Channel::End), &tape));
        assert!(matches(&seat.nodes(), &node.key(&seat)));
        assert!(matches(&seat.sim(), &NodeId::sim().key(&open)));
        let all = |place: &Place, key: &str| place.everything().iter().filter(|one| matches(one, key)).count();
        for key in [seat.told(&w0), seat.answer(&plan), tape, seat.door("4f")] {
            assert_eq!((all(&seat, &key), all(&open, &key)), (1, 0), "{key}: heard at its place alone");
            assert!(!matches("**", &key) && !matches("reloop/*/*/**", &key), "{key}: no wildcard finds it");
        }
        assert_eq!(all(&open, "reloop/demo-1/w0/s/plan"), 1, "whoever speaks into the open is heard");
    }
}
