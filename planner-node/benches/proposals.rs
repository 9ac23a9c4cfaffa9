//! What a plan of `proposals` costs: all policies, two of them refined. One core.
//!
//! `cargo bench -p planner-node --bench proposals` first prints the mean time of a step along a drive of 3 s in a bend, among 10 and
//! among 30 agents, with one future and with three, beside its bound and its floor; then criterion times the same. What is measured is a whole
//! answer: it begins with nobody known and ends with the plan.
//!
//! The floor is measured in the same run: what cannot be left out whoever is met. Each proposal is driven, and with second thoughts and the
//! braking behind those ahead that is three drives of 50 steps by the bicycle model; at each of 20 looks each agent is held
//! against the AV once in each future.
//!
//! `cargo bench -p planner-node --bench proposals -- --count` plans a hundred times and leaves, to be run under
//! `valgrind --tool=callgrind`.
#![allow(clippy::unwrap_used, clippy::print_stdout, missing_docs, reason = "a bench")]

use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

use criterion::Criterion;
use planner_node::{Contingency, Proposals, ProposalsOptions};
use wire::node::{History, Planner, PlannerFactory, StepInput};
use world::geometry::{Point, Pose};
use world::observation::{Briefing, Observation, ObservedAgent};
use world::plan::{Control, Future, PLAN_STEPS, PredictedTrajectory, Prediction, STEP_SECONDS, UncheckedPrediction};
use world::reference_line::{ReferenceLine, ReferenceWindow};
use world::scene::{AgentKind, AgentState, SceneId, TrackId};
use world::vehicle::{BicycleModel, VehicleState, WHEELBASE};

/// Steps of the drive.
const STEPS: u32 = 30;

/// Radius of the bend (m).
const RADIUS: f64 = 80.0;

/// A drive as it was told.
struct Drive {
    briefing: Briefing,
    history: History,
    steps: Vec<(Observation, Prediction)>,
}

/// A place so far along the bend, and to its left (m).
fn place(along: f64, left: f64) -> Pose {
    let heading = along / RADIUS;
    let radius = RADIUS - left;
    Pose::new(radius * libm::sin(heading), RADIUS - radius * libm::cos(heading), heading)
}

fn line() -> ReferenceLine {
    let samples = 2000;
    let at = |k: usize| place(0.1 * k as f64, 0.0);
    ReferenceLine {
        x: (0..samples).map(|k| at(k).x).collect(),
        y: (0..samples).map(|k| at(k).y).collect(),
        z: vec![0.0; samples],
        heading: (0..samples).map(|k| at(k).heading).collect(),
        curvature: vec![1.0 / RADIUS; samples],
        speed_limit: vec![13.0; samples],
        crosswalk: vec![false; samples],
    }
}

/// Where an agent is so many seconds from the beginning, and its speed (m/s): in dense traffic ahead, oncoming, or parked beside the road.
fn agent(index: usize, seconds: f64) -> (Pose, f64) {
    let along = 12.0 * (index / 3) as f64;
    let (along, left, speed) =
        [(along + 14.0, 0.3, 7.0), (along + 4.0, 3.6, -8.0), (along + 8.0, -3.2, 0.0)][index % 3];
    (place(along + speed * seconds, left), speed)
}

fn seen(index: usize, seconds: f64) -> ObservedAgent {
    let (pose, speed) = agent(index, seconds);
    let velocity = Point::unit(pose.heading) * speed;
    let kind = if index % 7 == 5 { AgentKind::Pedestrian } else { AgentKind::Vehicle };
    let (length, width) = if kind == AgentKind::Pedestrian { (0.8, 0.8) } else { (4.6, 2.0) };
    let state = AgentState {
        x: pose.x,
        y: pose.y,
        heading: pose.heading,
        velocity_x: velocity.x,
        velocity_y: velocity.y,
        length,
        width,
        height: 1.6,
        ..AgentState::default()
    };
    ObservedAgent { track: TrackId(index as i32), kind, state, unseen: 0 }
}

/// The first future goes on as now, each further one more slowly.
fn expected(agents: usize, seconds: f64, futures: usize) -> Prediction {
    let future = |number: usize| {
        let slowly = 1.0 - 0.3 * number as f64;
        let pose = |index: usize, k: usize| agent(index, seconds + slowly * k as f64 * STEP_SECONDS).0;
        let poses = |index: usize| (1..=PLAN_STEPS).map(|k| pose(index, k)).collect();
        let trajectory = |index: usize| PredictedTrajectory { track: TrackId(index as i32), poses: poses(index) };
        let probability = if futures == 1 { 1.0 } else { [0.5, 0.3, 0.2][number] };
        Future { probability, trajectories: (0..agents).map(trajectory).collect(), controls: vec![] }
    };
    let futures = (0..futures).map(future).collect();
    let prediction = UncheckedPrediction { futures, ..UncheckedPrediction::default() };
    prediction.check(0).unwrap()
}

/// Drives what is planned.
fn drive(options: ProposalsOptions, agents: usize, futures: usize) -> Drive {
    let line = Arc::new(line());
    let briefing = Briefing {
        scene: SceneId::new("bend").unwrap(),
        protocol: "strict".to_owned(),
        start: 19,
        horizon: 150,
        wheelbase: WHEELBASE,
        map: Arc::default(),
        route: vec![],
        reference_line: Arc::clone(&line),
        history: vec![],
    };
    let history = History::new(&briefing);
    let mut planner = Proposals(options).start(&briefing).unwrap();
    let model = BicycleModel::new(WHEELBASE);
    let start = place(20.0, 0.2);
    let mut state = VehicleState { x: start.x, y: start.y, heading: start.heading, speed: 8.0 };
    let mut control = Control::default();
    let mut steps = Vec::new();
    for step in 0..STEPS {
        let seconds = f64::from(step) * STEP_SECONDS;
        let velocity = Point::unit(state.heading) * state.speed;
        let av = AgentState {
            x: state.x,
            y: state.y,
            heading: state.heading,
            velocity_x: velocity.x,
            velocity_y: velocity.y,
            length: 5.0,
            width: 2.2,
            height: 1.6,
            ..AgentState::default()
        };
        let observation = Observation {
            step,
            log_index: 19 + step,
            av,
            control,
            agents: (0..agents).map(|index| seen(index, seconds)).collect(),
            signals: vec![],
            window: ReferenceWindow {
                line: Arc::clone(&line),
                start: 0,
                samples: 1500,
                first_sample: 0,
                red_stops: vec![],
                speed_limit: None,
            },
        };
        let prediction = expected(agents, seconds, futures);
        let input = StepInput {
            briefing: &briefing,
            observation: &observation,
            history: &history,
            prediction: Some(&prediction),
        };
        control = planner.plan(&input).unwrap().controls[0];
        state = model.step(state, control, STEP_SECONDS);
        steps.push((observation, prediction));
    }
    Drive { briefing, history, steps }
}

impl Drive {
    /// Plans all of it anew.
    #[inline(never)]
    fn replay(&self, planner: &mut dyn Planner) {
        for (observation, prediction) in &self.steps {
            let (briefing, history) = (&self.briefing, &self.history);
            let input = StepInput { briefing, observation, history, prediction: Some(prediction) };
            black_box(planner.plan(&input).unwrap());
        }
    }

    /// What no planner of this kind can leave out.
    fn floor(&self) {
        /// Policies, the last plan, and two refined.
        const PROPOSALS: usize = 29;
        let model = BicycleModel::new(WHEELBASE);
        for (observation, prediction) in &self.steps {
            let av = &observation.av;
            for proposal in 0..PROPOSALS {
                for _ in 0..3 {
                    let mut state = VehicleState { x: av.x, y: av.y, heading: av.heading, speed: av.speed() };
                    let mut rollout = model.roll_out(state);
                    let control = Control { acceleration: 0.01 * proposal as f64, steering: 0.03 };
                    let mut nearest = f64::INFINITY;
                    for k in 0..PLAN_STEPS {
                        state = rollout.step(control, STEP_SECONDS);
                        if k % 2 == 0 && k < 40 {
                            for trajectory in prediction.futures().iter().flat_map(|future| &future.trajectories) {
                                let distance = trajectory.poses[k].position().distance_squared(state.pose().position());
                                nearest = if distance < nearest { distance } else { nearest };
                            }
                        }
                    }
                    black_box((state, nearest));
                }
            }
        }
    }
}

/// Microseconds a step, the best of five rounds: the machine is shared.
fn microseconds(mut run: impl FnMut()) -> f64 {
    let round = |run: &mut dyn FnMut()| {
        let start = Instant::now();
        run();
        start.elapsed().as_secs_f64() * 1e6 / f64::from(STEPS)
    };
    (0..5).map(|_| round(&mut run)).fold(f64::INFINITY, |a, b| if b < a { b } else { a })
}

fn main() {
    let branches = ProposalsOptions::default();
    let off = ProposalsOptions { contingency: Contingency::Off, ..branches };
    let cases = [
        ("10 agents, one future", off, 10, 1, 2000.0),
        ("30 agents, one future", off, 30, 1, 2000.0),
        ("10 agents, three futures, branches", branches, 10, 3, 3000.0),
        ("30 agents, three futures, branches", branches, 30, 3, 3000.0),
    ];
    if std::env::args().any(|argument| argument == "--count") {
        let (_, options, agents, futures, _) = cases[3];
        let told = drive(options, agents, futures);
        let mut planner = Proposals(options).start(&told.briefing).unwrap();
        (0..100_u32.div_ceil(STEPS)).for_each(|_| told.replay(planner.as_mut()));
        return;
    }
    let mut criterion = Criterion::default().configure_from_args();
    let mut group = criterion.benchmark_group("proposals");
    group.sample_size(20).measurement_time(std::time::Duration::from_secs(2));
    for (name, options, agents, futures, bound) in cases {
        let told = drive(options, agents, futures);
        let mut planner = Proposals(options).start(&told.briefing).unwrap();
        let plan = microseconds(|| told.replay(planner.as_mut()));
        let floor = microseconds(|| told.floor());
        let worth = if plan <= bound { "within" } else { "beyond" };
        println!("{name:<36} {plan:>8.1} us a plan, {worth} {bound} us; floor {floor:.1} us");
        group.bench_function(format!("{STEPS} steps/{name}"), |b| b.iter(|| told.replay(planner.as_mut())));
    }
    group.finish();
    criterion.final_summary();
}
