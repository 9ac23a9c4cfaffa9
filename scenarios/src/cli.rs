//! What can be typed.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};

/// Look into scenes before they are driven.
#[derive(Debug, Parser)]
#[command(name = "scenarios", max_term_width = 100)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// What can be done.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// A table of scenes, one a row
    List(ListArguments),
    /// All about scenes: time, AV, agents, map, signals, route, findings
    Inspect(InspectArguments),
    /// What to know of scenes before believing their results; exits with 1 if a scene cannot be judged
    Lint(LintArguments),
    /// Write scenes as TFRecord files, one each, for any tool that reads WOMD
    Export(ExportArguments),
}

/// Where scenes are taken from.
#[derive(Debug, Args)]
pub struct Inputs {
    /// WOMD TFRecord files (packed with gzip or zlib or not), folders or globs of them, scene-set TOML files, or the word demo
    #[arg(value_name = "PATH", default_value = "demo")]
    pub paths: Vec<String>,

    /// Only the scene of this id; may be given several times
    #[arg(long, value_name = "ID")]
    pub scene: Vec<String>,
}

/// Arguments of `list`.
#[derive(Debug, Args)]
pub struct ListArguments {
    #[command(flatten)]
    pub inputs: Inputs,
}

/// Arguments of `inspect`.
#[derive(Debug, Args)]
pub struct InspectArguments {
    #[command(flatten)]
    pub inputs: Inputs,
}

/// Arguments of `lint`.
#[derive(Debug, Args)]
pub struct LintArguments {
    #[command(flatten)]
    pub inputs: Inputs,

    /// Leave out what matters less than this
    #[arg(long, value_enum, default_value_t = Level::Note)]
    pub at_least: Level,
}

/// A severity as it is typed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
#[allow(missing_docs, reason = "scenarios::lint::Severity tells")]
pub enum Level {
    Note,
    Warning,
    Error,
}

/// Arguments of `export`.
#[derive(Debug, Args)]
pub struct ExportArguments {
    #[command(flatten)]
    pub inputs: Inputs,

    /// Folder for the files; made if it is not there
    #[arg(long, value_name = "FOLDER")]
    pub out: PathBuf,

    /// Replace files that are there
    #[arg(long)]
    pub force: bool,
}
