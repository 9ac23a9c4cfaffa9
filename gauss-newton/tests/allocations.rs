//! Planning and training allocate nothing once they are set up. A program of its own: its allocator counts.

#![allow(clippy::unwrap_used, reason = "a test says what failed by failing")]

use gauss_newton::constants::{NEIGHBORS, STEPS};
use gauss_newton::{
    Branch, Controls, Gradients, Inputs, Layer, LayerSettings, LinearSolver, Neighbor, OutputGradient, Problem,
    Settings, Solver, TRUNK, Tree, TreeSolver, Vehicle,
};
use world::vehicle::{BicycleModel, VehicleState};

/// Hands the inputs of a situation in a bend behind slow traffic, before a red light, to `with`.
fn with_inputs<T>(speed: f64, with: impl FnOnce(&Inputs<'_>) -> T) -> T {
    let x: Vec<f64> = (0..1200).map(|k| 0.1 * f64::from(k) - 20.0).collect();
    let y: Vec<f64> = x.iter().map(|x| 0.002 * x * x).collect();
    let heading: Vec<f64> = x.iter().map(|x| libm::atan(0.004 * x)).collect();
    let trajectory = |j: usize| (0..STEPS).map(|t| (8.0 * (j + 1) as f64 + 0.5 * t as f64, j as f64 - 3.0)).collect();
    let positions: [Vec<(f64, f64)>; NEIGHBORS] = std::array::from_fn(trajectory);
    let (headings, deviations) = ([0.1; STEPS], [(0.5, 0.1); STEPS]);
    let neighbor = |j: usize| Neighbor {
        length: 4.5,
        width: 2.0,
        positions: &positions[j],
        headings: &headings,
        deviations: &deviations,
    };
    let neighbors: [_; NEIGHBORS] = std::array::from_fn(|j| Some(neighbor(j)));
    with(&Inputs {
        line_x: &x,
        line_y: &y,
        line_heading: &heading,
        speed_target: 13.0,
        speed_targets: None,
        stop_distance: Some(30.0),
        av: Vehicle { state: VehicleState { x: 0.0, y: 0.3, heading: 0.0, speed }, length: 5.0, width: 2.2 },
        present: None,
        neighbors: &neighbors,
        weights: [0.2, 0.2, 0.1, 0.2, 0.1, 2.0, 10.0, 10.0, 10.0],
    })
}

fn allocations(run: impl FnOnce()) -> u64 {
    allocation_counter::measure(run).count_total
}

#[test]
fn allocations_are_counted() {
    assert_eq!(allocations(|| drop(std::hint::black_box(vec![1_u8, 2]))), 1);
}

#[test]
fn a_plan_allocates_nothing() {
    let mut problem = with_inputs(8.0, Problem::new).unwrap();
    let model = BicycleModel::default();
    for settings in [Settings::paper_test(), Settings::strict(model), Settings::contingency(model)] {
        let mut solver = Solver::new(LinearSolver::Sweep);
        let (mut iterations, mut counted) = (0, 0);
        with_inputs(9.0, |inputs| {
            counted = allocations(|| {
                problem.set(inputs).unwrap();
                iterations = solver.solve(&problem, &settings, &Controls::ZERO).unwrap().iterations;
            });
        });
        assert!(iterations > 5, "{iterations}");
        assert_eq!(counted, 0);
    }
}

#[test]
fn a_plan_for_three_futures_allocates_nothing() {
    let mut problems = [8.0; 3].map(|speed| with_inputs(speed, Problem::new).unwrap());
    let settings = Settings::contingency(BicycleModel::default());
    let mut solver = TreeSolver::new(LinearSolver::Sweep);
    for settings in [settings, settings.refining(8)] {
        let (mut iterations, mut counted) = (0, 0);
        with_inputs(9.0, |inputs| {
            counted = allocations(|| {
                problems.iter_mut().for_each(|problem| problem.set(inputs).unwrap());
                let branches = [0, 1, 2].map(|k| Branch { problem: &problems[k], probability: [0.5, 0.3, 0.2][k] });
                let tree = Tree { trunk: TRUNK, branches: &branches };
                iterations = solver.solve(&tree, &settings, &[Controls::ZERO]).unwrap().iterations;
                solver.evaluate_best(&tree, &settings.costing);
            });
        });
        assert!(iterations > 5, "{iterations}");
        assert_eq!(counted, 0);
    }
}

#[test]
fn a_training_sample_allocates_nothing_forward_or_backward() {
    let problem = with_inputs(8.0, Problem::new).unwrap();
    let mut layer = Layer::new(LayerSettings::paper(), LinearSolver::Sweep);
    let output = OutputGradient { squares: 1e-3, ..OutputGradient::ZERO };
    let mut gradients = Gradients::ZERO;
    let counted = allocations(|| {
        layer.forward(&problem, &Controls::ZERO).unwrap();
        layer.backward(&problem, &output, &mut gradients).unwrap();
    });
    assert!(gradients.weights.iter().any(|by| *by != 0.0));
    assert_eq!(counted, 0);
}
