//! A worker: a thread with nodes of its own, that drives one scene after the other and stores what came of it.

use std::fs;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, SyncSender};
use std::time::Duration;

use episode::protocol::Protocol;
use results::part::{LoggedState, Part};
use results::settings::Record;
use results::settings::{Node, Planner};
use scenarios::lint;
use wire::hub::{Cast, HereLine, Line, Seat};
use wire::keys::{Role, Worker as WorkerName, Workers};
use wire::proto::{AgentState, EndReason, EpisodeEnd};
use world::scene::Scene;

use super::beginning::{Begun, NotBegun};
use super::calling;
use super::clock::Clock;
use super::core::{Drive, Event};
use super::drive::{Driven, drive};
use super::in_process::weights_arguments;
use super::lag::Lag;
use super::line::LineDriver;
use super::process::Process;
use super::ready::{Prepared, Ready};
use super::shared::Shared;
use super::witness::Witness;

/// What the recorder may take to close an episode's file, beyond the deadline of an answer.
const CLOSING: Duration = Duration::from_secs(5);

/// What the run asks of a worker.
#[derive(Clone, Copy, Debug)]
pub enum Order {
    /// Start its nodes, in the place of those it has.
    StartNodes,
    /// Drive a scene.
    Drive(Drive),
}

/// Does what is ordered until nobody orders any more.
pub fn work(number: usize, shared: &Arc<Shared>, orders: &Receiver<Order>, events: &SyncSender<Event>) {
    if let Some(cores) = shared.cores
        && let Err(error) = cores.one(number).and_then(|one| one.keep_to())
    {
        tracing::warn!("worker {number} is on no core of its own: {error}");
    }
    let mut worker = Worker::new(number, shared);
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
    /// The recorder that the last episode found lost.
    missed: Option<u32>,
    /// How often this program stood still until the last episode but one ended, and until the last.
    pauses: [u64; 2],
}

/// The places of a worker's nodes on the bus.
struct Seats {
    planner: Arc<Seat>,
    predictor: Option<Seat>,
    traffic: Option<Seat>,
}

impl<'a> Worker<'a> {
    /// A worker without nodes yet.
    pub(super) fn new(number: usize, shared: &'a Shared) -> Self {
        Self {
            number,
            name: WorkerName::numbered(number),
            shared,
            nodes: Vec::new(),
            seats: None,
            starts: 0,
            missed: None,
            pauses: [shared.pauses(); 2],
        }
    }
}

impl Worker<'_> {
    /// Whether this program stood still in the episode that has ended, or in the one before: whom a pause cost us when that had all it needed
    /// is missed by the next alone.
    pub(super) fn stood_still(&mut self) -> bool {
        let now = self.shared.pauses();
        let [before, last] = self.pauses;
        self.pauses = [last, now];
        before != now
    }

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
            let Seats { planner, predictor, traffic } = seats;
            let cast = Cast { planner, predictor: predictor.as_ref(), traffic: traffic.as_ref(), recorder };
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
            Planner::Command { command, .. } => Some(self.start_own(Role::Planner, command, &planner)?),
            Planner::External => None,
        };
        let traffic = settings.traffic.as_ref().map(|traffic| &traffic.node);
        let predictor = self.start_beside("predictor-node", Role::Predictor, settings.predictor.as_ref())?;
        let traffic = self.start_beside("traffic-node", Role::Traffic, traffic)?;
        // All start side by side; then all are waited for.
        self.wait_for(&planner, process)?;
        let mut seated = |started: Option<(Process, Seat)>| -> Result<Option<Seat>, String> {
            let Some((process, seat)) = started else { return Ok(None) };
            self.wait_for(&seat, Some(process))?;
            Ok(Some(seat))
        };
        let (predictor, traffic) = (seated(predictor)?, seated(traffic)?);
        self.seats = Some(Seats { planner, predictor, traffic });
        Ok(())
    }

    /// Starts a node beside the planner, if there is one, at a seat of its own.
    fn start_beside(&self, program: &str, role: Role, node: Option<&Node>) -> Result<Option<(Process, Seat)>, String> {
        let Some(node) = node else { return Ok(None) };
        let seat = self.seat(role)?;
        let process = match &node.command {
            None => self.start_node(program, role, node, &seat)?,
            Some(command) => self.start_own(role, command, &seat)?,
        };
        Ok(Some((process, seat)))
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
        let index = if node.reads_log { Some(self.shared.index.path(&self.shared.scenes)?) } else { None };
        arguments.extend(index.iter().flat_map(|index| ["--scenarios", index.as_str()]));
        arguments.extend(node.options.iter().map(String::as_str));
        arguments.extend(weights_arguments(&which, node, &self.shared.file.machine));
        self.shared.start_program(program, &format!("{role} {worker}"), &arguments, seat, &self.shared.groups)
    }

    /// Starts a command of the user's.
    fn start_own(&self, role: Role, command: &str, seat: &Seat) -> Result<Process, String> {
        let (worker, name) = (self.name.to_string(), self.node_name());
        let shell = calling::own(command, &worker, &name);
        self.shared.start_command(&format!("{role} {worker}"), shell, seat, &self.shared.groups)
    }

    fn stop_nodes(&mut self) {
        self.nodes.drain(..).for_each(|node| node.stop(Duration::from_millis(500)));
    }

    /// Drives a scene and stores what came of it; none where the run is stopped before that.
    fn drive(&mut self, Drive { scene, recorder, repeatable }: Drive) -> Option<Event> {
        let shared = self.shared;
        let begin = shared.clock.now();
        let id = &shared.scenes.entries()[scene].id;
        let ready = shared.ahead.take(scene).unwrap_or_else(|| Ready::new(shared, scene));
        let mut part = match ready.scene {
            Err(error) => self.unreadable(id.as_str(), &error.to_string()),
            Ok(Prepared { scene, lints, begun, prepare }) => {
                let _log = shared.logs.open(&scene);
                lints.iter().for_each(|lint| tracing::debug!(scene = %id, "{lint}"));
                let protocol = &shared.file.settings.protocol;
                let mut part = match begun {
                    Err(NotBegun::Undrivable(error)) => self.without_drive(error.end(&scene, protocol)),
                    Err(NotBegun::Setting(error)) => return Some(Event::Broken(error.to_string())),
                    Err(NotBegun::Scene(error)) => self.unreadable(id.as_str(), &error.to_string()),
                    Err(NotBegun::Lead(error)) => return Some(Event::Broken(error.to_string())),
                    Ok(begun) => self.drive_episode(begun, recorder)?,
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
        part.run_sha256.clone_from(&shared.identity);
        part.scene_sha256 = shared.scenes.known_sha256(scene).unwrap_or_default();
        let timing = part.timing.get_or_insert_default();
        timing.worker = self.number as u32;
        timing.load = ready.load.as_secs_f64();
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
        let (missed, stood_still) = (self.missed.take(), self.stood_still());
        if spoiled && repeatable && stood_still {
            return Some(Event::Disturbed { worker: self.number, scene, missed });
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
        Some(Event::Driven { worker: self.number, driver_failed, recorded, missed })
    }

    fn drive_episode(&mut self, Begun { scene, episode, lead }: Begun, number: Option<u32>) -> Option<Part> {
        let shared = self.shared;
        let settings = &shared.file.settings;
        let start = AgentState::from(&episode.observe().av);
        let start_log_index = episode.briefing().start;
        let record = number.is_some();
        let recorder = if record { shared.recorder() } else { None };
        let mut driver = match self.driver(&scene, recorder.as_deref()) {
            Ok(driver) => driver,
            Err(reason) => return Some(self.unreadable(scene.id().as_str(), &reason)),
        };
        let scene_id = scene.id().as_str();
        let lag =
            settings.latency.as_ref().map(|latency| Lag::new(latency, shared.trace.as_ref(), scene_id, lead.len()));
        driver.driver.lead_by(lead);
        let driven = drive(episode, &mut driver, lag, &shared.clock, &shared.stop)?;
        let Driven { outcome, plans, recording, timing } = driven;
        let is_lost = driver.driver.recorder_is_lost;
        if let Some(number) = number.filter(|_| is_lost) {
            shared.missed_recorder.store(number.into(), Ordering::Relaxed);
            self.missed = Some(number);
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
            moved: outcome.moved,
            without_room: outcome.without_room,
            start: Some(start),
            start_log_index,
            recorded: record,
            recording_error,
            timing: Some(timing),
            plans,
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
