//! The built binary, driven from outside.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test says what failed by failing")]

mod cli;
mod process;
mod real_scenes;
