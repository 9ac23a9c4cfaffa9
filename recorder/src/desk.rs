//! A writer thread's episodes, from the first message to the answer. Knows no bus: messages in, answers out.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::{Duration, Instant};

use wire::keys::{Address, Channel, Worker};
use wire::proto;
use world::scene::SceneId;

use crate::message::Message;
use crate::recording::{Recording, RunSettings};

/// How long an episode that has ended waits for messages that are still on their way.
const PATIENCE: Duration = Duration::from_secs(2);

/// Episodes that may be open at once. An honest run has one for each worker.
const OPEN: usize = 256;

type Place = (Worker, SceneId);

/// The episodes of one writer thread.
pub struct Desk {
    run: Arc<RunSettings>,
    open: BTreeMap<Place, Recording>,
    /// Ended, but not whole; until when they wait.
    waiting: BTreeMap<Place, Instant>,
    /// What comes late for these is ignored.
    closed: BTreeSet<Place>,
}

impl Desk {
    /// An empty desk.
    #[must_use]
    pub fn new(run: Arc<RunSettings>) -> Self {
        Self { run, open: BTreeMap::new(), waiting: BTreeMap::new(), closed: BTreeSet::new() }
    }

    /// Takes a message from the bus at the time `now`. The answer where its episode is settled with it.
    pub fn take(&mut self, address: Address, payload: Vec<u8>, now: Instant) -> Option<(Address, proto::Recorded)> {
        let Address { worker, scene, channel } = address;
        let message = match Message::decode(channel, payload) {
            Ok(message) => message,
            Err(error) => {
                // The simulator refuses it too, where it asked for it.
                tracing::warn!("episode {scene}: {error}; ignored");
                return None;
            }
        };
        let place = (worker, scene);
        if channel == Channel::Scene {
            // The same scene again: it is driven anew.
            self.closed.remove(&place);
        } else if self.closed.contains(&place) {
            return None;
        }
        if !self.open.contains_key(&place) && self.open.len() >= OPEN {
            tracing::warn!("{OPEN} episodes are open: one more, {}, is ignored", place.1);
            return None;
        }
        let recording = self
            .open
            .entry(place.clone())
            .or_insert_with_key(|(_, scene)| Recording::new(scene.clone(), Arc::clone(&self.run)));
        recording.take(message);
        match (recording.has_ended(), recording.is_settled()) {
            (true, true) => return self.close(place),
            (true, false) => {
                self.waiting.entry(place).or_insert(now + PATIENCE);
            }
            (false, _) => {}
        }
        None
    }

    /// The answer of an episode that has waited long enough.
    pub fn take_overdue(&mut self, now: Instant) -> Option<(Address, proto::Recorded)> {
        let place = self.waiting.iter().find(|(_, until)| **until <= now).map(|(place, _)| place.clone())?;
        self.close(place)
    }

    /// When the next episode will have waited long enough.
    #[must_use]
    pub fn next_due(&self) -> Option<Instant> {
        self.waiting.values().min().copied()
    }

    /// Ends all that is open, as far as it is. Nobody waits for it any more: the run is over, or was interrupted.
    pub fn abandon(mut self) {
        while let Some(((_, scene), recording)) = self.open.pop_first() {
            let recorded = recording.finish();
            tracing::debug!("episode {scene} is left: {}", recorded.error);
        }
    }

    fn close(&mut self, place: Place) -> Option<(Address, proto::Recorded)> {
        self.waiting.remove(&place);
        let recorded = self.open.remove(&place)?.finish();
        self.closed.insert(place.clone());
        let (worker, scene) = place;
        if !recorded.error.is_empty() {
            tracing::error!("episode {scene}: {}", recorded.error);
        }
        Some((Address { worker, scene, channel: Channel::Recorded }, recorded))
    }
}
