//! The binary `scenarios`: shows what is in scene sets, judges whether to trust it, and writes scenes and their pictures to files.

mod cli;
mod commands;

use std::io::{self, ErrorKind, Write};
use std::process::ExitCode;

use cli::{Cli, Command};
use commands::{Failure, INTERRUPTED, export, families, fetch, generate, index, inspect, lint, list, render, stats};

/// Exit codes: 0 done; 1 done, and something is gravely wrong with a scene; 2 wrong usage or unusable input; 130 interrupted.
fn main() -> ExitCode {
    let cli = terminal::parse::<Cli>(terminal::REVISION);
    start_log();
    let mut out = io::stdout().lock();
    let done = match &cli.command {
        Command::List(arguments) => list::run(arguments, &mut out),
        Command::Inspect(arguments) => inspect::run(arguments, &mut out),
        Command::Lint(arguments) => lint::run(arguments, &mut out),
        Command::Export(arguments) => export::run(arguments, &mut out),
        Command::Index(arguments) => index::run(arguments, &mut out),
        Command::Families(arguments) => families::run(arguments, &mut out),
        Command::Generate(arguments) => generate::run(arguments, &mut out),
        Command::Render(arguments) => render::run(arguments, &mut out),
        Command::Fetch(arguments) => fetch::run(arguments, &mut out),
        Command::Stats(arguments) => stats::run(arguments, &mut out),
    };
    match done.and_then(|grave| out.flush().map(|()| grave).map_err(Failure::Output)) {
        Ok(grave) => ExitCode::from(u8::from(grave)),
        // Whoever was reading has seen enough.
        Err(Failure::Output(error)) if error.kind() == ErrorKind::BrokenPipe => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("error: {failure}\nhint: {}", failure.hint());
            ExitCode::from(if matches!(failure, Failure::Interrupted) { INTERRUPTED } else { 2 })
        }
    }
}

/// Logs go to standard error; `RUST_LOG=debug` shows more of them.
fn start_log() {
    let filter = tracing_subscriber::EnvFilter::try_from_default_env().unwrap_or_else(|_| "warn".into());
    let ansi = terminal::colours(&io::stderr());
    tracing_subscriber::fmt().with_env_filter(filter).with_ansi(ansi).with_writer(io::stderr).without_time().init();
}
