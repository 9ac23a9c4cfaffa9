//! The node as a process of its own on a real bus.

use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

use wire::hub::{Cast, EpisodeLine, Hub, Line, LineError, Seat};
use wire::keys::{Role, Secret, Worker, Workers};
use world::observation::{Briefing, HistoryStep, Observation};
use world::reference_line::{ReferenceLine, ReferenceWindow};
use world::scene::{AgentState, SceneId};

const DEADLINE: Duration = Duration::from_secs(10);

fn av(x: f64) -> AgentState {
    AgentState { x, velocity_x: 8.0, length: 4.8, width: 2.0, height: 1.6, ..Default::default() }
}

fn line() -> Arc<ReferenceLine> {
    let samples = 2000;
    Arc::new(ReferenceLine {
        x: (0..samples).map(|i| 0.1 * f64::from(i)).collect(),
        y: vec![0.0; 2000],
        z: vec![0.0; 2000],
        heading: vec![0.0; 2000],
        curvature: vec![0.0; 2000],
        speed_limit: vec![10.0; 2000],
        crosswalk: vec![false; 2000],
    })
}

fn briefing() -> Briefing {
    Briefing {
        scene: SceneId::new("straight").unwrap(),
        protocol: "strict".to_owned(),
        start: 19,
        horizon: 150,
        wheelbase: 3.089,
        map: Arc::default(),
        route: vec![],
        reference_line: line(),
        history: (0..19).map(|log_index| HistoryStep { log_index, av: av(20.0), agents: vec![] }).collect(),
    }
}

fn observation(step: u32) -> Observation {
    Observation {
        step,
        log_index: 19 + step,
        av: av(20.0 + 0.8 * f64::from(step)),
        control: Default::default(),
        agents: vec![],
        signals: vec![],
        window: ReferenceWindow {
            line: line(),
            start: 0,
            samples: 1200,
            first_sample: 0,
            red_stops: vec![],
            speed_limit: None,
        },
    }
}

/// The node's process, killed when the test ends, however it does; and where it sits.
struct Node(Child, Seat);

impl Drop for Node {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Node {
    fn start(hub: &Hub, planner: &str) -> Self {
        let seat = seat(hub);
        let child = Command::new(env!("CARGO_BIN_EXE_planner-node"))
            .args(["--planner", planner, "--worker", "w0", "--exit-with-parent"])
            .args(["--endpoint", hub.endpoint(), "--run", &hub.run().to_string()])
            .env(Secret::VARIABLE, seat.secret().reveal())
            .stdin(Stdio::piped())
            .spawn()
            .unwrap();
        let node = Self(child, seat);
        hub.wait_for_nodes(&[&node.1], DEADLINE, &|| false).unwrap();
        node
    }

    fn leaves(&mut self) -> bool {
        let start = Instant::now();
        while start.elapsed() < DEADLINE {
            if self.0.try_wait().unwrap().is_some() {
                return true;
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        false
    }

    fn signal(&self, signal: &str) {
        assert!(Command::new("kill").args([signal, &self.0.id().to_string()]).status().unwrap().success());
    }
}

fn hub() -> Hub {
    Hub::open(&"test".parse().unwrap()).unwrap()
}

fn seat(hub: &Hub) -> Seat {
    hub.seat(Role::Planner, &Workers::One(Worker::numbered(0))).unwrap()
}

fn open(hub: &Hub, node: &Node) -> EpisodeLine {
    let cast = Cast { planner: &node.1, predictor: None, traffic: None, recorder: None };
    let mut line = hub.episode(&Worker::numbered(0), &SceneId::new("straight").unwrap(), cast).unwrap();
    line.announce(&briefing()).unwrap();
    line
}

#[test]
fn its_plans_are_whole_and_it_leaves_with_the_run() {
    for planner in ["idm", "constant-velocity"] {
        let hub = hub();
        let mut node = Node::start(&hub, planner);
        let mut line = open(&hub, &node);
        for step in 0..10 {
            let (plan, _) = line.step(&observation(step), DEADLINE).unwrap();
            plan.check(step).unwrap();
        }
        drop(line);
        hub.close();
        assert!(node.leaves(), "{planner} outlives its run");
    }
}

#[test]
fn it_leaves_when_its_parent_does() {
    let hub = hub();
    let mut node = Node::start(&hub, "idm");
    drop(node.0.stdin.take());
    assert!(node.leaves());
}

#[test]
fn it_leaves_on_ctrl_c() {
    let hub = hub();
    let mut node = Node::start(&hub, "idm");
    node.signal("-INT");
    assert!(node.leaves());
}

#[test]
fn a_killed_node_is_noticed_at_once() {
    let hub = hub();
    let mut node = Node::start(&hub, "idm");
    let mut line = open(&hub, &node);
    line.step(&observation(0), DEADLINE).unwrap();
    node.0.kill().unwrap();
    let start = Instant::now();
    let error = line.step(&observation(1), DEADLINE).unwrap_err();
    assert!(matches!(error, LineError::NodeLost { role: Role::Planner }), "{error}");
    assert!(start.elapsed() < DEADLINE / 2, "{:?}", start.elapsed());
}

#[test]
fn a_stopped_node_costs_a_deadline_and_no_more() {
    let hub = hub();
    let node = Node::start(&hub, "idm");
    let mut line = open(&hub, &node);
    line.step(&observation(0), DEADLINE).unwrap();
    node.signal("-STOP");
    let start = Instant::now();
    let error = line.step(&observation(1), Duration::from_millis(300)).unwrap_err();
    assert!(matches!(error, LineError::NoAnswer { role: Role::Planner, .. }), "{error}");
    assert!(start.elapsed() < Duration::from_secs(2));
    node.signal("-CONT");
}

/// `PYTHON=venv/bin/python cargo nextest run -p planner-node --run-ignored only`
#[test]
#[ignore = "needs a Python with eclipse-zenoh and grpcio-tools, named by PYTHON"]
fn the_python_example_plans() {
    let hub = hub();
    let (python, seat) = (std::env::var("PYTHON").unwrap(), seat(&hub));
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/../examples/python/planner.py");
    let child = Command::new(python)
        .arg(script)
        .envs([("RELOOP_ENDPOINT", hub.endpoint()), ("RELOOP_RUN", "test"), ("RELOOP_WORKER", "w0")])
        .env(Secret::VARIABLE, seat.secret().reveal())
        .spawn()
        .unwrap();
    let mut node = Node(child, seat);
    hub.wait_for_nodes(&[&node.1], DEADLINE, &|| false).unwrap();
    let mut line = open(&hub, &node);
    for step in 0..20 {
        let (plan, _) = line.step(&observation(step), DEADLINE).unwrap();
        let plan = plan.check(step).unwrap();
        let expected = 20.0 + 0.8 * f64::from(step) + 0.8; // 8 m/s along the x axis
        assert!((plan.states()[0].x - expected).abs() < 0.06, "{:?}", plan.states()[0]);
    }
    line.dismiss(&Default::default(), DEADLINE).unwrap();
    drop(line);
    hub.close();
    assert!(node.leaves());
}
