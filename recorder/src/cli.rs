//! What can be typed.

use std::path::PathBuf;

use clap::{Parser, Subcommand};

use recorder::recording::Format;

/// Writes episodes down as MCAP and Rerun files, and shows what recordings hold.
#[derive(Parser)]
#[command(name = "recorder", about, max_term_width = 100)]
pub struct Cli {
    #[command(subcommand)]
    pub command: Command,
}

#[derive(Subcommand)]
pub enum Command {
    /// Join a run and record its episodes until it ends; `sim run` starts this by itself
    Record(Record),
    /// Show a run in the Rerun viewer while it is driven; `sim run --view` starts this by itself
    ///
    /// A viewer that runs on this machine shows it, else one is started (`rerun` on the PATH). The run waits for neither.
    View(View),
    /// Draw a recording into a file for the Rerun viewer
    Export(Export),
    /// Show what recordings hold
    Info(Info),
}

#[derive(clap::Args)]
pub struct Record {
    #[command(flatten)]
    pub node: wire::node::Options,
    /// Folder for the files; made if it is not there
    #[arg(long, value_name = "FOLDER")]
    pub out: PathBuf,
    /// What to write for each episode
    #[arg(long, value_name = "FORMATS", value_enum, value_delimiter = ',', default_values = ["mcap", "rrd"])]
    pub format: Vec<Format>,
}

#[derive(clap::Args)]
pub struct View {
    #[command(flatten)]
    pub node: wire::node::Options,
}

#[derive(clap::Args)]
pub struct Export {
    /// The recording; one that is cut off will do
    #[arg(value_name = "MCAP")]
    pub mcap: PathBuf,
    /// The file to write; beside the recording where it is not said
    #[arg(long, value_name = "FILE")]
    pub rrd: Option<PathBuf>,
    /// Draw this recording of the same scene beside it
    #[arg(long, value_name = "MCAP", conflicts_with = "run", requires = "rrd")]
    pub beside: Option<PathBuf>,
    /// Step before which the viewer begins to play both
    #[arg(long, value_name = "STEP", default_value_t = 0, requires = "beside")]
    pub from: u32,
    /// The run it is shown under; its own where it is not said
    #[arg(long, value_name = "NAME")]
    pub run: Option<String>,
    /// Replace a file that is there
    #[arg(long)]
    pub force: bool,
}

#[derive(clap::Args)]
pub struct Info {
    /// Recordings; cut off ones will do
    #[arg(value_name = "MCAP", required = true)]
    pub files: Vec<PathBuf>,
    /// Show the run's settings too
    #[arg(long)]
    pub settings: bool,
}
