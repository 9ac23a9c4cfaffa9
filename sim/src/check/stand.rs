//! The bus on which a node is looked at, and the node on it.

use std::process::Command;
use std::sync::Arc;
use std::time::{Duration, Instant};

use nix::sys::signal::Signal;
use wire::hub::{BarrierError, Cast, EpisodeLine, Hub, HubSettings, Line as _, LineError, Seat};
use wire::keys::{Role, Secret, Worker, Workers};
use wire::proto::RunInfo;

use world::traffic::MoveError;

use super::answers::{Answer, Driven};
use super::course::Course;
use crate::run::console::Console;
use crate::run::process::{Groups, Process, program};
use crate::run::voice::Voice;
use crate::run::{bus_threads, calling};

/// How long a process may take to be gone after its connection is.
const DYING: Duration = Duration::from_millis(500);

/// Who is looked at.
#[derive(Clone, Debug)]
pub struct Subject {
    /// What it is.
    pub role: Role,
    /// How it is started.
    pub command: String,
    /// Who predicts for a planner: a predictor of ours, by its name.
    pub predictor: Option<String>,
}

impl Subject {
    /// What it is, as a phrase.
    #[must_use]
    pub fn what(&self) -> String {
        match &self.predictor {
            Some(predictor) => format!("{}, with predictor {predictor}", self.role),
            None => self.role.to_string(),
        }
    }
}

/// The bus.
pub struct Stand {
    hub: Hub,
    subject: Subject,
    /// How long an answer may take.
    pub deadline: Duration,
    /// How long a process may take to be on the bus.
    pub start_timeout: Duration,
    console: Console,
    groups: Groups,
}

/// The seats of one cast.
#[derive(Clone)]
pub struct Seats {
    workers: Workers,
    planner: Arc<Seat>,
    predictor: Option<Arc<Seat>>,
    traffic: Option<Arc<Seat>>,
}

impl Seats {
    fn of(&self, role: Role) -> &Seat {
        match (&self.predictor, &self.traffic, role) {
            (Some(predictor), _, Role::Predictor) => predictor,
            (_, Some(traffic), Role::Traffic) => traffic,
            _ => &self.planner,
        }
    }
}

impl Stand {
    /// A bus on a free port of this machine.
    ///
    /// # Errors
    /// Why there is none, as a sentence.
    pub fn open(
        subject: Subject,
        [deadline, start_timeout]: [Duration; 2],
        console: &Console,
        groups: &Groups,
    ) -> Result<Self, String> {
        let says = |error: &dyn std::fmt::Display| error.to_string();
        let name = "check-node";
        let hub = Hub::open_with(
            &name.parse().map_err(|error| says(&error))?,
            &HubSettings { deadline, ..HubSettings::default() },
        )
        .map_err(|error| says(&error))?;
        let info = RunInfo {
            wire_version: wire::WIRE_VERSION,
            run: name.to_owned(),
            predictor: subject.role == Role::Predictor || subject.predictor.is_some(),
            traffic: subject.role == Role::Traffic,
            ..RunInfo::default()
        };
        hub.publish_run_info(&info).map_err(|error| says(&error))?;
        Ok(Self { hub, subject, deadline, start_timeout, console: console.clone(), groups: groups.clone() })
    }

    /// Who is looked at.
    #[must_use]
    pub fn subject(&self) -> &Subject {
        &self.subject
    }

    /// New seats for the node and whom it needs beside it.
    ///
    /// # Errors
    /// Why there are none, as a sentence.
    pub fn seats(&self, workers: &Workers) -> Result<Seats, String> {
        let seat = |role| self.hub.seat(role, workers).map(Arc::new).map_err(|error| error.to_string());
        let predicts = self.subject.role == Role::Predictor || self.subject.predictor.is_some();
        let predictor = if predicts { Some(seat(Role::Predictor)?) } else { None };
        let traffic = if self.subject.role == Role::Traffic { Some(seat(Role::Traffic)?) } else { None };
        Ok(Seats { workers: workers.clone(), planner: seat(Role::Planner)?, predictor, traffic })
    }

    /// Starts the node at these seats, and waits until it sits there.
    ///
    /// # Errors
    /// Why it does not, as a sentence.
    pub fn start(&self, seats: &Seats) -> Result<Node<'_>, String> {
        let companion = match (self.subject.role, &self.subject.predictor) {
            (Role::Predictor | Role::Traffic, _) => {
                Some(("planner-node", "--planner", "constant-velocity", Role::Planner))
            }
            (_, Some(predictor)) => Some(("predictor-node", "--predictor", predictor.as_str(), Role::Predictor)),
            (_, None) => None,
        };
        let companion = companion.map(|(name, which, what, role)| -> Result<Process, String> {
            let mut command = Command::new(program(name).map_err(|error| error.to_string())?);
            command.args([which, what, "--worker", &seats.workers.to_string(), "--name", "companion"]);
            bus_threads::set(&mut command, Some(1));
            let process = self.call(name, command, seats.of(role))?;
            self.wait_for(seats.of(role), process)
        });
        let companion = companion.transpose()?;
        let start = Instant::now();
        let process = self.wait_for(seats.of(self.subject.role), self.begin(seats)?)?;
        Ok(Node { stand: self, seats: seats.clone(), process, _companion: companion, joined: start.elapsed() })
    }

    /// Starts the node's process at these seats, and waits for nothing.
    ///
    /// # Errors
    /// Why it cannot be started, as a sentence.
    pub fn begin(&self, seats: &Seats) -> Result<Process, String> {
        let command = calling::own(&self.subject.command, &seats.workers.to_string(), "checked");
        self.call("node", command, seats.of(self.subject.role))
    }

    /// Starts the node's process with a secret that nobody knows.
    ///
    /// # Errors
    /// Why it cannot be started, as a sentence.
    pub fn begin_unknown(&self, seats: &Seats) -> Result<Process, String> {
        let secret = Secret::random().map_err(|error| error.to_string())?;
        let mut command = calling::own(&self.subject.command, &seats.workers.to_string(), "unknown");
        calling::to_seat(&mut command, &self.hub, seats.of(self.subject.role));
        command.env(Secret::VARIABLE, secret.reveal());
        Process::start("unknown node", command, &self.groups, Voice::unlogged("unknown node", &self.console))
            .map_err(|error| error.to_string())
    }

    fn call(&self, name: &str, mut command: Command, seat: &Seat) -> Result<Process, String> {
        calling::to_seat(&mut command, &self.hub, seat);
        Process::start(name, command, &self.groups, Voice::unlogged(name, &self.console))
            .map_err(|error| error.to_string())
    }

    fn wait_for(&self, seat: &Seat, process: Process) -> Result<Process, String> {
        let process = std::cell::RefCell::new(process);
        let gone = || process.borrow_mut().gone();
        match self.hub.wait_for_nodes(&[seat], self.start_timeout, &|| gone().is_some()) {
            Ok(()) => {}
            Err(BarrierError::Cancelled) => {
                return Err(format!("it {} before it was on the bus", gone().unwrap_or_default()));
            }
            Err(error) => return Err(error.to_string()),
        }
        Ok(process.into_inner())
    }

    /// Waits until the sim has seen that every node is gone.
    ///
    /// # Errors
    /// Who is still there, as a sentence.
    pub fn wait_until_left(&self, patience: Duration) -> Result<(), String> {
        let until = Instant::now() + patience;
        loop {
            match self.hub.nodes().first() {
                None => return Ok(()),
                Some(node) if Instant::now() >= until => {
                    return Err(format!("{node} was killed, and is still on the bus"));
                }
                Some(_) => std::thread::sleep(Duration::from_millis(5)),
            }
        }
    }

    /// Leaves the bus, as a sim that is done.
    pub fn close(self) {
        self.hub.close();
    }
}

/// Why a course was not driven to its end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Trouble {
    /// No answer came in time.
    Late(String),
    /// What came was none, or too much, or the node died.
    Wrong(String),
    /// What came says of an agent what no body can do.
    Impossible(String),
}

impl Trouble {
    /// It, as a sentence.
    #[must_use]
    pub fn said(self) -> String {
        match self {
            Self::Late(said) | Self::Wrong(said) | Self::Impossible(said) => said,
        }
    }
}

/// The node at its seat. It is killed when this is dropped.
pub struct Node<'a> {
    stand: &'a Stand,
    seats: Seats,
    process: Process,
    _companion: Option<Process>,
    /// How long it took from its start until it sat there.
    pub joined: Duration,
}

impl Node<'_> {
    /// Its seats, which another may take after it.
    #[must_use]
    pub fn seats(&self) -> &Seats {
        &self.seats
    }

    /// Its process.
    pub fn process(&mut self) -> &mut Process {
        &mut self.process
    }

    /// Its process alone: whom it needs beside it leaves.
    #[must_use]
    pub fn into_process(self) -> Process {
        self.process
    }

    /// A line of worker `number` for a course.
    ///
    /// # Errors
    /// [`Trouble`].
    pub fn line(&self, number: usize, course: &Course) -> Result<EpisodeLine, Trouble> {
        let cast = Cast {
            planner: &self.seats.planner,
            predictor: self.seats.predictor.as_deref(),
            traffic: self.seats.traffic.as_deref(),
            recorder: None,
        };
        let line = self.stand.hub.episode(&Worker::numbered(number), &course.briefing.scene, cast);
        line.map_err(|error| Trouble::Wrong(error.to_string()))
    }

    /// Drives a course to its end.
    ///
    /// # Errors
    /// [`Trouble`], with what became of its process.
    pub fn drive(&mut self, course: &Course) -> Result<Driven, Trouble> {
        let mut line = self.line(0, course)?;
        let driven = self.drive_on(&mut line, course);
        driven.map_err(|trouble| self.testify(course, trouble))
    }

    fn drive_on(&self, line: &mut EpisodeLine, course: &Course) -> Result<Driven, Trouble> {
        line.announce(&course.briefing).map_err(|error| trouble(&error))?;
        let mut driven = Driven::default();
        for at in 0..course.steps.len() {
            self.step(line, course, at, &mut driven)?;
        }
        self.dismiss(line, course)?;
        Ok(driven)
    }

    /// Asks for the answer at a step of a course.
    ///
    /// # Errors
    /// [`Trouble`].
    pub fn step(&self, line: &mut EpisodeLine, course: &Course, at: usize, driven: &mut Driven) -> Result<(), Trouble> {
        let Some((observation, led)) = course.steps.get(at) else { return Ok(()) };
        if self.stand.subject.role == Role::Traffic {
            return self.move_on(line, course, at, driven);
        }
        let wrong = |error: &dyn std::fmt::Display| Trouble::Wrong(format!("step {at}: {error}"));
        let start = Instant::now();
        let (plan, prediction) =
            line.led_step(observation, led, self.stand.deadline).map_err(|error| trouble(&error))?;
        driven.times.push(start.elapsed());
        driven.answers.push(match self.stand.subject.role {
            Role::Predictor => {
                let prediction = prediction.ok_or_else(|| wrong(&"no prediction"))?;
                Answer::Prediction(prediction.check(observation.step).map_err(|error| wrong(&error))?)
            }
            _ => Answer::Plan(plan.check(observation.step).map_err(|error| wrong(&error))?),
        });
        Ok(())
    }

    /// Asks traffic where everybody is next whom it drives. The planner beside it is not asked: the AV's drive is known.
    fn move_on(&self, line: &mut EpisodeLine, course: &Course, at: usize, driven: &mut Driven) -> Result<(), Trouble> {
        let Some((observation, taken)) = course.reacting(at, driven.answers.last()) else { return Ok(()) };
        let start = Instant::now();
        let moves = line.moves(&observation, &taken, self.stand.deadline).map_err(|error| trouble(&error))?;
        driven.times.push(start.elapsed());
        let checked = moves.check(observation.step, &taken);
        let moves = checked.map_err(|error| {
            let said = format!("step {at}: {error}");
            match error {
                MoveError::Impossible { .. } | MoveError::Resized { .. } => Trouble::Impossible(said),
                _ => Trouble::Wrong(said),
            }
        })?;
        driven.answers.push(Answer::Moves(moves));
        Ok(())
    }

    /// Tells how a course ended, and waits for the node to be done with it.
    ///
    /// # Errors
    /// [`Trouble`].
    pub fn dismiss(&self, line: &mut EpisodeLine, course: &Course) -> Result<(), Trouble> {
        line.dismiss(&course.end, self.stand.deadline).map_err(|error| trouble(&error))
    }

    /// What went wrong, where, and what became of the process.
    fn testify(&mut self, course: &Course, trouble: Trouble) -> Trouble {
        let is_gone = self.process.wait(DYING);
        let raised = self.process.raised(DYING);
        let more = [is_gone.map(|how| format!("it {how}")), raised.map(|what| format!("it {what}"))];
        let more: String = more.into_iter().flatten().map(|more| format!("; {more}")).collect();
        let say = |what: String| format!("{}: {what}{more}", course.name);
        match trouble {
            Trouble::Late(what) => Trouble::Late(say(what)),
            Trouble::Wrong(what) => Trouble::Wrong(say(what)),
            Trouble::Impossible(what) => Trouble::Impossible(say(what)),
        }
    }

    /// Asks it to end: SIGTERM to it and all that it started.
    pub fn terminate(&mut self, patience: Duration) -> Option<String> {
        self.process.signal(Signal::SIGTERM);
        self.process.wait(patience)
    }
}

fn trouble(error: &LineError) -> Trouble {
    match error {
        LineError::NoAnswer { .. } => Trouble::Late(error.to_string()),
        _ => Trouble::Wrong(error.to_string()),
    }
}
