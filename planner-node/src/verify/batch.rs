//! Cases that the authors solved as one batch. Each must come out as it does alone, but for a quirk of theirs: what
//! lacks to a safe distance they reckon with the length of another neighbor, the one that is nearest in the *first* case of
//! the batch (their Jacobian does not). Here the quirk is computed beside our own residual and must explain theirs to the
//! last digits; a case that it makes another is not followed further.

use vectors::{Npz, absolute, relative, worst_deviation};

use super::case::{CaseError, controls, problem};
use super::quantities as q;
use crate::gauss_newton::constants::{KEY_STEPS, LATERAL_MARGIN, NEIGHBORS, SAFE_GAP, STEPS, Term};
use crate::gauss_newton::dense::{UNKNOWNS, jacobian};
use crate::gauss_newton::{
    Controls, Evaluation, Gradients, Layer, LayerSettings, LinearSolver, Problem, Settings, Solver,
};

/// At each key step the place of the nearest neighbor in the AV's path and its distance (m): the first place and the authors'
/// 100 m where nobody is.
type Nearest = [(usize, f64); KEY_STEPS.len()];

/// How many cases these arrays are of; none where they are those of a single case.
pub(super) fn size(npz: &Npz) -> Option<usize> {
    npz.shapes().find(|(name, shape)| *name == "controls0" && shape.len() == 3).map(|(_, shape)| shape[0])
}

/// The deviations of a batch of `size` cases.
pub(super) fn deviations(npz: &Npz, size: usize, linear: LinearSolver) -> Result<q::Deviations, CaseError> {
    let mut found = Vec::new();
    let mut first: Option<Nearest> = None;
    for index in 0..size {
        let case = npz.case(index, size);
        let (problem, initial) = (problem(&case)?, controls(&case, "controls0")?);
        let mut at = Evaluation::default();
        at.evaluate(&problem, &Settings::paper_test().costing, &initial);
        let agents = case.array("current_state", &[Some(NEIGHBORS + 1), Some(8)])?.as_chunks::<8>().0;
        let predictions = case.array("predictions", &[Some(NEIGHBORS), Some(STEPS), Some(3)])?;
        let own = nearest_in_path(&problem, &at, agents, predictions);
        let quirk = residuals(&at, &problem, agents, &own, first.get_or_insert(own));
        let wanted = case.array("residual_weighted", &[Some(quirk.len())])?;
        found.push((q::RESIDUALS, worst_deviation(quirk.iter().copied(), wanted, absolute)));
        found.push((q::JACOBIAN, safety_jacobian(&case, &problem, &at)?));
        if quirk == q::stacked(&at, problem.weights()) {
            searched(&case, &problem, &initial, linear, &mut found)?;
            trained(&case, size, &problem, &initial, linear, &mut found)?;
        }
    }
    Ok(found)
}

fn nearest_in_path(problem: &Problem, at: &Evaluation, agents: &[[f64; 8]], predictions: &[f64]) -> Nearest {
    std::array::from_fn(|key| {
        let state = &at.motion.states[KEY_STEPS[key]];
        let av = problem.line().frenet(state.x, state.y, 0);
        let mut nearest = (0, 100.0);
        for j in 0..NEIGHBORS {
            let Some(other) = problem.neighbor_frenet(j).map(|frenet| frenet[key]) else { continue };
            let reach = (agents[0][6] + agents[j + 1][6]) / 2.0 + LATERAL_MARGIN;
            let place = &predictions[(j * STEPS + KEY_STEPS[key]) * 3..][..2];
            let (dx, dy) = (state.x - place[0], state.y - place[1]);
            let distance = (dx * dx + dy * dy).sqrt();
            let in_path = other.sample > av.sample && (av.lateral - other.lateral).abs() < reach;
            if in_path && distance < nearest.1 {
                nearest = (j, distance);
            }
        }
        nearest
    })
}

/// The weighted residuals with the authors' quirk.
fn residuals(at: &Evaluation, problem: &Problem, agents: &[[f64; 8]], own: &Nearest, first: &Nearest) -> Vec<f64> {
    let mut all = q::stacked(at, problem.weights());
    let plain = all.len() - KEY_STEPS.len();
    for (key, row) in all[plain..].iter_mut().enumerate() {
        let safe = (agents[0][5] + agents[first[key].0 + 1][5]) / 2.0 + SAFE_GAP;
        let missing = safe - own[key].1;
        *row = if missing > 0.0 { problem.weights()[Term::Safety as usize] * missing } else { 0.0 };
    }
    all
}

/// The Jacobian of the safety rows.
fn safety_jacobian(case: &Npz, problem: &Problem, at: &Evaluation) -> Result<f64, CaseError> {
    let wanted = case.array("jacobian_safety", &[Some(KEY_STEPS.len()), Some(UNKNOWNS)])?;
    let ours = jacobian(at, problem.weights());
    let plain = ours.nrows() - at.safety().len();
    let mut worst = 0.0_f64;
    for (i, row) in at.safety().iter().enumerate() {
        let ours = ours.row(plain + i);
        worst = worst.max(worst_deviation(ours.iter().copied(), &wanted[row.key * UNKNOWNS..][..UNKNOWNS], absolute));
    }
    Ok(worst)
}

fn searched(
    case: &Npz,
    problem: &Problem,
    initial: &Controls,
    linear: LinearSolver,
    found: &mut q::Deviations,
) -> Result<(), CaseError> {
    let mut solver = Solver::new(linear);
    let Ok(summary) = solver.solve(problem, &Settings::paper_test(), initial) else {
        found.push((q::ITERATIONS, f64::INFINITY));
        return Ok(());
    };
    let history = case.array("test_objective_history", &[None])?;
    found.push((q::OBJECTIVE_HISTORY, worst_deviation(solver.history().iter().copied(), history, relative)));
    found.push((q::ITERATIONS, q::ended_otherwise(case, &summary)?));
    let best = case.array("test_best_controls", &[Some(STEPS), Some(2)])?;
    found.push((q::BEST_CONTROLS, worst_deviation(solver.best().interleaved(), best, absolute)));
    Ok(())
}

fn trained(
    case: &Npz,
    size: usize,
    problem: &Problem,
    initial: &Controls,
    linear: LinearSolver,
    found: &mut q::Deviations,
) -> Result<(), CaseError> {
    let mut layer = Layer::new(LayerSettings::paper(), linear);
    if layer.forward(problem, initial).is_err() {
        found.push((q::TRAINING_STATUS, 1.0));
        return Ok(());
    }
    q::training_result(case, &layer, found)?;
    let (_, gradient) = q::loss(&layer, case.array("target", &[Some(STEPS), Some(3)])?, true);
    let mut by = Gradients::ZERO;
    if layer.backward(problem, &gradient, &mut by).is_err() {
        found.push((q::CONTROL_GRADIENTS, f64::INFINITY));
        return Ok(());
    }
    // Their loss is the mean over the batch.
    q::gradients(case, "train", &by, 1.0 / size as f64, found)
}
