//! The product's messages as a recording holds them: the bytes that travelled, and what they say.

use prost::Message as _;
use thiserror::Error;
use wire::convert::decode;
use wire::keys::Channel;
use wire::proto;

/// Length of a step (ns).
pub const STEP_NANOSECONDS: u64 = 100_000_000;

/// The channels that are recorded, in the order of an episode and, within it, of a step.
pub const CHANNELS: [Channel; 8] = [
    Channel::Scene,
    Channel::Observation,
    Channel::Prediction,
    Channel::Plan,
    Channel::Record,
    Channel::Event,
    Channel::End,
    // Last, for the numbers of the others stay: within a step it comes before the observation's answers.
    Channel::Moves,
];

/// The full name of the protobuf message that travels on `channel`.
#[must_use]
pub fn schema(channel: Channel) -> &'static str {
    match channel {
        Channel::Scene => "reloop.v1.Scene",
        Channel::Observation => "reloop.v1.Observation",
        Channel::Prediction => "reloop.v1.Prediction",
        Channel::Plan => "reloop.v1.Plan",
        Channel::Moves => "reloop.v1.TrafficMoves",
        Channel::Record => "reloop.v1.StepRecord",
        Channel::Event => "reloop.v1.Event",
        Channel::End => "reloop.v1.EpisodeEnd",
        Channel::Recorded => "reloop.v1.Recorded",
    }
}

/// Why bytes are no message of a recording.
#[derive(Debug, Error)]
pub enum MessageError {
    /// They do not decode, or are more than any honest message has.
    #[error(transparent)]
    Refused(#[from] wire::convert::MessageError),
    /// They are the recorder's own answer.
    #[error("what the recorder itself says is not recorded")]
    NotRecorded,
}

/// What a message says.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs, reason = "as the channels")]
pub enum Body {
    Scene(Box<proto::Scene>),
    Observation(Box<proto::Observation>),
    Prediction(proto::Prediction),
    Plan(proto::Plan),
    Moves(proto::TrafficMoves),
    Record(Box<proto::StepRecord>),
    Event(proto::Event),
    End(proto::EpisodeEnd),
}

/// A message: its bytes, as they came, and their meaning.
#[derive(Clone, Debug, PartialEq)]
pub struct Message {
    /// What it says.
    pub body: Body,
    /// The bytes that are recorded. They are never encoded anew, so a node's own fields survive.
    pub payload: Vec<u8>,
}

impl Message {
    /// Reads `payload` as a message of `channel`.
    ///
    /// # Errors
    /// [`MessageError`] if it is no such message.
    pub fn decode(channel: Channel, payload: Vec<u8>) -> Result<Self, MessageError> {
        let bytes = payload.as_slice();
        let body = match channel {
            Channel::Scene => Body::Scene(Box::new(decode(bytes)?)),
            Channel::Observation => Body::Observation(Box::new(decode(bytes)?)),
            Channel::Prediction => Body::Prediction(decode(bytes)?),
            Channel::Plan => Body::Plan(decode(bytes)?),
            Channel::Moves => Body::Moves(decode(bytes)?),
            Channel::Record => Body::Record(Box::new(decode(bytes)?)),
            Channel::Event => Body::Event(decode(bytes)?),
            Channel::End => Body::End(decode(bytes)?),
            Channel::Recorded => return Err(MessageError::NotRecorded),
        };
        Ok(Self { body, payload })
    }

    /// The message that says `body`, encoded here.
    #[must_use]
    pub fn encode(body: Body) -> Self {
        let payload = match &body {
            Body::Scene(message) => message.encode_to_vec(),
            Body::Observation(message) => message.encode_to_vec(),
            Body::Prediction(message) => message.encode_to_vec(),
            Body::Plan(message) => message.encode_to_vec(),
            Body::Moves(message) => message.encode_to_vec(),
            Body::Record(message) => message.encode_to_vec(),
            Body::Event(message) => message.encode_to_vec(),
            Body::End(message) => message.encode_to_vec(),
        };
        Self { body, payload }
    }

    /// What kind of message it is.
    #[must_use]
    pub fn channel(&self) -> Channel {
        match self.body {
            Body::Scene(_) => Channel::Scene,
            Body::Observation(_) => Channel::Observation,
            Body::Prediction(_) => Channel::Prediction,
            Body::Plan(_) => Channel::Plan,
            Body::Moves(_) => Channel::Moves,
            Body::Record(_) => Channel::Record,
            Body::Event(_) => Channel::Event,
            Body::End(_) => Channel::End,
        }
    }

    /// The step that it belongs to: 0 for the scene, one past the last for the end.
    #[must_use]
    pub fn step(&self) -> u32 {
        match &self.body {
            Body::Scene(_) => 0,
            Body::Observation(message) => message.step,
            Body::Prediction(message) => message.step,
            Body::Plan(message) => message.step,
            Body::Moves(message) => message.step,
            Body::Record(message) => message.step,
            Body::Event(message) => message.step,
            Body::End(message) => message.steps,
        }
    }

    /// Simulated time of [`Message::step`] since the first step driven (ns).
    #[must_use]
    pub fn log_time(&self) -> u64 {
        u64::from(self.step()) * STEP_NANOSECONDS
    }
}
