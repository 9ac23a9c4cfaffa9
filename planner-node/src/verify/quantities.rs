//! What is compared, how, and within which tolerance.

use gauss_newton::constants::{KEY_STEPS, NEIGHBORS, STEPS, TERMS, Term};
use gauss_newton::dense::{UNKNOWNS, jacobian};
use gauss_newton::{
    Controls, Evaluation, Gradients, Layer, LayerSettings, LinearSolver, OutputGradient, Problem, Settings, Solver,
    StateChange, trajectory,
};
use vectors::{Npz, Quantity, absolute, relative, worst_deviation};
use world::vehicle::{BicycleModel, VehicleState};

use super::case::{CaseError, controls, from_interleaved, problem};
use super::ending::{Ending, differences, ended_otherwise, history_deviation};

/// A deviation of each quantity that a case has.
pub(super) type Deviations = Vec<(Quantity, f64)>;

const INITIAL_TRAJECTORY: Quantity = Quantity::within("initial trajectory", 1e-10, "abs");
const NEAREST_SAMPLES: Quantity = Quantity::exact("nearest samples");
const FRENET: Quantity = Quantity::within("Frenet coordinates", 1e-10, "abs");
pub(super) const RESIDUALS: Quantity = Quantity::within("initial residuals", 1e-10, "abs");
pub(super) const JACOBIAN: Quantity = Quantity::within("Jacobian", 1e-10, "abs");
const NORMAL_EQUATIONS: Quantity = Quantity::within("first step, J'Jd + J'r", 1e-9, "rel");
const TEACHER_FORCED_STEPS: Quantity = Quantity::within("teacher-forced steps", 1e-8, "abs");
pub(super) const OBJECTIVE_HISTORY: Quantity = Quantity::within("objective history", 1e-7, "rel");
pub(super) const ITERATIONS: Quantity = Quantity::exact("iterations and status");
pub(super) const BEST_CONTROLS: Quantity = Quantity::within("best controls", 1e-7, "abs");
const BEST_TRAJECTORY: Quantity = Quantity::within("best trajectory", 1e-7, "abs");
const DRIVEN_TRAJECTORY: Quantity = Quantity::within("driven trajectory", 1e-7, "abs");
pub(super) const TRAINING_STATUS: Quantity = Quantity::exact("training status");
pub(super) const TRAINING_CONTROLS: Quantity = Quantity::within("training controls", 1e-8, "abs");
pub(super) const TRAINING_TRAJECTORY: Quantity = Quantity::within("training trajectory", 1e-8, "abs");
pub(super) const TRAINING_OBJECTIVE: Quantity = Quantity::within("training objective", 1e-8, "rel");
const LOSSES: Quantity = Quantity::within("training losses", 1e-8, "rel");
pub(super) const CONTROL_GRADIENTS: Quantity = Quantity::within("gradients by controls", 1e-6, "rel");
pub(super) const PREDICTION_GRADIENTS: Quantity = Quantity::within("gradients by predictions", 1e-6, "rel");
const WEIGHT_GRADIENTS: Quantity = Quantity::within("gradients by weights", 1e-6, "rel");

pub(super) const LOOP_CONTROLS: Quantity = Quantity::within("closed loop, first control", 1e-3, "abs");
pub(super) const LOOP_POSES: Quantity = Quantity::within("closed loop, first pose", 1e-5, "abs");
pub(super) const LOOP_OBJECTIVES: Quantity = Quantity::within("closed loop, objective", 1e-4, "rel");

/// What a case must have for a quantity of it to be compared.
#[derive(Clone, Copy)]
enum Needs {
    Nothing,
    /// A step that the authors' test took.
    TestStep,
    /// A step that their training took.
    TrainingStep,
}

/// The quantities of cases, with the tolerances of the vectors' README.
const OF_CASES: [(Quantity, Needs); 20] = [
    (INITIAL_TRAJECTORY, Needs::Nothing),
    (NEAREST_SAMPLES, Needs::Nothing),
    (FRENET, Needs::Nothing),
    (RESIDUALS, Needs::Nothing),
    (JACOBIAN, Needs::Nothing),
    (NORMAL_EQUATIONS, Needs::TestStep),
    (TEACHER_FORCED_STEPS, Needs::TestStep),
    (OBJECTIVE_HISTORY, Needs::Nothing),
    (ITERATIONS, Needs::Nothing),
    (BEST_CONTROLS, Needs::Nothing),
    (BEST_TRAJECTORY, Needs::Nothing),
    (DRIVEN_TRAJECTORY, Needs::Nothing),
    (TRAINING_STATUS, Needs::Nothing),
    (TRAINING_CONTROLS, Needs::TrainingStep),
    (TRAINING_TRAJECTORY, Needs::TrainingStep),
    (TRAINING_OBJECTIVE, Needs::TrainingStep),
    (LOSSES, Needs::TrainingStep),
    (CONTROL_GRADIENTS, Needs::TrainingStep),
    (PREDICTION_GRADIENTS, Needs::TrainingStep),
    (WEIGHT_GRADIENTS, Needs::TrainingStep),
];

/// The quantities of a batch. Its first case at least is compared throughout.
const OF_BATCHES: [Quantity; 10] = [
    RESIDUALS,
    JACOBIAN,
    OBJECTIVE_HISTORY,
    ITERATIONS,
    BEST_CONTROLS,
    TRAINING_CONTROLS,
    TRAINING_TRAJECTORY,
    TRAINING_OBJECTIVE,
    CONTROL_GRADIENTS,
    PREDICTION_GRADIENTS,
];

/// The quantities of a closed loop's episode.
const OF_EPISODES: [Quantity; 3] = [LOOP_CONTROLS, LOOP_POSES, LOOP_OBJECTIVES];

/// What a file of vectors is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// An episode of the closed loop.
    Episode,
    /// As many cases as this, solved as one.
    Batch(usize),
    /// A case: whether the test took a step from it, and whether the training did.
    Case { tested: bool, trained: bool },
}

impl Kind {
    /// Whether this quantity must be compared.
    fn has(self, quantity: &Quantity) -> bool {
        match self {
            Self::Episode => OF_EPISODES.contains(quantity),
            Self::Batch(_) => OF_BATCHES.contains(quantity),
            Self::Case { tested, trained } => OF_CASES.iter().any(|(own, needs)| {
                let is_there = match needs {
                    Needs::Nothing => true,
                    Needs::TestStep => tested,
                    Needs::TrainingStep => trained,
                };
                own == quantity && is_there
            }),
        }
    }

    /// A case, by its arrays.
    pub fn of_case(npz: &Npz) -> Result<Self, CaseError> {
        let holds = |name: &str| npz.number(name).map(|status| status >= 0.0);
        Ok(Self::Case { tested: holds("test_status")?, trained: holds("train_status")? })
    }
}

/// The quantities that must be compared where there are files of these kinds.
pub(super) fn announced(kinds: &[Kind]) -> Vec<Quantity> {
    let all = OF_CASES.iter().map(|(quantity, _)| quantity).chain(&OF_EPISODES);
    all.filter(|quantity| kinds.iter().any(|kind| kind.has(quantity))).copied().collect()
}

/// The deviations of one case.
pub(super) fn deviations(npz: &Npz, linear: LinearSolver) -> Result<Deviations, CaseError> {
    let problem = problem(npz)?;
    let mut found = Vec::new();
    at_the_start(npz, &problem, linear, &mut found)?;
    test_configuration(npz, &problem, linear, &mut found)?;
    training_configuration(npz, &problem, linear, &mut found)?;
    Ok(found)
}

/// For gradients 1e-6 relative and 1e-9 absolute.
fn gradient_scale(wanted: f64) -> f64 {
    wanted.abs() + 1e-3
}

fn poses(states: &[VehicleState; STEPS]) -> impl Iterator<Item = f64> {
    states.iter().flat_map(|s| [s.x, s.y, s.heading, s.speed.max(0.0)])
}

/// Rows in the vectors' order: safety by key step, absent where no neighbor is too near.
pub(super) fn stacked(at: &Evaluation, weights: &[f64; TERMS]) -> Vec<f64> {
    let weight = |term: Term| weights[term as usize];
    let mut all = Vec::new();
    for (term, rows) in at.rows.parts().into_iter().filter(|(term, _)| *term != Term::Safety) {
        all.extend(rows.iter().map(|c| weight(term) * c));
    }
    let mut safety = [0.0; KEY_STEPS.len()];
    for (row, c) in at.safety().iter().zip(&at.rows.safety) {
        safety[row.key] = weight(Term::Safety) * c;
    }
    all.extend(safety);
    all
}

fn at_the_start(npz: &Npz, problem: &Problem, linear: LinearSolver, found: &mut Deviations) -> Result<(), CaseError> {
    let initial = controls(npz, "controls0")?;
    let costing = Settings::paper_test().costing;
    let mut at = Evaluation::default();
    at.evaluate(problem, &costing, &initial);
    let states = &at.motion.states;
    found.push((
        INITIAL_TRAJECTORY,
        worst_deviation(poses(states), npz.array("traj0", &[Some(STEPS), Some(4)])?, absolute),
    ));

    let line = problem.line();
    let frenet = states.map(|s| line.frenet(s.x, s.y, 0));
    let nearest = npz.array("nearest0", &[Some(STEPS)])?;
    found.push((NEAREST_SAMPLES, worst_deviation(frenet.iter().map(|f| f.sample as f64), nearest, absolute)));
    let station = |sample: usize| 0.1 * (sample as f64 - 200.0);
    let own = npz.array("frenet_ego0", &[Some(STEPS), Some(2)])?;
    let mut frenet_worst = worst_deviation(frenet.iter().flat_map(|f| [station(f.sample), f.lateral]), own, absolute);
    let others = npz.array("frenet_neighbors0", &[Some(KEY_STEPS.len()), Some(NEIGHBORS), Some(2)])?;
    for j in 0..NEIGHBORS {
        let Some(frenet) = problem.neighbor_frenet(j) else { continue };
        for (key, f) in frenet.iter().enumerate() {
            let other = &others[(key * NEIGHBORS + j) * 2..][..2];
            frenet_worst = frenet_worst.max(worst_deviation([station(f.sample), f.lateral], other, absolute));
        }
    }
    found.push((FRENET, frenet_worst));

    let residuals = stacked(&at, problem.weights());
    let wanted = npz.array("residual_weighted", &[Some(residuals.len())])?;
    found.push((RESIDUALS, worst_deviation(residuals.iter().copied(), wanted, absolute)));

    let wanted = npz.array("jacobian", &[Some(residuals.len()), Some(UNKNOWNS)])?;
    let ours = jacobian(&at, problem.weights());
    let plain = residuals.len() - KEY_STEPS.len();
    let rows = (0..residuals.len()).map(|row| {
        if row < plain {
            return Some(row);
        }
        let key = row - plain;
        at.safety().iter().position(|row| row.key == key).map(|i| plain + i)
    });
    let entries = rows.flat_map(|row| {
        let ours = &ours;
        (0..UNKNOWNS).map(move |column| row.map_or(0.0, |row| ours[(row, column)]))
    });
    found.push((JACOBIAN, worst_deviation(entries, wanted, absolute)));

    if npz.number("test_status")? >= 0.0 {
        let mut solver = Solver::new(linear);
        let left_over = match solver.step_at(problem, &costing, &initial) {
            Ok(step) => left_over(&step, wanted, npz.array("residual_weighted", &[None])?),
            Err(_) => f64::INFINITY,
        };
        found.push((NORMAL_EQUATIONS, left_over));
    }
    Ok(())
}

/// The largest entry of J'(J d + r), over that of J'r or 1, with the vectors' own J and r.
fn left_over(step: &Controls, jacobian: &[f64], residuals: &[f64]) -> f64 {
    let step: Vec<f64> = step.interleaved().collect();
    let mut left = [0.0; UNKNOWNS];
    let mut gradient = [0.0; UNKNOWNS];
    for (row, r) in jacobian.as_chunks::<UNKNOWNS>().0.iter().zip(residuals) {
        let linear: f64 = r + row.iter().zip(&step).map(|(j, d)| j * d).sum::<f64>();
        for i in 0..UNKNOWNS {
            left[i] += row[i] * linear;
            gradient[i] += row[i] * r;
        }
    }
    worst_deviation(left, &[0.0; UNKNOWNS], absolute) / worst_deviation(gradient, &[0.0; UNKNOWNS], absolute).max(1.0)
}

fn test_configuration(
    npz: &Npz,
    problem: &Problem,
    linear: LinearSolver,
    found: &mut Deviations,
) -> Result<(), CaseError> {
    let settings = Settings::paper_test();
    let mut solver = Solver::new(linear);
    let iterates = npz.array("test_iterates", &[None, Some(STEPS), Some(2)])?;
    let iterates = iterates.as_chunks::<UNKNOWNS>().0;
    if iterates.len() > 1 {
        let mut steps = 0.0_f64;
        for pair in iterates.windows(2) {
            let mut next = from_interleaved(&pair[0]);
            let deviation = match solver.step_at(problem, &settings.costing, &next) {
                Ok(step) => {
                    next.add_scaled(0.2, &step);
                    worst_deviation(next.interleaved(), &pair[1], absolute)
                }
                Err(_) => f64::INFINITY,
            };
            steps = if deviation > steps { deviation } else { steps };
        }
        found.push((TEACHER_FORCED_STEPS, steps));
    }

    let initial = controls(npz, "controls0")?;
    let Ok(summary) = solver.solve(problem, &settings, &initial) else {
        found.push((ITERATIONS, f64::INFINITY));
        return Ok(());
    };
    let history = npz.array("test_objective_history", &[None])?;
    found.push((OBJECTIVE_HISTORY, history_deviation(solver.history(), history)));
    found.push((
        ITERATIONS,
        differences(&[(summary.iterations as f64, npz.number("test_iterations")?)])
            + ended_otherwise(npz, &Ending::of(&summary))?,
    ));
    let best = npz.array("test_best_controls", &[Some(STEPS), Some(2)])?;
    let last = npz.array("test_final_controls", &[Some(STEPS), Some(2)])?;
    let deviation = worst_deviation(solver.best().interleaved(), best, absolute);
    found.push((BEST_CONTROLS, deviation.max(worst_deviation(solver.last().interleaved(), last, absolute))));
    for (quantity, model, name) in [
        (BEST_TRAJECTORY, BicycleModel::authors_planner(), "test_best_traj"),
        (DRIVEN_TRAJECTORY, BicycleModel::authors_test(), "test_best_traj_output"),
    ] {
        let states = trajectory(problem, &model, solver.best());
        found.push((quantity, worst_deviation(poses(&states), npz.array(name, &[Some(STEPS), Some(4)])?, absolute)));
    }
    Ok(())
}

fn training_configuration(
    npz: &Npz,
    problem: &Problem,
    linear: LinearSolver,
    found: &mut Deviations,
) -> Result<(), CaseError> {
    let mut layer = Layer::new(LayerSettings::paper(), linear);
    let forward = layer.forward(problem, &controls(npz, "controls0")?);
    let fails = npz.number("train_status")? < 0.0;
    found.push((TRAINING_STATUS, differences(&[(f64::from(forward.is_err()), f64::from(fails))])));
    if fails || forward.is_err() {
        return Ok(());
    }
    training_result(npz, &layer, found)?;

    let target = npz.array("target", &[Some(STEPS), Some(3)])?;
    for name in ["simple", "train"] {
        let (loss, gradient) = loss(&layer, target, name == "train");
        found.push((LOSSES, worst_deviation([loss], &[npz.number(&format!("loss_{name}"))?], relative)));
        let mut by = Gradients::ZERO;
        if layer.backward(problem, &gradient, &mut by).is_err() {
            found.push((CONTROL_GRADIENTS, f64::INFINITY));
            continue;
        }
        gradients(npz, name, &by, 1.0, found)?;
        let wanted = npz.array(&format!("grad_{name}_weights"), &[Some(TERMS)])?;
        found.push((WEIGHT_GRADIENTS, worst_deviation(by.weights, wanted, gradient_scale)));
    }
    Ok(())
}

/// What two iterations come to.
pub(super) fn training_result(npz: &Npz, layer: &Layer, found: &mut Deviations) -> Result<(), CaseError> {
    let wanted = npz.array("train_controls", &[Some(STEPS), Some(2)])?;
    found.push((TRAINING_CONTROLS, worst_deviation(layer.controls().interleaved(), wanted, absolute)));
    let wanted = npz.array("train_traj", &[Some(STEPS), Some(4)])?;
    found.push((TRAINING_TRAJECTORY, worst_deviation(poses(&layer.output().states), wanted, absolute)));
    let objective = npz.number("train_objective")?;
    found.push((TRAINING_OBJECTIVE, worst_deviation([layer.objective()], &[objective], relative)));
    Ok(())
}

/// The gradients by controls and predictions, `share` of each.
pub(super) fn gradients(
    npz: &Npz,
    name: &str,
    by: &Gradients,
    share: f64,
    found: &mut Deviations,
) -> Result<(), CaseError> {
    let wanted = npz.array(&format!("grad_{name}_controls"), &[Some(STEPS), Some(2)])?;
    let ours = by.controls.interleaved().map(|g| share * g);
    found.push((CONTROL_GRADIENTS, worst_deviation(ours, wanted, gradient_scale)));
    let wanted = npz.array(&format!("grad_{name}_predictions"), &[Some(NEIGHBORS), Some(STEPS), Some(3)])?;
    let mut all = vec![0.0; NEIGHBORS * STEPS * 3];
    for (j, neighbor) in by.predictions.iter().enumerate() {
        for (&t, (x, y)) in KEY_STEPS.iter().zip(neighbor) {
            all[(j * STEPS + t) * 3..][..2].copy_from_slice(&[share * x, share * y]);
        }
    }
    found.push((PREDICTION_GRADIENTS, worst_deviation(all, wanted, gradient_scale)));
    Ok(())
}

/// The authors' loss on the planner's output, and its gradient: smooth L1 of all poses, and (`whole`) of the last pose and the
/// cost, a thousandth of its mean over the rows.
pub(super) fn loss(layer: &Layer, target: &[f64], whole: bool) -> (f64, OutputGradient) {
    const COST: f64 = 1e-3 / 383.0;
    let mut gradient = OutputGradient::ZERO;
    let mut loss = 0.0;
    for t in 0..STEPS {
        let share = if whole && t == STEPS - 1 { 1.0 / 150.0 + 1.0 / 3.0 } else { 1.0 / 150.0 };
        let state = &layer.output().states[t];
        let mut by = [0.0; 3];
        for (c, value) in [state.x, state.y, state.heading].into_iter().enumerate() {
            let off = value - target[3 * t + c];
            loss += share * if off.abs() < 1.0 { 0.5 * off * off } else { off.abs() - 0.5 };
            by[c] = share * off.clamp(-1.0, 1.0);
        }
        gradient.poses[t] = StateChange { x: by[0], y: by[1], heading: by[2], speed: 0.0 };
    }
    if whole {
        loss += COST * 2.0 * layer.objective();
        gradient.squares = COST;
    }
    (loss, gradient)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_must_be_compared_depends_on_what_is_there() {
        let whole = Kind::Case { tested: true, trained: true };
        let unsolvable = Kind::Case { tested: false, trained: false };
        let all = OF_CASES.map(|(quantity, _)| quantity);
        assert_eq!(announced(&[whole]), all);
        assert_eq!(announced(&[unsolvable, whole]), all);
        let alone = announced(&[unsolvable]);
        assert!(alone.contains(&ITERATIONS) && alone.contains(&TRAINING_STATUS));
        assert!(!alone.contains(&NORMAL_EQUATIONS) && !alone.contains(&CONTROL_GRADIENTS));
        assert_eq!(announced(&[Kind::Batch(3)]).len(), OF_BATCHES.len());
        assert_eq!(announced(&[Kind::Episode]), OF_EPISODES);
    }
}
