//! The two solvers of the normal equations behind one face. They give the same step.

use super::controls::Controls;
use super::dense::Dense;
use super::sweep::{BadPivot, Sweep};
use super::tree::Part;

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
    /// For trees of at most so many branches.
    pub fn new(which: LinearSolver, branches: usize) -> Self {
        match which {
            LinearSolver::Sweep => Self::Sweep(Box::new(Sweep::new(branches))),
            LinearSolver::Dense => Self::Dense(Box::default()),
        }
    }

    pub fn factorize(&mut self, parts: &[Part<'_>], trunk: usize) -> Result<(), BadPivot> {
        match self {
            Self::Sweep(sweep) => sweep.factorize(parts, trunk),
            Self::Dense(dense) => dense.factorize(parts, trunk),
        }
    }

    /// Solves for the tree that was factorized last.
    pub fn solve(&mut self, parts: &[Part<'_>], right: &[Controls], solution: &mut [Controls]) {
        match self {
            Self::Sweep(sweep) => sweep.solve(parts, right, solution),
            Self::Dense(dense) => dense.solve(right, solution),
        }
    }
}
