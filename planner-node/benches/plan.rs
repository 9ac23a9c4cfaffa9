//! What a plan costs.
//!
//! `cargo bench -p planner-node --bench plan` first prints, over every vector in `../shared/dipp/planner-vectors` (or one
//! generated situation where that is missing), the median over the cases of an iteration, of a plan of 50 iterations
//! and of a training sample forward and backward, and what other searches reach; then times the parts on one case.
//! One core.
//!
//! The floor. An iteration of the sweep takes some 35,000 floating-point operations: factorization 15,000, solve 4,000, the
//! rollout with its sines and cosines 4,000, residuals and gradient 3,000, nearest samples 9,000. Two a cycle at 3 GHz make 6 us.
//! Nothing is vectorized by hand, and the chain's recurrences bind: twice the floor is what to expect.
//!
//! `cargo bench -p planner-node --bench plan -- --count` solves a hundred plans and leaves, to be run under
//! `valgrind --tool=callgrind`.
#![allow(clippy::unwrap_used, clippy::print_stdout, missing_docs, reason = "a bench")]

use std::hint::black_box;
use std::time::Instant;

use criterion::Criterion;
use gauss_newton::constants::{NEIGHBORS, STEPS, TERMS};
use gauss_newton::{
    Controls, Gradients, Inputs, Layer, LayerSettings, LinearSolver, Neighbor, OutputGradient, Problem, Settings,
    Solver, StateChange, Vehicle,
};
use planner_node::verify;
use world::vehicle::VehicleState;

struct Case {
    name: String,
    problem: Problem,
    initial: Controls,
}

fn cases() -> Vec<Case> {
    let Some(folder) = vectors::shared("dipp/planner-vectors") else { return vec![generated()] };
    let read = |path: &std::path::PathBuf| {
        let npz = vectors::Npz::read(path).unwrap();
        Case {
            name: path.file_stem().unwrap().to_string_lossy().into_owned(),
            problem: verify::problem(&npz).unwrap(),
            initial: verify::controls(&npz, "controls0").unwrap(),
        }
    };
    let mut all: Vec<_> = vectors::npz_files(&folder).unwrap().iter().map(read).collect();
    all.retain(|case| {
        Layer::new(LayerSettings::paper(), LinearSolver::Sweep).forward(&case.problem, &case.initial).is_ok()
    });
    all
}

fn generated() -> Case {
    let line: Vec<f64> = (0..1200).map(|k| 0.1 * f64::from(k) - 20.0).collect();
    let y: Vec<f64> = line.iter().map(|x| 0.002 * x * x).collect();
    let heading: Vec<f64> = line.iter().map(|x| libm::atan(0.004 * x)).collect();
    let positions: Vec<Vec<_>> = (0..NEIGHBORS)
        .map(|j| (0..STEPS).map(|t| (8.0 * (j + 1) as f64 + 0.5 * t as f64, j as f64 - 5.0)).collect())
        .collect();
    let neighbors: Vec<_> = positions
        .iter()
        .map(|positions| Some(Neighbor { length: 4.5, width: 2.0, positions, headings: &[], deviations: &[] }))
        .collect();
    let state = VehicleState { x: 0.0, y: 0.3, heading: 0.0, speed: 8.0 };
    let problem = Problem::new(&Inputs {
        line_x: &line,
        line_y: &y,
        line_heading: &heading,
        speed_target: 13.0,
        speed_targets: None,
        stop_distance: None,
        av: Vehicle { state, length: 5.0, width: 2.2 },
        present: None,
        neighbors: &neighbors,
        weights: [0.2, 0.2, 0.1, 0.2, 0.1, 2.0, 10.0, 10.0, 10.0],
    });
    Case { name: "generated".to_owned(), problem: problem.unwrap(), initial: Controls::ZERO }
}

/// Fifty iterations whatever the objective does.
fn fifty() -> Settings {
    Settings { absolute_tolerance: 0.0, relative_tolerance: 0.0, ..Settings::paper_test() }
}

fn output_gradient() -> OutputGradient {
    let mut output = OutputGradient { squares: 1e-3 / 383.0, ..OutputGradient::ZERO };
    output.poses = [StateChange { x: 0.01, y: -0.02, heading: 0.01, speed: 0.0 }; STEPS];
    output
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

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn over_cases(cases: &[Case]) {
    let all = |what: &str, run: &mut dyn FnMut(&Case) -> f64| {
        let times: Vec<f64> = cases.iter().map(run).collect();
        let slowest = times.iter().copied().fold(0.0, |a, b| if b > a { b } else { a });
        println!("{what:<44} {:>9.1} us median, {slowest:>9.1} us slowest of {} cases", median(times), cases.len());
    };
    let mut solver = Solver::new(LinearSolver::Sweep);
    all("a plan of 50 iterations", &mut |case| {
        microseconds(5, || solver.solve(&case.problem, &fifty(), &case.initial))
    });
    all("an iteration of it", &mut |case| {
        microseconds(5, || solver.solve(&case.problem, &fifty(), &case.initial)) / 50.0
    });
    all("a plan by the test configuration", &mut |case| {
        microseconds(5, || solver.solve(&case.problem, &Settings::paper_test(), &case.initial))
    });
    let mut layer = Layer::new(LayerSettings::paper(), LinearSolver::Sweep);
    let (output, mut gradients) = (output_gradient(), Gradients::ZERO);
    all("a training sample, forward and backward", &mut |case| {
        microseconds(50, || {
            layer.forward(&case.problem, &case.initial).unwrap();
            layer.backward(&case.problem, &output, &mut gradients).unwrap();
        })
    });
    let mut dense = Solver::new(LinearSolver::Dense);
    all("an iteration with the dense solver", &mut |case| {
        let three = Settings { iterations: 3, ..fifty() };
        microseconds(1, || dense.solve(&case.problem, &three, &case.initial)) / 3.0
    });
}

/// What other searches reach, and what it takes them, against the authors'.
fn searches(cases: &[Case]) {
    let paper = Settings::paper_test();
    let mut solver = Solver::new(LinearSolver::Sweep);
    for (name, settings) in [
        ("the authors': 0.2 of each step", paper),
        ("full steps", Settings { step: 1.0, ..paper }),
        ("0.1 of each step, 200 iterations", Settings { step: 0.1, iterations: 200, ..paper }),
        ("line search from the start", Settings { iterations: 0, polish: 50, ..paper }),
        ("the authors', then a line search", Settings { polish: 50, ..paper }),
    ] {
        let (mut logarithms, mut worse, mut iterations) = (0.0, 0, 0);
        for case in cases {
            let reference = solver.solve(&case.problem, &paper, &case.initial).unwrap().best_objective;
            let summary = solver.solve(&case.problem, &settings, &case.initial).unwrap();
            logarithms += libm::log(summary.best_objective / reference);
            worse += u32::from(summary.best_objective > reference * (1.0 + 1e-6));
            iterations += summary.iterations;
        }
        let count = cases.len() as f64;
        let (mean, iterations) = (libm::exp(logarithms / count), iterations as f64 / count);
        println!("{name:<44} objective {mean:.3} of theirs, worse in {worse}, {iterations:.0} iterations");
    }
}

fn main() {
    let cases = cases();
    if std::env::args().any(|a| a == "--count") {
        let mut solver = Solver::new(LinearSolver::Sweep);
        for case in cases.iter().cycle().take(100) {
            let _ = black_box(solver.solve(&case.problem, &fifty(), &case.initial));
        }
        return;
    }
    over_cases(&cases);
    searches(&cases);
    let mut criterion = Criterion::default().configure_from_args();
    let case = cases.iter().find(|case| case.name == "many_neighbors").unwrap_or(&cases[0]);
    let mut group = criterion.benchmark_group(format!("plan/{}", case.name));
    group.sample_size(20).measurement_time(std::time::Duration::from_secs(1));
    let mut solver = Solver::new(LinearSolver::Sweep);
    group.bench_function("50_iterations", |b| b.iter(|| solver.solve(&case.problem, &fifty(), &case.initial)));
    let mut weights = [0.0; TERMS];
    weights.copy_from_slice(case.problem.weights());
    let costing = Settings::paper_test().costing;
    let mut at = gauss_newton::Evaluation::default();
    group.bench_function("evaluate", |b| b.iter(|| at.evaluate(&case.problem, &costing, &case.initial)));
    let mut layer = Layer::new(LayerSettings::paper(), LinearSolver::Sweep);
    group.bench_function("training_forward", |b| b.iter(|| layer.forward(&case.problem, &case.initial)));
    let (output, mut gradients) = (output_gradient(), Gradients::ZERO);
    group.bench_function("training_backward", |b| b.iter(|| layer.backward(&case.problem, &output, &mut gradients)));
    group.finish();
    criterion.final_summary();
}
