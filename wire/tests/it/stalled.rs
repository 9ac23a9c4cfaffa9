//! A recorder that is stopped (SIGSTOP) reads nothing any more. The drives must go on.

use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

use wire::hub::{Cast, Hub, HubSettings, Line, NodeEvent, Seat};
use wire::keys::{Channel, Role, Secret, Worker, Workers};
use wire::node::{Connection, Options, Planner, PlannerFactory, StepInput, serve_planner};
use world::observation::{Briefing, Observation, ObservedAgent};
use world::plan::{PLAN_STEPS, PlanState, UncheckedPlan};
use world::reference_line::ReferenceWindow;
use world::scene::{AgentKind, AgentState, SceneId, TrackId};

const DEADLINE: Duration = Duration::from_secs(4);
const STEPS: u32 = 600;
const WORKERS: usize = 4;

struct Empty;

impl PlannerFactory for Empty {
    fn start(&self, _: &Briefing) -> Result<Box<dyn Planner>, String> {
        Ok(Box::new(Self))
    }
}

impl Planner for Empty {
    fn plan(&mut self, step: &StepInput<'_>) -> Result<UncheckedPlan, String> {
        let states = vec![PlanState::default(); PLAN_STEPS];
        Ok(UncheckedPlan { step: step.observation.step, states, ..Default::default() })
    }
}

fn options(endpoint: &str, worker: Workers, secret: &str) -> Options {
    Options {
        endpoint: endpoint.to_owned(),
        run: "stalled".parse().unwrap(),
        worker,
        name: None,
        secret: Some(Secret::from(secret)),
        zenoh_config: None,
        exit_with_parent: false,
    }
}

/// Not a test: the other process. It hears everything, like a recorder.
#[test]
#[ignore = "the listener's process, started by the test below"]
fn listener() {
    let Ok(endpoint) = std::env::var("STALLED_ENDPOINT") else { return };
    let secret = std::env::var("STALLED_SECRET").unwrap();
    let connection = Connection::open(&options(&endpoint, Workers::All, &secret)).unwrap();
    connection.subscribe(&Channel::ALL, |_, _| {}).unwrap();
    let _ = connection.serve(Role::Recorder);
}

struct Listener(Child);

impl Drop for Listener {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Large, so that what waits for the listener runs over.
fn observation(step: u32) -> Observation {
    let state = AgentState { x: 1.5, y: 1.5, length: 4.5, width: 2.0, heading: 0.3, ..AgentState::default() };
    let agent = |track| ObservedAgent { track: TrackId(track), kind: AgentKind::Vehicle, state, unseen: 0 };
    Observation {
        step,
        log_index: 19 + step,
        av: AgentState::default(),
        control: Default::default(),
        agents: (0..1_000).map(agent).collect(),
        signals: vec![],
        window: ReferenceWindow {
            line: Arc::default(),
            start: 0,
            samples: 0,
            first_sample: 0,
            red_stops: vec![],
            speed_limit: None,
        },
    }
}

#[test]
fn a_stopped_recorder_makes_no_drive_miss_a_deadline() {
    let hub =
        Hub::open_with(&"stalled".parse().unwrap(), &HubSettings { deadline: DEADLINE, ..HubSettings::default() })
            .unwrap();
    let events = hub.watch();
    let recorder = hub.seat(Role::Recorder, &Workers::All).unwrap();
    let listener = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "stalled::listener", "--ignored"])
        .env("STALLED_ENDPOINT", hub.endpoint())
        .env("STALLED_SECRET", recorder.secret().reveal())
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let listener = Listener(listener);
    let mut planners = Vec::new();
    for number in 0..WORKERS {
        let workers = Workers::One(Worker::numbered(number));
        let seat = hub.seat(Role::Planner, &workers).unwrap();
        let options = options(hub.endpoint(), workers, seat.secret().reveal());
        std::thread::spawn(move || serve_planner(&options, Arc::new(Empty)));
        planners.push(seat);
    }
    let seats: Vec<&Seat> = planners.iter().chain([&recorder]).collect();
    hub.wait_for_nodes(&seats, Duration::from_secs(10), &|| false).unwrap();
    let stopped = Command::new("kill").args(["-STOP", &listener.0.id().to_string()]).status().unwrap();
    assert!(stopped.success());

    let slowest = std::thread::scope(|scope| {
        let drives: Vec<_> = (0..WORKERS)
            .map(|number| {
                scope.spawn({
                    let (hub, seat) = (&hub, &planners[number]);
                    move || drive(hub, seat, number)
                })
            })
            .collect();
        drives.into_iter().map(|drive| drive.join().unwrap()).max().unwrap()
    });
    assert!(slowest < DEADLINE, "a step took {slowest:?}");
    drop(listener);
    let gone = |event: &NodeEvent| matches!(event, NodeEvent::Left(node) if node.role == Role::Recorder);
    let until = Instant::now() + Duration::from_secs(10);
    let next = || events.recv_timeout(until.saturating_duration_since(Instant::now()));
    while !gone(&next().expect("its death is not noticed")) {}
}

/// Drives an episode; gives the time of its slowest step.
fn drive(hub: &Hub, planner: &Seat, number: usize) -> Duration {
    let scene = SceneId::new(format!("scene-{number}")).unwrap();
    let cast = Cast { planner, predictor: None, traffic: None, recorder: None };
    let mut line = hub.episode(&Worker::numbered(number), &scene, cast).unwrap();
    let briefing = Briefing {
        scene,
        protocol: "strict".to_owned(),
        start: 19,
        horizon: STEPS,
        wheelbase: 3.0,
        map: Arc::default(),
        route: vec![],
        reference_line: Arc::default(),
        history: vec![],
    };
    line.announce(&briefing).unwrap();
    let mut slowest = Duration::ZERO;
    for step in 0..STEPS {
        let start = Instant::now();
        let (plan, _) = line.step(&observation(step), DEADLINE).unwrap();
        slowest = slowest.max(start.elapsed());
        plan.check(step).unwrap();
    }
    slowest
}
