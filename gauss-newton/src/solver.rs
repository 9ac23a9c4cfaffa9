//! Gauss-Newton: linearize, solve, step, until it no longer pays.
//!
//! The objective is not smooth: safety rows switch on where a neighbor comes into the path, and the nearest sample jumps. The
//! authors' steps go on whether or not the objective falls, which takes them across such edges, and the best iterate is kept.
//! A search that only goes down stops at the first edge; but begun at their best iterate it never ends higher, and mostly lower
//! by far. So that is what the globalized search is: theirs, then a line search from what it found.

use thiserror::Error;
use world::vehicle::{BicycleModel, Limits};

use super::constants::STEPS;
use super::controls::Controls;
use super::linear::{LinearSolver, NormalEquations};
use super::motion::Motion;
use super::objective::{Costing, Evaluation, Safety};
use super::problem::Problem;
use super::rows::Rows;
use super::sweep::BadPivot;

/// How a solve goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// What the objective is made of.
    pub costing: Costing,
    /// The share of the Gauss-Newton step that is taken, whether or not the objective falls.
    pub step: f64,
    /// The most iterations of that kind.
    pub iterations: usize,
    /// The most iterations after them, from the best iterate, by the largest of 1, 1/2, 1/4, ... of the step that lets the
    /// objective fall. The authors have none.
    pub polish: usize,
    /// Converged where the objective, or its change by an iteration, is below this.
    pub absolute_tolerance: f64,
    /// Converged where the objective's relative change by an iteration is below this.
    pub relative_tolerance: f64,
}

impl Settings {
    /// What the authors test with. The best iterate is the result.
    #[must_use]
    pub const fn paper_test() -> Self {
        Self {
            costing: Costing {
                model: BicycleModel::authors_planner(),
                wrap_heading: false,
                safety: Safety::Nearest,
                from_present: false,
                steering_rate: f64::INFINITY,
                lane_edge: f64::INFINITY,
            },
            step: 0.2,
            iterations: 50,
            polish: 0,
            absolute_tolerance: 1e-2,
            relative_tolerance: 1e-8,
        }
    }

    /// What the authors train with. The last iterate is the result.
    #[must_use]
    pub const fn paper_training() -> Self {
        Self { step: 0.4, iterations: 2, absolute_tolerance: 1e-10, ..Self::paper_test() }
    }

    /// Whether an iteration that took the objective from `before` to `now` changed so little that another will not pay.
    #[must_use]
    pub fn settled(&self, before: f64, now: f64) -> bool {
        settled(before, now, self.absolute_tolerance, self.relative_tolerance)
    }

    /// The better of what was measured (`docs/planner.md`): the objective of the vehicle that is driven, from what it does now on
    /// and as fast as its wheels turn, headings compared as angles, a lane with an edge, and a polish.
    #[must_use]
    pub const fn strict(model: BicycleModel) -> Self {
        let paper = Self::paper_test();
        let costing = Costing {
            model,
            wrap_heading: true,
            // Everyone's makes no drive better, and is harder to minimize.
            safety: Safety::Nearest,
            from_present: true,
            steering_rate: Limits::STRICT.steering_rate,
            lane_edge: 1.0,
        };
        Self { costing, polish: 50, ..paper }
    }
}

/// How a solve ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// Another iteration would change little.
    Converged,
    /// It was stopped.
    IterationLimit,
    /// The objective became infinite or not a number; what was best by then is the result.
    Diverged,
    /// The normal matrix was singular; what was best by then is the result.
    Singular {
        /// The step whose control has no effect on the objective.
        step: usize,
    },
}

impl Status {
    /// Its name in messages.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Converged => "converged",
            Self::IterationLimit => "iteration limit",
            Self::Diverged => "diverged",
            Self::Singular { .. } => "singular",
        }
    }
}

/// Why there is no plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum SolveError {
    /// The controls to start from are not numbers.
    #[error("the initial controls are not finite")]
    InitialControls,
    /// The objective is infinite or not a number: at the initial controls, or on the way where a gradient is wanted.
    #[error("the objective is not finite after {iterations} iterations")]
    Objective {
        /// Iterations done.
        iterations: usize,
    },
    /// The normal matrix cannot be factorized, and a gradient is wanted.
    #[error("the normal matrix of iteration {iteration} is singular: the control of step {step} costs nothing")]
    Singular {
        /// Which iteration, from 0.
        iteration: usize,
        /// The control's step.
        step: usize,
    },
}

/// What a solve came to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Summary {
    /// How it ended.
    pub status: Status,
    /// Iterations done.
    pub iterations: usize,
    /// After how many iterations the best controls were found; 0 for the initial ones.
    pub best_after: usize,
    /// Their objective.
    pub best_objective: f64,
}

/// Solves problems. What it needs is allocated once; with [`LinearSolver::Sweep`] a solve allocates nothing.
#[derive(Clone, Debug)]
pub struct Solver {
    at: Box<Evaluation>,
    trial: Box<Evaluation>,
    normal: NormalEquations,
    rows: Box<Rows>,
    gradient: Controls,
    step: Controls,
    controls: Controls,
    candidate: Controls,
    best: Controls,
    history: Vec<f64>,
}

impl Solver {
    /// A solver by this linear solver.
    #[must_use]
    pub fn new(linear: LinearSolver) -> Self {
        Self {
            at: Box::default(),
            trial: Box::default(),
            normal: NormalEquations::new(linear),
            rows: Box::new(Rows::ZERO),
            gradient: Controls::ZERO,
            step: Controls::ZERO,
            controls: Controls::ZERO,
            candidate: Controls::ZERO,
            best: Controls::ZERO,
            history: Vec::with_capacity(128),
        }
    }

    /// Searches from `initial`. The result is in [`Solver::best`] and [`Solver::last`].
    ///
    /// # Errors
    /// [`SolveError::InitialControls`], and [`SolveError::Objective`] of those. A singular matrix, or an objective that is no number later
    /// on, ends the search, but is no error: what is best by then stands.
    pub fn solve(&mut self, problem: &Problem, settings: &Settings, initial: &Controls) -> Result<Summary, SolveError> {
        if !initial.is_finite() {
            return Err(SolveError::InitialControls);
        }
        self.controls.clone_from(initial);
        self.best.clone_from(initial);
        self.at.evaluate(problem, &settings.costing, initial);
        self.history.clear();
        self.history.push(checked(self.at.objective, 0)?);
        let mut summary =
            Summary { status: Status::IterationLimit, iterations: 0, best_after: 0, best_objective: self.at.objective };
        self.iterate(problem, settings, settings.iterations, &mut summary, Self::fixed_step);
        if settings.polish > 0 && !matches!(summary.status, Status::Singular { .. }) {
            self.controls.clone_from(&self.best);
            self.at.evaluate(problem, &settings.costing, &self.best);
            self.iterate(problem, settings, settings.polish, &mut summary, Self::downhill_step);
        }
        Ok(summary)
    }

    /// At most `limit` steps by one rule.
    fn iterate(
        &mut self,
        problem: &Problem,
        settings: &Settings,
        limit: usize,
        summary: &mut Summary,
        step: fn(&mut Self, &Problem, &Settings) -> Result<(), BadPivot>,
    ) {
        summary.status = Status::IterationLimit;
        for _ in 0..limit {
            let before = self.at.objective;
            if let Err(pivot) = step(self, problem, settings) {
                summary.status = Status::Singular { step: pivot.step };
                break;
            }
            summary.iterations += 1;
            let now = self.at.objective;
            self.history.push(now);
            if !now.is_finite() {
                // The authors' factorization fails on it.
                summary.status = Status::Diverged;
                break;
            }
            if now < summary.best_objective {
                summary.best_objective = now;
                summary.best_after = summary.iterations;
                self.best.clone_from(&self.controls);
            }
            if now < settings.absolute_tolerance || settings.settled(before, now) {
                summary.status = Status::Converged;
                break;
            }
        }
    }

    /// Solves for the Gauss-Newton step at the present controls; it is to be subtracted.
    fn gauss_newton_step(&mut self, problem: &Problem) -> Result<(), BadPivot> {
        self.normal.factorize(&self.at, &problem.weights)?;
        self.at.gradient(problem, &mut self.rows, &mut self.gradient);
        self.normal.solve(&self.at, &self.gradient, &mut self.step);
        Ok(())
    }

    fn fixed_step(&mut self, problem: &Problem, settings: &Settings) -> Result<(), BadPivot> {
        self.gauss_newton_step(problem)?;
        self.controls.add_scaled(-settings.step, &self.step);
        self.at.evaluate(problem, &settings.costing, &self.controls);
        Ok(())
    }

    fn downhill_step(&mut self, problem: &Problem, settings: &Settings) -> Result<(), BadPivot> {
        /// The objective must fall by this share of what the gradient promises (Armijo).
        const SHARE: f64 = 1e-4;
        /// The smallest step tried is half to this power.
        const HALVINGS: usize = 10;
        self.gauss_newton_step(problem)?;
        let promised = self.gradient.dot(&self.step);
        let mut size = 1.0;
        for _ in 0..HALVINGS {
            self.candidate.clone_from(&self.controls);
            self.candidate.add_scaled(-size, &self.step);
            self.trial.start_search_at(&self.at);
            self.trial.evaluate(problem, &settings.costing, &self.candidate);
            if self.trial.objective <= self.at.objective - SHARE * size * promised {
                std::mem::swap(&mut self.at, &mut self.trial);
                std::mem::swap(&mut self.controls, &mut self.candidate);
                break;
            }
            size *= 0.5;
        }
        Ok(())
    }

    /// The controls of the lowest objective seen.
    #[must_use]
    pub fn best(&self) -> &Controls {
        &self.best
    }

    /// The controls after the last iteration.
    #[must_use]
    pub fn last(&self) -> &Controls {
        &self.controls
    }

    /// The objective at the start and after each iteration.
    #[must_use]
    pub fn history(&self) -> &[f64] {
        &self.history
    }

    /// The Gauss-Newton step at these controls, whole.
    ///
    /// # Errors
    /// [`SolveError`].
    pub fn step_at(
        &mut self,
        problem: &Problem,
        costing: &Costing,
        controls: &Controls,
    ) -> Result<Controls, SolveError> {
        if !controls.is_finite() {
            return Err(SolveError::InitialControls);
        }
        self.at.evaluate(problem, costing, controls);
        checked(self.at.objective, 0)?;
        self.gauss_newton_step(problem).map_err(|pivot| SolveError::Singular { iteration: 0, step: pivot.step })?;
        let mut step = Controls::ZERO;
        step.add_scaled(-1.0, &self.step);
        Ok(step)
    }
}

/// [`Settings::settled`] with these tolerances.
pub(super) fn settled(before: f64, now: f64, absolute: f64, relative: f64) -> bool {
    let change = (before - now).abs();
    change < absolute || change / before < relative
}

fn checked(objective: f64, iterations: usize) -> Result<f64, SolveError> {
    if objective.is_finite() { Ok(objective) } else { Err(SolveError::Objective { iterations }) }
}

/// The poses and speeds that controls lead to under a vehicle model.
#[must_use]
pub fn trajectory(
    problem: &Problem,
    model: &BicycleModel,
    controls: &Controls,
) -> [world::vehicle::VehicleState; STEPS] {
    let mut motion = Motion::default();
    motion.roll_out(model, problem.av.state, controls);
    motion.states
}
