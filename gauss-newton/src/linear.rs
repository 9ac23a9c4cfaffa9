//! The two solvers of the normal equations behind one face. They give the same step.

use super::constants::TERMS;
use super::controls::Controls;
use super::dense::Dense;
use super::objective::Evaluation;
use super::sweep::{BadPivot, Sweep};

/// Which one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinearSolver {
    /// Along the chain of steps: the fast one.
    Sweep,
    /// A dense Cholesky factorization: the reference. It allocates.
    Dense,
}

/// The factorized normal matrix of either.
#[derive(Clone, Debug)]
pub(super) enum NormalEquations {
    Sweep(Box<Sweep>),
    Dense(Box<Dense>),
}

impl NormalEquations {
    pub fn new(which: LinearSolver) -> Self {
        match which {
            LinearSolver::Sweep => Self::Sweep(Box::default()),
            LinearSolver::Dense => Self::Dense(Box::default()),
        }
    }

    pub fn factorize(&mut self, at: &Evaluation, weights: &[f64; TERMS]) -> Result<(), BadPivot> {
        match self {
            Self::Sweep(sweep) => sweep.factorize(at, weights),
            Self::Dense(dense) => dense.factorize(at, weights),
        }
    }

    pub fn solve(&mut self, at: &Evaluation, right: &Controls, solution: &mut Controls) {
        match self {
            Self::Sweep(sweep) => sweep.solve(at, right, solution),
            Self::Dense(dense) => dense.solve(right, solution),
        }
    }
}
