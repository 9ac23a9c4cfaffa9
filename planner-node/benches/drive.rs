//! What a plan costs along a drive: every observation of the real scenes (the demo set where there are none), each planner in its own
//! closed loop, planned again and again. One core.
//!
//! `cargo bench -p planner-node --bench drive` prints the mean over all steps, the start of an episode included, in time of
//! the core. The floor of `idm` is measured in the same run: every sample of the window and every agent is looked at once. That
//! of `gauss-newton` is in `benches/plan.rs`.
//!
//! `cargo bench -p planner-node --bench drive -- --count idm` (or `gauss-newton`) plans once and leaves, to be run under
//! `valgrind --tool=callgrind --toggle-collect='*replay*'`.
#![allow(clippy::unwrap_used, clippy::print_stdout, missing_docs, reason = "a bench")]

#[allow(dead_code, reason = "tests use more of it")]
#[path = "../tests/log/mod.rs"]
mod log;

use std::hint::black_box;
use std::time::Instant;

use planner_node::{GaussNewton, GaussNewtonOptions, Idm};
use scenarios::SceneSet;
use wire::node::{PlannerFactory, StepInput};
use world::geometry::Point;
use world::observation::Observation;
use world::plan::{Control, Prediction, STEP_SECONDS};
use world::vehicle::{BicycleModel, VehicleState};

use crate::log::{Foresight, Log, START, real_scenes};

/// What was told in a drive.
struct Drive {
    log: Log,
    steps: Vec<(Observation, Option<Prediction>)>,
}

/// Drives a scene of the set.
fn drive(factory: &dyn PlannerFactory, set: &SceneSet, index: usize) -> Drive {
    let mut log = Log::new(set.load(index).unwrap().0, "strict");
    let mut planner = factory.start(&log.briefing).unwrap();
    let (mut av, mut control) = (log.av(START).unwrap(), Control::default());
    let mut steps = Vec::new();
    for step in 0..log.steps() {
        let observation = log.observe(step, av, control);
        let prediction = factory.needs_prediction().then(|| log.predict(&observation, Foresight::Ctrv));
        let (briefing, history) = (&log.briefing, &log.history);
        let input = StepInput { briefing, observation: &observation, history, prediction: prediction.as_ref() };
        control = planner.plan(&input).unwrap().controls[0];
        let now = VehicleState { x: av.x, y: av.y, heading: av.heading, speed: av.speed() };
        let next = BicycleModel::new(briefing.wheelbase).step(now, control, STEP_SECONDS);
        let velocity = Point::unit(next.heading) * next.speed;
        (av.x, av.y, av.heading) = (next.x, next.y, next.heading);
        (av.velocity_x, av.velocity_y) = (velocity.x, velocity.y);
        steps.push((observation, prediction));
    }
    Drive { log, steps }
}

/// Plans all of it anew.
#[inline(never)]
fn replay(factory: &dyn PlannerFactory, drives: &[Drive]) {
    for Drive { log, steps } in drives {
        let (briefing, history) = (&log.briefing, &log.history);
        let mut planner = factory.start(briefing).unwrap();
        for (observation, prediction) in steps {
            let input = StepInput { briefing, observation, history, prediction: prediction.as_ref() };
            black_box(planner.plan(&input).unwrap());
        }
    }
}

/// Looks at every sample and every agent once.
fn look(drives: &[Drive]) {
    for (observation, _) in drives.iter().flat_map(|drive| &drive.steps) {
        let (window, av) = (&observation.window, observation.av.position());
        let samples = window.start..window.start + window.samples;
        let distance = |a: f64, b: f64| if b < a { b } else { a };
        black_box(samples.map(|k| window.line.point(k).distance_squared(av)).fold(f64::INFINITY, distance));
        let agents = observation.agents.iter().map(|agent| agent.state.position().distance_squared(av));
        black_box(agents.fold(f64::INFINITY, distance));
    }
}

/// Nanoseconds that this thread was on a core, where the system tells: the machine is shared.
fn spent(start: Instant) -> f64 {
    let told = std::fs::read_to_string("/proc/thread-self/schedstat");
    let spent = told.ok().and_then(|told| told.split(' ').next()?.parse().ok());
    spent.unwrap_or_else(|| start.elapsed().as_secs_f64() * 1e9)
}

/// Microseconds of the core a step, the mean over rounds: as many as the system needs to tell them, which looks at the clock every few
/// milliseconds.
fn microseconds(drives: &[Drive], rounds: u32, run: impl Fn(&[Drive])) -> f64 {
    let steps: usize = drives.iter().map(|drive| drive.steps.len()).sum();
    run(drives);
    let start = Instant::now();
    let before = spent(start);
    (0..rounds).for_each(|_| run(drives));
    (spent(start) - before) / 1e3 / steps as f64 / f64::from(rounds)
}

fn main() {
    let planners: [(&str, &dyn PlannerFactory); 2] =
        [("idm", &Idm), ("gauss-newton", &GaussNewton(GaussNewtonOptions::default()))];
    let counted = std::env::args().skip_while(|argument| argument != "--count").nth(1);
    let set = SceneSet::open(&real_scenes()).unwrap();
    for (name, factory) in planners {
        if counted.as_ref().is_some_and(|counted| counted != name) {
            continue;
        }
        let drives: Vec<_> = (0..set.entries().len()).map(|index| drive(factory, &set, index)).collect();
        if counted.is_some() {
            return replay(factory, &drives);
        }
        let agents: usize = drives.iter().flat_map(|drive| &drive.steps).map(|(seen, _)| seen.agents.len()).sum();
        let steps: usize = drives.iter().map(|drive| drive.steps.len()).sum();
        println!("{} drives, {steps} steps, {:.0} agents in the mean", drives.len(), agents as f64 / steps as f64);
        println!("{name:<14} {:>8.1} us a plan", microseconds(&drives, 20, |drives| replay(factory, drives)));
        println!(
            "{:<14} {:>8.1} us: every sample and agent looked at once",
            "floor of idm",
            microseconds(&drives, 1_000, look)
        );
    }
}
