//! Between messages and the world's types. What comes from outside is checked here, once: every number finite, every
//! enumeration known, every list bounded, columns of one length. No input makes it panic.
//!
//! | module | what |
//! | --- | --- |
//! | `agents` | agents, their kinds and states, signals |
//! | `map` | the map |
//! | `scene` | the briefing (message `Scene`) and the reference line |
//! | `observation` | observations |
//! | `answers` | plans and predictions |
//! | `traffic` | where agents are that react |
//! | `packed` | predictions, read fast |
//! | [`compact`] | predictions, as recordings hold them |

mod agents;
mod answers;
pub mod compact;
mod map;
mod observation;
mod packed;
mod scene;
#[cfg(test)]
mod tests;
mod traffic;

pub use observation::{by_number, observation};
pub use packed::prediction;
pub use scene::reference_line;
use thiserror::Error;

use crate::proto;

/// Why a message from outside is refused.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum MessageError {
    /// It is larger than any honest one.
    #[error("a {message} of {bytes} bytes; at most {limit} are taken")]
    TooBig {
        /// Which message.
        message: &'static str,
        /// Its size.
        bytes: usize,
        /// The most that is taken.
        limit: usize,
    },
    /// It is not this message at all.
    #[error("these bytes are no {message}: {reason}")]
    Malformed {
        /// Which message was expected.
        message: &'static str,
        /// What the decoder says.
        reason: String,
    },
    /// A field holds what it must not.
    #[error("{message}: field {field} {problem}")]
    Field {
        /// Which message.
        message: &'static str,
        /// Path of the field.
        field: String,
        /// What is wrong with it.
        problem: Problem,
    },
    /// It is for another episode than the one that is on.
    #[error("it is for episode {got}, but episode {expected} is on")]
    OtherEpisode {
        /// The number of the one that is on.
        expected: u64,
        /// The one that it says.
        got: u64,
    },
    /// The node says that it cannot answer, and why.
    #[error("it cannot answer: {0}")]
    Refused(String),
}

/// What is wrong with a field.
#[derive(Clone, Debug, PartialEq, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum Problem {
    #[error("is missing")]
    Missing,
    #[error("is not finite")]
    NotFinite,
    #[error("is {0}, but must not be negative")]
    Negative(f64),
    #[error("has the unknown value {0}")]
    UnknownValue(i32),
    #[error("has {got} entries, but at most {limit} are taken")]
    TooLong { limit: usize, got: usize },
    #[error("has {got} entries, but the columns beside it have {expected}")]
    UnequalColumns { expected: usize, got: usize },
    #[error("has the index {index}, but the line has {samples} samples")]
    OutOfRange { index: u32, samples: usize },
    #[error("is no name: {0}")]
    BadName(String),
}

/// A [`Problem`] and the path that leads to it, without the message's name.
#[derive(Clone, Debug, PartialEq)]
struct FieldError {
    path: String,
    problem: Problem,
}

impl FieldError {
    fn new(field: &str, problem: Problem) -> Self {
        Self { path: field.to_owned(), problem }
    }

    fn of(self, message: &'static str) -> MessageError {
        MessageError::Field { message, field: self.path, problem: self.problem }
    }
}

type Checked<T> = Result<T, FieldError>;

/// Puts the names of the outer fields before the inner one's; costs nothing until something is wrong.
trait Within {
    fn within(self, field: &str) -> Self;
    fn at(self, field: &str, index: usize) -> Self;
}

impl<T> Within for Checked<T> {
    fn within(self, field: &str) -> Self {
        self.map_err(|e| FieldError { path: format!("{field}.{}", e.path), ..e })
    }

    fn at(self, field: &str, index: usize) -> Self {
        self.map_err(|e| FieldError { path: format!("{field}[{index}].{}", e.path), ..e })
    }
}

fn required<T>(field: &str, value: Option<T>) -> Checked<T> {
    value.ok_or_else(|| FieldError::new(field, Problem::Missing))
}

fn finite(field: &str, value: f64) -> Checked<f64> {
    if value.is_finite() { Ok(unsigned(value)) } else { Err(FieldError::new(field, Problem::NotFinite)) }
}

/// The value, and 0 for -0. Prost sends nothing for -0, Google's protobuf its sign: one driver in two languages would come to differ.
fn unsigned(value: f64) -> f64 {
    value + 0.0
}

fn not_negative(field: &str, value: f64) -> Checked<f64> {
    let value = finite(field, value)?;
    if value < 0.0 { Err(FieldError::new(field, Problem::Negative(value))) } else { Ok(value) }
}

fn all_finite(field: &str, values: &[f64]) -> Checked<()> {
    match values.iter().position(|value| !value.is_finite()) {
        None => Ok(()),
        Some(index) => Err(FieldError::new(&format!("{field}[{index}]"), Problem::NotFinite)),
    }
}

fn all_unsigned(mut values: Vec<f64>) -> Vec<f64> {
    values.iter_mut().for_each(|value| *value = unsigned(*value));
    values
}

fn bounded(field: &str, limit: usize, got: usize) -> Checked<()> {
    if got <= limit { Ok(()) } else { Err(FieldError::new(field, Problem::TooLong { limit, got })) }
}

fn same_length(field: &str, expected: usize, got: usize) -> Checked<()> {
    if got == expected { Ok(()) } else { Err(FieldError::new(field, Problem::UnequalColumns { expected, got })) }
}

/// Converts each entry of a list that has at most `limit` of them.
fn each<P, W>(field: &str, limit: usize, list: Vec<P>, convert: impl Fn(P) -> Checked<W>) -> Checked<Vec<W>> {
    bounded(field, limit, list.len())?;
    list.into_iter().enumerate().map(|(index, entry)| convert(entry).at(field, index)).collect()
}

/// A message of the bus: its name for people, and the size above which it is not even looked at. That bounds the memory which a
/// hostile one can claim: empty entries of a list take two bytes here and some hundred once they are decoded.
pub trait Message: prost::Message + Default {
    /// Its name in `reloop.proto`.
    const NAME: &'static str;
    /// The most bytes that are taken.
    const MAX_BYTES: usize;
}

macro_rules! messages {
    ($($message:ident: $limit:expr),* $(,)?) => {
        $(impl Message for proto::$message {
            const NAME: &'static str = stringify!($message);
            const MAX_BYTES: usize = $limit;
        })*
    };
}

/// What others wrote, as it can be shown: control characters, which could clear a terminal or forge lines of a log, are escaped.
#[must_use]
pub fn shown(text: &str) -> String {
    let mut shown = String::with_capacity(text.len());
    for character in text.chars() {
        if character.is_control() {
            shown.extend(character.escape_default());
        } else {
            shown.push(character);
        }
    }
    shown
}

const KIB: usize = 1024;
const MIB: usize = 1024 * KIB;

/// The largest message of all: no transport takes a larger one.
pub const MAX_MESSAGE_BYTES: usize = 16 * MIB;

messages! {
    Scene: MAX_MESSAGE_BYTES,
    Observation: 4 * MIB,
    Prediction: MAX_MESSAGE_BYTES,
    Plan: 256 * KIB,
    StepRecord: 16 * KIB,
    TrafficMoves: 4 * MIB,
    Event: 64 * KIB,
    EpisodeEnd: 256 * KIB,
    RunInfo: 4 * MIB,
    Recorded: 64 * KIB,
    Admission: 64 * KIB,
}

impl Message for proto::service::Ask {
    const NAME: &'static str = "Ask";
    const MAX_BYTES: usize = 64 * KIB;
}

impl Message for proto::service::Reply {
    const NAME: &'static str = "Reply";
    const MAX_BYTES: usize = MAX_MESSAGE_BYTES;
}

/// The message in `bytes`.
///
/// # Errors
/// [`MessageError::TooBig`] and [`MessageError::Malformed`].
pub fn decode<M: Message>(bytes: &[u8]) -> Result<M, MessageError> {
    if bytes.len() > M::MAX_BYTES {
        return Err(MessageError::TooBig { message: M::NAME, bytes: bytes.len(), limit: M::MAX_BYTES });
    }
    M::decode(bytes).map_err(|e| MessageError::Malformed { message: M::NAME, reason: e.to_string() })
}
