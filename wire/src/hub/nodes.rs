//! Who sits where: which node the simulator has let in at each seat, who was refused, and why. Decided here, without a bus.

use std::collections::BTreeMap;
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Condvar, Mutex, PoisonError};
use std::time::{Duration, Instant};

use thiserror::Error;

use super::lock;
use crate::WIRE_VERSION;
use crate::keys::{NodeId, Role, Workers};
use crate::pulse::Pulse;

/// How often a waiting start looks whether it was interrupted.
const CANCEL_POLL: Duration = Duration::from_millis(20);

/// Comings and goings that a watcher may leave unread.
const WATCH_QUEUE: usize = 1024;

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
    #[error("after {} s still missing: {}", waited.as_secs_f64(), missing.join(", "))]
    Missing {
        /// Who.
        missing: Vec<String>,
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
    /// It is there, listens, and was let in.
    Joined(NodeId),
    /// It left, died, or was cut off because it read nothing.
    Left(NodeId),
    /// It was not let in.
    Refused(NodeId),
}

/// The number of a seat. None has another's, also after that is gone.
pub(super) type SeatNumber = u64;

#[derive(Default)]
pub(super) struct Nodes {
    table: Mutex<Table>,
    changed: Condvar,
    watchers: Mutex<Vec<SyncSender<NodeEvent>>>,
}

#[derive(Default)]
struct Table {
    seats: BTreeMap<SeatNumber, Sitting>,
    made: SeatNumber,
}

/// A seat, as far as it matters who sits there.
struct Sitting {
    role: Role,
    workers: Workers,
    node: Option<NodeId>,
    /// Whether it knows that it sits there: until then it is told nothing else.
    knows: bool,
    /// The last that asked and is of another build.
    foreign: Option<NodeId>,
}

impl Sitting {
    fn wanted(&self) -> String {
        format!("{} (worker {})", self.role, self.workers)
    }

    fn refusal(&self, node: &NodeId) -> Option<String> {
        if node.version != WIRE_VERSION {
            let theirs = node.version;
            return Some(format!("it speaks version {theirs} of the messages, this simulator version {WIRE_VERSION}"));
        }
        if let Some(sitting) = &self.node {
            return Some(format!("{sitting} answers already"));
        }
        let serves = node.workers == Workers::All || node.workers == self.workers;
        (node.role != self.role || !serves).then(|| format!("a {} is expected here", self.wanted()))
    }
}

impl Nodes {
    /// A new seat for one node of `role`.
    pub(super) fn add_seat(&self, role: Role, workers: &Workers) -> SeatNumber {
        let mut table = lock(&self.table);
        table.made += 1;
        let number = table.made;
        table.seats.insert(number, Sitting { role, workers: workers.clone(), node: None, knows: false, foreign: None });
        number
    }

    pub(super) fn remove_seat(&self, seat: SeatNumber) {
        lock(&self.table).seats.remove(&seat);
    }

    /// Gives `seat` to `node`, or says why not. It counts once [`Nodes::knows`] says that it was told.
    pub(super) fn ask(&self, seat: SeatNumber, node: &NodeId) -> Result<(), String> {
        let mut table = lock(&self.table);
        let Some(sitting) = table.seats.get_mut(&seat) else { return Err("its seat is gone".to_owned()) };
        let refusal = sitting.refusal(node);
        if node.version != WIRE_VERSION {
            sitting.foreign = Some(node.clone());
        } else if refusal.is_none() {
            (sitting.node, sitting.knows) = (Some(node.clone()), false);
        }
        drop(table);
        self.changed.notify_all();
        refusal.map_or(Ok(()), |refusal| {
            self.tell(&NodeEvent::Refused(node.clone()));
            Err(refusal)
        })
    }

    /// The node at `seat` was told that it may sit there.
    pub(super) fn knows(&self, seat: SeatNumber) {
        let mut table = lock(&self.table);
        let Some(sitting) = table.seats.get_mut(&seat) else { return };
        sitting.knows = true;
        let joined = sitting.node.clone().map(NodeEvent::Joined);
        drop(table);
        self.changed.notify_all();
        joined.iter().for_each(|joined| self.tell(joined));
    }

    /// Why somebody without a secret is not let in: who is in its place, as far as there is one.
    pub(super) fn refuse_stranger(&self, node: &NodeId) -> String {
        let table = lock(&self.table);
        let same = |sitting: &&Sitting| sitting.role == node.role && overlap(&sitting.workers, &node.workers);
        let sitting: Vec<String> = table
            .seats
            .values()
            .filter(same)
            .filter_map(|sitting| sitting.node.as_ref())
            .map(NodeId::to_string)
            .collect();
        drop(table);
        self.tell(&NodeEvent::Refused(node.clone()));
        let who = if sitting.is_empty() { String::new() } else { format!("; {} answers already", sitting.join(", ")) };
        format!("it does not know the run's secret{who}")
    }

    /// Whether `node` sat there; then the seat is free again.
    pub(super) fn left(&self, seat: SeatNumber, node: &NodeId) -> bool {
        let mut table = lock(&self.table);
        let Some(sitting) = table.seats.get_mut(&seat).filter(|sitting| sitting.node.as_ref() == Some(node)) else {
            return false;
        };
        sitting.node = None;
        drop(table);
        self.changed.notify_all();
        self.tell(&NodeEvent::Left(node.clone()));
        true
    }

    /// Who sits there.
    pub(super) fn at(&self, seat: SeatNumber) -> Option<NodeId> {
        lock(&self.table).seats.get(&seat).and_then(|sitting| sitting.node.clone())
    }

    /// Whether the node of this bus session sits there.
    pub(super) fn is_at(&self, seat: SeatNumber, session: &str) -> bool {
        let table = lock(&self.table);
        let node = table.seats.get(&seat).and_then(|sitting| sitting.node.as_ref());
        node.is_some_and(|node| node.session.as_deref() == Some(session))
    }

    pub(super) fn present(&self) -> Vec<NodeId> {
        lock(&self.table).seats.values().filter_map(|sitting| sitting.node.clone()).collect()
    }

    pub(super) fn watch(&self) -> Receiver<NodeEvent> {
        let (sender, receiver) = sync_channel(WATCH_QUEUE);
        lock(&self.watchers).push(sender);
        receiver
    }

    /// Waits until somebody sits at every one of `seats`, at most `timeout` of time in which this process runs.
    pub(super) fn wait_for(
        &self,
        seats: &[SeatNumber],
        timeout: Duration,
        pulse: &Pulse,
        cancelled: &dyn Fn() -> bool,
    ) -> Result<(), BarrierError> {
        let (mut start, mut pauses) = (Instant::now(), pulse.pauses());
        let mut table = lock(&self.table);
        loop {
            let wanted: Vec<&Sitting> = seats.iter().filter_map(|seat| table.seats.get(seat)).collect();
            let empty: Vec<&&Sitting> =
                wanted.iter().filter(|sitting| sitting.node.is_none() || !sitting.knows).collect();
            if let Some(node) = empty.iter().find_map(|sitting| sitting.foreign.as_ref()) {
                let (node_name, theirs) = (node.to_string(), node.version);
                return Err(BarrierError::WrongVersion { node: node_name, theirs, ours: WIRE_VERSION });
            }
            if empty.is_empty() {
                return Ok(());
            }
            if start.elapsed() >= timeout {
                if pulse.pauses() == pauses {
                    let missing = empty.iter().map(|sitting| sitting.wanted()).collect();
                    return Err(BarrierError::Missing { missing, waited: timeout });
                }
                (start, pauses) = (Instant::now(), pulse.pauses());
            }
            if cancelled() {
                return Err(BarrierError::Cancelled);
            }
            table = self.changed.wait_timeout(table, CANCEL_POLL).unwrap_or_else(PoisonError::into_inner).0;
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

fn overlap(one: &Workers, other: &Workers) -> bool {
    *one == Workers::All || *other == Workers::All || one == other
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::keys::Worker;

    fn planner(name: &str, workers: Workers) -> NodeId {
        NodeId::new(Role::Planner, workers, name, name).unwrap()
    }

    fn w0() -> Workers {
        Workers::One(Worker::numbered(0))
    }

    #[test]
    fn a_seat_has_one_node_and_the_second_is_told_who_it_is() {
        let nodes = Nodes::default();
        let seat = nodes.add_seat(Role::Planner, &w0());
        let (first, second) = (planner("first", w0()), planner("second", Workers::All));
        assert_eq!(nodes.ask(seat, &first), Ok(()));
        assert_eq!(nodes.ask(seat, &second), Err("planner first (worker w0) answers already".to_owned()));
        assert!(nodes.is_at(seat, "first") && !nodes.is_at(seat, "second"));
        assert!(!nodes.left(seat, &second) && nodes.left(seat, &first));
        assert_eq!(nodes.ask(seat, &second), Ok(()));
        assert_eq!(nodes.at(seat), Some(second));
    }

    #[test]
    fn who_is_not_meant_is_told_who_is() {
        let nodes = Nodes::default();
        let seat = nodes.add_seat(Role::Planner, &w0());
        let expected = Err("a planner (worker w0) is expected here".to_owned());
        let predictor = NodeId::new(Role::Predictor, w0(), "p", "p").unwrap();
        assert_eq!(nodes.ask(seat, &predictor), expected);
        assert_eq!(nodes.ask(seat, &planner("other", Workers::One(Worker::numbered(1)))), expected);
        assert_eq!(nodes.at(seat), None);
    }

    #[test]
    fn a_stranger_is_told_why_and_who_answers() {
        let nodes = Nodes::default();
        let seats = [nodes.add_seat(Role::Planner, &w0()), nodes.add_seat(Role::Predictor, &w0())];
        let stray = planner("stray", Workers::All);
        assert_eq!(nodes.refuse_stranger(&stray), "it does not know the run's secret");
        nodes.ask(seats[0], &planner("mine", w0())).unwrap();
        let said = nodes.refuse_stranger(&stray);
        assert_eq!(said, "it does not know the run's secret; planner mine (worker w0) answers already");
    }
}
