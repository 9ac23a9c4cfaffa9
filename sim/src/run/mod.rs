//! A run: many episodes under one driver and protocol, in one folder.
//!
//! ```text
//!                 ┌─ worker w0 ── planner, predictor ─┐
//! Core ─ orders ─▶├─ worker w1 ── planner, predictor ─┼─ events ─▶ Core        parts/<scene> as each episode ends,
//!                 └─ recorder ────────────────────────┘                        the Parquet files when all have
//! ```
//!
//! | module | what |
//! | --- | --- |
//! | [`core`] | what follows from what happened: pure |
//! | [`worker`], [`recorder`] | the threads that do it |
//! | [`shared`] | what they share |
//! | [`drive`], [`mod@line`] | one episode, and its driver at the end of a line |
//! | [`lag`] | when its plans take effect, under a latency |
//! | [`in_process`] | drivers that are in this process |
//! | [`beginning`] | episodes that are not their driver's from the first step on |
//! | [`frames`] | no drive at all: plans at frames of the log, to be judged |
//! | [`one`] | one episode, for who has it in hand |
//! | [`ready`] | the next scene, made ready while others are driven |
//! | [`view`] | a viewer that shows the run while it is driven |
//! | [`scene_index`] | where nodes that read the log find the scenes |
//! | [`progress`] | which episodes are done, and which are to be driven |
//! | [`bus_threads`] | the threads of the bus |
//! | [`calling`], [`process`], [`shell`], [`voice`], [`raised`], [`witness`] | nodes: started, heard, and how they ended |
//! | [`console`], [`interrupt`], [`threads`], [`clock`] | standard error, Ctrl-C, panics, time |
//! | [`timing`] | where the time went |

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use episode::latency::Latency;
use rayon::prelude::*;
use results::digest::DigestError;
use results::files::FileError;
use results::folder::{Folder, FolderError, Opened};
use results::parquet::ParquetError;
use results::part::Part;
use results::settings::Record;
use results::settings::{Build, Planner, RunFile, SceneLine};
use results::trace::{Trace, TraceError};
use scenarios::{SceneEntry, SceneSet, SetError};
use shard::Shard;
use thiserror::Error;
use wire::cores::Cores;
use wire::hub::{Hub, HubSettings};
use wire::keys::{KeyError, Place, Role, RunName, Secret, Workers};
use wire::proto::RunInfo;
use wire::session::{self, Guarded, SessionError, ZenohFile, ZenohFileError};

use self::beginning::Beginnings;
use self::clock::{Clock, WallClock};
use self::console::Console;
use self::core::{Core, Drive, Effects, Ending, Event};
use self::in_process::InProcessError;
use self::interrupt::Interrupts;
use self::progress::Progress;
use self::shared::{Onlooker, Reach, Shared};
use self::timing::Breakdown;
use self::view::View;
use self::worker::Order;
use crate::request::Request;

pub mod beginning;
pub mod bus_threads;
pub mod calling;
pub mod clock;
pub mod console;
pub mod core;
#[cfg(test)]
mod core_tests;
pub mod drive;
pub mod frames;
pub mod in_process;
pub mod interrupt;
pub mod lag;
pub mod line;
pub mod one;
pub mod process;
pub mod progress;
pub mod raised;
pub mod ready;
pub mod recorder;
pub mod refusals;
pub mod scene_index;
pub mod shared;
pub mod shell;
pub mod threads;
pub mod timing;
pub mod view;
pub mod voice;
pub mod witness;
pub mod worker;

/// How long a run waits for its threads at the end, before it leaves them to the end of the program.
const PATIENCE: Duration = Duration::from_secs(8);

/// A run that could not be driven to its end.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum RunError {
    #[error("{0}\nhint: {hint}", hint = .0.hint())]
    Scenes(#[from] SetError),
    #[error(transparent)]
    Folder(#[from] FolderError),
    #[error(transparent)]
    File(#[from] FileError),
    #[error(transparent)]
    Digest(#[from] DigestError),
    #[error(transparent)]
    Bus(#[from] SessionError),
    #[error(transparent)]
    Name(#[from] KeyError),
    #[error("cannot use the Zenoh configuration: {0}")]
    ZenohFile(#[from] ZenohFileError),
    #[error("the system gives no randomness for a secret: {0}")]
    Secret(std::io::Error),
    #[error(transparent)]
    InProcess(#[from] InProcessError),
    #[error("threads cannot be kept to a core: {0}\nhint: leave out --pin")]
    Pin(std::io::Error),
    #[error(transparent)]
    Results(#[from] ParquetError),
    #[error(transparent)]
    Trace(#[from] TraceError),
    #[error("{} is merged already, and shard {shard} cannot drive in it again\nhint: leave out --shard", path.display())]
    Merged { shard: Shard, path: PathBuf },
    #[error("{reason}\nnote: {state}")]
    Broken { reason: String, state: State },
    #[error("interrupted: {state}")]
    Interrupted { state: State },
}

impl RunError {
    /// The same of a run whose folder is thrown away.
    #[must_use]
    pub fn with_nothing_kept(mut self) -> Self {
        if let Self::Broken { state, .. } | Self::Interrupted { state } = &mut self {
            state.done = 0;
        }
        self
    }
}

/// How far a run came that is not complete.
#[derive(Clone, Debug)]
pub struct State {
    done: usize,
    scenes: usize,
    shard: Option<Shard>,
    folder: PathBuf,
}

impl fmt::Display for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { done, scenes, shard, folder } = self;
        match (done, shard) {
            (0, None) => write!(f, "no episode was driven, and no folder is left"),
            (0, Some(shard)) => write!(f, "no episode of shard {shard} was driven"),
            _ => {
                let place = Where { shard: *shard, folder };
                write!(f, "{done} of {scenes} episodes are done; the same command continues {}", place.the_run())
            }
        }
    }
}

/// What is driven, and where, for people.
struct Where<'a> {
    shard: Option<Shard>,
    folder: &'a Path,
}

impl Where<'_> {
    /// As the object of a sentence.
    fn the_run(&self) -> String {
        match self.shard {
            None => format!("the run in {}", self.folder.display()),
            Some(_) => self.to_string(),
        }
    }
}

impl fmt::Display for Where<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.shard {
            None => write!(f, "{}", self.folder.display()),
            Some(shard) => write!(f, "shard {shard} of {}", self.folder.display()),
        }
    }
}

/// A complete run, or a shard that is.
#[derive(Debug)]
pub struct Done {
    /// Its folder.
    pub folder: PathBuf,
    /// Where the time went that it took now.
    pub breakdown: Breakdown,
    /// The shard, where it is one: the run has no results until it is merged.
    pub shard: Option<ShardDone>,
}

/// A complete shard.
#[derive(Debug)]
pub struct ShardDone {
    /// Which.
    pub shard: Shard,
    /// How many it has.
    pub episodes: usize,
    /// The scenes whose episode has no result.
    pub failures: Vec<String>,
}

/// What is driven, and how.
pub struct Task {
    /// The scenes.
    pub scenes: SceneSet,
    /// How episodes begin that are not their driver's from the first step on.
    pub beginnings: Beginnings,
    /// Who looks at each episode when it is stored.
    pub onlooker: Option<Onlooker>,
    /// Whether a viewer shows it while it is driven.
    pub view: bool,
}

impl Task {
    /// All of these scenes, driven from their beginning, and nobody looks on.
    #[must_use]
    pub fn of(scenes: SceneSet) -> Self {
        Self { scenes, beginnings: Beginnings::default(), onlooker: None, view: false }
    }
}

/// Drives `request`, or continues it.
///
/// # Errors
/// [`RunError`] where it is not complete; what is done is kept.
pub fn run(request: &Request, clock: WallClock, console: &Console, interrupts: &Interrupts) -> Result<Done, RunError> {
    let scenes = SceneSet::open(&request.machine.scenarios)?;
    for note in scenes.notes() {
        console.line(&format!("note: {note}"));
    }
    if request.settings.traffic.is_some() && request.settings.predicts_by_the_log() {
        console.line("note: predictions are the log's future, which is not that of agents that react: this is no oracle among them");
    }
    if request.verify {
        scenes.verify()?;
    }
    run_task(request, Task { view: request.view, ..Task::of(scenes) }, clock, console, interrupts)
}

/// Drives this task as `request` says, or continues it; its scenes are those of the task.
///
/// # Errors
/// As [`run`].
pub fn run_task(
    request: &Request,
    task: Task,
    clock: WallClock,
    console: &Console,
    interrupts: &Interrupts,
) -> Result<Done, RunError> {
    let scenes = &task.scenes;
    let file = begun(request, scenes);
    let hashes = || (0..file.scenes.len()).into_par_iter().map(|at| scenes.sha256(at).unwrap_or_default()).collect();
    let retry = &request.retry;
    let opened = match (&request.out, request.shard) {
        (Some(path), Some(shard)) => Folder::open_shard(path, &file, &hashes, shard)?,
        (Some(path), None) => Folder::open_with(path, &file, &hashes)?,
        (None, _) => Folder::choose(Path::new(results::folder::RUNS), &file, &hashes, !retry.is_empty())?,
    };
    let (folder, finished) = match opened {
        Opened::Finished(folder) => (folder, true),
        Opened::New(folder) | Opened::Unfinished(folder) => (folder, false),
    };
    if let (true, Some(shard), false) = (finished, request.shard, retry.is_empty()) {
        return Err(RunError::Merged { shard, path: folder.path().to_owned() });
    }
    if finished {
        // Nothing is built upon rows that somebody has changed.
        results::digest(folder.path())?;
    }
    let progress = if finished && retry.is_empty() { None } else { Some(Progress::read(&folder, &file, retry)?) };
    let Some(progress) = progress.filter(|progress| !finished || !progress.pending.is_empty()) else {
        console.line(&format!("{} is finished already: nothing was driven", folder.path().display()));
        console.pass_over(file.scenes.len());
        return Ok(Done { folder: folder.path().to_owned(), breakdown: Breakdown::default(), shard: None });
    };
    if finished {
        folder.reopen()?;
    }
    let path = folder.path().to_owned();
    // Until nothing is left to be removed: another sim may wait for the folder.
    let hold = folder.hold();
    let done = drive_pending(task, file, folder, progress, clock, console, interrupts);
    if done.is_err() {
        results::folder::remove_if_nothing_is_done(&path, &hold);
    }
    done
}

/// The run that `request` begins over these scenes, none of which has been read yet.
fn begun(request: &Request, scenes: &SceneSet) -> RunFile {
    let line = |entry: &SceneEntry| SceneLine {
        id: entry.id.to_string(),
        fingerprint: Some(entry.fingerprint()),
        ..SceneLine::default()
    };
    let mut file = RunFile {
        settings: request.settings.clone(),
        build: Build::this(),
        machine: request.machine.clone(),
        scenes: scenes.entries().iter().map(line).collect(),
    };
    let identity = file.identity();
    if let Some(shards) = &mut file.machine.shards {
        shards.sha256 = identity;
    }
    file
}

/// Drives what is pending, and merges it with what is done.
fn drive_pending(
    Task { scenes, beginnings, onlooker, view }: Task,
    file: RunFile,
    folder: Folder,
    progress: Progress,
    clock: WallClock,
    console: &Console,
    interrupts: &Interrupts,
) -> Result<Done, RunError> {
    let Progress { pending, total, damaged, earlier, hashes } = progress;
    let (path, shard) = (folder.path().to_owned(), folder.shard());
    for scene in damaged {
        console.line(&format!("note: the stored episode of {scene} is damaged or of another run, and is driven again"));
    }
    if pending.len() < total {
        let (done, place) = (total - pending.len(), Where { shard, folder: &path });
        let rest = if pending.is_empty() { "" } else { ", the others follow" };
        console.line(&format!("{place}: {done} of {total} episodes are done{rest}"));
        if file.settings.planner == Planner::External {
            console.line("note: those were driven by the planner that was there then; is it still the same?");
        }
    }
    let cores = file.machine.pin.then(Cores::of_this_thread).transpose().map_err(RunError::Pin)?;
    // The bus has threads for all workers. Where there is but one worker, they are on its core.
    let alone = file.machine.parallel == 1 || pending.len() == 1;
    if let Some(cores) = cores.filter(|_| alone) {
        cores.one(0).and_then(|one| one.keep_to()).map_err(RunError::Pin)?;
    }
    let trace = trace(&file)?;
    let reach = reach(&file, view, console)?;
    if let Some(cores) = cores {
        cores.keep_to().map_err(RunError::Pin)?;
    }
    let shared = Arc::new(Shared {
        beginnings,
        onlooker,
        trace,
        ..Shared::new((scenes, file, folder), reach, cores, clock, console, interrupts.nodes())
    });
    let view = if view { View::start(&shared) } else { None };
    let ending = drive_all(&shared, pending.clone(), total, interrupts);
    console.end();
    if let Some(view) = view {
        view.end();
    }
    let part = |scene: &SceneLine| shared.folder.part(&scene.id).ok().flatten();
    let state = || {
        let before = |scene: &SceneLine| earlier.as_ref().is_some_and(|earlier| earlier.standing(&scene.id).is_some());
        let mine = shared.file.scenes.iter().enumerate().filter(|(place, _)| shard.is_none_or(|it| it.holds(*place)));
        let done = mine.filter(|(_, scene)| part(scene).is_some() || before(scene)).count();
        State { done, scenes: total, shard, folder: path.clone() }
    };
    match ending {
        Ending::Complete => {}
        Ending::Broken(reason) => return Err(RunError::Broken { reason, state: state() }),
        Ending::Interrupted => return Err(RunError::Interrupted { state: state() }),
    }
    let mut breakdown = Breakdown::default();
    if let Some(shard) = shard {
        let mut done = ShardDone { shard, episodes: total, failures: Vec::new() };
        for place in (0..shared.file.scenes.len()).filter(|place| shard.holds(*place)) {
            let Some(part) = part(&shared.file.scenes[place]) else { continue };
            if pending.binary_search(&place).is_ok() {
                breakdown.add(&part);
            }
            if part.failed() {
                done.failures.push(shared.file.scenes[place].id.clone());
            }
        }
        return Ok(Done { folder: path, breakdown, shard: Some(done) });
    }
    // Of a scene that was not read now, its episode of before knows.
    let hash = |(at, before)| shared.scenes.known_sha256(at).unwrap_or(before);
    let file = shared.file.with_hashes(hashes.into_iter().enumerate().map(hash));
    shared.folder.write_settings(&file)?;
    let add = |place: usize, part: &Part| {
        if pending.binary_search(&place).is_ok() {
            breakdown.add(part);
        }
        true
    };
    results::merge(&shared.folder, &file, earlier.as_ref(), add)
        .map_err(|error| RunError::Broken { reason: error.to_string(), state: state() })?;
    shared.folder.remove_parts()?;
    Ok(Done { folder: path, breakdown, shard: None })
}

/// The trace by which plans take effect: of all scenes if all delays are from it.
fn trace(file: &RunFile) -> Result<Option<Trace>, TraceError> {
    let Some(path) = file.machine.latency_trace.as_ref().map(Path::new) else { return Ok(None) };
    let Some(Latency::Trace { sha256 }) = &file.settings.latency else { return Ok(Some(Trace::read(path)?.0)) };
    let trace = Trace::read_held(path, sha256)?;
    trace.covers(path, file.scenes.iter().map(|line| line.id.as_str()))?;
    Ok(Some(trace))
}

/// What the driver of a run is reached by: there is no bus where it is in this process and nobody records.
fn reach(file: &RunFile, view: bool, console: &Console) -> Result<Reach, RunError> {
    if !file.machine.in_process {
        return open_bus(file, console);
    }
    let logs = Arc::default();
    let minds = in_process::minds(&file.settings, &file.machine, &logs)?;
    let bus = if file.settings.record == Record::None && !view { Reach::default() } else { open_bus(file, console)? };
    Ok(Reach { minds: Some(minds), logs, ..bus })
}

/// The bus of a run, and the place of a planner that is not the sim's to start. Its name says nothing of the folder, so that recordings of the same run are the same anywhere.
fn open_bus(file: &RunFile, console: &Console) -> Result<Reach, RunError> {
    let name = format!("{}-{}", file.settings.driver, file.settings.protocol.name());
    let run = name.parse()?;
    // Whoever starts both the sim and a planner may have told both already.
    let told = Secret::of_this_process();
    let secret = told.clone().map_or_else(Secret::random, Ok).map_err(RunError::Secret)?;
    let settings = hub_settings(file, &run, &secret)?;
    let hub = Hub::open_with(&run, &settings)?;
    hub.publish_run_info(&RunInfo {
        wire_version: wire::WIRE_VERSION,
        run: name,
        settings: file.to_recorded_toml(),
        predictor: file.settings.predictor.is_some(),
        traffic: file.settings.traffic.is_some(),
    })?;
    let run = hub.run();
    tracing::info!("run {run} at {}", hub.endpoint());
    if let Some(outside) = hub.outside() {
        tracing::info!("for others than your own processes at {outside}");
        warn_of_the_open(outside, settings.zenoh_file.as_ref());
    }
    let endpoint = hub.outside().unwrap_or(hub.endpoint());
    if file.settings.planner != Planner::External {
        return Ok(Reach { hub: Some(hub), ..Reach::default() });
    }
    let patience = file.machine.start_timeout_s;
    let environment = match told {
        Some(_) => format!("{} as here", Secret::VARIABLE),
        None => format!("{}={}", Secret::VARIABLE, secret.reveal()),
    };
    let seat = hub.seat_with(Role::Planner, &Workers::All, secret)?;
    console.line(&format!(
        "waiting up to {patience} s for your planner: --endpoint {endpoint} --run {run} --worker '*', and {environment} in its \
         environment"
    ));
    Ok(Reach { hub: Some(hub), external: Some(Arc::new(seat)), ..Reach::default() })
}

/// How the bus of `run` is opened; `secret` is that of the planner's seat, where the planner is not the sim's to start.
fn hub_settings(file: &RunFile, run: &RunName, secret: &Secret) -> Result<HubSettings, RunError> {
    let machine = &file.machine;
    let guarded = match machine.planner_certificates.clone() {
        names if names.is_empty() => None,
        names => Some(Guarded { seat: Place::seat(run, secret)?, names }),
    };
    let zenoh_file = machine.zenoh_config.as_ref().map(|config| ZenohFile::read(Path::new(&config.path)));
    let endpoint = machine.endpoint.clone();
    Ok(HubSettings { endpoint, deadline: file.settings.deadline(), zenoh_file: zenoh_file.transpose()?, guarded })
}

/// Says so where strangers may listen on the way to `outside`, or come in.
fn warn_of_the_open(outside: &str, zenoh_file: Option<&ZenohFile>) {
    if !session::is_beyond_loopback(outside) {
        return;
    }
    if !outside.starts_with("tls/") {
        tracing::warn!(
            "the bus listens beyond this machine, at {outside}, and nothing there is encrypted: whoever can listen on the way \
             reads it, and can pass for a node; docs/hosts.md tells of certificates"
        );
    } else if !zenoh_file.is_some_and(ZenohFile::asks_for_certificates) {
        tracing::warn!("who connects to {outside} is asked for no certificate: enable_mtls in --zenoh-config would");
    }
}

/// Drives the scenes of these places. All that was started is gone when it returns.
fn drive_all(shared: &Arc<Shared>, pending: Vec<usize>, total: usize, interrupts: &Interrupts) -> Ending {
    let (sender, events) = sync_channel(256);
    let things = if shared.frames.is_some() { "scenes" } else { "episodes" };
    shared.console.begin(things, total, total - pending.len());
    let mut core = Core::new(pending, shared.file.machine.parallel.into(), shared.file.settings.record != Record::None);
    let mut machinery = Machinery::start(shared, core.workers(), &sender, interrupts);
    interrupts.forward_to(sender);
    core.start(&mut machinery);
    let ending = wait_for_ending(&mut core, &mut machinery, &events, &shared.console);
    // Whoever has something to say now finds nobody listening, and leaves.
    drop(events);
    machinery.leave();
    ending
}

fn wait_for_ending(core: &mut Core, machinery: &mut Machinery, events: &Receiver<Event>, console: &Console) -> Ending {
    loop {
        if let Some(ending) = core.ending() {
            return ending.clone();
        }
        let Ok(event) = events.recv() else { return Ending::Broken("all workers are gone".to_owned()) };
        if matches!(event, Event::Driven { .. }) {
            console.advance();
        }
        core.on(event, machinery);
    }
}

/// The threads, and how they are told.
struct Machinery {
    shared: Arc<Shared>,
    /// To each worker. Capacity 1: a worker has one order at a time, so that sending never waits.
    workers: Vec<SyncSender<Order>>,
    /// To the recorder's thread: start it.
    recorder: Option<SyncSender<()>>,
    threads: Vec<JoinHandle<()>>,
}

impl Machinery {
    fn start(shared: &Arc<Shared>, workers: usize, events: &SyncSender<Event>, interrupts: &Interrupts) -> Self {
        let mut running = Vec::new();
        let mut orders = Vec::new();
        for number in 0..workers {
            let (sender, receiver) = sync_channel(1);
            let (shared, to) = (Arc::clone(shared), events.clone());
            let work = move || worker::work(number, &shared, &receiver, &to);
            running.push(threads::start(format!("worker {number}"), events.clone(), work));
            orders.push(sender);
        }
        let (recorder, receiver) = sync_channel(1);
        let (own, to, groups) = (Arc::clone(shared), events.clone(), interrupts.recorder().clone());
        let work = move || recorder::keep(&own, &groups, &receiver, &to);
        running.push(threads::start("the recorder's thread".to_owned(), events.clone(), work));
        Self { shared: Arc::clone(shared), workers: orders, recorder: Some(recorder), threads: running }
    }

    /// Waits for the threads; each ends what it started. One that waits for a node which somebody else started may stay.
    fn leave(mut self) {
        self.workers.clear();
        self.recorder = None;
        let until = self.shared.clock.now() + PATIENCE;
        for thread in &self.threads {
            while !thread.is_finished() && self.shared.clock.now() < until {
                thread::sleep(Duration::from_millis(2));
            }
        }
    }
}

impl Effects for Machinery {
    fn start_recorder(&mut self) {
        if let Some(recorder) = &self.recorder {
            let _ = recorder.try_send(());
        }
    }

    fn start_nodes(&mut self, worker: usize) {
        let _ = self.workers[worker].try_send(Order::StartNodes);
    }

    fn prepare(&mut self, scene: usize) {
        if self.shared.frames.is_none() {
            self.shared.ahead.begin(&self.shared, scene);
        }
    }

    fn drive(&mut self, worker: usize, drive: Drive) {
        let _ = self.workers[worker].try_send(Order::Drive(drive));
    }

    fn warn(&mut self, text: &str) {
        tracing::warn!("{text}");
    }

    fn halt(&mut self, ending: &Ending) {
        self.shared.stop.store(true, Ordering::Relaxed);
        if *ending != Ending::Complete {
            // Whoever waits for an answer waits no more. The recorder is left to close its files.
            self.shared.groups.kill_all();
        }
    }
}
