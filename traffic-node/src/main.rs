//! The process that drives the agents that react; see the library for who they are.

mod cli;

use std::process::ExitCode;

use tracing_subscriber::EnvFilter;
use wire::node::Stop;

fn main() -> ExitCode {
    let cli = terminal::parse::<cli::Cli>(terminal::REVISION);
    tracing_subscriber::fmt()
        .with_env_filter(EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new("warn,zenoh=error")))
        .with_ansi(terminal::colours(&std::io::stderr()))
        .with_writer(std::io::stderr)
        .init();
    match run(&cli) {
        Ok(Stop::Interrupted) => ExitCode::from(130),
        Ok(Stop::ParentGone | Stop::SimGone) => ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("error: {}", terminal::whole(e.as_ref()));
            ExitCode::from(2)
        }
    }
}

fn run(cli: &cli::Cli) -> anyhow::Result<Stop> {
    Ok(wire::node::serve_traffic(&cli.node, cli.choice.factory()?)?)
}
