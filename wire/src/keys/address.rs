//! Where a message of the tape belongs.

use world::scene::SceneId;

use super::place::on_tape;
use super::{Channel, Worker};

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
    /// What `key` means, if it is a message of the tape.
    #[must_use]
    pub fn parse(key: &str) -> Option<Self> {
        let [worker, scene, channel] = on_tape(key)?;
        let channel = Channel::named(channel)?;
        Some(Self { worker: worker.parse().ok()?, scene: SceneId::new(scene).ok()?, channel })
    }
}
