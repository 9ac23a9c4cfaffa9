//! `sim watch`: a bar with what is done and what time is left, failures as they happen, and the table at the end.

use std::collections::BTreeSet;
use std::time::Duration;

use clap::ValueEnum as _;
use wire::proto::service::{self as message, End, News, RunState, ask, reply};

use super::{ClientError, Service};
use crate::cli::WatchArgs;
use crate::run::console::Console;
use crate::run::voice::escaped;

/// Failures that were there before somebody watched: the last of them are shown.
const TAIL: usize = 10;

/// How long a service may be gone while somebody watches.
const PATIENCE: Duration = Duration::from_secs(600);

/// What became of a run.
#[derive(Debug)]
pub struct Watched {
    /// How it is.
    pub run: message::Run,
    /// Its table, if it is done.
    pub table: Option<String>,
}

/// Watches a run to its end.
///
/// # Errors
/// [`ClientError`].
pub fn watch(
    arguments: &WatchArgs,
    width: usize,
    service: &mut Service,
    console: &Console,
) -> Result<Watched, ClientError> {
    let mut asked = message::Watch { run: arguments.run.clone(), ..message::Watch::default() };
    let mut screen = Screen { console, ends: arguments.ends, known: BTreeSet::new(), has_bar: false, waits: None };
    let run = loop {
        let reply::What::News(News { run, ends, epoch, known }) =
            service.ask_for(&ask::What::Watch(asked.clone()), PATIENCE)?
        else {
            return Err(ClientError::OtherAnswer);
        };
        let run = run.ok_or(ClientError::OtherAnswer)?;
        (asked.epoch, asked.known, asked.state) = (epoch, known, run.state);
        screen.show(&run, ends);
        if !matches!(run.state(), RunState::Queued | RunState::Running) {
            break run;
        }
    };
    console.end();
    let mut table = None;
    if run.state() == RunState::Done {
        let format = arguments.format.to_possible_value().map(|value| value.get_name().to_owned());
        let (run, format, width) = (run.name.clone(), format.unwrap_or_default(), width as u32);
        let asked = ask::What::Table(message::AskTable { run, format, width, results: false });
        let reply::What::Table(told) = service.ask(&asked)? else { return Err(ClientError::OtherAnswer) };
        table = Some(told.text);
    }
    Ok(Watched { run, table })
}

/// What is shown of it.
struct Screen<'a> {
    console: &'a Console,
    /// Whether each end is shown, and not failures alone.
    ends: bool,
    known: BTreeSet<String>,
    has_bar: bool,
    /// How many runs were to come first, when that was last said.
    waits: Option<u32>,
}

impl Screen<'_> {
    fn show(&mut self, run: &message::Run, ends: Vec<End>) {
        if run.state() == RunState::Queued && run.done == 0 && self.waits != Some(run.before) {
            self.waits = Some(run.before);
            let behind = if run.before > 0 { format!(", behind {} others", run.before) } else { String::new() };
            self.console.line(&format!("{} waits{behind}", run.name));
        }
        let new: Vec<End> = ends.into_iter().filter(|end| self.known.insert(end.scene.clone())).collect();
        if !self.has_bar && run.episodes > 0 {
            self.has_bar = true;
            self.console.begin("episodes", run.episodes as usize, new.len());
            let shown: Vec<&End> = new.iter().filter(|end| self.is_shown(end)).collect();
            let passed_over = shown.len().saturating_sub(TAIL);
            if passed_over > 0 {
                self.console.line(&format!("... and {passed_over} before"));
            }
            return shown[passed_over..].iter().for_each(|end| self.console.line(&line(end)));
        }
        for end in &new {
            self.console.advance();
            if self.is_shown(end) {
                self.console.line(&line(end));
            }
        }
    }

    /// Whether the drive went wrong, or all are asked for.
    fn is_shown(&self, end: &End) -> bool {
        self.ends || !matches!(&*end.reason, "horizon" | "log-end")
    }
}

fn line(end: &End) -> String {
    let detail = if end.detail.is_empty() { String::new() } else { format!(": {}", escaped(&end.detail)) };
    format!("{}: {} after {} steps{detail}", escaped(&end.scene), escaped(&end.reason), end.steps)
}
