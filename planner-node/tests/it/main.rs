//! The built binary, driven from outside.

mod cli;
mod process;
