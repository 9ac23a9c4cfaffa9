//! The runs of a service: who waits, what is being driven, what is over.
//!
//! ```text
//!            submit                 its turn                 exit 0 or 1
//! nothing ───────────▶ queued ───────────────▶ driven by ───────────────▶ done
//!                        ▲  │                  `sim run`      exit 2, or killed too often
//!                        │  │ cancel              │ │     ───────────────▶ failed ──▶ queued, if submitted again
//!                        │  └──────────────▶ cancelled ◀────┘ cancel
//!                        └──────── the service ends, or its process is killed
//! ```
//!
//! Each run is driven by a process of its own, `sim run` with the client's settings: what takes one down leaves the others alone, cancelling is its end, and
//! going on is the same command. It leaves when its standard input ends, so also when the service is killed. The lock of the run's folder holds back the next one
//! until it has left; whatever was stored stays, and no episode that is stored is driven again.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use results::files::FileError;
use results::folder::BUSY;
use results::hold::is_busy;
use results::summary::Summary;
use wire::proto::service::refusal::Code;
use wire::proto::service::{self as message, News, Refusal, RunState};

use super::follow::{Follow, ends_of_results};
use super::offer::{Offer, is_name};
use super::record::{Record, Records, Standing, Wish};
use super::turns::{Turns, Waiting};
use crate::cli::ServeArgs;
use crate::run::bus_threads;
use crate::run::console::Console;
use crate::run::interrupt::INTERRUPTED;
use crate::run::process::{Groups, Process, StartError};
use crate::run::voice::Voice;

/// How often in a row the process of a run may be killed before the run is given up: it may be what kills it.
const MOST_DEATHS: u32 = 3;

/// How long a process that was asked to leave may take.
const PATIENCE: Duration = Duration::from_secs(15);

/// How long the last words of a process are waited for.
const HEARING: Duration = Duration::from_millis(300);

/// Runs that are over and still listed.
const LISTED: usize = 200;

/// A process that drives a run.
struct Driving {
    process: Process,
    /// What it says.
    log: PathBuf,
    /// When it was asked to leave, if it was.
    leaving: Option<Instant>,
}

/// The runs of a service.
pub struct Runs {
    /// Where their folders are.
    folder: PathBuf,
    records: Records,
    turns: Turns,
    driving: BTreeMap<String, Driving>,
    /// Of runs that are not done, as far as somebody wanted to know.
    followed: BTreeMap<String, Follow>,
    /// How many lists of ends there were.
    epochs: u64,
    /// How often in a row a run's process was killed.
    deaths: BTreeMap<String, u32>,
    /// Runs driven at a time.
    at_once: usize,
    /// Of each of them, episodes driven at a time.
    share: u16,
    most_queued: usize,
    /// Whether nothing new is begun.
    ending: bool,
    /// When the disk last refused a record: for a while nothing is begun then, for it would end likewise.
    refused: Option<Instant>,
    console: Console,
}

impl Runs {
    /// Those that are there.
    ///
    /// # Errors
    /// [`FileError`].
    pub fn open(arguments: &ServeArgs, own: &Path, workers: u16, console: &Console) -> Result<Self, FileError> {
        let (records, unreadable) = Records::open(&own.join("runs"))?;
        for file in unreadable {
            console.line(&format!(
                "note: {} is no record of a run, and is passed over",
                own.join("runs").join(file).display()
            ));
        }
        let at_once = arguments.runs_at_once.min(workers);
        Ok(Self {
            folder: arguments.runs.clone(),
            records,
            turns: Turns::default(),
            driving: BTreeMap::new(),
            followed: BTreeMap::new(),
            epochs: u64::from(std::process::id()) << 32,
            deaths: BTreeMap::new(),
            at_once: at_once.into(),
            share: workers / at_once,
            most_queued: arguments.most_queued.into(),
            ending: false,
            refused: None,
            console: console.clone(),
        })
    }

    /// How many are being driven, and how many wait.
    #[must_use]
    pub fn counts(&self) -> (usize, usize) {
        let queued = self.records.iter().filter(|(_, record)| record.standing == Standing::Queued).count();
        (self.driving.len(), queued.saturating_sub(self.driving.len()))
    }

    /// Runs driven at a time.
    #[must_use]
    pub fn at_once(&self) -> usize {
        self.at_once
    }

    /// Takes a run into the queue. When this returns it will be driven, whatever happens to the service.
    ///
    /// # Errors
    /// A refusal.
    pub fn submit(&mut self, asked: message::Submit, offer: &Offer) -> Result<message::Run, Refusal> {
        let refused = |code: Code, text: String| Err(Refusal { code: code.into(), text });
        if !is_name(&asked.submission) || !is_name(&asked.client) || !(asked.name.is_empty() || is_name(&asked.name)) {
            let what = "the names of run, client and submission are 1 to 100 of A-Z a-z 0-9 _ . -, not beginning with a dot or dash";
            return refused(Code::BadSettings, what.to_owned());
        }
        if let Some(name) = self.records.of_submission(&asked.submission).cloned() {
            return self.status(&name);
        }
        let wish = offer.wish(&asked.settings.unwrap_or_default())?;
        let request = offer.request(&wish, self.share)?;
        let name = match asked.name {
            name if name.is_empty() => {
                self.new_name(&format!("{}-{}", request.settings.driver, request.settings.protocol.name()))
            }
            name => name,
        };
        match self.records.get(&name) {
            Some(there) if !there.wish.is_same_run(&wish) => {
                let text = format!("there is another run called {name}\nhint: give it another name, or none");
                return refused(Code::NameTaken, text);
            }
            Some(Record { standing: Standing::Queued | Standing::Done { .. }, .. }) => return self.status(&name),
            None if self.folder.join(&name).exists() => {
                let text = format!(
                    "there is a folder {name} that is no run of this service\nhint: give it another name, or none"
                );
                return refused(Code::NameTaken, text);
            }
            _ => {}
        }
        if self.counts().1 >= self.most_queued {
            return refused(
                Code::Full,
                format!("{} runs are waiting, as many as may\nhint: submit it later", self.most_queued),
            );
        }
        self.deaths.remove(&name);
        let order = self.records.next_order();
        let record =
            Record { order, client: asked.client, submission: asked.submission, standing: Standing::Queued, wish };
        self.records.keep(&name, record).map_err(failed)?;
        self.status(&name)
    }

    /// STEM-N, with the next number that is free.
    fn new_name(&self, stem: &str) -> String {
        let is_free = |name: &String| self.records.get(name).is_none() && !self.folder.join(name).exists();
        (1..u64::MAX).map(|number| format!("{stem}-{number}")).find(is_free).unwrap_or_default()
    }

    /// Stops a run. What it has driven is kept.
    ///
    /// # Errors
    /// A refusal.
    pub fn cancel(&mut self, name: &str) -> Result<message::Run, Refusal> {
        if self.record(name)?.standing == Standing::Queued {
            // First on the disk: a service that is started again does not go on with it.
            self.records.stand(name, Standing::Cancelled).map_err(failed)?;
            self.ask_to_leave(name);
        }
        self.status(name)
    }

    fn ask_to_leave(&mut self, name: &str) {
        if let Some(driving) = self.driving.get_mut(name) {
            driving.process.end_input();
            driving.leaving.get_or_insert_with(Instant::now);
        }
    }

    /// How a run is.
    ///
    /// # Errors
    /// A refusal.
    pub fn status(&mut self, name: &str) -> Result<message::Run, Refusal> {
        let waits = self.is_queued(name) && !self.driving.contains_key(name);
        let before = if waits { self.order().iter().position(|waiting| waiting == name) } else { None };
        self.run(name, before.unwrap_or(0))
    }

    /// How all are that are not over, in the order of their turns, and the last that are.
    #[must_use]
    pub fn all(&mut self) -> Vec<message::Run> {
        let order = self.order();
        let mut over: Vec<(u64, String)> = Vec::new();
        for (name, record) in self.records.iter() {
            if record.standing != Standing::Queued {
                over.push((record.order, name.clone()));
            }
        }
        over.sort();
        let over = over.split_off(over.len().saturating_sub(LISTED)).into_iter().map(|(_, name)| (0, name));
        let driven: Vec<String> = self.driving.keys().filter(|name| self.is_queued(name)).cloned().collect();
        let driven = driven.into_iter().map(|name| (0, name));
        let names: Vec<(usize, String)> = over.chain(driven).chain(order.into_iter().enumerate()).collect();
        names.iter().filter_map(|(before, name)| self.run(name, *before).ok()).collect()
    }

    fn is_queued(&self, name: &str) -> bool {
        self.records.get(name).is_some_and(|record| record.standing == Standing::Queued)
    }

    /// Those that wait, in the order of their turns.
    fn order(&self) -> Vec<String> {
        let driven: Vec<&str> = self
            .driving
            .keys()
            .filter_map(|name| self.records.get(name))
            .map(|record| record.client.as_str())
            .collect();
        let is_waiting = |(name, record): &(&String, &Record)| {
            record.standing == Standing::Queued && !self.driving.contains_key(*name)
        };
        let waiting = self.records.iter().filter(is_waiting).map(|(name, record)| Waiting {
            name,
            client: &record.client,
            order: record.order,
            begun: self.folder.join(name).join("run.toml").exists(),
        });
        let waiting: Vec<Waiting<'_>> = waiting.collect();
        self.turns.order(&waiting, &driven).into_iter().map(|run| run.name.to_owned()).collect()
    }

    fn record(&self, name: &str) -> Result<&Record, Refusal> {
        self.records.get(name).ok_or_else(|| Refusal {
            code: Code::NoSuchRun.into(),
            text: format!("there is no run {name:?}\nhint: `sim status` lists them"),
        })
    }

    fn run(&mut self, name: &str, before: usize) -> Result<message::Run, Refusal> {
        let record = self.record(name)?.clone();
        let driven = self.driving.contains_key(name);
        let mut run = message::Run {
            name: name.to_owned(),
            client: record.client,
            before: before as u32,
            arguments: record.wish.arguments,
            ..message::Run::default()
        };
        run.arguments.extend(record.wish.scenes.iter().map(|set| format!("--scenarios={set}")));
        run.arguments.extend(record.wish.weights.iter().map(|name| format!("--weights={name}")));
        match record.standing {
            Standing::Done { episodes, failed, digest } => {
                run.set_state(RunState::Done);
                (run.episodes, run.done, run.failed, run.digest) = (episodes, episodes, failed, digest);
                return Ok(run);
            }
            Standing::Queued if driven => run.set_state(RunState::Running),
            Standing::Queued => run.set_state(RunState::Queued),
            Standing::Cancelled => run.set_state(RunState::Cancelled),
            Standing::Failed { why } => {
                run.set_state(RunState::Failed);
                run.detail = why;
            }
        }
        let follow = self.follow(name);
        follow.look();
        run.episodes = follow.episodes().unwrap_or_default() as u32;
        (run.done, run.failed) = (follow.ends.len() as u32, follow.failed() as u32);
        Ok(run)
    }

    fn follow(&mut self, name: &str) -> &mut Follow {
        let epochs = &mut self.epochs;
        let folder = self.folder.join(name);
        self.followed.entry(name.to_owned()).or_insert_with(|| {
            *epochs += 1;
            Follow::new(&folder, *epochs)
        })
    }

    /// What is new of a run for who knows this much; none where nothing is.
    ///
    /// # Errors
    /// A refusal.
    pub fn news(&mut self, asked: &message::Watch) -> Result<Option<News>, Refusal> {
        let run = self.status(&asked.run)?;
        let is_other_state = run.state != asked.state;
        let (ends, epoch) = if run.state() == RunState::Done {
            // Its list is that of its results, and needs no other.
            self.followed.remove(&asked.run);
            if !is_other_state {
                return Ok(None);
            }
            (ends_of_results(&self.folder.join(&asked.run)).map_err(failed)?, 0)
        } else {
            let follow = self.follow(&asked.run);
            (follow.ends.clone(), follow.epoch)
        };
        let known = if epoch == asked.epoch { (asked.known as usize).min(ends.len()) } else { 0 };
        if known == ends.len() && !is_other_state && epoch == asked.epoch {
            return Ok(None);
        }
        Ok(Some(News { run: Some(run), known: ends.len() as u32, ends: ends[known..].to_vec(), epoch }))
    }

    /// The folder of a run that is done.
    ///
    /// # Errors
    /// A refusal.
    pub fn done(&self, name: &str) -> Result<PathBuf, Refusal> {
        match &self.record(name)?.standing {
            Standing::Done { .. } => Ok(self.folder.join(name)),
            _ => Err(Refusal {
                code: Code::NotDone.into(),
                text: format!("the run {name} is not done\nhint: `sim watch {name}` waits for it"),
            }),
        }
    }

    /// Looks at what is being driven, and begins what can begin.
    pub fn tick(&mut self, offer: &Offer, own: &Path) {
        let names: Vec<String> = self.driving.keys().cloned().collect();
        for name in names {
            self.look_after(&name);
        }
        if self.ending || self.refused.is_some_and(|since| since.elapsed() < PATIENCE) {
            return;
        }
        let mut order = self.order().into_iter();
        while self.driving.len() < self.at_once
            && let Some(name) = order.next()
        {
            // A process of an earlier service is on its way out.
            if !is_busy(&self.folder.join(&name)) {
                self.begin(&name, offer, own);
            }
        }
    }

    fn begin(&mut self, name: &str, offer: &Offer, own: &Path) {
        let Some(Record { wish, client, .. }) = self.records.get(name).cloned() else { return };
        let log = own.join("logs").join(format!("{name}.log"));
        match self.start(name, &wish, offer, Voice::new(name, &Console::silent(), log.clone())) {
            Err(why) => self.over(name, Standing::Failed { why }),
            Ok(process) => {
                self.turns.begin(&client);
                self.driving.insert(name.to_owned(), Driving { process, log, leaving: None });
                self.console.line(&format!("{name} begins, for {client}"));
            }
        }
    }

    fn start(&self, name: &str, wish: &Wish, offer: &Offer, voice: Voice) -> Result<Process, String> {
        let mut command = Command::new(std::env::current_exe().map_err(|error| error.to_string())?);
        command.arg("run").args(offer.command_line(wish)?).arg(format!("--out={}", self.folder.join(name).display()));
        let parallel = wish.parallel.unwrap_or(self.share).min(self.share);
        command.arg(format!("--parallel={parallel}")).arg("--exit-with-parent");
        // Whoever knows the service's secret is no node of the run.
        command.env_remove(wire::keys::Secret::VARIABLE).env("NO_COLOR", "1");
        bus_threads::set(&mut command, None);
        Process::start(name, command, &Groups::default(), voice).map_err(|error: StartError| error.to_string())
    }

    /// Sees whether the process of a run has ended, and what follows from that.
    fn look_after(&mut self, name: &str) {
        let Some(driving) = self.driving.get_mut(name) else { return };
        let Some(how) = driving.process.gone() else {
            if driving.leaving.is_some_and(|since| since.elapsed() > PATIENCE) {
                // Dropped, it is killed; and the next look finds nobody.
                self.driving.remove(name);
            }
            return;
        };
        let (code, was_asked) = (driving.process.exit_code(), driving.leaving.is_some());
        driving.process.hear_out(HEARING);
        let log = driving.log.clone();
        self.driving.remove(name);
        if !self.is_queued(name) {
            return;
        }
        let folder = self.folder.join(name);
        match code {
            Some(0 | 1) => match done(&folder) {
                Ok(standing) => self.over(name, standing),
                Err(why) => self.over(name, Standing::Failed { why }),
            },
            Some(2) => {
                let why = last_error(name, &log);
                // One of an earlier service was still on its way out: it is driven on when that has left.
                if !why.starts_with(BUSY) {
                    self.over(name, Standing::Failed { why });
                }
            }
            Some(INTERRUPTED) if was_asked => {}
            _ => {
                let deaths = self.deaths.entry(name.to_owned()).or_default();
                *deaths += 1;
                if *deaths >= MOST_DEATHS {
                    let why = format!(
                        "its process {how}, {MOST_DEATHS} times in a row\nhint: submit it again under its name, and it goes on"
                    );
                    self.over(name, Standing::Failed { why });
                } else {
                    self.console.line(&format!("{name}: its process {how}; it is driven on"));
                }
            }
        }
    }

    fn over(&mut self, name: &str, standing: Standing) {
        self.console.line(&match &standing {
            Standing::Done { episodes, failed, .. } => {
                format!("{name} is done: {episodes} episodes, {failed} without a result")
            }
            Standing::Failed { why } => format!("{name} failed: {why}"),
            Standing::Queued | Standing::Cancelled => format!("{name} is stopped"),
        });
        self.deaths.remove(name);
        if let Err(error) = self.records.stand(name, standing) {
            // It stays queued: `sim run` finds it as it is, and says the same again.
            self.refused = Some(Instant::now());
            self.console.line(&format!("{name}: {error}"));
        }
    }

    /// Lets everything that is being driven leave; it goes on when the service is started again.
    pub fn end(&mut self) {
        self.ending = true;
        let names: Vec<String> = self.driving.keys().cloned().collect();
        names.iter().for_each(|name| self.ask_to_leave(name));
    }

    /// Whether nothing is being driven.
    #[must_use]
    pub fn is_idle(&self) -> bool {
        self.driving.is_empty()
    }
}

/// The last error in the log of a run, with its hints.
fn last_error(name: &str, log: &Path) -> String {
    let text = fs::read(log).unwrap_or_default();
    let text = String::from_utf8_lossy(&text);
    let prefix = format!("{name}: ");
    let lines: Vec<&str> = text.lines().filter_map(|line| line.strip_prefix(&prefix)).collect();
    let last = lines.iter().rposition(|line| line.starts_with("error: "));
    match last {
        Some(at) => lines[at..].join("\n").trim_start_matches("error: ").to_owned(),
        None => format!("it said no reason\nhint: what it said is in {}, where the service is", log.display()),
    }
}

/// What a run that is done came to.
fn done(folder: &Path) -> Result<Standing, String> {
    let summary = Summary::read(folder).map_err(|error| error.to_string())?;
    let digest = results::digest(folder).map_err(|error| error.to_string())?;
    Ok(Standing::Done { episodes: summary.scenes.len() as u32, failed: summary.failures.len() as u32, digest })
}

/// The service's own failure.
pub fn failed(error: impl std::fmt::Display) -> Refusal {
    Refusal { code: Code::Failed.into(), text: format!("the service failed: {error}") }
}
