//! The process that serves a predictor; see the library for the predictors.

mod cli;

use std::process::ExitCode;

use anyhow::bail;
use predictor_node::explain::explain;
use predictor_node::verify::verify;

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
        Some(cli::Command::Verify { weights, vectors, scenarios }) => {
            let reports = verify(&weights, &vectors, &scenarios)?;
            for (title, report) in &reports {
                terminal::say(&format!("{title}\n{report}\n"))?;
            }
            let holds = reports.iter().all(|(_, report)| report.holds());
            return Ok(if holds { ExitCode::SUCCESS } else { ExitCode::from(1) });
        }
        Some(cli::Command::Explain { recording, step, weights, features }) => {
            terminal::say(&explain(&recording, step, weights.as_deref(), features)?.to_string())?;
            return Ok(ExitCode::SUCCESS);
        }
        None => {}
    }
    // clap lets nothing pass that has neither.
    let Some(serve) = cli.serve else { bail!("nothing to do: give --predictor") };
    let factory = serve.choice.factory(None)?;
    Ok(match wire::node::serve_predictor(&serve.node, factory)? {
        Stop::Interrupted => ExitCode::from(130),
        Stop::ParentGone | Stop::SimGone => ExitCode::SUCCESS,
    })
}
