//! Gauss-Newton: linearize, solve, step, until it no longer pays.
//!
//! The objective is not smooth: safety rows switch on where a neighbor comes into the path, and the nearest sample jumps. The
//! authors' steps go on whether or not the objective falls, which takes them across such edges, and the best iterate is kept.
//! A search that only goes down stops at the first edge; but begun at their best iterate it never ends higher, and mostly lower
//! by far. So that is what the globalized search is: theirs, then a line search from what it found.

use std::slice::from_ref;

use thiserror::Error;
use world::vehicle::{BicycleModel, Limits};

use super::constants::STEPS;
use super::controls::Controls;
use super::linear::LinearSolver;
use super::motion::Motion;
use super::objective::{Costing, Safety};
use super::problem::Problem;
use super::shapes::Margins;
use super::tree::{Branch, Tree};
use super::tree_solver::TreeSolver;

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

    /// `strict`, with safety by the shapes of all and how uncertain they are ([`Safety::Boxes`]): what a tree of futures is costed by.
    #[must_use]
    pub const fn contingency(model: BicycleModel) -> Self {
        let strict = Self::strict(model);
        Self { costing: Costing { safety: Safety::Boxes(Margins::DEFAULT), ..strict.costing }, ..strict }
    }

    /// The same objective, and at most so many steps downhill: from a good start.
    #[must_use]
    pub const fn refining(self, steps: usize) -> Self {
        Self { iterations: 0, polish: steps, ..self }
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
    /// A gradient is wanted, and boxes have none by what training learns.
    #[error("there is no gradient through the distances of boxes")]
    NoGradient,
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
    tree: TreeSolver,
}

/// Calls `with` with the tree that has this branch alone.
fn as_tree<T>(problem: &Problem, with: impl FnOnce(&Tree<'_>) -> T) -> T {
    with(&Tree { trunk: STEPS, branches: &[Branch { problem, probability: 1.0 }] })
}

impl Solver {
    /// A solver by this linear solver.
    #[must_use]
    pub fn new(linear: LinearSolver) -> Self {
        Self { tree: TreeSolver::with_branches(linear, 1) }
    }

    /// Searches from `initial`. The result is in [`Solver::best`] and [`Solver::last`].
    ///
    /// # Errors
    /// [`SolveError::InitialControls`], and [`SolveError::Objective`] of those. A singular matrix, or an objective that is no number later
    /// on, ends the search, but is no error: what is best by then stands.
    pub fn solve(&mut self, problem: &Problem, settings: &Settings, initial: &Controls) -> Result<Summary, SolveError> {
        as_tree(problem, |tree| self.tree.search(tree, settings, from_ref(initial)))
    }

    /// The controls of the lowest objective seen.
    #[must_use]
    pub fn best(&self) -> &Controls {
        self.tree.best().first()
    }

    /// The controls after the last iteration.
    #[must_use]
    pub fn last(&self) -> &Controls {
        self.tree.last().first()
    }

    /// The objective at the start and after each iteration.
    #[must_use]
    pub fn history(&self) -> &[f64] {
        self.tree.history()
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
        let mut step = Controls::ZERO;
        as_tree(problem, |tree| {
            step.add_scaled(-1.0, self.tree.step_at(tree, costing, from_ref(controls))?.first());
            Ok(step)
        })
    }
}

/// [`Settings::settled`] with these tolerances.
pub(super) fn settled(before: f64, now: f64, absolute: f64, relative: f64) -> bool {
    let change = (before - now).abs();
    change < absolute || change / before < relative
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
