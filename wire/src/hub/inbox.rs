//! What arrives for an episode's line, and how long it is waited for.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::{Duration, Instant};

use zenoh::bytes::ZBytes;

use crate::keys::Role;
use crate::pulse::Pulse;

/// Answers that may wait in a line's inbox. An honest node sends one and waits for the next observation.
pub(super) const INBOX: usize = 64;

/// What the transport's callbacks put down for a line, and what the line takes up.
pub(super) struct Inbox {
    sender: SyncSender<Incoming>,
    /// The queue ran over.
    flooded: AtomicBool,
}

pub(super) enum Incoming {
    Answer(Role, ZBytes),
    /// Some node that may be this line's is gone: look.
    NodeLost,
    /// Somebody else spoke to the node of this role.
    Intruded(Role),
}

impl Inbox {
    /// An inbox, and where what it takes comes out.
    pub fn open() -> (Arc<Self>, Receiver<Incoming>) {
        let (sender, incoming) = sync_channel(INBOX);
        (Arc::new(Self { sender, flooded: AtomicBool::new(false) }), incoming)
    }

    /// Whether more came than it holds.
    pub fn is_flooded(&self) -> bool {
        self.flooded.load(Ordering::Relaxed)
    }

    pub fn deliver(&self, role: Role, payload: &ZBytes) {
        self.push(Incoming::Answer(role, payload.clone()));
    }

    pub fn node_lost(&self) {
        self.push(Incoming::NodeLost);
    }

    pub fn intruded(&self, role: Role) {
        self.push(Incoming::Intruded(role));
    }

    fn push(&self, incoming: Incoming) {
        if self.sender.try_send(incoming).is_err() {
            self.flooded.store(true, Ordering::Relaxed);
        }
    }
}

/// Until when something is waited for. A time in which this process stood still does not count: nobody could be heard.
pub(super) struct Patience<'a> {
    pulse: &'a Pulse,
    /// How long each wait is.
    pub deadline: Duration,
    /// When this one ends.
    pub until: Instant,
    pauses: u64,
}

impl<'a> Patience<'a> {
    pub fn new(pulse: &'a Pulse, deadline: Duration) -> Self {
        Self { pulse, deadline, until: Instant::now() + deadline, pauses: pulse.pauses() }
    }

    /// Whether there is a reason to wait once more, from now on.
    pub fn renewed(&mut self) -> bool {
        let pauses = std::mem::replace(&mut self.pauses, self.pulse.pauses());
        self.until = Instant::now() + self.deadline;
        self.pauses != pauses
    }
}
