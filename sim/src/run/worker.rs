//! A worker: a thread with nodes of its own, that drives one scene after the other and stores what came of it.

use std::cell::RefCell;
use std::fs;
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use episode::protocol::Protocol;
use results::folder::Folder;
use results::part::{LoggedState, Part};
use results::settings::Record;
use results::settings::{Node, Planner, RunFile};
use scenarios::{SceneSet, lint};
use wire::cores::Cores;
use wire::hub::{BarrierError, Cast, HereLine, Hub, Line, Minds, Seat};
use wire::keys::{Role, Secret, Worker as WorkerName, Workers};
use wire::proto::{AgentState, EndReason, EpisodeEnd};
use world::scene::Scene;

use super::beginning::{Beginnings, Begun, NotBegun};
use super::bus_threads;
use super::clock::{Clock, WallClock};
use super::console::Console;
use super::core::{Drive, Event};
use super::drive::{Driven, drive};
use super::frames::Frames;
use super::in_process::DrivenLogs;
use super::line::LineDriver;
use super::process::{self, Groups, Process, program};
use super::shell;
use super::voice::Voice;
use super::witness::Witness;

/// What the recorder may take to close an episode's file, beyond the deadline of an answer.
const CLOSING: Duration = Duration::from_secs(5);

/// Who looks at each episode when it is stored, and at its files.
pub type Onlooker = Box<dyn Fn(&Folder, &Part) + Send + Sync>;

/// What the run asks of a worker.
#[derive(Clone, Copy, Debug)]
pub enum Order {
    /// Start its nodes, in the place of those it has.
    StartNodes,
    /// Drive a scene.
    Drive(Drive),
}

/// What all workers share. Nothing of it changes during a run, but for `stop`, the recorder and the groups.
pub struct Shared {
    /// Where the scenes come from.
    pub scenes: SceneSet,
    /// Who drives, and by which rules.
    pub file: RunFile,
    /// Where finished episodes go.
    pub folder: Folder,
    /// How episodes begin that are not their driver's from the first step on.
    pub beginnings: Beginnings,
    /// Who looks at each episode when it is stored.
    pub onlooker: Option<Onlooker>,
    /// Where figures go, if nothing is driven: plans are asked for at frames of the log, and judged.
    pub frames: Option<Frames>,
    /// The bus; none where nobody is on it.
    pub hub: Option<Hub>,
    /// Who drives in this process, in the place of nodes.
    pub minds: Option<Minds>,
    /// What they may know of the log.
    pub logs: Arc<DrivenLogs>,
    /// The place of a planner that somebody else starts, and that serves all workers.
    pub external: Option<Arc<Seat>>,
    /// The place of the recorder that runs.
    pub recorder: Mutex<Option<Arc<Seat>>>,
    /// Set by a worker that the recorder keeps waiting: it is replaced, so that this costs once.
    pub recorder_is_frozen: AtomicBool,
    /// The cores, if each worker keeps to one of them with its nodes.
    pub cores: Option<Cores>,
    /// Since the program began.
    pub clock: WallClock,
    /// Where nodes' lines go.
    pub console: Console,
    /// The planners and predictors that run, to be ended by whoever ends the run.
    pub groups: Groups,
    /// Set when nothing more is to be begun or stored.
    pub stop: AtomicBool,
}

/// What drivers are reached by.
#[derive(Default)]
pub struct Reach {
    /// The bus; none where nobody is on it.
    pub hub: Option<Hub>,
    /// The place of a planner that somebody else starts.
    pub external: Option<Arc<Seat>>,
    /// Who drives in this process.
    pub minds: Option<Minds>,
    /// What they may know of the log.
    pub logs: Arc<DrivenLogs>,
}

impl Shared {
    /// What workers share in a run in which every episode is its driver's from the first step on, and nobody looks on.
    pub fn new(
        (scenes, file, folder): (SceneSet, RunFile, Folder),
        Reach { hub, external, minds, logs }: Reach,
        cores: Option<Cores>,
        clock: WallClock,
        console: &Console,
        groups: &Groups,
    ) -> Self {
        Self {
            scenes,
            file,
            folder,
            beginnings: Beginnings::default(),
            onlooker: None,
            frames: None,
            hub,
            minds,
            logs,
            external,
            recorder: Mutex::default(),
            recorder_is_frozen: AtomicBool::new(false),
            cores,
            clock,
            console: console.clone(),
            groups: groups.clone(),
            stop: AtomicBool::new(false),
        }
    }

    /// Starts a program of the workspace on the bus.
    ///
    /// # Errors
    /// Why not, as a sentence.
    pub fn start_program(
        &self,
        name: &str,
        process: &str,
        arguments: &[&str],
        seat: &Seat,
        groups: &Groups,
    ) -> Result<Process, String> {
        let mut command = Command::new(program(name).map_err(|error| error.to_string())?);
        command.args(arguments);
        bus_threads::set(&mut command, Some(1));
        self.start_command(process, command, seat, groups)
    }

    fn start_command(
        &self,
        process: &str,
        mut command: Command,
        seat: &Seat,
        groups: &Groups,
    ) -> Result<Process, String> {
        let hub = self.hub()?;
        let run = hub.run().to_string();
        // Nodes say what the sim would say, unless the user said otherwise.
        if std::env::var_os("RUST_LOG").is_none() {
            // A message that comes while a session closes is an error to Zenoh; here it is the end of every run.
            let quiet = "warn,zenoh::api::session=off";
            command.env("RUST_LOG", if tracing::enabled!(tracing::Level::INFO) { "info" } else { quiet });
        }
        // In the environment too, for a planner's command that is a script.
        command.env("NO_COLOR", "1").env("RELOOP_ENDPOINT", hub.endpoint()).env("RELOOP_RUN", &run);
        command.env("RELOOP_EXIT_WITH_PARENT", "true");
        // There alone: everybody on the machine can read arguments.
        command.env(Secret::VARIABLE, seat.secret().reveal());
        command.args(["--endpoint", hub.endpoint(), "--run", &run, "--exit-with-parent"]);
        // The logs of a worker's nodes are one: what they say belongs together.
        let log = process.rsplit(' ').next().unwrap_or(process);
        let voice = Voice::new(process, &self.console, self.folder.file("logs").join(format!("{log}.log")));
        Process::start(process, command, groups, voice).map_err(|error| error.to_string())
    }

    /// The bus.
    ///
    /// # Errors
    /// That there is none, as a sentence.
    pub fn hub(&self) -> Result<&Hub, String> {
        self.hub.as_ref().ok_or_else(|| "this run has no bus".to_owned())
    }

    /// How often this process stood still.
    pub fn pauses(&self) -> u64 {
        self.hub.as_ref().map_or(0, Hub::pauses)
    }

    /// The place of the recorder that runs.
    fn recorder(&self) -> Option<Arc<Seat>> {
        self.recorder.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Waits until a node is on the bus; `process` is looked at meanwhile, if the sim started it.
    ///
    /// # Errors
    /// Why it will not come, as a sentence.
    pub fn wait_for(&self, seat: &Seat, process: Option<&mut Process>) -> Result<(), String> {
        let name = process.as_ref().map(|process| process.name().to_owned());
        let process = RefCell::new(process);
        let gone = || process.borrow_mut().as_mut().and_then(|process| process.gone());
        let cancelled = || self.stop.load(Ordering::Relaxed) || gone().is_some();
        match self.hub()?.wait_for_nodes(&[seat], self.file.machine.start_timeout(), &cancelled) {
            Ok(()) => Ok(()),
            Err(error) => Err(match (gone(), name) {
                (Some(how), Some(name)) => format!("{name} {how} before it was on the bus"),
                _ if matches!(error, BarrierError::Missing { .. }) => {
                    format!("{error}\nhint: give it more time with --start-timeout; what it says itself stands above")
                }
                _ => error.to_string(),
            }),
        }
    }
}

/// Does what is ordered until nobody orders any more.
pub fn work(number: usize, shared: &Arc<Shared>, orders: &Receiver<Order>, events: &SyncSender<Event>) {
    if let Some(cores) = shared.cores
        && let Err(error) = cores.one(number).and_then(|one| one.keep_to())
    {
        tracing::warn!("worker {number} is on no core of its own: {error}");
    }
    let mut worker =
        Worker { number, name: WorkerName::numbered(number), shared, nodes: Vec::new(), seats: None, starts: 0 };
    while let Ok(order) = orders.recv() {
        let event = match order {
            Order::StartNodes => match worker.start_nodes() {
                Ok(()) => Event::NodesReady(number),
                Err(reason) => Event::NodesLost(number, reason),
            },
            Order::Drive(drive) => {
                let event = match &shared.frames {
                    None => worker.drive(drive),
                    Some(frames) => worker.judge(drive, frames),
                };
                match event {
                    Some(event) => event,
                    None => return,
                }
            }
        };
        if events.send(event).is_err() {
            return;
        }
    }
    worker.stop_nodes();
}

pub(super) struct Worker<'a> {
    pub(super) number: usize,
    pub(super) name: WorkerName,
    pub(super) shared: &'a Shared,
    pub(super) nodes: Vec<Process>,
    seats: Option<Seats>,
    /// How often nodes were started, for their names.
    starts: u32,
}

/// The places of a worker's nodes on the bus.
struct Seats {
    planner: Arc<Seat>,
    predictor: Option<Seat>,
}

impl Worker<'_> {
    /// The line to its nodes for an episode of `scene`, and the processes behind it.
    pub(super) fn driver(
        &mut self,
        scene: &Arc<Scene>,
        recorder: Option<&Seat>,
    ) -> Result<Witness<'_, LineDriver>, String> {
        let shared = self.shared;
        let line: Box<dyn Line> = if let Some(minds) = &shared.minds {
            let tape = shared.hub.as_ref().map(|hub| hub.tape(&self.name, scene.id(), recorder));
            Box::new(HereLine::new(minds, tape.transpose().map_err(|error| error.to_string())?))
        } else {
            let seats = self.seats.as_ref().ok_or("its worker has no nodes")?;
            let cast = Cast { planner: &seats.planner, predictor: seats.predictor.as_ref(), recorder };
            let line = shared.hub()?.episode(&self.name, scene.id(), cast);
            Box::new(line.map_err(|error| error.to_string())?)
        };
        let driver = LineDriver::new(line, scene, shared.file.settings.deadline(), recorder.map(|_| CLOSING));
        Ok(Witness { driver, nodes: &mut self.nodes })
    }

    pub(super) fn start_nodes(&mut self) -> Result<(), String> {
        self.nodes.clear();
        if self.shared.minds.is_some() {
            return Ok(());
        }
        self.starts += 1;
        let settings = &self.shared.file.settings;
        // New seats for new nodes: of those before none is heard any more.
        let planner = match &self.shared.external {
            Some(seat) => Arc::clone(seat),
            None => Arc::new(self.seat(Role::Planner)?),
        };
        let process = match &settings.planner {
            Planner::Node(node) => Some(self.start_node("planner-node", Role::Planner, node, &planner)?),
            Planner::Command { command, .. } => Some(self.start_own_planner(command, &planner)?),
            Planner::External => None,
        };
        let mut predictor = None;
        if let Some(node) = &settings.predictor {
            let seat = self.seat(Role::Predictor)?;
            predictor = Some((self.start_node("predictor-node", Role::Predictor, node, &seat)?, seat));
        }
        // Both start side by side; then both are waited for.
        self.wait_for(&planner, process)?;
        let mut seats = Seats { planner, predictor: None };
        if let Some((process, seat)) = predictor {
            self.wait_for(&seat, Some(process))?;
            seats.predictor = Some(seat);
        }
        self.seats = Some(seats);
        Ok(())
    }

    fn seat(&self, role: Role) -> Result<Seat, String> {
        self.shared.hub()?.seat(role, &Workers::One(self.name.clone())).map_err(|error| error.to_string())
    }

    fn wait_for(&mut self, seat: &Seat, mut process: Option<Process>) -> Result<(), String> {
        self.shared.wait_for(seat, process.as_mut())?;
        self.nodes.extend(process);
        Ok(())
    }

    fn node_name(&self) -> String {
        format!("{}.{}", self.name, self.starts)
    }

    fn start_node(&self, program: &str, role: Role, node: &Node, seat: &Seat) -> Result<Process, String> {
        let (worker, name) = (self.name.to_string(), self.node_name());
        let which = format!("--{role}");
        let mut arguments = vec![&*which, &node.name, "--worker", &worker, "--name", &name];
        if node.reads_log {
            let inputs = self.shared.file.machine.scenarios.iter();
            arguments.extend(inputs.flat_map(|input| ["--scenarios", input.as_str()]));
        }
        arguments.extend(node.options.iter().map(String::as_str));
        if node.weights_sha256.is_some() {
            arguments.extend(self.shared.file.machine.weights.iter().flat_map(|path| ["--weights", path.as_str()]));
        }
        self.shared.start_program(program, &format!("{role} {worker}"), &arguments, seat, &self.shared.groups)
    }

    fn start_own_planner(&self, command: &str, seat: &Seat) -> Result<Process, String> {
        let (worker, name) = (self.name.to_string(), self.node_name());
        let mut shell = Command::new("sh");
        // So that a command finds the nodes of this sim, wherever they are installed.
        if let Some(path) = process::path_with_our_programs() {
            shell.env("PATH", path);
        }
        shell.args(["-c", &shell::line(command), "sh", "--worker", &worker, "--name", &name]);
        bus_threads::set(&mut shell, None);
        shell.env("RELOOP_WORKER", &worker).env("RELOOP_NAME", &name);
        self.shared.start_command(&format!("planner {worker}"), shell, seat, &self.shared.groups)
    }

    fn stop_nodes(&mut self) {
        self.nodes.drain(..).for_each(|node| node.stop(Duration::from_millis(500)));
    }

    /// Drives a scene and stores what came of it; none where the run is stopped before that.
    fn drive(&mut self, Drive { scene, record, repeatable }: Drive) -> Option<Event> {
        let shared = self.shared;
        let pauses = shared.pauses();
        let begin = shared.clock.now();
        let id = &shared.scenes.entries()[scene].id;
        let loaded = shared.scenes.load(scene);
        let load = shared.clock.now();
        let mut part = match loaded {
            Err(error) => self.unreadable(id.as_str(), &error.to_string()),
            Ok((scene, findings)) => {
                let _log = shared.logs.open(&scene);
                let lints = lint::lint(&scene, &findings);
                lints.iter().for_each(|lint| tracing::debug!(scene = %id, "{lint}"));
                let protocol = &shared.file.settings.protocol;
                let begun = shared.beginnings.of(id.as_str()).begin(&scene, protocol);
                let prepare = shared.clock.now() - load;
                let mut part = match begun {
                    Err(NotBegun::Undrivable(error)) => self.without_drive(error.end(&scene, protocol)),
                    Err(NotBegun::Scene(error)) => self.unreadable(id.as_str(), &error.to_string()),
                    Err(NotBegun::Lead(error)) => return Some(Event::Broken(error.to_string())),
                    Ok(begun) => self.drive_episode(begun, record)?,
                };
                part.timing.get_or_insert_default().prepare = prepare.as_secs_f64();
                let summary = lint::Summary::of(&lints);
                part.findings = summary.codes.into_iter().map(str::to_owned).collect();
                if matches!(shared.file.settings.protocol, Protocol::Strict(_)) {
                    part.unjudged = summary.unjudged.iter().map(ToString::to_string).collect();
                }
                part
            }
        };
        let timing = part.timing.get_or_insert_default();
        timing.worker = self.number as u32;
        timing.load = (load - begin).as_secs_f64();
        timing.wall = (shared.clock.now() - begin).as_secs_f64();
        if shared.stop.load(Ordering::Relaxed) {
            return None;
        }
        if is_full_disk(&part.recording_error) {
            return Some(Event::Broken(part.recording_error));
        }
        let driver_failed = part.reason() == EndReason::DriverFailed;
        let recorded = part.recorded && part.recording_error.is_empty();
        let spoiled = driver_failed || part.recorded && !recorded;
        if spoiled && repeatable && shared.pauses() != pauses {
            return Some(Event::Disturbed { worker: self.number, scene });
        }
        if let Err(error) = self
            .drop_unwanted_recording(id.as_str(), &mut part)
            .and_then(|()| shared.folder.store(id.as_str(), &part).map_err(|error| error.to_string()))
        {
            return Some(Event::Broken(error));
        }
        if let Some(onlooker) = &shared.onlooker {
            onlooker(&shared.folder, &part);
        }
        Some(Event::Driven { worker: self.number, driver_failed, recorded })
    }

    fn drive_episode(&mut self, Begun { scene, episode, lead }: Begun, record: bool) -> Option<Part> {
        let shared = self.shared;
        let settings = &shared.file.settings;
        let start = AgentState::from(&episode.observe().av);
        let start_log_index = episode.briefing().start;
        let recorder = if record { shared.recorder() } else { None };
        let mut driver = match self.driver(&scene, recorder.as_deref()) {
            Ok(driver) => driver,
            Err(reason) => return Some(self.unreadable(scene.id().as_str(), &reason)),
        };
        driver.driver.lead_by(lead);
        let Driven { outcome, recording, timing } = drive(episode, &mut driver, &shared.clock, &shared.stop)?;
        if driver.driver.recorder_is_frozen {
            shared.recorder_is_frozen.store(true, Ordering::Relaxed);
        }
        let wanted = settings.record != Record::None;
        let recording_error = match recording {
            Err(error) => error,
            Ok(()) if wanted && !record => "no recorder was there".to_owned(),
            Ok(()) => String::new(),
        };
        let human = scene.av();
        let at = |log_index: u32| human.states.get(log_index as usize).copied().flatten();
        let logged = outcome
            .records
            .iter()
            .map(|record| LoggedState { state: at(record.log_index).as_ref().map(AgentState::from) });
        Some(Part {
            logged: logged.collect(),
            end: Some(outcome.end),
            records: outcome.records,
            events: outcome.events,
            start: Some(start),
            start_log_index,
            recorded: record,
            recording_error,
            timing: Some(timing),
            ..Part::default()
        })
    }

    /// The part of a scene that cannot be read.
    fn unreadable(&self, scene: &str, detail: &str) -> Part {
        let end = EpisodeEnd {
            scene: scene.to_owned(),
            protocol: self.shared.file.settings.protocol.name().to_owned(),
            reason: EndReason::Undrivable.into(),
            detail: detail.to_owned(),
            ..EpisodeEnd::default()
        };
        self.without_drive(end)
    }

    /// The part of an episode that never began.
    fn without_drive(&self, end: EpisodeEnd) -> Part {
        Part { end: Some(end), ..Part::default() }
    }

    /// With `--record failures`, removes the recording of an episode that went well.
    fn drop_unwanted_recording(&self, scene: &str, part: &mut Part) -> Result<(), String> {
        let bad = matches!(
            part.reason(),
            EndReason::Collision | EndReason::OffRoute | EndReason::RouteLost | EndReason::DriverFailed
        );
        if !part.recorded || bad || self.shared.file.settings.record != Record::Failures {
            return Ok(());
        }
        part.recorded = false;
        for kind in ["mcap", "rrd"] {
            let path = self.shared.folder.episodes().join(format!("{scene}.{kind}"));
            match fs::remove_file(&path) {
                Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                    return Err(results::files::at("remove", &path)(error).to_string());
                }
                _ => {}
            }
        }
        Ok(())
    }
}

/// Whether this says that there is no room: the numbers of Linux's ENOSPC, EDQUOT and EFBIG, as Rust writes them.
fn is_full_disk(error: &str) -> bool {
    [28, 122, 27].iter().any(|number| error.contains(&format!("(os error {number})")))
}
