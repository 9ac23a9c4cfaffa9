//! What trees of futures cost: a bend with ten neighbors who are uncertain, and futures in which other ones of them stop. One core.
//!
//! The floor. An iteration of a chain takes some 35,000 floating-point operations (`planner-node/benches/plan.rs`), with boxes 5,000
//! more: 250 distances between centers, and some forty meetings of 80 each. Two a cycle at 3 GHz make 7 us. A tree of k branches takes k times that, but for the trunk, whose controls are eliminated once.
#![allow(clippy::unwrap_used, clippy::print_stdout, missing_docs, reason = "a bench")]

use std::hint::black_box;
use std::time::{Duration, Instant};

use criterion::Criterion;
use gauss_newton::constants::{HAND_TUNED, NEIGHBORS, STEPS};
use gauss_newton::{
    BRANCHES, Branch, Controls, Evaluation, Inputs, LinearSolver, Neighbor, Problem, Settings, Solver, TRUNK, Tree,
    TreeSolver, Vehicle,
};
use world::vehicle::{BicycleModel, VehicleState};

/// What a chain's refinement and that of three branches may take (us).
const WANTED: [f64; BRANCHES] = [250.0, 475.0, 700.0];

/// Microseconds of an iteration of so many branches at two operations a cycle and 3 GHz.
fn floor(branches: usize) -> f64 {
    let (own, shared) = (40_000.0, 15_000.0 * TRUNK as f64 / STEPS as f64);
    (own * branches as f64 - shared * (branches - 1) as f64) / 6000.0
}

/// The situation in a future in which every third neighbor, from that one on, comes to a stop.
fn problem(future: usize) -> Problem {
    let x: Vec<f64> = (0..1200).map(|k| 0.1 * f64::from(k) - 20.0).collect();
    let y: Vec<f64> = x.iter().map(|x| 0.002 * x * x).collect();
    let heading: Vec<f64> = x.iter().map(|x| libm::atan(0.004 * x)).collect();
    let driven = |j: usize, t: usize| {
        let seconds = 0.1 * (t + 1) as f64;
        if j % BRANCHES == future { 5.0 * seconds - 0.5 * seconds * seconds } else { 5.0 * seconds }
    };
    let place = |j: usize, t: usize| {
        let along = 7.0 * (j / 2 + 1) as f64 + driven(j, t);
        (along, 0.002 * along * along + if j.is_multiple_of(2) { 0.4 } else { -2.9 })
    };
    let positions: Vec<Vec<_>> = (0..NEIGHBORS).map(|j| (0..STEPS).map(|t| place(j, t)).collect()).collect();
    let headings: Vec<Vec<_>> =
        positions.iter().map(|all| all.iter().map(|(x, _)| libm::atan(0.004 * x)).collect()).collect();
    let deviations: [_; STEPS] = std::array::from_fn(|t| (0.03 * t as f64, 0.01 * t as f64));
    let neighbors: Vec<_> = (0..NEIGHBORS)
        .map(|j| {
            let (positions, headings) = (&positions[j], &headings[j]);
            Some(Neighbor { length: 4.5, width: 2.0, positions, headings, deviations: &deviations })
        })
        .collect();
    let state = VehicleState { x: 0.0, y: 0.3, heading: 0.0, speed: 7.0 };
    let problem = Problem::new(&Inputs {
        line_x: &x,
        line_y: &y,
        line_heading: &heading,
        speed_target: 10.0,
        speed_targets: None,
        stop_distance: None,
        av: Vehicle { state, length: 5.0, width: 2.2 },
        present: None,
        neighbors: &neighbors,
        weights: HAND_TUNED,
    });
    problem.unwrap()
}

/// Microseconds a run, the best of five rounds: the machine is shared.
fn microseconds<T>(runs: u32, mut run: impl FnMut() -> T) -> f64 {
    let round = |run: &mut dyn FnMut() -> T| {
        let start = Instant::now();
        (0..runs).for_each(|_| {
            black_box(run());
        });
        start.elapsed().as_secs_f64() * 1e6 / f64::from(runs)
    };
    (0..5).map(|_| round(&mut run)).fold(f64::INFINITY, |a, b| if b < a { b } else { a })
}

/// Fifty fixed steps, whatever they bring.
fn fifty() -> Settings {
    let settings = Settings::contingency(BicycleModel::default());
    Settings { polish: 0, absolute_tolerance: 0.0, relative_tolerance: 0.0, ..settings }
}

fn main() {
    let problems: Vec<Problem> = (0..BRANCHES).map(problem).collect();
    let mut solver = TreeSolver::new(LinearSolver::Sweep);
    // A good start: the plan for the first future by the nearest neighbor's distance.
    let model = BicycleModel::default();
    let mut chain = Solver::new(LinearSolver::Sweep);
    chain.solve(&problems[0], &Settings::strict(model), &Controls::ZERO).unwrap();
    let refining = Settings::contingency(model).refining(8);
    let start = [chain.best().clone()];
    let mut at = Evaluation::default();
    at.evaluate(&problems[0], &refining.costing, &start[0]);
    println!("{} safety rows at the start", at.safety().len());
    let mut group_of = Criterion::default().configure_from_args();
    let mut group = group_of.benchmark_group("tree");
    group.sample_size(20).measurement_time(Duration::from_secs(1));
    for count in 1..=BRANCHES {
        let share = 1.0 / count as f64;
        let branches: Vec<_> = problems[..count].iter().map(|problem| Branch { problem, probability: share }).collect();
        let tree = Tree { trunk: TRUNK, branches: &branches };
        let iteration = microseconds(20, || solver.solve(&tree, &fifty(), &start)) / 50.0;
        let refinement = microseconds(100, || solver.solve(&tree, &refining, &start));
        let summary = solver.solve(&tree, &refining, &start).unwrap();
        println!(
            "{count} branches: an iteration {iteration:>5.1} us (floor {:>4.1}), {} downhill {refinement:>4.0} us (floor {:>3.0}, wanted {}), objective {:.1} to {:.1}",
            floor(count),
            summary.iterations,
            summary.iterations as f64 * floor(count),
            WANTED[count - 1],
            solver.history()[0],
            summary.best_objective,
        );
        group.bench_function(format!("refinement/{count}"), |b| b.iter(|| solver.solve(&tree, &refining, &start)));
    }
    group.bench_function("evaluate", |b| b.iter(|| at.evaluate(&problems[0], &refining.costing, &start[0])));
    group.finish();
    group_of.final_summary();
}
