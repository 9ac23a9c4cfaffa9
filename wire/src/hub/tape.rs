//! Tells the recorder, and whoever else listens in, all that happens, from a thread of its own: a listener that reads
//! nothing makes this thread wait, and not the workers' or the transport's, whom the drives need.
//!
//! The queue before the thread is bounded in bytes. While it is full, workers wait, so that a slow recorder slows the run
//! instead of losing messages. A listener that takes nothing at all is cut off by the transport after the stall of
//! [`crate::session::open_router`], and the queue flows again.

use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use zenoh::Session;
use zenoh::bytes::ZBytes;

use super::lock;
use crate::session;

/// Bytes that may wait: some five episodes.
const QUEUE_BYTES: usize = 64 * 1024 * 1024;

/// The queue's near end.
pub(super) struct Tape {
    queue: Arc<Queue>,
    /// A worker waits so long for room, then its message is left out; the counts at the episode's end tell.
    patience: Duration,
    thread: Option<JoinHandle<()>>,
}

#[derive(Default)]
struct Queue {
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Default)]
struct State {
    messages: VecDeque<(String, ZBytes)>,
    bytes: usize,
    /// Nothing comes any more: the thread ends when it has sent the rest.
    closed: bool,
}

impl Tape {
    pub(super) fn new(session: &Session, stall: Duration) -> Self {
        let queue = Arc::new(Queue::default());
        let (session, far_end) = (session.clone(), Arc::clone(&queue));
        let thread = std::thread::spawn(move || {
            while let Some((key, payload)) = far_end.take() {
                if let Err(e) = session::send(&session, &key, payload) {
                    tracing::error!("{key} is not told: {e}");
                }
            }
        });
        // Twice: the stall of one listener must not cost another one a message.
        Self { queue, patience: 2 * stall, thread: Some(thread) }
    }

    /// Puts messages at the end of the queue, together.
    pub(super) fn push(&self, messages: Vec<(String, ZBytes)>) {
        let bytes: usize = messages.iter().map(|(_, payload)| payload.len()).sum();
        let until = Instant::now() + self.patience;
        let mut state = lock(&self.queue.state);
        while state.bytes + bytes > QUEUE_BYTES && !state.messages.is_empty() {
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                for (key, _) in messages {
                    tracing::error!("the recorder is too slow: {key} is left out");
                }
                return;
            }
            state = self.queue.changed.wait_timeout(state, left).unwrap_or_else(PoisonError::into_inner).0;
        }
        state.bytes += bytes;
        state.messages.extend(messages);
        self.queue.changed.notify_all();
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
    fn take(&self) -> Option<(String, ZBytes)> {
        let mut state = lock(&self.state);
        loop {
            if let Some((key, payload)) = state.messages.pop_front() {
                state.bytes -= payload.len();
                self.changed.notify_all();
                return Some((key, payload));
            }
            if state.closed {
                return None;
            }
            state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }
}
