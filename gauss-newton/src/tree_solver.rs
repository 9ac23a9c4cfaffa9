//! The search over a tree's controls. That over a chain's (`solver`) is this one, over a tree of one branch.

use super::controls::Controls;
use super::linear::{LinearSolver, NormalEquations};
use super::objective::{Costing, Evaluation};
use super::rows::Rows;
use super::solver::{Settings, SolveError, Status, Summary};
use super::sweep::BadPivot;
use super::tree::{BRANCHES, Part, Tree, TreeControls, TreeError};

/// Solves trees. What it needs is allocated once; with [`LinearSolver::Sweep`] a solve allocates nothing.
#[derive(Clone, Debug)]
pub struct TreeSolver {
    at: Point,
    trial: Point,
    normal: NormalEquations,
    rows: Box<Rows>,
    gradient: TreeControls,
    step: TreeControls,
    controls: TreeControls,
    candidate: TreeControls,
    best: TreeControls,
    history: Vec<f64>,
}

/// Each branch evaluated at some controls, and the tree's objective there.
#[derive(Clone, Debug)]
struct Point {
    /// As many as a tree may have branches.
    branches: Vec<Evaluation>,
    objective: f64,
}

impl Point {
    fn evaluate(&mut self, tree: &Tree<'_>, costing: &Costing, controls: &TreeControls) {
        self.objective = 0.0;
        for ((at, branch), controls) in self.branches.iter_mut().zip(tree.branches).zip(controls.branches()) {
            at.evaluate(branch.problem, costing, controls);
            self.objective += branch.probability * at.objective;
        }
    }

    /// Begins the search for nearest samples where `other` found its own.
    fn start_search_at(&mut self, other: &Self) {
        self.branches.iter_mut().zip(&other.branches).for_each(|(own, other)| own.start_search_at(other));
    }

    /// Calls `with` with the tree's branches as the normal equations see them.
    fn with_parts<T>(&self, tree: &Tree<'_>, with: impl FnOnce(&[Part<'_>]) -> T) -> T {
        let mut parts = [Part::alone(&self.branches[0], &tree.branches[0].problem.weights); BRANCHES];
        let there = self.branches.iter().zip(tree.branches);
        let count = there.len().min(BRANCHES);
        for (part, (at, branch)) in parts.iter_mut().zip(there) {
            *part = Part { at, weights: &branch.problem.weights, probability: branch.probability };
        }
        with(&parts[..count])
    }
}

impl TreeSolver {
    /// A solver of trees of at most [`BRANCHES`] branches, by this linear solver.
    #[must_use]
    pub fn new(linear: LinearSolver) -> Self {
        Self::with_branches(linear, BRANCHES)
    }

    /// One of trees of at most so many branches.
    pub(super) fn with_branches(linear: LinearSolver, most: usize) -> Self {
        let point = || Point { branches: vec![Evaluation::default(); most], objective: 0.0 };
        let controls = || TreeControls::with_room(most);
        Self {
            at: point(),
            trial: point(),
            normal: NormalEquations::new(linear, most),
            rows: Box::new(Rows::ZERO),
            gradient: controls(),
            step: controls(),
            controls: controls(),
            candidate: controls(),
            best: controls(),
            history: Vec::with_capacity(128),
        }
    }

    /// Searches from `initial`: one for all branches, or one for each; the trunk is that of the first. The result is in
    /// [`TreeSolver::best`].
    ///
    /// # Errors
    /// [`TreeError`]: the tree is none, or the search does not begin. A singular matrix, or an objective that is no number later on,
    /// ends the search, but is no error: what is best by then stands.
    pub fn solve(&mut self, tree: &Tree<'_>, settings: &Settings, initial: &[Controls]) -> Result<Summary, TreeError> {
        tree.check(self.at.branches.len())?;
        let (branches, got) = (tree.branches.len(), initial.len());
        if got != 1 && got != branches {
            return Err(TreeError::Initial { branches, got });
        }
        Ok(self.search(tree, settings, initial)?)
    }

    /// [`TreeSolver::solve`] of a checked tree.
    pub(super) fn search(
        &mut self,
        tree: &Tree<'_>,
        settings: &Settings,
        initial: &[Controls],
    ) -> Result<Summary, SolveError> {
        self.start(tree, &settings.costing, initial)?;
        self.best.clone_from(&self.controls);
        self.history.clear();
        self.history.push(self.at.objective);
        let mut summary =
            Summary { status: Status::IterationLimit, iterations: 0, best_after: 0, best_objective: self.at.objective };
        self.iterate(tree, settings, settings.iterations, &mut summary, Self::fixed_step);
        if settings.polish > 0 && !matches!(summary.status, Status::Singular { .. }) {
            self.controls.clone_from(&self.best);
            self.at.evaluate(tree, &settings.costing, &self.best);
            self.iterate(tree, settings, settings.polish, &mut summary, Self::downhill_step);
        }
        Ok(summary)
    }

    /// Goes to the initial controls.
    fn start(&mut self, tree: &Tree<'_>, costing: &Costing, initial: &[Controls]) -> Result<(), SolveError> {
        for controls in [&mut self.controls, &mut self.gradient, &mut self.step, &mut self.candidate] {
            controls.set(tree, initial);
        }
        if !self.controls.is_finite() {
            return Err(SolveError::InitialControls);
        }
        self.at.evaluate(tree, costing, &self.controls);
        if self.at.objective.is_finite() { Ok(()) } else { Err(SolveError::Objective { iterations: 0 }) }
    }

    /// At most `limit` steps by one rule.
    fn iterate(
        &mut self,
        tree: &Tree<'_>,
        settings: &Settings,
        limit: usize,
        summary: &mut Summary,
        step: fn(&mut Self, &Tree<'_>, &Settings) -> Result<(), BadPivot>,
    ) {
        summary.status = Status::IterationLimit;
        for _ in 0..limit {
            let before = self.at.objective;
            if let Err(pivot) = step(self, tree, settings) {
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
    fn gauss_newton_step(&mut self, tree: &Tree<'_>) -> Result<(), BadPivot> {
        let Self { at, normal, rows, gradient, step, .. } = self;
        at.with_parts(tree, |parts| {
            normal.factorize(parts, tree.trunk)?;
            for ((part, branch), gradient) in parts.iter().zip(tree.branches).zip(gradient.branches_mut()) {
                part.at.gradient(branch.problem, rows, gradient);
            }
            gradient.add_up_gradient(tree);
            normal.solve(parts, gradient.branches(), step.branches_mut());
            Ok(())
        })
    }

    fn fixed_step(&mut self, tree: &Tree<'_>, settings: &Settings) -> Result<(), BadPivot> {
        self.gauss_newton_step(tree)?;
        self.controls.add_scaled(-settings.step, &self.step);
        self.at.evaluate(tree, &settings.costing, &self.controls);
        Ok(())
    }

    fn downhill_step(&mut self, tree: &Tree<'_>, settings: &Settings) -> Result<(), BadPivot> {
        /// The objective must fall by this share of what the gradient promises (Armijo).
        const SHARE: f64 = 1e-4;
        /// The smallest step tried is half to this power.
        const HALVINGS: usize = 10;
        self.gauss_newton_step(tree)?;
        let promised = self.gradient.dot(&self.step);
        let mut size = 1.0;
        for _ in 0..HALVINGS {
            self.candidate.clone_from(&self.controls);
            self.candidate.add_scaled(-size, &self.step);
            self.trial.start_search_at(&self.at);
            self.trial.evaluate(tree, &settings.costing, &self.candidate);
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
    pub fn best(&self) -> &TreeControls {
        &self.best
    }

    /// The controls after the last iteration.
    #[must_use]
    pub fn last(&self) -> &TreeControls {
        &self.controls
    }

    /// The objective at the start and after each iteration.
    #[must_use]
    pub fn history(&self) -> &[f64] {
        &self.history
    }

    /// Each branch of the tree that was solved last, evaluated at the best controls: its terms, its states, the rows that bind.
    pub fn evaluate_best(&mut self, tree: &Tree<'_>, costing: &Costing) -> &[Evaluation] {
        self.at.evaluate(tree, costing, &self.best);
        let there = self.best.branches().len().min(tree.branches.len());
        &self.at.branches[..there]
    }

    /// The Gauss-Newton step of a checked tree at these controls, whole; it is to be subtracted.
    pub(super) fn step_at(
        &mut self,
        tree: &Tree<'_>,
        costing: &Costing,
        controls: &[Controls],
    ) -> Result<&TreeControls, SolveError> {
        self.start(tree, costing, controls)?;
        self.gauss_newton_step(tree).map_err(|pivot| SolveError::Singular { iteration: 0, step: pivot.step })?;
        Ok(&self.step)
    }
}
