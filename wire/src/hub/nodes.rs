//! Which nodes are there, by their liveliness tokens.

use std::collections::BTreeSet;
use std::fmt;
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Condvar, Mutex, PoisonError};
use std::time::{Duration, Instant};

use thiserror::Error;

use super::lock;
use crate::WIRE_VERSION;
use crate::keys::{NodeId, Role, Worker, Workers};

/// How often a waiting start looks whether it was interrupted.
const CANCEL_POLL: Duration = Duration::from_millis(20);

/// Comings and goings that a watcher may leave unread.
const WATCH_QUEUE: usize = 1024;

/// A node that a run cannot do without.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Wanted {
    /// What it does.
    pub role: Role,
    /// Whom it must serve.
    pub workers: Workers,
    /// Its name, where just this one is meant; so a restarted node is not taken for the one before.
    pub name: Option<String>,
}

impl Wanted {
    fn is(&self, node: &NodeId) -> bool {
        let serves = node.workers == Workers::All || node.workers == self.workers;
        node.role == self.role && serves && self.name.as_ref().is_none_or(|name| *name == node.name)
    }
}

impl fmt::Display for Wanted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {} (worker {})", self.role, self.name.as_deref().unwrap_or("of any name"), self.workers)
    }
}

/// Why the nodes are not ready.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum BarrierError {
    /// A node is of another build.
    #[error(
        "{node} speaks version {theirs} of the messages, this simulator version {ours}\n  hint: build both from the same revision"
    )]
    WrongVersion {
        /// Who.
        node: String,
        /// Its version.
        theirs: u32,
        /// Ours.
        ours: u32,
    },
    /// Somebody did not come in time.
    #[error("after {} s still missing: {}", waited.as_secs_f64(), missing.iter().map(Wanted::to_string).collect::<Vec<_>>().join(", "))]
    Missing {
        /// Who.
        missing: Vec<Wanted>,
        /// How long was waited.
        waited: Duration,
    },
    /// The caller said so.
    #[error("interrupted while waiting for nodes")]
    Cancelled,
}

/// Something that happened to a node.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum NodeEvent {
    /// It is there and listens.
    Joined(NodeId),
    /// It left, died, or was cut off because it read nothing.
    Left(NodeId),
}

#[derive(Default)]
pub(super) struct Nodes {
    present: Mutex<BTreeSet<NodeId>>,
    changed: Condvar,
    watchers: Mutex<Vec<SyncSender<NodeEvent>>>,
}

impl Nodes {
    pub(super) fn joined(&self, node: NodeId) {
        tracing::debug!("{node} is there");
        lock(&self.present).insert(node.clone());
        self.changed.notify_all();
        self.tell(&NodeEvent::Joined(node));
    }

    pub(super) fn left(&self, node: &NodeId) {
        tracing::debug!("{node} is gone");
        lock(&self.present).remove(node);
        self.changed.notify_all();
        self.tell(&NodeEvent::Left(node.clone()));
    }

    pub(super) fn present(&self) -> Vec<NodeId> {
        lock(&self.present).iter().cloned().collect()
    }

    /// Whether somebody of this build does `role` for `worker`.
    pub(super) fn serve(&self, role: Role, worker: &Worker) -> bool {
        let fits = |node: &NodeId| node.role == role && node.version == WIRE_VERSION && node.workers.serve(worker);
        lock(&self.present).iter().any(fits)
    }

    pub(super) fn watch(&self) -> Receiver<NodeEvent> {
        let (sender, receiver) = sync_channel(WATCH_QUEUE);
        lock(&self.watchers).push(sender);
        receiver
    }

    pub(super) fn wait_for(
        &self,
        wanted: &[Wanted],
        timeout: Duration,
        cancelled: &dyn Fn() -> bool,
    ) -> Result<(), BarrierError> {
        let start = Instant::now();
        let mut present = lock(&self.present);
        loop {
            if let Some(node) = present.iter().find(|n| n.version != WIRE_VERSION && wanted.iter().any(|w| w.is(n))) {
                let node_name = node.to_string();
                return Err(BarrierError::WrongVersion { node: node_name, theirs: node.version, ours: WIRE_VERSION });
            }
            let missing: Vec<Wanted> = wanted.iter().filter(|w| !present.iter().any(|n| w.is(n))).cloned().collect();
            if missing.is_empty() {
                return Ok(());
            }
            if start.elapsed() >= timeout {
                return Err(BarrierError::Missing { missing, waited: timeout });
            }
            if cancelled() {
                return Err(BarrierError::Cancelled);
            }
            present = self.changed.wait_timeout(present, CANCEL_POLL).unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    fn tell(&self, event: &NodeEvent) {
        lock(&self.watchers).retain(|watcher| match watcher.try_send(event.clone()) {
            Ok(()) => true,
            Err(TrySendError::Disconnected(_)) => false,
            Err(TrySendError::Full(_)) => {
                tracing::warn!("a watcher of nodes does not keep up: {event:?} is lost to it");
                true
            }
        });
    }
}
