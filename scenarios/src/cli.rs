//! What can be typed.

use std::num::NonZeroU8;
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
    /// Write an index of a set: a file that is given in its stead and opened at once, for large sets and packed files
    Index(IndexArguments),
    /// The families that scenes can be generated of; with a name, what can be said about its scenes beforehand
    Families(FamiliesArguments),
    /// Make scenes of families and write them as shards of TFRecords, any number, the same bytes for the same seed
    Generate(GenerateArguments),
    /// Draw scenes from above, as PNG or SVG: one scene at one step, or a sheet of many
    Render(RenderArguments),
    /// Download scenes of real traffic that are public, a few to begin with; their licence is shown first
    Fetch(FetchArguments),
    /// Figures of a set as a whole: percentiles of agents, sizes, speeds, gaps, lanes, signals ...
    Stats(StatsArguments),
}

/// Where scenes are taken from.
#[derive(Debug, Args)]
pub struct Inputs {
    /// WOMD TFRecord files (packed with gzip or zlib or not), ScenarioNet's pickles, Argoverse 2's tables, folders or globs of them,
    /// scene-set TOML files, indices, or the word demo
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

/// Arguments of `index`.
#[derive(Debug, Args)]
pub struct IndexArguments {
    /// What is to be indexed: files, folders, globs, scene-set TOML files, the word demo
    #[arg(value_name = "PATH", required = true)]
    pub paths: Vec<String>,

    /// The index, replaced if it is there. Scene files within its folder may be moved together with it
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
}

/// Arguments of `fetch`.
#[derive(Debug, Args)]
pub struct FetchArguments {
    /// Which scenes
    #[arg(value_name = "NAME", value_enum)]
    pub samples: Samples,

    /// Folder for the scenes; made if it is not there
    #[arg(long, value_name = "FOLDER")]
    pub out: PathBuf,

    /// Agree to the licence without being asked, for scripts; read it before
    #[arg(long)]
    pub yes: bool,

    /// The package, downloaded before by other means, instead of downloading it
    #[arg(long, value_name = "WHEEL")]
    pub from: Option<PathBuf>,

    /// Replace files that are there
    #[arg(long)]
    pub force: bool,
}

/// What can be fetched.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Samples {
    /// Three scenes of 20 s from the Waymo Open Motion Dataset, which the Python package metadrive-simulator brings; 49 MB to download
    MetadriveSamples,
}

/// Arguments of `families`.
#[derive(Debug, Args)]
pub struct FamiliesArguments {
    /// Show the parameters of this one
    #[arg(value_name = "NAME")]
    pub name: Option<String>,
}

/// Arguments of `generate`.
#[derive(Debug, Args)]
pub struct GenerateArguments {
    /// Families, with commas between, or the word all
    #[arg(long, value_name = "NAME", value_delimiter = ',', required = true)]
    pub family: Vec<String>,

    /// Scenes of each family; they are called FAMILY-SEED-0, FAMILY-SEED-1 ...
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub count: u32,

    /// Where random numbers start: another seed, other scenes
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u64).range(..1 << 63))]
    pub seed: u64,

    /// Folder for the shards; made if it is not there. Whole shards of the same command in it are kept
    #[arg(long, value_name = "FOLDER")]
    pub out: PathBuf,

    /// Pack them with gzip: a third of the size, and slower to make and to read
    #[arg(long)]
    pub gzip: bool,

    /// What is known of the scenes beforehand: name=4, or a range that each draws from, name=4..7; may be given several times
    #[arg(long, value_name = "NAME=RANGE")]
    pub set: Vec<String>,

    /// Scenes in a shard
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..))]
    pub shard_size: u32,

    /// Threads that make scenes, one a core if left out; the bytes are the same for any number
    #[arg(long, value_name = "N")]
    pub jobs: Option<NonZeroU8>,

    /// Start anew where scenes of other settings are: their shards are removed
    #[arg(long)]
    pub force: bool,
}

/// Arguments of `render`.
#[derive(Debug, Args)]
pub struct RenderArguments {
    #[command(flatten)]
    pub inputs: Inputs,

    /// The picture's file, .png or .svg; replaced if it is there. One scene fills it; several share it as a sheet, a tile each
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,

    /// The step that is shown, from 0 [default: where the scene's prediction tasks begin, else 19, where drives begin]
    #[arg(long, value_name = "K")]
    pub step: Option<usize>,

    /// Width of the picture, or of each tile of a sheet [default: 1200, tiles 480]
    #[arg(long, value_name = "PIXELS", value_parser = clap::value_parser!(u32).range(100..=10_000))]
    pub width: Option<u32>,

    /// Tiles in a row of a sheet [default: about as many as rows]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100))]
    pub columns: Option<u32>,

    /// How far the picture reaches from the AV, to each side
    #[arg(long, value_name = "METERS", default_value = "60", value_parser = radius)]
    pub radius: f64,

    /// The whole map, instead of what is around the AV
    #[arg(long, conflicts_with = "radius")]
    pub whole: bool,

    /// Turn the picture so that the AV heads up; else north is up
    #[arg(long)]
    pub av_up: bool,

    /// How long a past agents trail behind them; 0 leaves out the trails, and the dashed line on which the logged AV goes on
    #[arg(long, value_name = "SECONDS", default_value = "2", value_parser = trail)]
    pub trail: f64,
}

fn radius(text: &str) -> Result<f64, String> {
    within(text, 5.0, 5000.0)
}

fn trail(text: &str) -> Result<f64, String> {
    within(text, 0.0, 60.0)
}

fn within(text: &str, low: f64, high: f64) -> Result<f64, String> {
    let number: f64 = text.parse().map_err(|_| "it is no number".to_owned())?;
    if (low..=high).contains(&number) { Ok(number) } else { Err(format!("it is not from {low} to {high}")) }
}

/// Arguments of `stats`.
#[derive(Debug, Args)]
pub struct StatsArguments {
    #[command(flatten)]
    pub inputs: Inputs,

    /// Write the figures to this Parquet file too, a row a figure
    #[arg(long, value_name = "FILE")]
    pub parquet: Option<PathBuf>,

    /// Write figures of each scene to this Parquet file, a row a scene
    #[arg(long, value_name = "FILE")]
    pub per_scene: Option<PathBuf>,

    /// Print the tables as Markdown
    #[arg(long)]
    pub markdown: bool,
}
