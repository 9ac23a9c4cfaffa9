//! The wall clock, which nothing but `timing.parquet` depends on.

use std::time::{Duration, Instant};

/// Tells the time since some moment.
pub trait Clock {
    /// How long ago that moment is.
    fn now(&self) -> Duration;
}

/// The machine's clock, from the moment it was made.
#[derive(Clone, Copy, Debug)]
pub struct WallClock(Instant);

impl WallClock {
    /// Starts at zero.
    #[must_use]
    pub fn start() -> Self {
        Self(Instant::now())
    }
}

impl Clock for WallClock {
    fn now(&self) -> Duration {
        self.0.elapsed()
    }
}
