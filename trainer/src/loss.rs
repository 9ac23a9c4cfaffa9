//! What is learned from one window: its losses, and their gradient by what the network says (`training.md` 2).
//!
//! ```text
//! plans, predictions ──▶ best future ──▶ prediction and score loss ──────────────────────────▶ gradients
//!                            └─▶ planner ──▶ plan ──▶ imitation loss, planning cost ──▶ planner ──┘
//! ```
//!
//! All in double precision: two steps of the planner from a random plan are ill-conditioned in single.

use gauss_newton::constants::{KEY_STEPS, TERMS};
use gauss_newton::{
    Choices, Controls, Gradients, Layer, LinearSolver, Motion, OutputGradient, ProblemError, SolveError, StateChange,
};
use network::constants::{AGENTS, COST_WEIGHTS, FUTURES, NEIGHBORS, STEPS};
use thiserror::Error;
use world::geometry::wrap_angle;
use world::vehicle::BicycleModel;

use crate::cost;
use crate::planning::{Planning, now};
use crate::settings::{InitialControls, LossWeights, Predictor, Rules};
use crate::step::Look;
use crate::windows::Window;

/// Steps at which futures are compared.
const COMPARED: [usize; 5] = [9, 19, 29, 39, 49];
/// Residuals of the planner: its cost is their mean square.
const RESIDUALS: f64 = 383.0;

/// What the network says of one window.
#[derive(Clone, Debug)]
pub struct Said {
    /// The AV's controls in each future.
    pub plans: Vec<Controls>,
    /// The neighbours' poses (x, y, heading) in each future; 0 of those who are not there. Empty where none is predicted.
    pub poses: Vec<Box<[[[f64; 3]; STEPS]; NEIGHBORS]>>,
    /// Each future's score; empty where none is given.
    pub scores: Vec<f64>,
    /// What the cost's weights come from, if they are learned.
    pub cost: Option<[f64; COST_WEIGHTS]>,
}

/// The gradient by what was said. Only the best future has one, but for the scores.
#[derive(Clone, Debug)]
pub struct ByWhatWasSaid {
    /// Which future was best.
    pub future: usize,
    /// By its plan.
    pub plan: Controls,
    /// By its poses.
    pub poses: Box<[[[f64; 3]; STEPS]; NEIGHBORS]>,
    /// By all scores.
    pub scores: Vec<f64>,
    /// By what the cost's weights come from; all 0 without the planner.
    pub cost: [f64; COST_WEIGHTS],
}

/// What a batch's sums are divided by, known before anything is computed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Divisors {
    /// Windows of the batch.
    pub windows: f64,
    /// For the AV and for each neighbour: numbers over all steps, and at the last.
    pub av: [f64; 2],
    /// The same for a neighbour.
    pub neighbor: [f64; 2],
}

impl Divisors {
    /// Those of a batch.
    #[must_use]
    pub fn of(windows: &[&Window], rules: Rules) -> Self {
        let count = windows.len() as f64;
        let all = [count * 3.0 * STEPS as f64, count * 3.0];
        match rules {
            Rules::Authors => Self { windows: count, av: all, neighbor: all },
            Rules::Mended => {
                let seen = |agents: std::ops::Range<usize>| {
                    let rows = || windows.iter().flat_map(|window| &window.seen[agents.clone()]);
                    let all = rows().flatten().filter(|seen| **seen).count();
                    let last = rows().filter(|row| row[STEPS - 1]).count();
                    [all, last].map(|count| 3.0 * count.max(1) as f64)
                };
                // Ten neighbours weigh as much as ten AVs, however many of them are seen.
                Self { windows: count, av: seen(0..1), neighbor: seen(1..AGENTS).map(|count| count / NEIGHBORS as f64) }
            }
        }
    }
}

/// A window's part of a batch's losses and metrics: they sum to the batch's.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Parts {
    /// For each agent, the AV first: the loss over all steps, and that of the last.
    pub prediction: [[f64; 2]; AGENTS],
    /// Cross entropy of the scores.
    pub score: f64,
    /// Imitation of the human by the planner: over all steps, and at the last.
    pub plan: [f64; 2],
    /// The planning cost.
    pub cost: f64,
    /// The plan's mean distance from the human over all steps, and at the last (m), divided by the batch's windows.
    pub plan_error: [f64; 2],
    /// The predictions' sums of the same over agents that were there at the first step (m), and how many those are.
    pub prediction_error: [f64; 2],
    /// Agents of that.
    pub predicted: f64,
    /// Distances by which the best future was found.
    pub distances: [[f64; 2]; FUTURES],
}

/// Why a window has no loss.
#[derive(Clone, Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum LossError {
    #[error("what the network says of it is not finite")]
    Said,
    #[error("its planning problem: {0}")]
    Problem(#[from] ProblemError),
    #[error("the planner: {0}")]
    Planner(#[from] SolveError),
    #[error("its loss is not finite")]
    Loss,
}

/// Losses of windows, one after another.
#[derive(Debug)]
pub struct Loss {
    rules: Rules,
    weights: LossWeights,
    planning: Option<Planning>,
    /// Whether prediction and score loss count.
    keeps_predictor_loss: bool,
    layer: Option<Layer>,
    /// The nearest neighbours of the batch's first window, where it is coupled.
    pub lead: Option<Choices>,
    gradients: Gradients,
    motion: Motion,
}

impl Loss {
    /// Losses by these rules; through the planner if there is one.
    #[must_use]
    pub fn new(rules: Rules, weights: LossWeights, planning: Option<Planning>, keeps_predictor_loss: bool) -> Self {
        let layer = planning.map(|planning| Layer::new(planning.layer(), LinearSolver::Sweep));
        Self {
            rules,
            weights,
            planning,
            keeps_predictor_loss,
            layer,
            lead: None,
            gradients: Gradients::ZERO,
            motion: Motion::default(),
        }
    }

    /// The losses of a window, and the gradient of its part of the batch's.
    ///
    /// # Errors
    /// [`LossError`].
    pub fn of(
        &mut self,
        window: &Window,
        said: &Said,
        divisors: &Divisors,
    ) -> Result<(Parts, ByWhatWasSaid), LossError> {
        if !said.plans.iter().all(Controls::is_finite) || !said.scores.iter().all(|score| score.is_finite()) {
            return Err(LossError::Said);
        }
        let mut parts = Parts::default();
        let future = self.best_future(window, said, &mut parts);
        let mut by = ByWhatWasSaid {
            future,
            plan: Controls::ZERO,
            poses: Box::new([[[0.0; 3]; STEPS]; NEIGHBORS]),
            scores: vec![0.0; said.scores.len()],
            cost: [0.0; COST_WEIGHTS],
        };
        self.roll_out(window, &said.plans[future]);
        let mut by_trajectory = [StateChange::default(); STEPS];
        let weight = self.weights.prediction;
        parts.prediction[0] = self.imitation(window, divisors, weight, &mut by_trajectory);
        self.motion.pull_back(&by_trajectory, &mut by.plan);
        if let Some(poses) = said.poses.get(future) {
            for neighbor in 0..NEIGHBORS {
                parts.prediction[neighbor + 1] =
                    self.prediction(window, neighbor, &poses[neighbor], divisors, &mut by.poses[neighbor], &mut parts);
            }
        }
        parts.score = score_loss(&said.scores, future, divisors.windows, self.weights.score, &mut by.scores);
        if !self.keeps_predictor_loss {
            by.plan = Controls::ZERO;
            by.poses.as_flattened_mut().as_flattened_mut().fill(0.0);
        }
        if self.planning.is_some() {
            self.plan(window, said, divisors, &mut parts, &mut by)?;
        }
        self.plan_error(window, divisors, &mut parts);
        let is_finite = parts.total(&self.weights, true).is_finite()
            && by.plan.is_finite()
            && by.cost.iter().all(|by| by.is_finite());
        if is_finite { Ok((parts, by)) } else { Err(LossError::Loss) }
    }

    /// What came of the window whose losses were reckoned last, and whose best future that was.
    #[must_use]
    pub fn look(&self, said: &Said, future: usize) -> Look {
        let place = |poses: &[[f64; 3]; STEPS]| poses.map(|[x, y, _]| [x, y]);
        Look {
            plan: self.motion.states.map(|state| [state.x, state.y]),
            predictions: said.poses.get(future).map(|poses| Box::new(poses.each_ref().map(place))),
        }
    }

    /// The future whose plan and predictions are nearest to what happened, neighbours' distances summed; the first of equals.
    fn best_future(&mut self, window: &Window, said: &Said, parts: &mut Parts) -> usize {
        let mut best = (0, f64::INFINITY);
        for (future, plan) in said.plans.iter().enumerate() {
            self.roll_out(window, plan);
            let human = |t: usize| window.future[0][t];
            let own = COMPARED.map(|t| {
                let state = &self.motion.states[t];
                norm(state.x - f64::from(human(t)[0]), state.y - f64::from(human(t)[1]))
            });
            let mut others = 0.0;
            for neighbor in 0..NEIGHBORS {
                let Some(poses) = said.poses.get(future) else { continue };
                for t in COMPARED {
                    let [x, y, _] = self.errors(window, neighbor, t, &poses[neighbor][t]);
                    others += norm(x, y) / COMPARED.len() as f64;
                }
            }
            let own = own.iter().sum::<f64>() / COMPARED.len() as f64;
            if let Some(distances) = parts.distances.get_mut(future) {
                *distances = [own, others];
            }
            if own + others < best.1 {
                best = (future, own + others);
            }
        }
        best.0
    }

    fn roll_out(&mut self, window: &Window, plan: &Controls) {
        self.motion.roll_out(&BicycleModel::authors_training(), now(window), plan);
    }

    /// A neighbour's errors in x, y and heading at a step; 0 where nothing is known.
    fn errors(&self, window: &Window, neighbor: usize, t: usize, pose: &[f64; 3]) -> [f64; 3] {
        let (truth, seen) = (&window.future[neighbor + 1][t], window.seen[neighbor + 1][t]);
        std::array::from_fn(|column| {
            let is_known = match self.rules {
                Rules::Authors => truth[column] != 0.0,
                Rules::Mended => seen,
            };
            if is_known { self.difference(column, pose[column], f64::from(truth[column])) } else { 0.0 }
        })
    }

    /// The difference of two numbers of a pose: the authors do not wrap headings.
    fn difference(&self, column: usize, said: f64, truth: f64) -> f64 {
        if column == 2 && self.rules == Rules::Mended { wrap_angle(said - truth) } else { said - truth }
    }

    /// The loss of the trajectory that was rolled out last against the human's, and `weight` times its gradient.
    fn imitation(&self, window: &Window, divisors: &Divisors, weight: f64, by: &mut [StateChange; STEPS]) -> [f64; 2] {
        let mut loss = [0.0; 2];
        for (t, state) in self.motion.states.iter().enumerate() {
            if self.rules == Rules::Mended && !window.seen[0][t] {
                continue;
            }
            let truth = window.future[0][t].map(f64::from);
            let errors = [(0, state.x), (1, state.y), (2, state.heading)]
                .map(|(column, said)| self.difference(column, said, truth[column]));
            let slopes = add_huber(&mut loss, errors, t, divisors.av).map(|slope| weight * slope);
            by[t].x += slopes[0];
            by[t].y += slopes[1];
            by[t].heading += slopes[2];
        }
        loss
    }

    /// A neighbour's loss and its gradient; and its part of the metrics.
    fn prediction(
        &self,
        window: &Window,
        neighbor: usize,
        poses: &[[f64; 3]; STEPS],
        divisors: &Divisors,
        by: &mut [[f64; 3]; STEPS],
        parts: &mut Parts,
    ) -> [f64; 2] {
        let mut loss = [0.0; 2];
        let mut distance = [0.0; 2];
        for (t, pose) in poses.iter().enumerate() {
            let errors = self.errors(window, neighbor, t, pose);
            by[t] = add_huber(&mut loss, errors, t, divisors.neighbor).map(|slope| self.weights.prediction * slope);
            let away = norm(errors[0], errors[1]);
            distance[0] += away;
            distance[1] = away;
        }
        let row = &window.seen[neighbor + 1];
        let (is_there, steps, is_there_last) = match self.rules {
            Rules::Authors => (window.future[neighbor + 1][0][0] != 0.0, STEPS, true),
            Rules::Mended => (row[0], row.iter().filter(|seen| **seen).count(), row[STEPS - 1]),
        };
        if is_there {
            parts.prediction_error[0] += distance[0] / steps.max(1) as f64;
            parts.prediction_error[1] += if is_there_last { distance[1] } else { 0.0 };
            parts.predicted += 1.0;
        }
        loss
    }

    /// Through the planner from the best future's plan, and back.
    fn plan(
        &mut self,
        window: &Window,
        said: &Said,
        divisors: &Divisors,
        parts: &mut Parts,
        by: &mut ByWhatWasSaid,
    ) -> Result<(), LossError> {
        let Some(planning) = self.planning else { return Ok(()) };
        let (problem, start) = planning.problem(window, said, by.future)?;
        let Some(mut layer) = self.layer.take() else { return Ok(()) };
        let solved = layer.forward_led(&problem, &start, self.lead.as_ref()).and_then(|()| {
            self.motion = layer.output().clone();
            let mut output = OutputGradient::ZERO;
            parts.plan = self.imitation(window, divisors, self.weights.plan, &mut output.poses);
            let scale = 1.0 / (RESIDUALS * divisors.windows);
            parts.cost = 2.0 * layer.objective() * scale;
            output.squares = self.weights.cost * scale;
            layer.backward(&problem, &output, &mut self.gradients)
        });
        self.layer = Some(layer);
        solved?;
        if planning.start == InitialControls::Network && !planning.cut.controls {
            by.plan.add_scaled(1.0, &self.gradients.controls);
        }
        if planning.predictor == Predictor::Network && !planning.cut.predictions {
            for (poses, positions) in by.poses.iter_mut().zip(&self.gradients.predictions) {
                for (t, (x, y)) in KEY_STEPS.iter().zip(positions) {
                    poses[*t][0] += x;
                    poses[*t][1] += y;
                }
            }
        }
        if let (Some(outputs), Some(kind)) = (&said.cost, planning.cost) {
            by.cost = cost::by_outputs(outputs, &self.gradients.weights, kind);
        }
        Ok(())
    }

    /// Plans as [`Loss::of`] does, if there is a planner.
    ///
    /// # Errors
    /// [`LossError`].
    pub fn solve(&mut self, window: &Window, said: &Said) -> Result<Option<&Layer>, LossError> {
        let future = self.best_future(window, said, &mut Parts::default());
        let (Some(planning), Some(layer)) = (self.planning, &mut self.layer) else { return Ok(None) };
        let (problem, start) = planning.problem(window, said, future)?;
        layer.forward_led(&problem, &start, self.lead.as_ref())?;
        Ok(Some(layer))
    }

    /// A penalty: `weight` times the sum of squares of how far the logarithms of the learned weights are from those they began with.
    #[must_use]
    pub fn prior(&self, weight: f64, start: &[f64; TERMS], said: &Said, by: &mut ByWhatWasSaid) -> f64 {
        let (Some(outputs), Some(kind)) = (&said.cost, self.planning.and_then(|planning| planning.cost)) else {
            return 0.0;
        };
        let now = cost::of_outputs(outputs, kind);
        let away: [f64; TERMS] = std::array::from_fn(|term| libm::log(now[term] / start[term]));
        let by_weights = std::array::from_fn(|term| 2.0 * weight * away[term] / now[term]);
        by.cost.iter_mut().zip(cost::by_outputs(outputs, &by_weights, kind)).for_each(|(sum, more)| *sum += more);
        weight * away.iter().map(|away| away * away).sum::<f64>()
    }

    fn plan_error(&self, window: &Window, divisors: &Divisors, parts: &mut Parts) {
        let mut last = 0.0;
        let mut sum = 0.0;
        for (state, truth) in self.motion.states.iter().zip(&window.future[0]) {
            last = norm(state.x - f64::from(truth[0]), state.y - f64::from(truth[1]));
            sum += last;
        }
        parts.plan_error = [sum / STEPS as f64 / divisors.windows, last / divisors.windows];
    }
}

impl Parts {
    /// Adds another window's.
    pub fn add(&mut self, other: &Self) {
        let pairs = self.prediction.iter_mut().flatten().zip(other.prediction.iter().flatten());
        pairs.for_each(|(sum, part)| *sum += part);
        self.score += other.score;
        self.cost += other.cost;
        self.predicted += other.predicted;
        for k in 0..2 {
            self.plan[k] += other.plan[k];
            self.plan_error[k] += other.plan_error[k];
            self.prediction_error[k] += other.prediction_error[k];
        }
    }

    /// The sum over agents, before its weight.
    #[must_use]
    pub fn prediction_loss(&self) -> f64 {
        self.prediction.iter().flatten().sum()
    }

    /// Prediction and score loss as they are weighted.
    #[must_use]
    pub fn without_planner(&self, weights: &LossWeights) -> f64 {
        weights.prediction * self.prediction_loss() + weights.score * self.score
    }

    /// All losses as they are weighted; without the prediction loss if it does not count.
    #[must_use]
    pub fn total(&self, weights: &LossWeights, keeps_predictor_loss: bool) -> f64 {
        let own = if keeps_predictor_loss { self.without_planner(weights) } else { weights.score * self.score };
        own + weights.plan * (self.plan[0] + self.plan[1]) + weights.cost * self.cost
    }
}

/// Cross entropy with the best future, and `weight` times its gradient.
fn score_loss(scores: &[f64], future: usize, windows: f64, weight: f64, by: &mut [f64]) -> f64 {
    if scores.is_empty() {
        return 0.0;
    }
    let most = scores.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let sum: f64 = scores.iter().map(|score| libm::exp(score - most)).sum();
    for (index, (by, score)) in by.iter_mut().zip(scores).enumerate() {
        let share = libm::exp(score - most) / sum;
        *by = weight * (share - f64::from(u8::from(index == future))) / windows;
    }
    (most + libm::log(sum) - scores[future]) / windows
}

/// Adds Huber's loss of the errors at a step, over all steps and at the last, and answers its slopes.
fn add_huber(loss: &mut [f64; 2], errors: [f64; 3], t: usize, divisors: [f64; 2]) -> [f64; 3] {
    errors.map(|error| {
        let (value, slope) =
            if error.abs() < 1.0 { (0.5 * error * error, error) } else { (error.abs() - 0.5, error.signum()) };
        loss[0] += value / divisors[0];
        let mut by = slope / divisors[0];
        if t + 1 == STEPS {
            loss[1] += value / divisors[1];
            by += slope / divisors[1];
        }
        by
    })
}

fn norm(x: f64, y: f64) -> f64 {
    (x * x + y * y).sqrt()
}
