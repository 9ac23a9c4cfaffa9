//! The process that serves a predictor; see the library for the predictors.

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
    match serve(&cli) {
        Ok(Stop::Interrupted) => ExitCode::from(130),
        Ok(Stop::ParentGone | Stop::SimGone) => ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("error: {e:#}");
            ExitCode::from(2)
        }
    }
}

fn serve(cli: &cli::Cli) -> anyhow::Result<Stop> {
    let factory = cli.predictor.factory(&cli.options)?;
    Ok(wire::node::serve_predictor(&cli.node, factory)?)
}
