//! What a recording says of an episode.

use wire::proto;

use crate::recorded::{RecordedError, messages};

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
        let (mut scene, mut end) = (None, None);
        let (mut observations, mut plans, mut records, mut events) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        messages(bytes, |channel, data| {
            match channel {
                "scene" => scene = Some(decoded(data)?),
                "observation" => observations.push(decoded(data)?),
                "plan" => plans.push(decoded(data)?),
                // What pictures show beside the drive is none of it.
                "record" => records.push(proto::StepRecord { logged_av: None, ..decoded(data)? }),
                "event" => events.push(proto::Event { other: None, ..decoded(data)? }),
                "end" => end = Some(decoded(data)?),
                _ => {}
            }
            Ok(())
        })?;
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

fn decoded<M: prost::Message + Default>(data: &[u8]) -> Result<M, String> {
    M::decode(data).map_err(|error| error.to_string())
}
