//! What the bus costs a step: observation out, plan back, to an empty planner in another process, by the run's socket.
//!
//! The observation has 64 agents and a whole window of 1,200 samples; the plan has 50 states and 50 controls. Time is
//! that of [`wire::hub::EpisodeLine::step`]: conversion, encoding and decoding on both sides included. The floor is a
//! ping-pong of the same sizes over a bare TCP connection between the same two processes.
//!
//! Both are measured twice: as the system places the threads, and with all of them on one core. The difference is what it costs to
//! wake a core: 1 us or 50, by machine and moment, so judge the first figure by its floor.

#![allow(clippy::print_stdout, reason = "a bench prints its result")]
#![allow(clippy::unwrap_used, reason = "a bench has nobody to report an error to")]

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::process::{Child, Command};
use std::sync::Arc;
use std::time::{Duration, Instant};

use prost::Message;
use wire::cores::Cores;
use wire::hub::{Cast, Hub, Line};
use wire::keys::{Role, Secret, Worker, Workers};
use wire::node::{Options, Planner, PlannerFactory, StepInput, serve_planner};
use wire::session::{self, RUNTIME_VARIABLE};
use wire::{convert, proto};
use world::observation::{Briefing, Observation, ObservedAgent};
use world::plan::{Control, PLAN_STEPS, PlanState, UncheckedPlan};
use world::reference_line::{ReferenceLine, ReferenceWindow};
use world::scene::{AgentKind, AgentState, SceneId, TrackId};

const WARM_UP: u32 = 500;
const STEPS: u32 = 5_000;
const DEADLINE: Duration = Duration::from_secs(10);

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>().as_slice() {
        [_, "--node", endpoint, secret] => {
            serve_planner(&options(endpoint, secret), Arc::new(Empty)).unwrap();
        }
        // Processes of their own: the bus's threads are started once and stay where they were started.
        [_, "--anywhere"] => measure_bus("wherever the system puts it"),
        [_, "--pinned"] => {
            Cores::of_this_thread().unwrap().one(0).unwrap().keep_to().unwrap();
            measure_bus("on one core (sim run --pin)");
        }
        [_, "--echo", address] => echo(TcpStream::connect(address).unwrap()),
        arguments if arguments.contains(&"--list") => {} // a test runner asks for tests: there are none
        _ => measure(),
    }
}

fn measure() {
    let observation = observation(0);
    let request = proto::Observation::from(&observation).encode_to_vec();
    let reply = proto::Plan::from(&plan(0)).encode_to_vec();
    println!("observation {} bytes, plan {} bytes, {STEPS} steps", request.len(), reply.len());

    report("encode observation", time(|_| drop(proto::Observation::from(&observation).encode_to_vec())));
    let line = Arc::clone(&observation.window.line);
    report(
        "decode observation",
        time(|_| {
            let message = convert::decode::<proto::Observation>(&request).unwrap();
            drop(convert::observation(message, &line).unwrap());
        }),
    );
    start(&["--anywhere"]).0.wait().unwrap();
    start(&["--pinned"]).0.wait().unwrap();
}

fn measure_bus(place: &str) {
    println!("\n{place}");
    let request = proto::Observation::from(&observation(0)).encoded_len();
    let reply = proto::Plan::from(&plan(0)).encoded_len();
    let floor = report("floor: bare TCP", floor(request, reply));
    let (median, p99) = report("bus: observation out, plan back", bus());
    let (median, p99) = (median / floor.0, p99 / floor.0);
    let verdict = if median <= 4.0 && p99 <= 10.0 { "met" } else { "MISSED" };
    println!("{median:.1} times the floor's median, p99 {p99:.1} times; target 4 and 10: {verdict}");
}

/// What a step costs beside its time: voluntary and other context switches, and seconds of CPU, of all threads of these processes.
fn cost(processes: &[u32]) -> (u64, f64) {
    let (mut switches, mut ticks) = (0, 0);
    for process in processes {
        for thread in std::fs::read_dir(format!("/proc/{process}/task")).unwrap().flatten() {
            let status = std::fs::read_to_string(thread.path().join("status")).unwrap_or_default();
            let counts = status.lines().filter(|line| line.contains("_ctxt_switches:"));
            switches += counts.filter_map(|line| line.split_whitespace().last()?.parse::<u64>().ok()).sum::<u64>();
        }
        let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).unwrap();
        // Behind the name, which may hold anything: the 12th and 13th field, user and system.
        let fields: Vec<u64> =
            stat.rsplit(')').next().unwrap().split_whitespace().skip(11).take(2).flat_map(str::parse).collect();
        ticks += fields.iter().sum::<u64>();
    }
    (switches, ticks as f64 / 100.0)
}

fn bus() -> Vec<Duration> {
    let hub = Hub::open(&"bench".parse().unwrap()).unwrap();
    let seat = hub.seat(Role::Planner, &w0()).unwrap();
    let node = start(&["--node", hub.endpoint(), seat.secret().reveal()]);
    hub.wait_for_nodes(&[&seat], DEADLINE, &|| false).unwrap();
    let cast = Cast { planner: &seat, predictor: None, traffic: None, recorder: None };
    let mut line = hub.episode(&Worker::numbered(0), &SceneId::new("bench").unwrap(), cast).unwrap();
    let mut observation = observation(0);
    line.announce(&briefing(&observation)).unwrap();
    let processes = [std::process::id(), node.0.id()];
    let before = cost(&processes);
    let times = time(|step| {
        observation.step = step;
        let (plan, _) = line.step(&observation, DEADLINE).unwrap();
        plan.check(step).unwrap();
    });
    let after = cost(&processes);
    let a_step = |sum: f64| sum / f64::from(WARM_UP + STEPS);
    let (switches, us) = (a_step((after.0 - before.0) as f64), 1e6 * a_step(after.1 - before.1));
    println!("{:<34} {switches:.1} context switches, {us:.0} us of CPU a step, both processes", "");
    times
}

fn floor(request: usize, reply: usize) -> Vec<Duration> {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let _node = start(&["--echo", &listener.local_addr().unwrap().to_string()]);
    let (mut stream, _) = listener.accept().unwrap();
    stream.set_nodelay(true).unwrap();
    let sizes = [request as u64, reply as u64].map(u64::to_le_bytes).concat();
    stream.write_all(&sizes).unwrap();
    let (request, mut reply) = (vec![0; request], vec![0; reply]);
    time(|_| {
        stream.write_all(&request).unwrap();
        stream.read_exact(&mut reply).unwrap();
    })
}

/// The other end of the floor.
fn echo(mut stream: TcpStream) {
    stream.set_nodelay(true).unwrap();
    let mut sizes = [0; 16];
    stream.read_exact(&mut sizes).unwrap();
    let size = |at: usize| u64::from_le_bytes(sizes[at..at + 8].try_into().unwrap()) as usize;
    let (mut request, reply) = (vec![0; size(0)], vec![0; size(8)]);
    while stream.read_exact(&mut request).is_ok() && stream.write_all(&reply).is_ok() {}
}

/// This program again, in another role; killed when dropped.
struct Process(Child);

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn start(arguments: &[&str]) -> Process {
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.args(arguments);
    if arguments.first() != Some(&"--echo") {
        // As `sim run` starts itself and its nodes.
        command.env(RUNTIME_VARIABLE, session::runtime(1));
    }
    Process(command.spawn().unwrap())
}

fn time(mut work: impl FnMut(u32)) -> Vec<Duration> {
    (0..WARM_UP).for_each(&mut work);
    (WARM_UP..WARM_UP + STEPS)
        .map(|step| {
            let start = Instant::now();
            work(step);
            start.elapsed()
        })
        .collect()
}

/// Prints and gives median and 99th percentile (us).
fn report(what: &str, mut times: Vec<Duration>) -> (f64, f64) {
    times.sort_unstable();
    let at = |share: f64| times[((times.len() - 1) as f64 * share) as usize].as_secs_f64() * 1e6;
    println!("{what:<34} median {:>7.1} us   p99 {:>7.1} us   max {:>8.1} us", at(0.5), at(0.99), at(1.0));
    (at(0.5), at(0.99))
}

struct Empty;

impl PlannerFactory for Empty {
    fn start(&self, _: &Briefing) -> Result<Box<dyn Planner>, String> {
        Ok(Box::new(Self))
    }
}

impl Planner for Empty {
    fn plan(&mut self, step: &StepInput<'_>) -> Result<UncheckedPlan, String> {
        Ok(plan(step.observation.step))
    }
}

fn plan(step: u32) -> UncheckedPlan {
    let state = |k: usize| PlanState { x: 0.8 * k as f64, y: 1.0, heading: 0.1, speed: 8.0 };
    UncheckedPlan {
        step,
        states: (1..=PLAN_STEPS).map(state).collect(),
        controls: vec![Control { acceleration: 0.1, steering: 0.01 }; PLAN_STEPS],
        ..Default::default()
    }
}

fn w0() -> Workers {
    Workers::One(Worker::numbered(0))
}

fn options(endpoint: &str, secret: &str) -> Options {
    Options {
        endpoint: endpoint.to_owned(),
        run: "bench".parse().unwrap(),
        worker: w0(),
        name: None,
        secret: Some(Secret::from(secret)),
        zenoh_config: None,
        exit_with_parent: false,
    }
}

fn briefing(observation: &Observation) -> Briefing {
    Briefing {
        scene: SceneId::new("bench").unwrap(),
        protocol: "strict".to_owned(),
        start: 19,
        horizon: 150,
        wheelbase: 3.089,
        map: Arc::default(),
        route: vec![],
        reference_line: Arc::clone(&observation.window.line),
        history: vec![],
    }
}

fn observation(step: u32) -> Observation {
    let state = AgentState {
        x: 8_123.4,
        y: -1_234.5,
        z: 12.3,
        heading: 0.7,
        velocity_x: 5.5,
        velocity_y: 4.4,
        length: 4.8,
        width: 2.1,
        height: 1.7,
    };
    let agent = |track| ObservedAgent { track: TrackId(track), kind: AgentKind::Vehicle, state, unseen: 0 };
    let column = |scale: f64| (0..1200).map(|i| scale * f64::from(i) + 0.1).collect::<Vec<_>>();
    Observation {
        step,
        log_index: 19 + step,
        av: state,
        control: Control { acceleration: 0.3, steering: 0.02 },
        agents: (1..=64).map(agent).collect(),
        signals: vec![],
        window: ReferenceWindow {
            line: Arc::new(ReferenceLine {
                x: column(0.1),
                y: column(0.02),
                z: column(0.001),
                heading: column(0.001),
                curvature: column(0.0001),
                speed_limit: vec![11.0; 1200],
                crosswalk: vec![false; 1200],
            }),
            start: 0,
            samples: 1200,
            first_sample: 0,
            red_stops: vec![],
            speed_limit: None,
        },
    }
}
