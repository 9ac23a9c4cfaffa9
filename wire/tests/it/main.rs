//! The hub against other processes: what a test in one process cannot show.

mod stalled;
