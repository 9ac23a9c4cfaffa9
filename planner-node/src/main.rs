//! The process that serves a planner; see the library for the planners.

mod cli;

use std::process::ExitCode;

use anyhow::bail;
use planner_node::explain::explain;
use planner_node::verify::{verify, verify_own};
use tracing_subscriber::EnvFilter;
use wire::node::Stop;

fn main() -> ExitCode {
    let cli = terminal::parse::<cli::Cli>(terminal::REVISION);
    tracing_subscriber::fmt()
        .with_env_filter(EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new("warn,zenoh=error")))
        .with_ansi(terminal::colours(&std::io::stderr()))
        .with_writer(std::io::stderr)
        .init();
    match run(cli) {
        Ok(code) => code,
        Err(e) => {
            eprintln!("error: {}", terminal::whole(e.as_ref()));
            ExitCode::from(2)
        }
    }
}

fn run(cli: cli::Cli) -> anyhow::Result<ExitCode> {
    match cli.command {
        Some(cli::Command::Verify { folder }) => {
            let report = folder.map_or_else(verify_own, |folder| verify(&folder))?;
            terminal::say(&format!("{report}\n"))?;
            return Ok(if report.holds() { ExitCode::SUCCESS } else { ExitCode::from(1) });
        }
        Some(cli::Command::Explain { recording, step, weights }) => {
            terminal::say(&explain(&recording, step, weights.as_ref())?.to_string())?;
            return Ok(ExitCode::SUCCESS);
        }
        None => {}
    }
    // clap lets nothing pass that has neither.
    let Some(serve) = cli.serve else { bail!("nothing to do: give --planner") };
    let factory = serve.choice.factory(&serve.gauss_newton, serve.proposals, &serve.cql, None)?;
    Ok(match wire::node::serve_planner(&serve.node, factory)? {
        Stop::Interrupted => ExitCode::from(130),
        Stop::ParentGone | Stop::SimGone => ExitCode::SUCCESS,
    })
}
