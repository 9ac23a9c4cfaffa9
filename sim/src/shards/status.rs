//! `sim status RUN`: how far a run in a folder is, what is missing or failed in it, and the commands that drive that.

use std::fmt::Write as _;
use std::path::Path;

use results::files::FileError;
use results::folder::{FolderError, read_run_file};
use results::hold::{is_at_work, is_busy};
use results::settings::RunFile;
use results::summary::{Summary, SummaryError};
use results::survey::{State, Survey};
use serde_json::json;
use shard::Shard;
use thiserror::Error;

use super::command;
use super::merge::names;

/// Failed scenes that are shown with their reasons.
const MOST_FAILURES: usize = 10;

/// A run that nothing can be said of.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum StatusError {
    #[error(transparent)]
    Folder(#[from] FolderError),
    #[error(transparent)]
    File(#[from] FileError),
    #[error(transparent)]
    Summary(#[from] SummaryError),
}

/// How far a run is.
pub struct Status {
    /// For people, or as JSON.
    pub text: String,
    /// Whether all of it is driven and has a result.
    pub is_clean: bool,
}

/// One shard of a run, or all of a run that has none.
struct Row {
    shard: Option<Shard>,
    episodes: usize,
    done: usize,
    failed: usize,
    is_at_work: bool,
}

impl Row {
    fn of<'s>(shard: Option<Shard>, states: impl Iterator<Item = &'s State>, is_at_work: bool) -> Self {
        let mut row = Self { shard, episodes: 0, done: 0, failed: 0, is_at_work };
        for state in states {
            row.episodes += 1;
            row.done += usize::from(state.is_done());
            row.failed += usize::from(matches!(state, State::Done { failure } if !failure.is_empty()));
        }
        row
    }

    fn missing(&self) -> usize {
        self.episodes - self.done
    }
}

/// How far the run in `folder` is.
///
/// # Errors
/// [`StatusError`] where there is no run, or it cannot be read.
pub fn status(folder: &Path, json: bool) -> Result<Status, StatusError> {
    let file = read_run_file(folder)?.ok_or_else(|| FolderError::NoRun(folder.to_owned()))?;
    match Summary::read(folder) {
        Ok(run) => return Ok(finished(&run, json)),
        Err(SummaryError::Unfinished(_)) => {}
        Err(error) => return Err(error.into()),
    }
    let survey = Survey::of(folder, &file)?;
    let rows: Vec<Row> = match &file.machine.shards {
        None => vec![Row::of(None, survey.scenes.iter(), is_busy(folder))],
        Some(shards) => Shard::all(shards.count)
            .map(|it| Row::of(Some(it), survey.of_shard(it).map(|(_, state)| state), is_at_work(folder, it)))
            .collect(),
    };
    let text = if json { as_json(folder, &file, &survey, &rows) } else { as_text(folder, &file, &survey, &rows) };
    Ok(Status { text, is_clean: survey.is_whole() && rows.iter().all(|row| row.failed == 0) })
}

fn finished(run: &Summary, as_json: bool) -> Status {
    let (folder, total, failed) = (run.folder.display(), run.scenes.len(), run.failures.len());
    let text = if as_json {
        let failures = run.failures.iter().map(|it| json!({"scene": it.scene, "why": it.detail}));
        let value = json!({"folder": folder.to_string(), "finished": true, "episodes": total, "done": total,
                           "failed": failures.collect::<Vec<_>>(), "missing": []});
        format!("{value:#}\n")
    } else if failed == 0 {
        format!("{folder} is finished: {total} episodes, none failed\n")
    } else {
        format!(
            "{folder} is finished: {total} episodes, {failed} failed\nhint: the command that it was begun with and `--retry failed` drives \
             those again\n"
        )
    };
    Status { text, is_clean: failed == 0 }
}

/// The scenes in this state.
fn scenes<'a>(file: &'a RunFile, survey: &'a Survey, which: impl Fn(&State) -> bool) -> Vec<&'a str> {
    let pairs = file.scenes.iter().zip(&survey.scenes);
    pairs.filter(|(_, state)| which(state)).map(|(line, _)| line.id.as_str()).collect()
}

fn as_text(folder: &Path, file: &RunFile, survey: &Survey, rows: &[Row]) -> String {
    let total = file.scenes.len();
    let missing = scenes(file, survey, |state| !state.is_done());
    let failed: usize = rows.iter().map(|row| row.failed).sum();
    let mut text = format!(
        "{}: {}, {}{}: {} of {total} episodes are done, {failed} of them failed\n",
        folder.display(),
        file.settings.driver,
        file.settings.protocol.name(),
        file.settings.traffic.as_ref().map_or_else(String::new, |traffic| format!(", traffic {traffic}")),
        total - missing.len(),
    );
    let columns = |[shard, episodes, done, failed, state]: [&str; 5]| {
        let line = format!("{shard:>8}  {episodes:>8}  {done:>8}  {failed:>8}  {state}");
        format!("{}\n", line.trim_end())
    };
    text += &format!("\n{}", columns(["shard", "episodes", "done", "failed", ""]));
    for row in rows {
        let shard = row.shard.map_or_else(|| "all".to_owned(), |shard| shard.to_string());
        let state = match (row.missing(), row.is_at_work) {
            (_, true) => "at work",
            (0, false) => "whole",
            (_, false) => "nobody is at work",
        };
        let numbers = [row.episodes, row.done, row.failed].map(|number| number.to_string());
        text += &columns([&shard, &numbers[0], &numbers[1], &numbers[2], state]);
    }
    for (what, state) in [
        ("damaged, driven again", State::Damaged),
        ("without a whole recording, driven again", State::Unrecorded),
        ("of another run: remove their files from parts/", State::Foreign),
    ] {
        let found = scenes(file, survey, |it| *it == state);
        if !found.is_empty() {
            let _ = writeln!(text, "\n{} {what}: {}", found.len(), names(&found));
        }
    }
    if !survey.strangers.is_empty() {
        let strangers: Vec<&str> = survey.strangers.iter().map(String::as_str).collect();
        let _ = writeln!(text, "\n{} of scenes that the run has not: {}", strangers.len(), names(&strangers));
    }
    if !missing.is_empty() {
        let _ = writeln!(text, "\n{} missing: {}", missing.len(), names(&missing));
    }
    text += &failures(file, survey, failed);
    text += &what_to_do(folder, file, rows);
    text
}

fn failures(file: &RunFile, survey: &Survey, failed: usize) -> String {
    let why = |state: &State| match state {
        State::Done { failure } if !failure.is_empty() => Some(failure.clone()),
        _ => None,
    };
    let failures = file.scenes.iter().zip(&survey.scenes).filter_map(|(line, state)| Some((&line.id, why(state)?)));
    let mut text = String::new();
    for (scene, why) in failures.take(MOST_FAILURES) {
        let _ = writeln!(text, "{}failed: {scene}: {why}", if text.is_empty() { "\n" } else { "" });
    }
    if failed > MOST_FAILURES {
        let _ = writeln!(text, "and {} more", failed - MOST_FAILURES);
    }
    text
}

/// The commands that drive what is missing; or that merge, where nothing is.
fn what_to_do(folder: &Path, file: &RunFile, rows: &[Row]) -> String {
    let left = |row: &&Row| row.missing() > 0 && !row.is_at_work;
    let lines: Vec<String> = match &file.machine.shards {
        None => return "\nthe command that the run was begun with drives what is missing\n".to_owned(),
        Some(_) => rows.iter().filter(left).map(|row| command(file, row.shard)).collect(),
    };
    let mut text = String::new();
    if !lines.is_empty() {
        let _ = writeln!(text, "\nthis drives what is missing:\n  {}", lines.join("\n  "));
        if !rows.iter().any(|row| row.is_at_work) {
            let _ = writeln!(text, "or, all of it here, and then merged:\n  {}", command(file, None));
        }
    }
    if rows.iter().all(|row| row.missing() == 0) {
        let _ = writeln!(text, "\nthis makes it a run:\n  sim merge {}", super::quoted(&folder.display().to_string()));
    }
    for row in rows.iter().filter(|row| row.failed > 0 && !row.is_at_work) {
        let again = if text.contains("--retry failed") { "" } else { "\nthis drives again what failed:\n" };
        let _ = writeln!(text, "{again}  {} --retry failed", command(file, row.shard));
    }
    text
}

fn as_json(folder: &Path, file: &RunFile, survey: &Survey, rows: &[Row]) -> String {
    let of = |row: &Row| {
        json!({"shard": row.shard.map(|shard| shard.to_string()), "episodes": row.episodes, "done": row.done, "failed": row.failed,
               "at-work": row.is_at_work, "command": row.shard.map(|shard| command(file, Some(shard)))})
    };
    let failed = file.scenes.iter().zip(&survey.scenes).filter_map(|(line, state)| match state {
        State::Done { failure } if !failure.is_empty() => Some(json!({"scene": line.id, "why": failure})),
        _ => None,
    });
    let value = json!({
        "folder": folder.display().to_string(),
        "finished": false,
        "episodes": file.scenes.len(),
        "done": rows.iter().map(|row| row.done).sum::<usize>(),
        "missing": scenes(file, survey, |state| !state.is_done()),
        "failed": failed.collect::<Vec<_>>(),
        "shards": rows.iter().map(of).collect::<Vec<_>>(),
    });
    format!("{value:#}\n")
}
