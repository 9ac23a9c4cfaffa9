//! Notices that this process stood still: Ctrl-Z, `docker pause`, a debugger, a laptop that slept.
//!
//! A thread looks at the clock ten times a second. Where much more than that has passed between two looks, the process did not run
//! meanwhile, or the machine had no time for it; either way nobody could answer it, and what ran out then did not run out fairly.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Weak};
use std::thread;
use std::time::{Duration, Instant};

const TICK: Duration = Duration::from_millis(100);

/// What a look may be late by before it counts as a pause.
const LATE: Duration = Duration::from_millis(400);

/// Counts the pauses of this process. Its thread ends when it is dropped.
#[derive(Debug)]
pub struct Pulse(Arc<State>);

#[derive(Debug)]
struct State {
    start: Instant,
    /// When the clock was looked at last (us since the start).
    last_look: AtomicU64,
    pauses: AtomicU64,
}

impl Pulse {
    /// Begins to look.
    #[must_use]
    pub fn start() -> Self {
        let state = State { start: Instant::now(), last_look: AtomicU64::new(0), pauses: AtomicU64::new(0) };
        let pulse = Self(Arc::new(state));
        let state: Weak<State> = Arc::downgrade(&pulse.0);
        thread::spawn(move || {
            while let Some(state) = state.upgrade() {
                state.look();
                drop(state);
                thread::sleep(TICK);
            }
        });
        pulse
    }

    /// How many pauses there were until now. Whoever asks looks at the clock too: after a pause it may be the first to run again.
    #[must_use]
    pub fn pauses(&self) -> u64 {
        self.0.look();
        self.0.pauses.load(Ordering::SeqCst)
    }
}

impl State {
    fn look(&self) {
        let now = u64::try_from(self.start.elapsed().as_micros()).unwrap_or(u64::MAX);
        // `fetch_max`: of two that look at once, one sees the gap.
        let last = self.last_look.fetch_max(now, Ordering::SeqCst);
        if Duration::from_micros(now.saturating_sub(last)) > TICK + LATE {
            self.pauses.fetch_add(1, Ordering::SeqCst);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gap_between_two_looks_is_a_pause() {
        let state = State { start: Instant::now(), last_look: AtomicU64::new(0), pauses: AtomicU64::new(0) };
        state.look();
        assert_eq!(state.pauses.load(Ordering::SeqCst), 0);
        thread::sleep(TICK + LATE + Duration::from_millis(50));
        state.look();
        state.look();
        assert_eq!(state.pauses.load(Ordering::SeqCst), 1);
    }
}
