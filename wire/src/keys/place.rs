//! Where a node sits: keys that only the sim and that node know.
//!
//! A chunk that begins with `@` is matched by itself alone and by no wildcard. So keys with a secret behind an `@` can be
//! neither guessed nor found by listening to everything: who was not told the secret hears nothing there, and says nothing.

use std::fmt;
use std::fs::File;
use std::io::{self, Read};

use super::{Address, Channel, KeyError, ROOT, RunName, Worker, Workers, check};

const SEAT: &str = "@seat-";
const TAPE: &str = "@tape";
const DOOR: &str = "@door";
const NODES: &str = "@node";
const TOLD: &str = "told";

/// What only the simulator and a node know.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Secret(String);

impl Secret {
    /// The environment variable that tells a node its own. No argument does: everybody on a machine can read those.
    pub const VARIABLE: &'static str = "RELOOP_SECRET";

    /// A new one: 128 bits of the system's randomness.
    ///
    /// # Errors
    /// Where the system gives none.
    pub fn random() -> io::Result<Self> {
        let mut bits = [0; 16];
        File::open("/dev/urandom")?.read_exact(&mut bits)?;
        Ok(Self(bits.iter().map(|byte| format!("{byte:02x}")).collect()))
    }

    /// The one that this process was told, if any.
    #[must_use]
    pub fn of_this_process() -> Option<Self> {
        std::env::var(Self::VARIABLE).ok().filter(|text| !text.is_empty()).map(Self)
    }

    /// The secret itself, to hand on to the node that it is for.
    #[must_use]
    pub fn reveal(&self) -> &str {
        &self.0
    }
}

impl From<&str> for Secret {
    fn from(text: &str) -> Self {
        Self(text.to_owned())
    }
}

impl fmt::Debug for Secret {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Secret(..)")
    }
}

/// A seat of a run, or the run's open floor, where whoever was told no secret stands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    run: RunName,
    secret: Option<Secret>,
}

/// Whose answer a key is: as the key says, which only who sits there can say.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Answering {
    /// The worker whose episode it is about.
    pub worker: Worker,
    /// What it is.
    pub channel: Channel,
    /// The bus session of the node.
    pub session: String,
}

impl Place {
    /// The seat behind `secret`.
    ///
    /// # Errors
    /// [`KeyError`] where the secret cannot be part of a key.
    pub fn seat(run: &RunName, secret: &Secret) -> Result<Self, KeyError> {
        // The error does not hold the secret: it will be shown.
        check("secret", &secret.0).map_err(|_| KeyError { what: "the secret", text: "***".to_owned() })?;
        Ok(Self { run: run.clone(), secret: Some(secret.clone()) })
    }

    /// Where everybody may stand.
    #[must_use]
    pub fn open_floor(run: &RunName) -> Self {
        Self { run: run.clone(), secret: None }
    }

    /// The place that `key` belongs to.
    #[must_use]
    pub fn of(key: &str) -> Option<Self> {
        Some(split(key)?.0)
    }

    /// Whether it takes no secret to be here.
    #[must_use]
    pub fn is_open(&self) -> bool {
        self.secret.is_none()
    }

    fn prefix(&self) -> String {
        match &self.secret {
            Some(secret) => format!("{ROOT}/{}/{SEAT}{}", self.run, secret.0),
            None => format!("{ROOT}/{}", self.run),
        }
    }

    /// The key, or the selector, of what the sim tells of the episodes of `workers`.
    #[must_use]
    pub fn told(&self, workers: &Workers) -> String {
        format!("{}/{}/{TOLD}", self.prefix(), workers.selector())
    }

    /// The worker of a [`Place::told`] key.
    #[must_use]
    pub fn told_of(key: &str) -> Option<Worker> {
        match split(key)?.1.as_slice() {
            [worker, TOLD] => worker.parse().ok(),
            _ => None,
        }
    }

    /// The key of an answer.
    #[must_use]
    pub fn answer(&self, of: &Answering) -> String {
        format!("{}/{}/{}/{}", self.prefix(), of.worker, of.channel.name(), of.session)
    }

    /// The key of the sim's word to the node of this session.
    #[must_use]
    pub fn door(&self, session: &str) -> String {
        format!("{}/{DOOR}/{session}", self.prefix())
    }

    /// The key under which a message is told to whoever listens in here.
    #[must_use]
    pub fn tape(&self, address: &Address) -> String {
        format!("{}/{TAPE}/{}/{}/{}", self.prefix(), address.worker, address.scene, address.channel.name())
    }

    /// Selects what is told of one channel of all episodes of these workers to whoever listens in here.
    #[must_use]
    pub fn tape_channel(&self, workers: &Workers, channel: Channel) -> String {
        format!("{}/{TAPE}/{}/*/{}", self.prefix(), workers.selector(), channel.name())
    }

    /// Selects all that is told to whoever listens in here.
    #[must_use]
    pub fn whole_tape(&self) -> String {
        format!("{}/{TAPE}/**", self.prefix())
    }

    /// Selects the liveliness tokens of the nodes that are here.
    #[must_use]
    pub fn nodes(&self) -> String {
        format!("{}/{NODES}/**", self.prefix())
    }

    /// Selects the sim's liveliness token. It is on the open floor, whatever the place.
    #[must_use]
    pub fn sim(&self) -> String {
        format!("{ROOT}/{}/{NODES}/sim/**", self.run)
    }

    pub(super) fn token(&self, rest: &str) -> String {
        format!("{}/{NODES}/{rest}", self.prefix())
    }

    /// Selects all else that can be said here: together they match whatever somebody puts at this place.
    #[must_use]
    pub fn everything(&self) -> [String; 3] {
        ["**", "@tape/**", "@door/**"].map(|rest| format!("{}/{rest}", self.prefix()))
    }
}

impl Answering {
    /// Whose answer `key` is, if it is one.
    #[must_use]
    pub fn parse(key: &str) -> Option<Self> {
        let (_, rest) = split(key)?;
        let [worker, channel, session] = rest.as_slice() else { return None };
        let channel = Channel::named(channel)?;
        Some(Self { worker: worker.parse().ok()?, channel, session: check("session", session).ok()? })
    }
}

/// The key of the run's settings.
#[must_use]
pub fn info(run: &RunName) -> String {
    format!("{ROOT}/{run}/info")
}

/// The place that `key` belongs to, and the chunks that follow.
pub(super) fn split(key: &str) -> Option<(Place, Vec<&str>)> {
    let mut chunks = key.split('/').peekable();
    if chunks.next()? != ROOT {
        return None;
    }
    let run = chunks.next()?.parse().ok()?;
    let secret = chunks.next_if(|chunk| chunk.starts_with(SEAT)).map(|chunk| Secret(chunk[SEAT.len()..].to_owned()));
    if let Some(secret) = &secret {
        check("secret", &secret.0).ok()?;
    }
    Some((Place { run, secret }, chunks.collect()))
}

/// The chunks of a message of the tape, wherever it is told.
pub(super) fn on_tape(key: &str) -> Option<[&str; 3]> {
    match split(key)?.1.as_slice() {
        [TAPE, worker, scene, channel] => Some([worker, scene, channel]),
        _ => None,
    }
}

/// The chunks of a liveliness token, wherever it is shown.
pub(super) fn in_token(key: &str) -> Option<Vec<&str>> {
    let (_, mut chunks) = split(key)?;
    (chunks.first() == Some(&NODES)).then(|| chunks.split_off(1))
}
