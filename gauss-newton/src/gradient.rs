//! The solver as a layer of a network: forward through a fixed number of iterations, and the gradient back through them.
//!
//! With J the weighted Jacobian, r the weighted rows, A = J'J and the step d = -A^-1 J'r, a gradient by the controls after an
//! iteration becomes one by those before it, by the predictions and by the weights:
//!
//! ```text
//! A l = size * gradient;   m = J l;   p = r + J d
//! dL = -( m . dr + p' dJ l + m' dJ d )        and the gradient itself, for u + size d
//! ```
//!
//! dJ is exact: products with the second derivatives of the rollout and of the distances, along l and d. Masks, nearest samples
//! and the choice of the nearest neighbor are constants. dr is that of the rows' values, which is J but in the authors' coupling. Of the forward pass the iterates are kept, 100 numbers each; the rest is
//! computed again.

use std::slice::{from_mut, from_ref};

use world::vehicle::BicycleModel;

use super::constants::{KEY_STEPS, NEIGHBORS, STEPS, TERMS, lane_step};
use super::controls::Controls;
use super::coupling::{Choices, Nearest};
use super::linear::{LinearSolver, NormalEquations};
use super::motion::{Motion, StateChange};
use super::objective::{Costing, Evaluation, Safety};
use super::problem::Problem;
use super::rows::Rows;
use super::solver::{Settings, SolveError, settled};
use super::tree::Part;

/// A gradient by everything that is learned.
#[derive(Clone, Debug, PartialEq)]
pub struct Gradients {
    /// By the initial controls.
    pub controls: Controls,
    /// By the predicted positions (x, y) of each neighbor at the key steps; those at other steps do not matter.
    pub predictions: [[(f64, f64); KEY_STEPS.len()]; NEIGHBORS],
    /// By the weights.
    pub weights: [f64; TERMS],
}

impl Gradients {
    /// All zero.
    pub const ZERO: Self = Self {
        controls: Controls::ZERO,
        predictions: [[(0.0, 0.0); KEY_STEPS.len()]; NEIGHBORS],
        weights: [0.0; TERMS],
    };
}

/// A gradient by what the layer puts out.
#[derive(Clone, Debug)]
pub struct OutputGradient {
    /// By the controls.
    pub controls: Controls,
    /// By the poses that the controls lead to under a model of choice; speed is that of the model's state.
    pub poses: [StateChange; STEPS],
    /// By the sum of squared residuals at the controls (twice the objective).
    pub squares: f64,
}

impl OutputGradient {
    /// All zero.
    pub const ZERO: Self = Self {
        controls: Controls::ZERO,
        poses: [StateChange { x: 0.0, y: 0.0, heading: 0.0, speed: 0.0 }; STEPS],
        squares: 0.0,
    };
}

/// How the layer works.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LayerSettings {
    /// What the objective is made of.
    pub costing: Costing,
    /// Share of the Gauss-Newton step that is taken.
    pub step: f64,
    /// The most iterations.
    pub iterations: usize,
    /// Converged where the objective, or its change by an iteration, is below this.
    pub absolute_tolerance: f64,
    /// Converged where the objective's relative change by an iteration is below this.
    pub relative_tolerance: f64,
    /// The vehicle that the poses are computed with that the loss looks at.
    pub output_model: BicycleModel,
}

impl LayerSettings {
    /// What the authors train with.
    #[must_use]
    pub const fn paper() -> Self {
        let Settings { costing, step, iterations, absolute_tolerance, relative_tolerance, .. } =
            Settings::paper_training();
        Self {
            costing,
            step,
            iterations,
            absolute_tolerance,
            relative_tolerance,
            output_model: BicycleModel::authors_training(),
        }
    }
}

/// One sample's forward and backward pass. What it needs is allocated once; with [`LinearSolver::Sweep`] neither pass allocates.
#[derive(Clone, Debug)]
pub struct Layer {
    settings: LayerSettings,
    normal: NormalEquations,
    /// The initial controls and those after each iteration.
    iterates: Vec<Controls>,
    /// Iterations done by the last forward pass.
    done: usize,
    /// The nearest neighbors at each of the iterates.
    chosen: Vec<Nearest>,
    /// Those of the batch's first sample; empty where samples are not coupled.
    lead: Choices,
    at: Box<Evaluation>,
    objective: f64,
    output: Box<Motion>,
    scratch: Box<Scratch>,
}

#[derive(Clone, Debug)]
struct Scratch {
    right: Controls,
    step: Controls,
    adjoint: Controls,
    step_change: [StateChange; STEPS],
    adjoint_change: [StateChange; STEPS],
    step_rows: Rows,
    adjoint_rows: Rows,
    multipliers: Rows,
    direct: [StateChange; STEPS],
    change: Controls,
}

impl Layer {
    /// A layer.
    #[must_use]
    pub fn new(settings: LayerSettings, linear: LinearSolver) -> Self {
        Self {
            settings,
            normal: NormalEquations::new(linear, 1),
            iterates: vec![Controls::ZERO; settings.iterations + 1],
            done: 0,
            chosen: vec![Nearest::default(); settings.iterations + 1],
            lead: Choices(Vec::with_capacity(settings.iterations + 1)),
            at: Box::default(),
            objective: 0.0,
            output: Box::default(),
            scratch: Box::new(Scratch {
                right: Controls::ZERO,
                step: Controls::ZERO,
                adjoint: Controls::ZERO,
                step_change: [StateChange::default(); STEPS],
                adjoint_change: [StateChange::default(); STEPS],
                step_rows: Rows::ZERO,
                adjoint_rows: Rows::ZERO,
                multipliers: Rows::ZERO,
                direct: [StateChange::default(); STEPS],
                change: Controls::ZERO,
            }),
        }
    }

    /// Goes through the iterations from `initial`.
    ///
    /// # Errors
    /// [`SolveError`], also where a matrix is singular: there is no gradient then.
    pub fn forward(&mut self, problem: &Problem, initial: &Controls) -> Result<(), SolveError> {
        self.forward_led(problem, initial, None)
    }

    /// [`Layer::forward`] in a batch of the authors, whose first sample made these choices; its own, or none, for the first itself.
    /// [`Layer::backward`] keeps to them.
    ///
    /// # Errors
    /// As [`Layer::forward`].
    pub fn forward_led(
        &mut self,
        problem: &Problem,
        initial: &Controls,
        lead: Option<&Choices>,
    ) -> Result<(), SolveError> {
        self.lead.0.clear();
        self.lead.0.extend(lead.iter().flat_map(|lead| &lead.0));
        if matches!(self.settings.costing.safety, Safety::Boxes(_)) {
            return Err(SolveError::NoGradient);
        }
        if !initial.is_finite() {
            return Err(SolveError::InitialControls);
        }
        self.iterates[0].clone_from(initial);
        self.done = 0;
        let mut before = f64::NAN;
        for k in 0..self.settings.iterations {
            self.evaluate(problem, k, k)?;
            if k > 0 && self.converged(before) {
                break;
            }
            before = self.at.objective;
            self.factorize(problem, k)?;
            let Scratch { right, step, .. } = &mut *self.scratch;
            self.normal.solve(&[Part::alone(&self.at, &problem.weights)], from_ref(right), from_mut(step));
            let (done, next) = self.iterates.split_at_mut(k + 1);
            next[0].clone_from(&done[k]);
            next[0].add_scaled(-self.settings.step, &self.scratch.step);
            self.done = k + 1;
        }
        self.evaluate_last(problem)?;
        self.objective = self.at.objective;
        self.output.roll_out(&self.settings.output_model, problem.av.state, &self.iterates[self.done]);
        Ok(())
    }

    /// Whether the iteration that led here from an objective of `before` makes another one needless.
    fn converged(&self, before: f64) -> bool {
        let LayerSettings { absolute_tolerance, relative_tolerance, .. } = self.settings;
        self.at.objective < absolute_tolerance
            || settled(before, self.at.objective, absolute_tolerance, relative_tolerance)
    }

    /// Evaluates iterate `k`, as it is when the batch is evaluated for the `evaluation`th time, from 0.
    fn evaluate(&mut self, problem: &Problem, k: usize, evaluation: usize) -> Result<(), SolveError> {
        self.at.evaluate_led(problem, &self.settings.costing, &self.iterates[k], self.lead.at(evaluation));
        self.chosen[k] = self.at.nearest;
        if self.at.objective.is_finite() { Ok(()) } else { Err(SolveError::Objective { iterations: k }) }
    }

    /// Evaluates where the last iteration led, when the batch's last iteration is over.
    fn evaluate_last(&mut self, problem: &Problem) -> Result<(), SolveError> {
        self.evaluate(problem, self.done, self.settings.iterations)
    }

    /// Evaluates and factorizes at iterate `k`; the gradient goes into `right`.
    fn linearize(&mut self, problem: &Problem, k: usize) -> Result<(), SolveError> {
        self.evaluate(problem, k, k)?;
        self.factorize(problem, k)
    }

    /// Factorizes at iterate `k`, which was evaluated last.
    fn factorize(&mut self, problem: &Problem, k: usize) -> Result<(), SolveError> {
        self.normal
            .factorize(&[Part::alone(&self.at, &problem.weights)], STEPS)
            .map_err(|pivot| SolveError::Singular { iteration: k, step: pivot.step })?;
        self.at.gradient(problem, &mut self.scratch.multipliers, &mut self.scratch.right);
        Ok(())
    }

    /// The controls after the last iteration.
    #[must_use]
    pub fn controls(&self) -> &Controls {
        &self.iterates[self.done]
    }

    /// The initial controls and those after each iteration.
    #[must_use]
    pub fn iterates(&self) -> &[Controls] {
        &self.iterates[..=self.done]
    }

    /// The neighbors that were nearest at each of these, as [`Layer::forward_led`] wants them of a batch's first sample.
    #[must_use]
    pub fn choices(&self) -> Choices {
        Choices(self.chosen[..=self.done].to_vec())
    }

    /// The rollout that the loss looks at.
    #[must_use]
    pub fn output(&self) -> &Motion {
        &self.output
    }

    /// Half the sum of squared residuals at [`Layer::controls`].
    #[must_use]
    pub fn objective(&self) -> f64 {
        self.objective
    }

    /// The gradient by what was put in, of that by what was put out by the last [`Layer::forward`] of the same problem.
    ///
    /// # Errors
    /// [`SolveError`].
    pub fn backward(
        &mut self,
        problem: &Problem,
        output: &OutputGradient,
        gradients: &mut Gradients,
    ) -> Result<(), SolveError> {
        gradients.controls.clone_from(&output.controls);
        gradients.predictions = [[(0.0, 0.0); KEY_STEPS.len()]; NEIGHBORS];
        gradients.weights = [0.0; TERMS];
        self.output.pull_back(&output.poses, &mut gradients.controls);
        if output.squares != 0.0 {
            self.evaluate_last(problem)?;
            self.pull_back_squares(problem, output.squares, gradients);
        }
        for k in (0..self.done).rev() {
            self.linearize(problem, k)?;
            self.pull_back_iteration(problem, gradients);
        }
        Ok(())
    }

    /// Of `factor * sum (w c)^2`.
    fn pull_back_squares(&mut self, problem: &Problem, factor: f64, gradients: &mut Gradients) {
        let multipliers = &mut self.scratch.multipliers;
        multipliers.set_weighted(&problem.weights, &self.at.rows, None);
        self.at.pull_back_values(multipliers, &mut self.scratch.change);
        gradients.controls.add_scaled(2.0 * factor, &self.scratch.change);
        for (term, rows) in self.at.rows.parts() {
            let squares: f64 = rows.iter().map(|c| c * c).sum();
            gradients.weights[term as usize] += 2.0 * factor * problem.weights[term as usize] * squares;
        }
        for (i, row) in self.at.safety().iter().enumerate() {
            let scale = 2.0 * factor * multipliers.safety[i];
            let by = &mut gradients.predictions[row.neighbor][row.key];
            by.0 += scale * row.value_away.0;
            by.1 += scale * row.value_away.1;
        }
    }

    /// Back through the iteration that was linearized last.
    fn pull_back_iteration(&mut self, problem: &Problem, gradients: &mut Gradients) {
        let Scratch {
            right,
            step,
            adjoint,
            step_change,
            adjoint_change,
            step_rows,
            adjoint_rows,
            multipliers,
            direct,
            change,
        } = &mut *self.scratch;
        // The normal equations give minus the step.
        let parts = [Part::alone(&self.at, &problem.weights)];
        self.normal.solve(&parts, from_ref(right), from_mut(change));
        *step = Controls::ZERO;
        step.add_scaled(-1.0, change);
        self.normal.solve(&parts, from_ref(&gradients.controls), from_mut(change));
        *adjoint = Controls::ZERO;
        adjoint.add_scaled(self.settings.step, change);
        self.at.push_forward(step, step_change, step_rows);
        self.at.push_forward(adjoint, adjoint_change, adjoint_rows);

        let (rows, along_step) = (self.at.rows.parts(), step_rows.parts());
        for (((term, l), (_, c)), (_, d)) in adjoint_rows.parts().iter().zip(rows).zip(along_step) {
            let sum: f64 = l.iter().zip(c).zip(d).map(|((l, c), d)| l * (c + d)).sum();
            gradients.weights[*term as usize] -= 2.0 * problem.weights[*term as usize] * sum;
        }

        // m . dr and m' dJ d
        multipliers.set_weighted(&problem.weights, adjoint_rows, None);
        self.at.pull_back_values(multipliers, change);
        gradients.controls.add_scaled(-1.0, change);
        for (i, row) in self.at.safety().iter().enumerate() {
            let by = &mut gradients.predictions[row.neighbor][row.key];
            by.0 -= multipliers.safety[i] * row.value_away.0;
            by.1 -= multipliers.safety[i] * row.value_away.1;
        }
        pull_back_curvature(&self.at, multipliers, step, step_change, direct, change, gradients);
        // p' dJ l
        multipliers.set_weighted(&problem.weights, &self.at.rows, Some(step_rows));
        pull_back_curvature(&self.at, multipliers, adjoint, adjoint_change, direct, change, gradients);
    }
}

/// Subtracts the gradient by controls and predictions of `multipliers . (Jacobian direction)`, the rows before weighting.
fn pull_back_curvature(
    at: &Evaluation,
    multipliers: &Rows,
    direction: &Controls,
    states: &[StateChange; STEPS],
    direct: &mut [StateChange; STEPS],
    change: &mut Controls,
    gradients: &mut Gradients,
) {
    *direct = [StateChange::default(); STEPS];
    for (row, multiplier) in at.safety().iter().zip(&multipliers.safety) {
        // At one place, or not in the Jacobian.
        if row.away == (0.0, 0.0) {
            continue;
        }
        // The row changes by -away . s; away turns as (s - away (away . s)) / distance.
        let t = row.step;
        let (s, (ax, ay)) = (&states[t], row.away);
        let along = ax * s.x + ay * s.y;
        let (x, y) = (multiplier * (s.x - ax * along) / row.distance, multiplier * (s.y - ay * along) / row.distance);
        direct[t].x -= x;
        direct[t].y -= y;
        let by = &mut gradients.predictions[row.neighbor][row.key];
        by.0 -= x;
        by.1 -= y;
    }
    for (i, edge) in at.edge.iter().enumerate().take(at.rows.extent.lane_edge) {
        if *edge == (0.0, 0.0) {
            continue;
        }
        // The row changes by edge . s; edge points away from the line's sample, and turns about it.
        let t = lane_step(i);
        let s = &states[t];
        let (x, y) = (at.rows.lane_x[i], at.rows.lane_y[i]);
        let turn = multipliers.lane_edge[i] * (edge.0 * s.y - edge.1 * s.x) / (x * x + y * y);
        direct[t].x -= turn * y;
        direct[t].y += turn * x;
    }
    *change = Controls::ZERO;
    at.motion.pull_back_curvature(direction, states, &at.state_gradient(multipliers), direct, change);
    gradients.controls.add_scaled(-1.0, change);
}
