//! Traffic that reacts, in whole episodes.

#![allow(clippy::unwrap_used, clippy::print_stdout, missing_docs, reason = "a test may panic, and prints its table")]

mod generated_scenes;
mod lanes;
mod laws;
mod real_scenes;
mod stage;
#[path = "../../../episode/tests/straight_road/mod.rs"]
mod straight_road;
