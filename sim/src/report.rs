//! `sim report`: finished runs as one page.

use std::io::Write as _;
use std::path::PathBuf;

use evaluation::report::{ReportError, Request, report};
use results::files::{FileError, write_whole};
use thiserror::Error;

use crate::cli::ReportArgs;

/// A page that could not be made or written.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum WriteReportError {
    #[error(transparent)]
    Report(#[from] ReportError),
    #[error(transparent)]
    File(#[from] FileError),
}

/// What came of it.
#[derive(Debug)]
pub struct Written {
    /// Where the page is, and what is in it.
    pub text: String,
    /// What could not be shown.
    pub notes: Vec<String>,
}

/// Writes the page of the finished `runs`.
///
/// # Errors
/// [`WriteReportError`].
pub fn write(arguments: &ReportArgs, runs: Vec<PathBuf>) -> Result<Written, WriteReportError> {
    let request = Request {
        runs,
        scenarios: arguments.scenarios.clone(),
        players: arguments.players,
        episodes: arguments.episodes.clone(),
        seed: arguments.seed,
    };
    let made = report(&request)?;
    write_whole(&arguments.html, |file| file.write_all(made.html.as_bytes()))?;
    let (path, kilobytes) = (arguments.html.display(), made.html.len().div_ceil(1000));
    let text = format!("{path}: {kilobytes} kB, {} drives to be played\n", made.players);
    Ok(Written { text, notes: made.notes })
}
