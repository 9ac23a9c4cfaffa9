//! Laws of the planner, over random situations.

mod tree;

use std::f64::consts::PI;

use proptest::prelude::*;
use world::plan::Control;
use world::vehicle::{BicycleModel, VehicleState};

use super::constants::{KEY_STEPS, NEIGHBORS, STEPS, TERMS};
use super::gradient::Layer;
use super::linear::NormalEquations;
use super::solver::{Settings, Solver};
use super::tree::Part;
use super::*;

/// A situation, owned.
#[derive(Clone, Debug)]
struct Situation {
    line: Vec<(f64, f64, f64)>,
    speed: f64,
    stop_distance: Option<f64>,
    positions: Vec<Option<Vec<(f64, f64)>>>,
    boxes: Option<Boxes>,
    weights: [f64; TERMS],
}

/// What is predicted of the neighbors' boxes: a heading (rad), and how fast standard deviations grow (m/s), along and across.
#[derive(Clone, Copy, Debug)]
struct Boxes {
    heading: f64,
    along: f64,
    across: f64,
}

impl Situation {
    fn problem(&self) -> Problem {
        let column = |f: fn(&(f64, f64, f64)) -> f64| self.line.iter().map(f).collect::<Vec<_>>();
        let headings: Vec<f64> = self.boxes.iter().flat_map(|boxes| [boxes.heading; STEPS]).collect();
        let deviations = |boxes: &Boxes| {
            std::array::from_fn::<_, STEPS, _>(|t| (0.1 * t as f64 * boxes.along, 0.1 * t as f64 * boxes.across))
        };
        let deviations: Vec<(f64, f64)> = self.boxes.iter().flat_map(deviations).collect();
        let neighbors: Vec<_> = self
            .positions
            .iter()
            .enumerate()
            .map(|(j, p)| {
                // A wheelchair, cars, a bus.
                let length = 1.0 + 1.3 * j as f64;
                p.as_ref().map(|positions| Neighbor {
                    length,
                    width: 1.9,
                    positions,
                    headings: &headings,
                    deviations: &deviations,
                })
            })
            .collect();
        Problem::new(&Inputs {
            line_x: &column(|p| p.0),
            line_y: &column(|p| p.1),
            line_heading: &column(|p| p.2),
            speed_target: 12.0,
            speed_targets: None,
            stop_distance: self.stop_distance,
            av: Vehicle {
                state: VehicleState { x: 0.1, y: -0.2, heading: 0.05, speed: self.speed },
                length: 5.3,
                width: 2.3,
            },
            neighbors: &neighbors,
            present: Some(Control { acceleration: 0.7, steering: -0.05 }),
            weights: self.weights,
        })
        .unwrap()
    }
}

fn any_boxes() -> impl Strategy<Value = Boxes> {
    (-PI..PI, 0.0..2.0, 0.0..0.5).prop_map(|(heading, along, across)| Boxes { heading, along, across })
}

prop_compose! {
    fn any_situation()(
        curvature in -0.05..0.05, speed in 0.5..15.0, red in prop::option::of(-1.0..40.0),
        cars in prop::collection::vec(prop::option::of((3.0..40.0, -3.0..3.0, -1.0..12.0)), NEIGHBORS),
        weights in prop::array::uniform9(0.1..3.0), samples in 300..1200_usize, boxes in prop::option::of(any_boxes()),
    ) -> Situation {
        let mut line = vec![(-20.0, 0.3, 0.0)];
        for k in 1..samples {
            let (x, y, h): (f64, f64, f64) = line[k - 1];
            let heading = h + if k > 200 { 0.1 * curvature } else { 0.0 };
            line.push((x + 0.1 * libm::cos(heading), y + 0.1 * libm::sin(heading), world::geometry::wrap_angle(heading)));
        }
        let positions = cars.into_iter().map(|car| car.map(|(x, y, v): (f64, f64, f64)| {
            (0..STEPS).map(|t| (x + 0.1 * v * (t + 1) as f64, y)).collect()
        })).collect();
        Situation { line, speed, stop_distance: red, positions, boxes, weights }
    }
}

fn any_controls(largest: f64) -> impl Strategy<Value = Controls> {
    prop::collection::vec((-3.0..3.0, -0.2..0.2), STEPS).prop_map(move |pairs| {
        Controls::from_pairs(pairs.into_iter().map(|(a, s): (f64, f64)| (largest * a, largest * s))).unwrap()
    })
}

/// Of three evaluations.
fn any_choices() -> impl Strategy<Value = Choices> {
    let nearest = || prop::collection::vec(0..NEIGHBORS, KEY_STEPS.len());
    prop::collection::vec(nearest().prop_map(|key| std::array::from_fn(|i| key[i])), 3).prop_map(Choices)
}

fn any_costing() -> impl Strategy<Value = Costing> {
    let margins = (1.0..6.0, 0.2..1.5, 0.0..2.0);
    let boxes = margins.prop_map(|(along, across, deviations)| Safety::Boxes(Margins { along, across, deviations }));
    (any_trained_costing(), prop::option::of(boxes))
        .prop_map(|(costing, boxes)| Costing { safety: boxes.unwrap_or(costing.safety), ..costing })
}

/// Without boxes.
fn any_trained_costing() -> impl Strategy<Value = Costing> {
    let models = [BicycleModel::authors_planner(), BicycleModel::authors_test(), BicycleModel::default()];
    let switches = prop::array::uniform5(any::<bool>());
    (prop::sample::select(models.to_vec()), switches).prop_map(|(model, [wrap, everyone, from_present, rate, edge])| {
        Costing {
            model,
            wrap_heading: wrap,
            safety: if everyone { Safety::Everyone } else { Safety::Nearest },
            from_present,
            steering_rate: if rate { 0.5 } else { f64::INFINITY },
            lane_edge: if edge { 1.0 } else { f64::INFINITY },
        }
    })
}

/// Which clips of the vehicle are at work, and where its heading jumps by a turn.
fn clips(motion: &Motion) -> impl PartialEq + use<> {
    let gains: Vec<_> = motion.derivatives.iter().map(|d| [d.speed_gain, d.acceleration_gain, d.moving_gain]).collect();
    let steers: Vec<_> = motion.derivatives.iter().map(|d| d.turn_slope > 0.0).collect();
    let wraps: Vec<_> = motion.states.windows(2).map(|s| (s[1].heading - s[0].heading).abs() > PI).collect();
    (gains, steers, wraps)
}

/// What decides which rows are active, and of which piece each is: where two points agree on it, the rows are smooth between.
fn pieces(at: &Evaluation) -> impl PartialEq + use<> {
    let headings: Vec<_> = at.rows.lane_heading.windows(2).map(|c| (c[1] - c[0]).abs() > PI).collect();
    let nowhere = (0.0, 0.0);
    let there = |row: &SafetyRow| (row.key, row.neighbor, row.away != nowhere, row.value_away != nowhere);
    let safety: Vec<_> = at.safety().iter().map(there).collect();
    let edge = at.edge.map(|slope| slope != (0.0, 0.0));
    (at.lane_sample, at.moves.map(|m| m > 0.0), at.red_from, safety, headings, edge, at.stiffness, clips(&at.motion))
}

fn evaluated(problem: &Problem, costing: &Costing, controls: &Controls) -> Evaluation {
    let mut at = Evaluation::default();
    at.evaluate(problem, costing, controls);
    at
}

fn flat(rows: &Rows) -> Vec<f64> {
    rows.parts().iter().flat_map(|(_, rows)| rows.to_vec()).collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn near(a: f64, b: f64, tolerance: f64) -> bool {
    (a - b).abs() <= tolerance * (1.0 + a.abs().max(b.abs()))
}

proptest! {
    #[test]
    fn the_jacobian_is_that_of_the_rows(
        situation in any_situation(), costing in any_costing(), controls in any_controls(2.0), direction in any_controls(1.0),
    ) {
        let problem = situation.problem();
        let at = evaluated(&problem, &costing, &controls);
        let h = 1e-6;
        let beside = |h: f64| {
            let mut moved = controls.clone();
            moved.add_scaled(h, &direction);
            evaluated(&problem, &costing, &moved)
        };
        let (low, high) = (beside(-h), beside(h));
        prop_assume!(pieces(&low) == pieces(&at) && pieces(&high) == pieces(&at));
        let mut change = [StateChange::default(); STEPS];
        let mut rows = Rows::ZERO;
        at.push_forward(&direction, &mut change, &mut rows);
        let differences = flat(&low.rows).into_iter().zip(flat(&high.rows));
        for (i, ((low, high), slope)) in differences.zip(flat(&rows)).enumerate() {
            prop_assert!(near((high - low) / (2.0 * h), slope, 1e-6), "row {i}: {} {slope}", (high - low) / (2.0 * h));
        }
    }

    #[test]
    fn the_transposed_jacobian_is_the_jacobian_transposed(
        situation in any_situation(), costing in any_costing(), controls in any_controls(2.0), direction in any_controls(1.0),
        multipliers in prop::collection::vec(-1.0..1.0, 64),
    ) {
        let problem = situation.problem();
        let at = evaluated(&problem, &costing, &controls);
        let mut change = [StateChange::default(); STEPS];
        let (mut rows, mut back) = (Rows::ZERO, Controls::ZERO);
        at.push_forward(&direction, &mut change, &mut rows);
        // Any multipliers at all.
        let mut weighted = at.rows.clone();
        let next = |i: usize| multipliers[i % multipliers.len()];
        weighted.speed = std::array::from_fn(next);
        weighted.lane_heading = std::array::from_fn(|i| next(3 * i));
        weighted.red_light = std::array::from_fn(|i| next(7 * i));
        at.pull_back(&weighted, &mut back);
        let (left, right) = (dot(&flat(&weighted), &flat(&rows)), back.dot(&direction));
        prop_assert!(near(left, right, 1e-9), "{left} {right}");
    }

    #[test]
    fn the_sweep_and_the_dense_factorization_give_the_same_step(
        situation in any_situation(), costing in any_costing(), controls in any_controls(2.0),
    ) {
        let problem = situation.problem();
        let at = evaluated(&problem, &costing, &controls);
        let (mut rows, mut gradient) = (Rows::ZERO, Controls::ZERO);
        at.gradient(&problem, &mut rows, &mut gradient);
        let steps = [LinearSolver::Sweep, LinearSolver::Dense].map(|linear| {
            let mut normal = NormalEquations::new(linear, 1);
            let parts = [Part::alone(&at, problem.weights())];
            normal.factorize(&parts, STEPS).unwrap();
            let mut step = Controls::ZERO;
            normal.solve(&parts, std::slice::from_ref(&gradient), std::slice::from_mut(&mut step));
            step
        });
        let scale = steps[1].dot(&steps[1]).sqrt();
        let mut apart = steps[0].clone();
        apart.add_scaled(-1.0, &steps[1]);
        prop_assert!(apart.dot(&apart).sqrt() <= 1e-9 * scale, "{} of {scale}", apart.dot(&apart).sqrt());
    }

    #[test]
    fn a_polish_never_raises_the_objective(
        situation in any_situation(), costing in any_costing(), controls in any_controls(1.0), iterations in 0..20_usize,
    ) {
        let problem = situation.problem();
        let mut solver = Solver::new(LinearSolver::Sweep);
        let settings = Settings { costing, iterations, ..Settings::paper_test() };
        let plain = solver.solve(&problem, &settings, &controls).unwrap();
        let summary = solver.solve(&problem, &Settings { polish: 20, ..settings }, &controls).unwrap();
        let polish = &solver.history()[plain.iterations + 1..];
        prop_assert!(polish.windows(2).all(|pair| pair[1] <= pair[0]), "{polish:?}");
        prop_assert!(summary.best_objective <= plain.best_objective);
        // A step that ends level with the one before is taken, but is not better.
        prop_assert_eq!(evaluated(&problem, &costing, solver.last()).objective, summary.best_objective);
        prop_assert_eq!(evaluated(&problem, &costing, solver.best()).objective, summary.best_objective);
    }

    #[test]
    fn the_gradient_through_the_iterations_is_that_of_central_differences(
        situation in any_situation(), costing in any_trained_costing(), initial in any_controls(0.5), direction in any_controls(0.3),
        output_model in prop::sample::select(vec![BicycleModel::authors_training(), BicycleModel::default()]),
        nudges in prop::collection::vec(-1.0..1.0, 2 * NEIGHBORS * KEY_STEPS.len() + TERMS), squares in -0.01..0.01,
        wanted in prop::collection::vec(-1.0..1.0, 5 * STEPS), lead in prop::option::of(any_choices()),
    ) {
        let settings = LayerSettings { costing, output_model, ..LayerSettings::paper() };
        let mut output = OutputGradient { squares, ..OutputGradient::ZERO };
        for (t, w) in wanted.chunks(5).enumerate() {
            output.poses[t] = StateChange { x: w[0], y: w[1], heading: w[2], speed: 0.0 };
            output.controls.acceleration[t] = w[3];
            output.controls.steering[t] = w[4];
        }
        let h = 2e-4;
        let moved = |h: f64| {
            let mut situation = situation.clone();
            let mut controls = initial.clone();
            controls.add_scaled(h, &direction);
            for (j, positions) in situation.positions.iter_mut().enumerate() {
                let Some(positions) = positions else { continue };
                for (key, &t) in KEY_STEPS.iter().enumerate() {
                    let nudge = &nudges[2 * (j * KEY_STEPS.len() + key)..][..2];
                    positions[t].0 += h * nudge[0];
                    positions[t].1 += h * nudge[1];
                }
            }
            let by_weight = &nudges[2 * NEIGHBORS * KEY_STEPS.len()..];
            situation.weights.iter_mut().zip(by_weight).for_each(|(w, n)| *w += h * 0.05 * n);
            (situation.problem(), controls)
        };
        let run = |h: f64| {
            let (problem, controls) = moved(h);
            let mut layer = Layer::new(settings, LinearSolver::Sweep);
            layer.forward_led(&problem, &controls, lead.as_ref()).unwrap();
            let states = &layer.output().states;
            let mut value: f64 = output.controls.dot(layer.controls()) + squares * 2.0 * layer.objective();
            let mut unwrapped = 0.0;
            for (t, by) in output.poses.iter().enumerate() {
                let before = if t == 0 { problem.av.state.heading } else { states[t - 1].heading };
                unwrapped += world::geometry::wrap_angle(states[t].heading - before);
                value += by.x * states[t].x + by.y * states[t].y + by.heading * unwrapped;
            }
            let piece = |(k, controls)| {
                let mut at = Evaluation::default();
                at.evaluate_led(&problem, &costing, controls, lead.as_ref().and_then(|lead| lead.at(k)));
                pieces(&at)
            };
            let pieces: Vec<_> = layer.iterates().iter().enumerate().map(piece).collect();
            (value, (pieces, clips(layer.output())), layer)
        };
        let (_, pieces, mut layer) = run(0.0);
        let [far_low, low, high, far_high] = [-2.0 * h, -h, h, 2.0 * h].map(run);
        prop_assume!([&far_low, &low, &high, &far_high].iter().all(|(_, there, _)| *there == pieces));
        // Of fourth order over a wide step: far beyond the lane's edge, rounding is much and the step bends.
        let difference = (8.0 * (high.0 - low.0) - (far_high.0 - far_low.0)) / (12.0 * h);
        let mut by = Gradients::ZERO;
        layer.backward(&moved(0.0).0, &output, &mut by).unwrap();
        let mut parts: Vec<f64> = by.controls.interleaved().zip(direction.interleaved()).map(|(g, d)| g * d).collect();
        for (j, neighbor) in by.predictions.iter().enumerate() {
            for (key, (x, y)) in neighbor.iter().enumerate() {
                let nudge = &nudges[2 * (j * KEY_STEPS.len() + key)..][..2];
                parts.extend([x * nudge[0], y * nudge[1]]);
            }
        }
        let by_weight = &nudges[2 * NEIGHBORS * KEY_STEPS.len()..];
        parts.extend(by.weights.iter().zip(by_weight).map(|(g, n)| 0.05 * g * n));
        let (slope, scale) = (parts.iter().sum::<f64>(), parts.iter().map(|part| part.abs()).sum::<f64>());
        prop_assert!((difference - slope).abs() <= 1e-5 * (1.0 + scale), "differences {difference}, gradient {slope}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]
    #[test]
    fn a_batch_gives_each_sample_what_it_gets_alone(
        samples in prop::collection::vec((any_situation(), any_controls(0.5)), 1..12),
    ) {
        let problems: Vec<_> = samples.iter().map(|(situation, _)| situation.problem()).collect();
        let initial: Vec<_> = samples.into_iter().map(|(_, controls)| controls).collect();
        let outputs = vec![OutputGradient { squares: 0.1, ..OutputGradient::ZERO }; problems.len()];
        let mut batch = Batch::new(LayerSettings::paper(), LinearSolver::Sweep, 16);
        batch.forward(&problems, &initial).unwrap();
        batch.backward(&problems, &outputs).unwrap();
        for (i, (layer, gradients)) in batch.results().take(problems.len()).enumerate() {
            let mut alone = Layer::new(LayerSettings::paper(), LinearSolver::Sweep);
            let mut by = Gradients::ZERO;
            alone.forward(&problems[i], &initial[i]).unwrap();
            alone.backward(&problems[i], &outputs[i], &mut by).unwrap();
            prop_assert_eq!(layer.controls(), alone.controls());
            prop_assert_eq!(gradients, &by);
        }
    }
}

proptest! {
    #[test]
    fn a_sample_led_by_its_own_choices_is_the_sample_alone(situation in any_situation(), initial in any_controls(0.5)) {
        let problem = situation.problem();
        let run = |lead: Option<&Choices>| {
            let mut layer = Layer::new(LayerSettings::paper(), LinearSolver::Sweep);
            let mut by = Gradients::ZERO;
            layer.forward_led(&problem, &initial, lead).unwrap();
            layer.backward(&problem, &OutputGradient { squares: 0.1, ..OutputGradient::ZERO }, &mut by).unwrap();
            (layer.controls().clone(), layer.objective(), by, layer.choices())
        };
        let alone = run(None);
        prop_assert_eq!(&run(Some(&alone.3)), &alone);
    }
}

/// Any number, and often one that breaks sums and products.
fn wild() -> impl Strategy<Value = f64> {
    let edges = vec![0.0, -0.0, 1e-300, 1e12, -1e12, 1e154, -1e200, f64::MAX, f64::NAN, f64::INFINITY];
    prop_oneof![8 => -50.0..50.0, 1 => prop::sample::select(edges)]
}

prop_compose! {
    /// Inputs as columns: line, speeds and sizes, positions of a neighbor, weights.
    fn wild_numbers()(
        line in prop::collection::vec(prop::array::uniform3(wild()), 0..40), scalars in prop::array::uniform12(wild()),
        positions in prop::collection::vec((wild(), wild()), STEPS), weights in prop::array::uniform9(wild()),
        tame in any::<bool>(),
    ) -> (Vec<[f64; 3]>, [f64; 12], Vec<(f64, f64)>, [f64; TERMS]) {
        // Else hardly any inputs are finite throughout.
        let calm = |v: f64| if tame && !v.is_finite() { 1.0 } else { v };
        let line = line.into_iter().map(|sample| sample.map(calm)).collect();
        let positions = positions.into_iter().map(|(x, y)| (calm(x), calm(y))).collect();
        (line, scalars.map(calm), positions, weights.map(calm))
    }
}

proptest! {
    #[test]
    fn whatever_comes_in_what_comes_out_is_a_plan_of_numbers_or_an_error(
        (line, n, positions, weights) in wild_numbers(), initial in prop::collection::vec((wild(), wild()), STEPS),
        costing in any_costing(),
    ) {
        let column = |c: usize| line.iter().map(|sample| sample[c]).collect::<Vec<_>>();
        let headings: Vec<f64> = positions.iter().map(|(x, _)| *x).collect();
        let boxed = Neighbor { length: n[0], width: n[1], positions: &positions, headings: &headings, deviations: &positions };
        let neighbors = [None, Some(boxed), Some(Neighbor { headings: &[], ..boxed })];
        let problem = Problem::new(&Inputs {
            line_x: &column(0),
            line_y: &column(1),
            line_heading: &column(2),
            speed_target: n[2],
            speed_targets: None,
            stop_distance: Some(n[3]),
            av: Vehicle { state: VehicleState { x: n[4], y: n[5], heading: n[6], speed: n[7] }, length: n[8], width: n[9] },
            present: Some(Control { acceleration: n[10], steering: n[11] }),
            neighbors: &neighbors,
            weights,
        });
        let Ok(problem) = problem else { return Ok(()) };
        let initial = Controls::from_pairs(initial.into_iter()).unwrap();
        for linear in [LinearSolver::Sweep, LinearSolver::Dense] {
            let mut solver = Solver::new(linear);
            let settings = Settings { costing, iterations: 5, polish: 5, ..Settings::paper_test() };
            let solved = solver.solve(&problem, &settings, &initial);
            prop_assert!(solved.is_err() || solver.best().is_finite() && solved.unwrap().best_objective.is_finite());
            let mut layer = Layer::new(LayerSettings { costing, ..LayerSettings::paper() }, linear);
            prop_assert!(layer.forward(&problem, &initial).is_err() || layer.controls().is_finite());
        }
    }
}

#[test]
fn a_batch_names_the_sample_that_has_no_result() {
    let mut singular = straight([1.0; TERMS]);
    singular.weights[3] = 0.0;
    let problems = [straight([1.0; TERMS]).problem(), singular.problem()];
    let mut batch = Batch::new(LayerSettings::paper(), LinearSolver::Sweep, 2);
    let error = batch.forward(&problems, &[Controls::ZERO, Controls::ZERO]).unwrap_err();
    assert_eq!(error.sample, 1);
}

fn straight(weights: [f64; TERMS]) -> Situation {
    Situation {
        line: (0..600).map(|k| (0.1 * f64::from(k) - 20.0, 0.0, 0.0)).collect(),
        speed: 0.0,
        stop_distance: None,
        positions: vec![],
        boxes: None,
        weights,
    }
}

#[test]
fn a_control_that_costs_nothing_is_a_typed_error_and_no_plan() {
    // Standing still, steering changes nothing.
    let problem = straight([1.0, 1.0, 1.0, 0.0, 1.0, 1.0, 1.0, 1.0, 1.0]).problem();
    for linear in [LinearSolver::Sweep, LinearSolver::Dense] {
        let mut solver = Solver::new(linear);
        let summary = solver.solve(&problem, &Settings::paper_test(), &Controls::ZERO).unwrap();
        assert!(matches!(summary.status, Status::Singular { .. }));
        assert_eq!((summary.iterations, solver.best()), (0, &Controls::ZERO));
        let error = Layer::new(LayerSettings::paper(), linear).forward(&problem, &Controls::ZERO).unwrap_err();
        assert!(matches!(error, SolveError::Singular { iteration: 0, .. }), "{error}");
    }
}

#[test]
fn a_full_turn_and_back_is_costed_by_the_remainder_of_the_summed_heading() {
    let mut situation = straight([1.0; TERMS]);
    situation.speed = 15.0;
    let problem = situation.problem();
    let mut controls = Controls::ZERO;
    controls.steering = std::array::from_fn(|t| if t < 32 { 0.48 } else { -0.4 });
    // The authors' planner: heading grows by speed * steering / wheelbase.
    let sums = controls.steering.iter().scan(0.05, |sum, steering| {
        *sum += 0.1 * 15.0 / world::vehicle::WHEELBASE * steering;
        Some(*sum)
    });
    let sums: Vec<f64> = sums.collect();
    assert!(sums.iter().any(|sum| *sum > 2.0 * PI) && sums[STEPS - 1] < 2.0 * PI);
    let at = evaluated(&problem, &Settings::paper_test().costing, &controls);
    let mut layer = Layer::new(LayerSettings { iterations: 0, ..LayerSettings::paper() }, LinearSolver::Sweep);
    layer.forward(&problem, &controls).unwrap();
    for (t, sum) in sums.iter().enumerate() {
        let wanted = sum % (2.0 * PI);
        assert!((at.motion.states[t].heading - wanted).abs() < 1e-12, "{t}");
        assert!((layer.output().states[t].heading - wanted).abs() < 1e-12, "{t}");
        if t % 2 == 1 {
            // The line's heading is 0.
            assert!((at.rows.lane_heading[t / 2] - wanted).abs() < 1e-12, "{t}");
        }
    }
}

#[test]
fn controls_that_are_no_numbers_are_refused() {
    let problem = straight([1.0; TERMS]).problem();
    let mut controls = Controls::ZERO;
    controls.steering[7] = f64::NAN;
    let mut solver = Solver::new(LinearSolver::Sweep);
    assert_eq!(solver.solve(&problem, &Settings::paper_test(), &controls), Err(SolveError::InitialControls));
    controls.steering[7] = 1e200;
    let error = solver.solve(&problem, &Settings::paper_test(), &controls).unwrap_err();
    assert_eq!(error.to_string(), "the objective is not finite after 0 iterations");
}

#[test]
fn a_search_that_leaves_all_numbers_keeps_the_best_it_had() {
    let mut situation = straight([1.0; TERMS]);
    situation.speed = 9.0;
    let problem = situation.problem();
    let mut solver = Solver::new(LinearSolver::Sweep);
    let settings = Settings { step: 1e200, ..Settings::paper_test() };
    let summary = solver.solve(&problem, &settings, &Controls::ZERO).unwrap();
    assert_eq!((summary.status, summary.iterations, summary.best_after), (Status::Diverged, 1, 0));
    assert_eq!(solver.best(), &Controls::ZERO);
    assert_eq!(summary.best_objective, solver.history()[0]);
    // A line search from there goes on.
    let summary = solver.solve(&problem, &Settings { polish: 20, ..settings }, &Controls::ZERO).unwrap();
    assert!(summary.best_objective < solver.history()[0]);
}

#[test]
fn training_ends_where_an_iteration_changes_nothing() {
    // Speed, acceleration and steering alone: one whole step leads to the minimum.
    let problem = straight([1.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0]).problem();
    let iterations = |initial: &Controls| {
        let mut layer = Layer::new(LayerSettings::paper(), LinearSolver::Sweep);
        layer.forward(&problem, initial).unwrap();
        let mut by = Gradients::ZERO;
        layer.backward(&problem, &OutputGradient { squares: 0.1, ..OutputGradient::ZERO }, &mut by).unwrap();
        assert_eq!(layer.controls(), layer.iterates().last().unwrap());
        layer.iterates().len() - 1
    };
    let mut solver = Solver::new(LinearSolver::Sweep);
    solver.solve(&problem, &Settings { step: 1.0, ..Settings::paper_test() }, &Controls::ZERO).unwrap();
    assert_eq!((iterations(&Controls::ZERO), iterations(solver.best())), (2, 1));
}

#[test]
fn a_led_sample_has_the_length_of_the_first_ones_choice_and_its_own_jacobian() {
    let mut situation = straight([1.0; TERMS]);
    let beside = vec![(30.0, 9.0); STEPS];
    let mut evaluate = |ahead: f64, lead: Option<usize>| {
        // Lengths of the AV and those in front of it and beside: 5.3, 1 and 3.6 m; nobody is in the second place.
        situation.positions = vec![Some(vec![(ahead, 0.0); STEPS]), None, Some(beside.clone())];
        let problem = situation.problem();
        let mut at = Evaluation::default();
        let lead = lead.map(|j| [j; KEY_STEPS.len()]);
        at.evaluate_led(&problem, &Settings::paper_test().costing, &Controls::ZERO, lead.as_ref());
        assert_eq!(at.nearest, [0; KEY_STEPS.len()]);
        at.safety().first().map(|row| (row.neighbor, row.away.0, row.value_away.0, at.rows.safety[0]))
    };
    let near =
        |ahead: f64, length: f64| (5.3 + length) / 2.0 + 5.0 - libm::sqrt((ahead - 0.1) * (ahead - 0.1) + 0.2 * 0.2);
    let mut check = |ahead: f64, lead: Option<usize>, wanted: Option<(bool, bool, f64)>| {
        let got = evaluate(ahead, lead).map(|(j, away, value_away, value)| {
            assert_eq!(j, 0);
            (away < 0.0, value_away < 0.0, (value * 1e9).round() / 1e9)
        });
        assert_eq!(got, wanted.map(|(jacobian, values, value)| (jacobian, values, (value * 1e9).round() / 1e9)));
    };
    check(7.0, None, Some((true, true, near(7.0, 1.0))));
    check(7.0, Some(2), Some((true, true, near(7.0, 3.6))));
    check(7.0, Some(1), Some((true, true, near(7.0, 0.0))));
    check(8.0, Some(1), Some((true, false, 0.0)));
    check(9.0, None, None);
    check(9.0, Some(2), Some((false, true, near(9.0, 3.6))));
    check(9.0, Some(1), None);
}

#[test]
fn a_warm_solver_gives_the_bits_of_a_new_one() {
    let mut first = straight([1.0; TERMS]);
    first.speed = 9.0;
    let mut second = first.clone();
    second.line.iter_mut().for_each(|p| p.0 += 17.0);
    let mut warm = Solver::new(LinearSolver::Sweep);
    for situation in [&first, &second, &first] {
        let mut new = Solver::new(LinearSolver::Sweep);
        let problem = situation.problem();
        new.solve(&problem, &Settings::paper_test(), &Controls::ZERO).unwrap();
        warm.solve(&problem, &Settings::paper_test(), &Controls::ZERO).unwrap();
        assert_eq!(warm.history(), new.history());
        assert_eq!(warm.best(), new.best());
    }
}
