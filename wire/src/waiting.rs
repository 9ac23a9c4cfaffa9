//! Waiting for a message that comes in a fraction of a millisecond.
//!
//! A thread that sleeps lets its core fall asleep too, and waking a core takes longer than everything else that a step does on the
//! bus: on a virtual machine half of the time between observation and plan. So whoever waits stays awake for a little while,
//! giving its core to any thread that wants it, and only then goes to sleep.

use std::sync::mpsc::{Receiver, TryRecvError};
use std::thread;
use std::time::{Duration, Instant};

/// How long a thread stays awake: longer than an answer takes that needs no thought, shorter than a step of a planner that thinks.
const AWAKE: Duration = Duration::from_micros(500);

/// The next message; none once `until` has passed or nobody can send any more.
pub(crate) fn receive<T>(messages: &Receiver<T>, until: Option<Instant>) -> Option<T> {
    let start = Instant::now();
    while start.elapsed() < AWAKE {
        match messages.try_recv() {
            Ok(message) => return Some(message),
            Err(TryRecvError::Disconnected) => return None,
            Err(TryRecvError::Empty) => thread::yield_now(),
        }
    }
    match until {
        None => messages.recv().ok(),
        Some(until) => messages.recv_timeout(until.saturating_duration_since(Instant::now())).ok(),
    }
}
