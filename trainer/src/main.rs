//! The binary `trainer`: trains the learned predictor, alone or through the planner.
//!
//! Results go to standard output, everything else to standard error. Exit codes: 0 done; 1 done, and something did not succeed;
//! 2 wrong usage, unusable input, or a loss that is no number; 130 interrupted.

use std::io;
use std::process::ExitCode;

use clap::Parser;
use trainer::commands::Command;

/// Train the learned predictor, alone or through the planner.
#[derive(Debug, Parser)]
#[command(name = "trainer", max_term_width = 100)]
struct Cli {
    /// What to do.
    #[command(subcommand)]
    command: Command,
}

fn main() -> ExitCode {
    let cli: Cli = terminal::parse(terminal::REVISION);
    start_log();
    cli.command.run().unwrap_or_else(|error| {
        eprintln!("error: {}", terminal::whole(error.as_ref()));
        ExitCode::from(2)
    })
}

/// Logs go to standard error; `RUST_LOG=debug` shows more of them.
fn start_log() {
    let filter = tracing_subscriber::EnvFilter::try_from_default_env().unwrap_or_else(|_| "warn".into());
    let ansi = terminal::colours(&io::stderr());
    tracing_subscriber::fmt().with_env_filter(filter).with_ansi(ansi).with_writer(io::stderr).without_time().init();
}
