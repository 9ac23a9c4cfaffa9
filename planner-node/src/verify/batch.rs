//! Cases that the authors solved as one batch. Each must come out as it does alone, but that they stop `together`, and for a
//! quirk: what lacks to a safe distance they reckon with the length of another neighbor, the one that is nearest in the *first*
//! case of the batch (their Jacobian does not). Here the quirk is computed beside our own residual and must explain theirs to
//! the last digits; a case that it makes another, at any of its iterates, is not followed.

use gauss_newton::constants::{KEY_STEPS, LATERAL_MARGIN, NEIGHBORS, SAFE_GAP, STEPS, Term};
use gauss_newton::dense::{UNKNOWNS, jacobian};
use gauss_newton::{Controls, Evaluation, Gradients, Layer, LayerSettings, LinearSolver, Problem, Settings};
use vectors::{Npz, absolute, worst_deviation};

use super::case::{CaseError, controls, problem};
use super::ending::{ended_otherwise, history_deviation};
use super::{quantities as q, together};

/// At each key step the place of the nearest neighbor in the AV's path and its distance (m): the first place and the authors'
/// 100 m where nobody is.
type Nearest = [(usize, f64); KEY_STEPS.len()];

/// How many cases these arrays are of; none where they are those of a single case.
pub(super) fn size(npz: &Npz) -> Option<usize> {
    npz.shapes().find(|(name, shape)| *name == "controls0" && shape.len() == 3).map(|(_, shape)| shape[0])
}

/// One case of a batch.
struct Case {
    arrays: Npz,
    problem: Problem,
    initial: Controls,
}

/// The deviations of a batch of `size` cases.
pub(super) fn deviations(npz: &Npz, size: usize, linear: LinearSolver) -> Result<q::Deviations, CaseError> {
    let mut cases = Vec::with_capacity(size);
    for index in 0..size {
        let arrays = npz.case(index, size);
        cases.push(Case { problem: problem(&arrays)?, initial: controls(&arrays, "controls0")?, arrays });
    }
    let mut found = Vec::new();
    at_the_start(&cases, &mut found)?;
    searched(&cases, linear, &mut found)?;
    trained(&cases, linear, &mut found)?;
    Ok(found)
}

impl Case {
    /// The rows at these controls as the authors have them, and whether their quirk makes them others than ours. `first` is
    /// the first case's [`Nearest`]; it is set where it is not yet.
    fn quirk(
        &self,
        at: &mut Evaluation,
        controls: &Controls,
        first: &mut Option<Nearest>,
    ) -> Result<(Vec<f64>, bool), CaseError> {
        at.evaluate(&self.problem, &Settings::paper_test().costing, controls);
        let agents = self.arrays.array("current_state", &[Some(NEIGHBORS + 1), Some(8)])?.as_chunks::<8>().0;
        let predictions = self.arrays.array("predictions", &[Some(NEIGHBORS), Some(STEPS), Some(3)])?;
        let own = nearest_in_path(&self.problem, at, agents, predictions);
        let rows = residuals(at, &self.problem, agents, &own, first.get_or_insert(own));
        let other = rows != q::stacked(at, self.problem.weights());
        Ok((rows, other))
    }
}

fn at_the_start(cases: &[Case], found: &mut q::Deviations) -> Result<(), CaseError> {
    let (mut at, mut first) = (Evaluation::default(), None);
    for case in cases {
        let (quirk, _) = case.quirk(&mut at, &case.initial, &mut first)?;
        let wanted = case.arrays.array("residual_weighted", &[Some(quirk.len())])?;
        found.push((q::RESIDUALS, worst_deviation(quirk.iter().copied(), wanted, absolute)));
        found.push((q::JACOBIAN, safety_jacobian(&case.arrays, &case.problem, &at)?));
    }
    Ok(())
}

/// Whether the quirk leaves each case alone, at every one of its iterates; where it has fewer than the first, at its last.
fn left_alone(cases: &[Case], iterates: &[&[Controls]]) -> Result<Vec<bool>, CaseError> {
    let mut alone = vec![true; cases.len()];
    let mut at = Evaluation::default();
    for k in 0..iterates.iter().map(|all| all.len()).max().unwrap_or(0) {
        let mut first = None;
        for ((case, iterates), alone) in cases.iter().zip(iterates).zip(&mut alone) {
            if let Some(controls) = iterates.get(k).or(iterates.last()) {
                *alone &= !case.quirk(&mut at, controls, &mut first)?.1;
            }
        }
    }
    Ok(alone)
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

fn searched(cases: &[Case], linear: LinearSolver, found: &mut q::Deviations) -> Result<(), CaseError> {
    let inputs: Vec<_> = cases.iter().map(|case| (&case.problem, &case.initial)).collect();
    let all = together::search(&inputs, &Settings::paper_test(), linear);
    let alone = left_alone(cases, &all.iter().map(|one| &one.iterates[..]).collect::<Vec<_>>())?;
    for ((Case { arrays, .. }, one), _) in cases.iter().zip(&all).zip(alone).filter(|(_, alone)| *alone) {
        let history = arrays.array("test_objective_history", &[None])?;
        found.push((q::OBJECTIVE_HISTORY, history_deviation(&one.history, history)));
        found.push((q::ITERATIONS, ended_otherwise(arrays, &one.ending)?));
        let best = arrays.array("test_best_controls", &[Some(STEPS), Some(2)])?;
        found.push((q::BEST_CONTROLS, worst_deviation(one.iterates[one.best].interleaved(), best, absolute)));
    }
    Ok(())
}

fn trained(cases: &[Case], linear: LinearSolver, found: &mut q::Deviations) -> Result<(), CaseError> {
    let mut layers = Vec::with_capacity(cases.len());
    for case in cases {
        let mut layer = Layer::new(LayerSettings::paper(), linear);
        if layer.forward(&case.problem, &case.initial).is_err() {
            found.push((q::TRAINING_STATUS, 1.0));
            return Ok(());
        }
        layers.push(layer);
    }
    let alone = left_alone(cases, &layers.iter().map(Layer::iterates).collect::<Vec<_>>())?;
    // Their loss is the mean over the batch.
    let share = 1.0 / cases.len() as f64;
    for ((case, layer), _) in cases.iter().zip(&mut layers).zip(alone).filter(|(_, alone)| *alone) {
        q::training_result(&case.arrays, layer, found)?;
        let (_, gradient) = q::loss(layer, case.arrays.array("target", &[Some(STEPS), Some(3)])?, true);
        let mut by = Gradients::ZERO;
        if layer.backward(&case.problem, &gradient, &mut by).is_err() {
            found.push((q::CONTROL_GRADIENTS, f64::INFINITY));
            continue;
        }
        q::gradients(&case.arrays, "train", &by, share, found)?;
    }
    Ok(())
}
