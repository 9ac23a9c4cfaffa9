//! What a recording says of an episode.

use prost::Message as _;
use recording::{Event, NotMcap, Reader, TOPICS};
use thiserror::Error;
use wire::proto;

/// A recording that an episode cannot be driven again from.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum RecordedError {
    #[error(transparent)]
    NotMcap(#[from] NotMcap),
    #[error("it is damaged: {0}\nhint: `recorder info` tells what of it can be read")]
    Damaged(String),
    #[error("its message on {topic} at byte {at} is none of this version: {why}")]
    Message { topic: String, at: u64, why: String },
    #[error("it has no {0}: it is not whole")]
    Missing(&'static str),
}

/// All that the simulator said, and what the planner answered, in their order.
#[derive(Clone, Debug)]
pub struct Recorded {
    pub(super) scene: proto::Scene,
    pub(super) observations: Vec<proto::Observation>,
    pub(super) plans: Vec<proto::Plan>,
    pub(super) records: Vec<proto::StepRecord>,
    pub(super) events: Vec<proto::Event>,
    pub(super) end: proto::EpisodeEnd,
}

impl Recorded {
    /// The metrics of its end, by name.
    pub fn metrics(&self) -> impl Iterator<Item = (&str, Option<f64>)> {
        let value = |metric: &proto::Metric| metric.value.filter(|value| !value.is_nan());
        self.end.metrics.iter().map(move |metric| (metric.name.as_str(), value(metric)))
    }

    /// Reads the bytes of an MCAP file.
    ///
    /// # Errors
    /// [`RecordedError`].
    pub fn read(bytes: &[u8]) -> Result<Self, RecordedError> {
        let mut reader = Reader::new(bytes)?;
        let (mut scene, mut end) = (None, None);
        let (mut observations, mut plans, mut records, mut events) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        while let Some(event) = reader.next() {
            let message = match event {
                Event::Message(message) => message,
                Event::Damage(damage) => return Err(RecordedError::Damaged(damage.to_string())),
                Event::Metadata { .. } | Event::Channel(_) => continue,
            };
            let topic = message.channel.topic.as_str();
            let wrong = |error: prost::DecodeError| RecordedError::Message {
                topic: topic.to_owned(),
                at: message.at,
                why: error.to_string(),
            };
            match topic.strip_prefix(TOPICS) {
                Some("scene") => scene = Some(proto::Scene::decode(message.data).map_err(wrong)?),
                Some("observation") => observations.push(proto::Observation::decode(message.data).map_err(wrong)?),
                Some("plan") => plans.push(proto::Plan::decode(message.data).map_err(wrong)?),
                Some("record") => {
                    let record = proto::StepRecord::decode(message.data).map_err(wrong)?;
                    // What pictures show beside the drive is none of it.
                    records.push(proto::StepRecord { logged_av: None, ..record });
                }
                Some("event") => {
                    let event = proto::Event::decode(message.data).map_err(wrong)?;
                    events.push(proto::Event { other: None, ..event });
                }
                Some("end") => end = Some(proto::EpisodeEnd::decode(message.data).map_err(wrong)?),
                _ => {}
            }
        }
        Ok(Self {
            scene: scene.ok_or(RecordedError::Missing("scene"))?,
            end: end.ok_or(RecordedError::Missing("end"))?,
            observations,
            plans,
            records,
            events,
        })
    }
}
