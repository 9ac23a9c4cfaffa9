//! What reads finished runs.

use std::path::PathBuf;
use std::str::FromStr;

use clap::Args;
use evaluation::compare::CompareFormat;
use evaluation::compare::gate::FailOn;
use evaluation::score::{self, Score};
use evaluation::table::TableFormat;

/// `sim table`.
#[derive(Debug, Args)]
pub struct TableArgs {
    /// Folders of finished runs
    #[arg(required = true, value_name = "DIR")]
    pub runs: Vec<PathBuf>,
    /// How to print
    #[arg(long, value_enum, default_value_t)]
    pub format: TableFormat,
    /// A row a scene, the worst first: how it ended, and what happened with whom
    #[arg(long)]
    pub scenes: bool,
    /// Only so many of the scenes
    #[arg(long, value_name = "N", requires = "scenes")]
    pub worst: Option<usize>,
    /// Draw score against latency, a line a driver, of runs at several: an SVG file
    #[arg(long, value_name = "FILE")]
    pub plot: Option<PathBuf>,
}

/// `sim predictions`.
#[derive(Debug, Args)]
pub struct PredictionsArgs {
    /// Folders of finished runs
    #[arg(required = true, value_name = "DIR")]
    pub runs: Vec<PathBuf>,
    /// How to print
    #[arg(long, value_enum, default_value_t)]
    pub format: TableFormat,
}

/// `sim validity`.
#[derive(Debug, Args)]
pub struct ValidityArgs {
    /// Folders of finished runs
    #[arg(required = true, value_name = "DIR")]
    pub runs: Vec<PathBuf>,
    /// Where the scenes are [default: where the run has them from]
    #[arg(long, value_name = "PATH", num_args = 1..)]
    pub scenarios: Vec<String>,
    /// Print the episodes instead, those with the most such steps first
    #[arg(long)]
    pub scenes: bool,
    /// Write each step to a Parquet file
    #[arg(long, value_name = "FILE.parquet")]
    pub out: Option<PathBuf>,
    /// How to print
    #[arg(long, value_enum, default_value_t)]
    pub format: TableFormat,
}

/// `sim score`.
#[derive(Debug, Args)]
pub struct ScoreArgs {
    /// Folders of finished runs
    #[arg(required = true, value_name = "DIR")]
    pub runs: Vec<PathBuf>,
    /// By whose definitions, as nuplan,navsim [default: all]
    #[arg(long = "as", value_enum, value_name = "SCORES", value_delimiter = ',')]
    pub scores: Vec<Score>,
    /// A row an episode
    #[arg(long)]
    pub scenes: bool,
    /// How to print
    #[arg(long, value_enum, default_value_t)]
    pub format: score::Format,
    /// Write every figure of every episode too
    #[arg(long, value_name = "FILE.parquet")]
    pub out: Option<PathBuf>,
    /// Write Waymax's figures of every step too
    #[arg(long, value_name = "FILE.parquet")]
    pub out_steps: Option<PathBuf>,
    /// Where the scenes are [default: where the run has them from]
    #[arg(long, value_name = "PATH", num_args = 1..)]
    pub scenarios: Vec<String>,
}

impl ScoreArgs {
    /// The scores that are asked for, each once.
    #[must_use]
    pub fn scores(&self) -> Vec<Score> {
        let mut scores: Vec<Score> = Vec::new();
        let asked = if self.scores.is_empty() { Score::ALL.as_slice() } else { &self.scores };
        asked.iter().for_each(|score| {
            if !scores.contains(score) {
                scores.push(*score);
            }
        });
        if self.out_steps.is_some() && !scores.contains(&Score::Waymax) {
            scores.push(Score::Waymax);
        }
        scores
    }
}

/// `sim compare`.
#[derive(Debug, Args)]
pub struct CompareArgs {
    /// Folder of the finished run that is compared with, the baseline
    #[arg(value_name = "A")]
    pub baseline: PathBuf,
    /// Folder of the finished run that is judged, the candidate
    #[arg(value_name = "B")]
    pub candidate: PathBuf,
    /// Exit with 1 if: new-failures (a scene goes from pass to fail), missing-scenes (A has scenes that B has not), 'METRIC>X' or
    /// 'METRIC<X' (mean of B - A, in the column's unit, or as X% of A's mean); in quotes, as often as you like
    #[arg(long, value_name = "RULE", value_parser = FailOn::from_str)]
    pub fail_on: Vec<FailOn>,
    /// How to print
    #[arg(long, value_enum, default_value_t)]
    pub format: CompareFormat,
    /// Write JUnit XML too: a test case a scene, a failure for each new one
    #[arg(long, value_name = "FILE")]
    pub junit: Option<PathBuf>,
    /// Show both drives of a scene side by side in the Rerun viewer, from where they part [default: the first that flipped]
    #[arg(long, value_name = "SCENE", num_args = 0..=1, default_missing_value = "")]
    pub open: Option<String>,
    /// Where --open draws them [default: a file in the folder for temporary files]
    #[arg(long, value_name = "FILE.rrd", requires = "open")]
    pub rrd: Option<PathBuf>,
    /// What draws the resamples of the intervals
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
}

/// `sim report`.
#[derive(Debug, Args)]
pub struct ReportArgs {
    /// Folders of finished runs
    #[arg(required = true, value_name = "RUN")]
    pub runs: Vec<PathBuf>,
    /// The page
    #[arg(long, value_name = "FILE", default_value = "report.html")]
    pub html: PathBuf,
    /// So many of the failed drives are in the page to be played, the worst first
    #[arg(long, value_name = "N", default_value_t = 20)]
    pub players: usize,
    /// These are too, failed or not, of each run that drove them
    #[arg(long, value_name = "ID", num_args = 1.., value_delimiter = ',')]
    pub episodes: Vec<String>,
    /// Where the scenes are [default: where the runs have them from]
    #[arg(long, value_name = "PATH", num_args = 1..)]
    pub scenarios: Vec<String>,
    /// What draws the resamples of the intervals
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
}
