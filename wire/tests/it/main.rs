//! The hub against other processes: what a test in one process cannot show.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test says what failed by failing")]

mod stalled;
