//! What a step of `idm` traffic costs with 64 agents that react, in one process on one core; and one of `network`, with and without a
//! forward pass.
//!
//! `cargo bench -p traffic-node --bench traffic` prints the mean time of a step along [`bend`], the least of 300 drives, beside its bound and its
//! floor; then criterion times whole drives. The floor is measured in the same run: each agent is held against each other once, by the distance
//! of their places.
#![allow(clippy::unwrap_used, clippy::print_stdout, missing_docs, reason = "a bench")]

use std::hint::black_box;
use std::time::Instant;

use criterion::Criterion;
use predictor_node::Network;
use traffic_node::{Cast, Characters, Company, Foreseen};

use bend::{AGENTS, Drive, STEPS};

mod bend;

/// The bound (us a step).
const BOUND: f64 = 60.0;

/// So many drives are timed: their least is what a step costs where nobody else uses the core.
const DRIVES: usize = 300;

fn round(drive: &Drive, traffic: &mut Company) {
    for (observation, taken) in &drive.steps {
        black_box(traffic.next(observation, taken));
    }
}

/// Microseconds a step, the least of some rounds. Meeting the agents is the first step's, and is left out.
fn measured(drive: &Drive) -> (f64, f64) {
    let (mut step, mut first) = (f64::INFINITY, f64::INFINITY);
    for _ in 0..DRIVES {
        let mut traffic = Characters { cast: Cast::Idm, seed: 1 }.company(&drive.briefing);
        let began = Instant::now();
        let (observation, taken) = &drive.steps[0];
        black_box(traffic.next(observation, taken));
        first = first.min(began.elapsed().as_secs_f64() * 1e6);
        let began = Instant::now();
        for (observation, taken) in &drive.steps[1..] {
            black_box(traffic.next(observation, taken));
        }
        step = step.min(began.elapsed().as_secs_f64() * 1e6 / f64::from(STEPS - 1));
    }
    (step, first)
}

/// So many drives of `network` are timed.
const FORESEEN_DRIVES: usize = 20;

/// Milliseconds of a step at which the network runs, and microseconds of one at which it does not, each the least of some drives. The network runs at
/// the first step, where agents are met too, and at each tenth from there.
fn foreseen(drive: &Drive) -> (f64, f64) {
    let traffic = Foreseen::new(Network::open(None, None).unwrap(), 1);
    let (mut replan, mut step) = (f64::INFINITY, f64::INFINITY);
    for _ in 0..FORESEEN_DRIVES {
        let mut traffic = traffic.company(&drive.briefing);
        for (index, (observation, taken)) in drive.steps.iter().enumerate() {
            let began = Instant::now();
            black_box(traffic.next(observation, taken));
            let took = began.elapsed().as_secs_f64();
            if index % 10 == 0 {
                replan = replan.min(1e3 * took);
            } else {
                step = step.min(1e6 * took);
            }
        }
    }
    (replan, step)
}

fn floor(drive: &Drive) -> f64 {
    let mut least = f64::INFINITY;
    for _ in 0..DRIVES {
        let began = Instant::now();
        for (observation, taken) in &drive.steps {
            let near = taken.iter().map(|agent| {
                let near = observation
                    .agents
                    .iter()
                    .filter(|other| black_box(other.state.position()).distance_squared(agent.state.position()) < 900.0);
                near.count()
            });
            black_box(near.sum::<usize>());
        }
        least = least.min(began.elapsed().as_secs_f64() * 1e6 / f64::from(STEPS));
    }
    least
}

fn main() {
    let drive = bend::drive();
    let (step, first) = measured(&drive);
    println!(
        "{AGENTS} agents: {step:.1} us a step (bound {BOUND} us, floor {:.1} us: each held against each); {first:.0} us for the step at which all are met",
        floor(&drive)
    );
    let (replan, step) = foreseen(&drive);
    println!("network: {replan:.2} ms a step at which it runs, {step:.1} us a step at which it does not");
    let mut criterion = Criterion::default().configure_from_args();
    criterion.bench_function("traffic/idm/64", |bencher| {
        bencher.iter_batched(
            || Characters { cast: Cast::Idm, seed: 1 }.company(&drive.briefing),
            |mut traffic| round(&drive, &mut traffic),
            criterion::BatchSize::SmallInput,
        );
    });
    criterion.final_summary();
}
