//! Tells the recorder, and whoever else listens in, all that happens, from a thread of its own: a listener that reads
//! nothing makes this thread wait, and not the workers' or the transport's, whom the drives need. While nobody listens, nothing is told.
//!
//! The queue before the thread is bounded in bytes. While it is full, workers wait, so that a slow recorder slows the run
//! instead of losing messages. A listener that takes nothing at all is cut off by the transport after the stall of
//! [`crate::session::open_router`], and the queue flows again.
//!
//! A recorder is told of the episodes that were begun with it, and not the rest of one that was begun with another: the scene of that
//! may be driven again at once, and the two would be one recording.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use zenoh::bytes::ZBytes;
use zenoh::pubsub::Publisher;
use zenoh::sample::Locality;
use zenoh::{Session, Wait};

use super::lock;
use super::nodes::SeatNumber;
use crate::keys::{Address, Channel, Place};
use crate::session::{self, SessionError};

/// Bytes that may wait: some five episodes.
const QUEUE_BYTES: usize = 64 * 1024 * 1024;

/// Messages set out together: those of so many bytes, those of so long, or when an episode ends, for whose recording the sim waits. Each journey
/// wakes three threads in two processes, and a step has three messages or four.
const TOGETHER_BYTES: usize = 128 * 1024;
const TOGETHER: Duration = Duration::from_millis(10);

/// The queue's near end.
pub(super) struct Tape {
    queue: Arc<Queue>,
    /// Where it is told: on the open floor and, last, at the recorder's seat.
    places: Arc<Mutex<Vec<Listener>>>,
    /// Whether there is a recorder's seat, or somebody on the open floor.
    is_recorded: AtomicBool,
    is_listened_to: Arc<AtomicBool>,
    /// Kept because it knows who is on the open floor. Nothing is ever put by it.
    _floor: Publisher<'static>,
    /// A worker waits so long for room, then its message is left out; the counts at the episode's end tell.
    patience: Duration,
    thread: Option<JoinHandle<()>>,
}

/// Somebody to whom all is told.
#[derive(Clone)]
struct Listener {
    place: Place,
    /// The seat of a recorder, which hears its own episodes alone.
    seat: Option<SeatNumber>,
    cut_off: Arc<dyn Fn() + Send + Sync>,
}

/// A message on its way.
struct Told {
    recorder: Option<SeatNumber>,
    address: Address,
    payload: ZBytes,
}

#[derive(Default)]
struct Queue {
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Default)]
struct State {
    messages: VecDeque<Told>,
    bytes: usize,
    /// They have set out: all that waits is sent.
    under_way: bool,
    /// Workers that wait for room.
    without_room: usize,
    /// Nothing comes any more: the thread ends when it has sent the rest.
    closed: bool,
}

impl Tape {
    /// # Errors
    /// [`SessionError`] where the session is closed.
    pub(super) fn new(session: &Session, open_floor: Place, stall: Duration) -> Result<Self, SessionError> {
        let is_listened_to = Arc::new(AtomicBool::new(false));
        let watch = Arc::clone(&is_listened_to);
        let floor = session.declare_publisher(open_floor.whole_tape()).allowed_destination(Locality::Remote).wait();
        let floor = floor.map_err(SessionError::bus("declare the tape"))?;
        let listener = floor.matching_listener().callback(move |now| watch.store(now.matching(), Ordering::Relaxed));
        listener.background().wait().map_err(SessionError::bus("watch the tape's listeners"))?;
        let queue = Arc::new(Queue::default());
        let open = Listener { place: open_floor, seat: None, cut_off: Arc::new(|| {}) };
        let places = Arc::new(Mutex::new(vec![open]));
        let (session, far_end, to) = (session.clone(), Arc::clone(&queue), Arc::clone(&places));
        let thread = std::thread::spawn(move || {
            while let Some(Told { recorder, address, payload }) = far_end.take() {
                let mut listeners = lock(&to).clone();
                listeners.retain(|listener| listener.seat.is_none() || listener.seat == recorder);
                for Listener { place, cut_off, .. } in listeners {
                    let begin = Instant::now();
                    if let Err(e) = session::send_together(&session, &place.tape(&address), payload.clone()) {
                        tracing::error!("{} of {} is not told: {e}", address.channel.name(), address.scene);
                    }
                    // The transport waited in vain, and closes the connection; that the node's token goes with it takes the node's help.
                    if begin.elapsed() >= stall {
                        cut_off();
                    }
                }
            }
        });
        // Twice: the stall of one listener must not cost another one a message.
        let (patience, is_recorded) = (2 * stall, AtomicBool::new(false));
        Ok(Self { queue, places, is_recorded, is_listened_to, _floor: floor, patience, thread: Some(thread) })
    }

    /// Whether anybody hears what is told.
    pub(super) fn is_heard(&self) -> bool {
        self.is_recorded.load(Ordering::Relaxed) || self.is_listened_to.load(Ordering::Relaxed)
    }

    /// From now on the episodes of the recorder at `seat` are told at its `place` too, and no more at that of the recorder before it.
    /// `cut_off` is called when it takes nothing for so long that its connection is given up.
    pub(super) fn tell_also(&self, seat: SeatNumber, place: Place, cut_off: impl Fn() + Send + Sync + 'static) {
        let mut places = lock(&self.places);
        self.is_recorded.store(true, Ordering::Relaxed);
        places.truncate(1);
        places.push(Listener { place, seat: Some(seat), cut_off: Arc::new(cut_off) });
    }

    /// Puts messages of an episode, which the recorder of that seat records, at the end of the queue, together.
    pub(super) fn push(&self, recorder: Option<SeatNumber>, messages: Vec<(Address, ZBytes)>) {
        let bytes: usize = messages.iter().map(|(_, payload)| payload.len()).sum();
        let until = Instant::now() + self.patience;
        let mut state = lock(&self.queue.state);
        while state.bytes + bytes > QUEUE_BYTES && !state.messages.is_empty() {
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                for (address, _) in messages {
                    tracing::error!(
                        "the recorder is too slow: {} of {} is left out",
                        address.channel.name(),
                        address.scene
                    );
                }
                return;
            }
            state.without_room += 1;
            state = self.queue.changed.wait_timeout(state, left).unwrap_or_else(PoisonError::into_inner).0;
            state.without_room -= 1;
        }
        let was_empty = state.messages.is_empty();
        let is_end = messages.iter().any(|(address, _)| address.channel == Channel::End);
        state.bytes += bytes;
        state.messages.extend(messages.into_iter().map(|(address, payload)| Told { recorder, address, payload }));
        let sets_out = !state.under_way && (is_end || state.bytes >= TOGETHER_BYTES);
        state.under_way |= sets_out;
        if was_empty || sets_out {
            self.queue.changed.notify_all();
        }
    }
}

impl Drop for Tape {
    fn drop(&mut self) {
        lock(&self.queue.state).closed = true;
        self.queue.changed.notify_all();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

impl Queue {
    /// The next message; `None` at the end.
    fn take(&self) -> Option<Told> {
        let mut state = lock(&self.state);
        loop {
            if state.messages.is_empty() && state.closed {
                return None;
            }
            if state.under_way || state.closed {
                if let Some(told) = state.messages.pop_front() {
                    state.bytes -= told.payload.len();
                    if state.without_room > 0 {
                        self.changed.notify_all();
                    }
                    return Some(told);
                }
                state.under_way = false;
            }
            if state.messages.is_empty() {
                state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
            } else {
                let waited = self.changed.wait_timeout(state, TOGETHER).unwrap_or_else(PoisonError::into_inner);
                state = waited.0;
                state.under_way |= waited.1.timed_out();
            }
        }
    }
}
