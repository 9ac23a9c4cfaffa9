//! `sim serve`: the simulator as a service. Clients ask for runs over the bus, and for sessions, one episode step by step; docs/serve.md
//! is its story.
//!
//! ```text
//!                                            ┌─▶ runs ──▶ DIR/.service/runs/NAME.toml     what was asked for
//! client ── Ask ──▶ desk (wire) ──▶ Service ─┤     └────▶ sim run --out DIR/NAME ...      a process a run
//!        ◀─ Reply ──────────────────────────┘└─▶ sessions ──▶ a thread a session
//! ```
//!
//! | module | what |
//! | --- | --- |
//! | [`offer`] | what clients may have: names and no paths |
//! | [`record`] | the queue, as files |
//! | [`turns`] | whose turn it is: pure |
//! | [`runs`] | who waits, what is being driven, what is over |
//! | [`follow`] | how far a run is, from its folder |
//! | [`sessions`] | episodes that are driven step by step |
//! | [`secret`] | what service and clients know |
//!
//! One thread does all but drive: it takes one question after the other, and looks at its runs ten times a second. Nothing in it waits for long, for what takes time is in other
//! processes and threads; so it needs no locks, and no asynchronous code, which would only wrap file system and processes in threads again.

pub mod follow;
pub mod offer;
pub mod record;
pub mod runs;
pub mod secret;
pub mod sessions;
pub mod turns;

use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::RecvTimeoutError;
use std::thread;
use std::time::{Duration, Instant};

use clap::ValueEnum as _;
use evaluation::table::{self, TableFormat};
use results::files::{FileError, at};
use results::summary::Summary;
use thiserror::Error;
use wire::convert::MAX_MESSAGE_BYTES;
use wire::proto::service::refusal::Code;
use wire::proto::service::{self as message, Refusal, ask, reply};
use wire::service::{Answer, Asked, Desk, ServiceError};
use wire::session::{self, ZenohFile, ZenohFileError};

use self::offer::{Offer, OfferError};
use self::runs::{Runs, failed};
use self::secret::SecretError;
use self::sessions::Sessions;
use crate::cli::ServeArgs;
use crate::run::clock::WallClock;
use crate::run::console::Console;

/// Where a service keeps its own files, in the folder of its runs.
pub const OWN: &str = ".service";

/// How often runs are looked at.
const TICK: Duration = Duration::from_millis(100);

/// A question for news is answered after this, if there are none.
const NEWS_WITHIN: Duration = Duration::from_secs(1);

/// Questions for news that wait; one more is answered at once.
const MOST_WAITING: usize = 256;

/// How long runs may take to leave when the service ends.
const PATIENCE: Duration = Duration::from_secs(20);

/// A service that cannot be.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum ServeError {
    #[error("cannot use the Zenoh configuration: {0}")]
    ZenohFile(#[from] ZenohFileError),
    #[error(transparent)]
    Offer(#[from] OfferError),
    #[error(transparent)]
    File(#[from] FileError),
    #[error(transparent)]
    Secret(#[from] SecretError),
    #[error(transparent)]
    Bus(#[from] ServiceError),
    #[error("another service works in {}\nhint: give another folder with --runs", .0.display())]
    Busy(PathBuf),
    #[error("signals cannot be caught: {0}")]
    Signals(#[from] ctrlc::Error),
}

/// Serves until Ctrl-C or SIGTERM. Runs that are not over then go on when it is started again.
///
/// # Errors
/// [`ServeError`] where it cannot begin.
pub fn serve(arguments: &ServeArgs, cores: u16, clock: WallClock, console: &Console) -> Result<(), ServeError> {
    let own = arguments.runs.join(OWN);
    fs::create_dir_all(&own).map_err(at("create", &own))?;
    let _lock = lock(&own, &arguments.runs)?;
    let offer = Offer::new(arguments)?;
    let workers = arguments.workers.unwrap_or(cores);
    let mut service = Service {
        runs: Runs::open(arguments, &own, workers, console)?,
        sessions: Sessions::new(arguments, clock, console),
        own: own.clone(),
        offer,
        workers,
        most_queued: arguments.most_queued,
        waiting: Vec::new(),
    };
    let stop = Arc::new(AtomicBool::new(false));
    let pressed = Arc::clone(&stop);
    ctrlc::set_handler(move || pressed.store(true, Ordering::Relaxed))?;
    let (secret, kept) = secret::of_service(&own)?;
    let zenoh_file = arguments.zenoh_config.as_deref().map(ZenohFile::read).transpose()?;
    let (desk, questions) = Desk::open(&arguments.endpoint, secret.clone(), zenoh_file.as_ref())?;
    let for_clients = kept.as_ref().and_then(|_| secret::leave_for_clients(desk.endpoint(), &secret));
    tell(&desk, kept.as_deref(), for_clients.is_some(), console);

    let mut looked = Instant::now();
    while !stop.load(Ordering::Relaxed) {
        match questions.recv_timeout(TICK) {
            Ok(asked) => service.hear(asked),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => break,
        }
        if looked.elapsed() >= TICK {
            looked = Instant::now();
            service.tick();
        }
    }
    console.line("the service ends; its runs go on when it is started again");
    desk.close();
    service.end();
    Ok(())
}

/// Held while a service works in a folder.
fn lock(own: &Path, runs: &Path) -> Result<File, ServeError> {
    let path = own.join("lock");
    let file = File::create(&path).map_err(at("create", &path))?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => Err(ServeError::Busy(runs.to_owned())),
        Err(TryLockError::Error(error)) => Err(at("lock", &path)(error).into()),
    }
}

/// Says where the service is, and who can ask it.
fn tell(desk: &Desk, kept: Option<&Path>, is_left: bool, console: &Console) {
    let endpoint = desk.endpoint();
    let who = match kept {
        None => "clients need RELOOP_SECRET as here".to_owned(),
        Some(path) if is_left => {
            format!("your own clients on this machine are let in; others need RELOOP_SECRET as in {}", path.display())
        }
        Some(path) => format!("clients need RELOOP_SECRET as in {}", path.display()),
    };
    console.line(&format!("serving at {endpoint}; {who}"));
    if session::is_beyond_loopback(endpoint) && !endpoint.starts_with("tls/") {
        console.line("warning: it listens beyond this machine, and nothing on the way is encrypted: whoever listens there can learn the secret");
    }
}

/// A client that waits for news.
struct Waiting {
    asked: message::Watch,
    answer: Answer,
    until: Instant,
}

/// All that is served.
struct Service {
    runs: Runs,
    sessions: Sessions,
    offer: Offer,
    own: PathBuf,
    workers: u16,
    most_queued: u16,
    waiting: Vec<Waiting>,
}

impl Service {
    fn hear(&mut self, Asked { what, answer }: Asked) {
        let said = match what {
            ask::What::Offer(_) => Ok(reply::What::Offer(self.offered())),
            ask::What::Submit(asked) => self.runs.submit(asked, &self.offer).map(reply::What::Run),
            ask::What::Status(asked) if asked.run.is_empty() => {
                Ok(reply::What::Runs(message::Runs { runs: self.runs.all() }))
            }
            ask::What::Status(asked) => {
                self.runs.status(&asked.run).map(|run| reply::What::Runs(message::Runs { runs: vec![run] }))
            }
            ask::What::Cancel(asked) => self.runs.cancel(&asked.run).map(reply::What::Run),
            ask::What::Table(asked) => self.table(&asked).map(reply::What::Table),
            ask::What::Watch(asked) => {
                let until =
                    if self.waiting.len() < MOST_WAITING { Instant::now() + NEWS_WITHIN } else { Instant::now() };
                let waiting = self.unless_answered(Waiting { asked, answer, until });
                return self.waiting.extend(waiting);
            }
            ask::What::Open(asked) => return self.sessions.open(asked, &self.offer, answer),
            ask::What::Step(asked) => return self.sessions.step(&asked, answer),
            ask::What::Fork(asked) => return self.sessions.fork(asked, &self.offer, answer),
            ask::What::Close(asked) => return self.sessions.close(&asked, answer),
        };
        answer.give(said.unwrap_or_else(reply::What::Refusal));
    }

    fn offered(&self) -> message::Offer {
        let (running, queued) = self.runs.counts();
        message::Offer {
            workers: self.workers.into(),
            runs_at_once: self.runs.at_once() as u32,
            running: running as u32,
            queued: queued as u32,
            most_queued: self.most_queued.into(),
            sessions: self.sessions.open_now() as u32,
            most_sessions: self.sessions.most() as u32,
            ..self.offer.message()
        }
    }

    fn table(&self, asked: &message::AskTable) -> Result<message::Table, Refusal> {
        let folder = self.runs.done(&asked.run)?;
        let format = match &*asked.format {
            "" => Ok(TableFormat::Text),
            format => TableFormat::from_str(format, false),
        };
        let format = format.map_err(|_| Refusal {
            code: Code::BadSettings.into(),
            text: format!("{:?} is no format\nhint: text, markdown or csv", asked.format),
        })?;
        let width = if asked.width == 0 { 80 } else { asked.width.clamp(40, 1000) };
        let results_parquet =
            if asked.results { results::files::read(&folder.join("results.parquet")).map_err(failed)? } else { None };
        let results_parquet = results_parquet.unwrap_or_default();
        if results_parquet.len() > MAX_MESSAGE_BYTES / 2 {
            return Err(failed(format!(
                "{} bytes of results are too many for a message\nhint: read results.parquet where the service is",
                results_parquet.len()
            )));
        }
        Ok(message::Table {
            text: table::render(&[Summary::read(&folder).map_err(failed)?], format, width as usize),
            digest: results::digest(&folder).map_err(failed)?,
            results_parquet,
        })
    }

    /// Answers who waits for news, if there are any or the time has come; else gives them back.
    fn unless_answered(&mut self, waiting: Waiting) -> Option<Waiting> {
        let news = self.runs.news(&waiting.asked);
        let is_late = Instant::now() >= waiting.until;
        let said = match news {
            Ok(Some(news)) => reply::What::News(news),
            Ok(None) if !is_late => return Some(waiting),
            Ok(None) => match self.runs.status(&waiting.asked.run) {
                Ok(run) => {
                    let message::Watch { epoch, known, .. } = waiting.asked;
                    reply::What::News(message::News { run: Some(run), ends: Vec::new(), epoch, known })
                }
                Err(refusal) => reply::What::Refusal(refusal),
            },
            Err(refusal) => reply::What::Refusal(refusal),
        };
        waiting.answer.give(said);
        None
    }

    fn tick(&mut self) {
        self.runs.tick(&self.offer, &self.own);
        self.sessions.tick();
        let waiting = std::mem::take(&mut self.waiting);
        self.waiting = waiting.into_iter().filter_map(|waiting| self.unless_answered(waiting)).collect();
    }

    /// Lets all that runs leave.
    fn end(&mut self) {
        self.sessions.end();
        self.runs.end();
        let until = Instant::now() + PATIENCE;
        while !self.runs.is_idle() && Instant::now() < until {
            thread::sleep(Duration::from_millis(10));
            self.runs.tick(&self.offer, &self.own);
        }
    }
}
