//! The recorder's command line. Exit codes: 0 done, 1 failed at work, 2 usage or unusable input, 130 interrupted.

mod cli;

use std::process::ExitCode;

use anyhow::Context as _;
use tracing_subscriber::EnvFilter;
use wire::node::Stop;

use cli::{Cli, Command};
use recorder::{export, info, record, view};

const UNUSABLE: u8 = 2;
const INTERRUPTED: u8 = 130;

fn main() -> ExitCode {
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new("warn,zenoh=error"));
    let ansi = terminal::colours(&std::io::stderr());
    tracing_subscriber::fmt().with_env_filter(filter).with_ansi(ansi).with_writer(std::io::stderr).init();
    let result = match terminal::parse::<Cli>(terminal::REVISION).command {
        Command::Record(arguments) => record_run(arguments),
        Command::View(arguments) => view_run(&arguments),
        Command::Export(arguments) => export_file(&arguments),
        Command::Info(arguments) => show_info(&arguments),
    };
    result.unwrap_or_else(|error| {
        eprintln!("error: {}", terminal::whole(error.as_ref()));
        ExitCode::from(UNUSABLE)
    })
}

fn record_run(arguments: cli::Record) -> anyhow::Result<ExitCode> {
    Ok(left(record::record(&arguments.node, arguments.out, arguments.format)?))
}

fn left(stop: Stop) -> ExitCode {
    match stop {
        Stop::Interrupted => ExitCode::from(INTERRUPTED),
        Stop::ParentGone | Stop::SimGone => ExitCode::SUCCESS,
    }
}

fn view_run(arguments: &cli::View) -> anyhow::Result<ExitCode> {
    Ok(left(view::view(&arguments.node)?))
}

fn export_file(arguments: &cli::Export) -> anyhow::Result<ExitCode> {
    let beside = || {
        let name = arguments.mcap.to_string_lossy();
        let stem = name.strip_suffix(".partial").unwrap_or(&name);
        format!("{}.rrd", stem.strip_suffix(".mcap").unwrap_or(stem)).into()
    };
    let rrd = arguments.rrd.clone().unwrap_or_else(beside);
    if let Some(other) = &arguments.beside {
        let troubles = export::export_beside([&arguments.mcap, other], &rrd, arguments.from, arguments.force)?;
        troubles.iter().for_each(|trouble| eprintln!("warning: {trouble}; the rest is drawn"));
    } else if let Some(trouble) = export::export(&arguments.mcap, &rrd, arguments.run.as_deref(), arguments.force)? {
        eprintln!("warning: {} is {trouble}; the rest is drawn", arguments.mcap.display());
    }
    terminal::say(&format!("{}\n", rrd.display()))?;
    Ok(ExitCode::SUCCESS)
}

fn show_info(arguments: &cli::Info) -> anyhow::Result<ExitCode> {
    for (number, path) in arguments.files.iter().enumerate() {
        let recorded = recording::load(path)?;
        let name = path.display().to_string();
        let info = info::Info::read(name, &recorded, arguments.settings);
        let info = info.with_context(|| format!("cannot use {}", path.display()))?;
        terminal::say(&format!("{}{info}", if number == 0 { "" } else { "\n" }))?;
    }
    Ok(ExitCode::SUCCESS)
}
