//! The built binary, driven from outside.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test says what failed by failing")]

mod cli;
#[path = "../log/mod.rs"]
mod log;
mod process;
mod real_scenes;
