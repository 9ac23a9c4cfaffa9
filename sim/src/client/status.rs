//! `sim status`: how runs are, and what a service offers; for people, or as JSON.

use std::fmt::Write as _;

use serde_json::{Value, json};
use wire::proto::service::{self as message, AskOffer, AskStatus, Offer, Run, RunState, ask, reply};

use super::{ClientError, Service};
use crate::cli::StatusArgs;
use crate::run::voice::escaped;

/// What the service says, as text.
///
/// # Errors
/// [`ClientError`].
pub fn status(arguments: &StatusArgs, service: &mut Service) -> Result<String, ClientError> {
    if arguments.offer {
        let reply::What::Offer(offer) = service.ask(&ask::What::Offer(AskOffer {}))? else {
            return Err(ClientError::OtherAnswer);
        };
        return Ok(if arguments.json { pretty(&offer_value(&offer)) } else { offer_text(&offer) });
    }
    let run = arguments.run.clone().unwrap_or_default();
    let reply::What::Runs(message::Runs { runs }) = service.ask(&ask::What::Status(AskStatus { run }))? else {
        return Err(ClientError::OtherAnswer);
    };
    if arguments.json {
        return Ok(pretty(&runs.iter().map(run_value).collect()));
    }
    Ok(if runs.is_empty() { "no run was submitted\n".to_owned() } else { runs_text(&runs) })
}

/// As people call it.
#[must_use]
pub fn state_name(state: RunState) -> &'static str {
    match state {
        RunState::Unspecified => "unknown",
        RunState::Queued => "queued",
        RunState::Running => "running",
        RunState::Done => "done",
        RunState::Failed => "failed",
        RunState::Cancelled => "cancelled",
    }
}

/// A line a run, in columns.
fn runs_text(runs: &[Run]) -> String {
    let mut rows = vec![["run", "client", "state", "episodes", "without a result"].map(str::to_owned)];
    for run in runs {
        let state = match run.state() {
            RunState::Queued if run.before > 0 => format!("queued behind {}", run.before),
            state => state_name(state).to_owned(),
        };
        let episodes = if run.episodes > 0 { format!("{} of {}", run.done, run.episodes) } else { String::new() };
        rows.push([escaped(&run.name), escaped(&run.client), state, episodes, run.failed.to_string()]);
    }
    let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
    let widths = [0, 1, 2, 3, 4].map(width);
    let mut text = String::new();
    for (row, run) in rows.iter().zip(std::iter::once(None).chain(runs.iter().map(Some))) {
        let cells = row.iter().zip(widths).map(|(cell, width)| format!("{cell:<width$}"));
        // A String takes whatever is written.
        let _ = writeln!(text, "{}", cells.collect::<Vec<_>>().join("  ").trim_end());
        for line in run.into_iter().flat_map(|run| run.detail.lines()) {
            let _ = writeln!(text, "    {}", escaped(line));
        }
    }
    text
}

fn offer_text(offer: &Offer) -> String {
    let mut text = String::new();
    let _ =
        writeln!(text, "reloop {} ({}), messages of version {}", offer.version, offer.git_revision, offer.wire_version);
    let _ = writeln!(
        text,
        "{} runs at a time with {} workers: {} running, {} of at most {} queued; {} of at most {} sessions",
        offer.runs_at_once,
        offer.workers,
        offer.running,
        offer.queued,
        offer.most_queued,
        offer.sessions,
        offer.most_sessions
    );
    let _ = writeln!(text, "commands of clients: {}", if offer.commands { "started" } else { "not started" });
    let _ = writeln!(text, "\nscene sets");
    for set in &offer.scene_sets {
        let _ = writeln!(text, "  {}: {} scenes", escaped(&set.name), set.scenes);
        for id in set.ids.iter().take(20) {
            let _ = writeln!(text, "    {}", escaped(id));
        }
        if set.scenes > 20 {
            let _ = writeln!(text, "    ... --json has more");
        }
    }
    let _ = writeln!(text, "\ndrivers");
    for driver in &offer.drivers {
        let needs = if driver.ready { "" } else { " (of those offered here)" };
        let _ = writeln!(text, "  {}: {}{needs}", escaped(&driver.name), escaped(&driver.about));
    }
    let weights =
        if offer.weights.is_empty() { "those of dipp, built in".to_owned() } else { offer.weights.join(", ") };
    let _ = writeln!(text, "\nweights: {}", escaped(&weights));
    text
}

/// A run, for programs.
fn run_value(run: &Run) -> Value {
    json!({
        "name": run.name, "client": run.client, "state": state_name(run.state()), "detail": run.detail,
        "episodes": run.episodes, "done": run.done, "failed": run.failed, "before": run.before,
        "arguments": run.arguments, "digest": run.digest,
    })
}

fn offer_value(offer: &Offer) -> Value {
    let driver =
        |driver: &message::DriverOffer| json!({"name": driver.name, "about": driver.about, "ready": driver.ready});
    let set = |set: &message::SceneSetOffer| json!({"name": set.name, "scenes": set.scenes, "ids": set.ids});
    json!({
        "version": offer.version, "git_revision": offer.git_revision, "wire_version": offer.wire_version,
        "drivers": offer.drivers.iter().map(driver).collect::<Vec<_>>(),
        "scene_sets": offer.scene_sets.iter().map(set).collect::<Vec<_>>(),
        "weights": offer.weights, "commands": offer.commands, "workers": offer.workers,
        "runs_at_once": offer.runs_at_once, "running": offer.running, "queued": offer.queued,
        "most_queued": offer.most_queued, "sessions": offer.sessions, "most_sessions": offer.most_sessions,
    })
}

fn pretty(value: &Value) -> String {
    format!("{value:#}\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_lines_and_reasons_stand_below() {
        let run = |name: &str, state: RunState| Run {
            name: name.to_owned(),
            client: "me".to_owned(),
            state: state.into(),
            episodes: 3,
            ..Run::default()
        };
        let failed = Run { detail: "no\u{7}\nhint: none".to_owned(), ..run("a", RunState::Failed) };
        let queued = Run { before: 2, ..run("longer", RunState::Queued) };
        insta::assert_snapshot!(runs_text(&[failed, queued]), @r"
        run     client  state            episodes  without a result
        a       me      failed           0 of 3    0
            no\u{7}
            hint: none
        longer  me      queued behind 2  0 of 3    0
        ");
    }
}
