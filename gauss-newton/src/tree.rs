//! A tree of futures: what the AV does first has to do for all of them, what it does later for each.
//!
//! ```text
//!                    ┌── branch 0, with probability p0: the controls from step `trunk` on, this future's neighbors
//!  trunk ────────────┼── branch 1, p1
//!  (steps 0..trunk)  └── branch 2, p2              objective = p0 * (its objective) + p1 * ... + p2 * ...
//! ```
//!
//! Each branch is a problem of its own over all fifty steps; they share the AV and what it does now, so that the trunk leads to the same states
//! in all. A trunk of fifty steps is one plan that is costed under every future; none is a plan for each.

use thiserror::Error;

use super::constants::{STEPS, TERMS};
use super::controls::Controls;
use super::objective::Evaluation;
use super::problem::Problem;
use super::solver::SolveError;

/// The most branches of a tree.
pub const BRANCHES: usize = 3;

/// How many steps the branches share unless told otherwise: one second.
pub const TRUNK: usize = 10;

/// One future.
#[derive(Clone, Copy, Debug)]
pub struct Branch<'a> {
    /// What is to be solved there.
    pub problem: &'a Problem,
    /// Its probability.
    pub probability: f64,
}

/// Futures whose controls are the same up to a step.
#[derive(Clone, Copy, Debug)]
pub struct Tree<'a> {
    /// So many controls are shared: 0 to [`STEPS`].
    pub trunk: usize,
    /// At least one, at most [`BRANCHES`]. Probabilities are positive and sum up to 1.
    pub branches: &'a [Branch<'a>],
}

/// Why a tree has no plan.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum TreeError {
    /// There are too few or too many.
    #[error("a tree has 1 to {most} branches, not {got}")]
    Branches {
        /// As many as the solver was made for.
        most: usize,
        /// As many as there are.
        got: usize,
    },
    /// The plan is shorter.
    #[error("a trunk has 0 to {STEPS} steps, not {got}")]
    Trunk {
        /// As many as were wanted.
        got: usize,
    },
    /// It is zero, negative, or no number.
    #[error("the probability of branch {branch} is {got}, not more than 0")]
    Probability {
        /// Which branch.
        branch: usize,
        /// Its probability.
        got: f64,
    },
    /// They are no distribution.
    #[error("the branches' probabilities sum up to {got}, not 1")]
    Sum {
        /// Their sum.
        got: f64,
    },
    /// A trunk does not lead to the same states in all branches.
    #[error("branch {branch} begins with another AV than the first")]
    OtherAv {
        /// Which branch.
        branch: usize,
    },
    /// There are controls to start from for some of the branches.
    #[error("there are initial controls for {got} branches of {branches}; one for all will do")]
    Initial {
        /// As many as there are branches.
        branches: usize,
        /// As many as there are controls.
        got: usize,
    },
    /// The search does not begin.
    #[error(transparent)]
    Solve(#[from] SolveError),
}

impl Tree<'_> {
    /// Checks it for a solver of so many branches.
    pub(super) fn check(&self, most: usize) -> Result<(), TreeError> {
        /// Probabilities come in single precision.
        const ROUNDING: f64 = 1e-6;
        let got = self.branches.len();
        if got == 0 || got > most {
            return Err(TreeError::Branches { most, got });
        }
        if self.trunk > STEPS {
            return Err(TreeError::Trunk { got: self.trunk });
        }
        let begin = |branch: &Branch<'_>| (branch.problem.av.state, branch.problem.present);
        for (branch, b) in self.branches.iter().enumerate() {
            if !(b.probability > 0.0 && b.probability.is_finite()) {
                return Err(TreeError::Probability { branch, got: b.probability });
            }
            if begin(b) != begin(&self.branches[0]) {
                return Err(TreeError::OtherAv { branch });
            }
        }
        let sum: f64 = self.branches.iter().map(|b| b.probability).sum();
        if (sum - 1.0).abs() > ROUNDING {
            return Err(TreeError::Sum { got: sum });
        }
        Ok(())
    }
}

/// The controls of each branch. The first steps of all are the same.
#[derive(Debug, PartialEq)]
pub struct TreeControls {
    trunk: usize,
    branches: Vec<Controls>,
}

impl Clone for TreeControls {
    fn clone(&self) -> Self {
        Self { trunk: self.trunk, branches: self.branches.clone() }
    }

    /// Into the memory that is there.
    fn clone_from(&mut self, source: &Self) {
        self.trunk = source.trunk;
        self.branches.clone_from(&source.branches);
    }
}

impl TreeControls {
    /// One branch of zeros, and room for so many.
    pub(super) fn with_room(branches: usize) -> Self {
        let mut all = Vec::with_capacity(branches);
        all.push(Controls::ZERO);
        Self { trunk: STEPS, branches: all }
    }

    /// As many as a checked tree has, from one for all or one for each. The trunk is that of the first.
    pub(super) fn set(&mut self, tree: &Tree<'_>, initial: &[Controls]) {
        self.trunk = tree.trunk;
        self.branches.clear();
        let of_branch = |k: usize| initial.get(k).or(initial.first()).unwrap_or(&Controls::ZERO).clone();
        self.branches.extend((0..tree.branches.len()).map(of_branch));
        share_trunk(self.trunk, &mut self.branches);
    }

    /// How many steps are shared.
    #[must_use]
    pub fn trunk(&self) -> usize {
        self.trunk
    }

    /// The whole controls of each branch, the trunk's first.
    #[must_use]
    pub fn branches(&self) -> &[Controls] {
        &self.branches
    }

    /// Those of the first branch; there is always one.
    pub(super) fn first(&self) -> &Controls {
        &self.branches[0]
    }

    pub(super) fn branches_mut(&mut self) -> &mut [Controls] {
        &mut self.branches
    }

    /// `self += factor * direction`.
    pub(super) fn add_scaled(&mut self, factor: f64, direction: &Self) {
        self.branches.iter_mut().zip(&direction.branches).for_each(|(own, by)| own.add_scaled(factor, by));
    }

    /// Sum of the products of both's numbers, those of the trunk once.
    pub(super) fn dot(&self, other: &Self) -> f64 {
        let mut sum = 0.0;
        for (k, (a, b)) in self.branches.iter().zip(&other.branches).enumerate() {
            if k == 0 {
                sum = a.dot(b);
            } else {
                let own = |a: &[f64; STEPS], b: &[f64; STEPS]| {
                    a.iter().zip(b).skip(self.trunk).map(|(a, b)| a * b).sum::<f64>()
                };
                sum += own(&a.acceleration, &b.acceleration) + own(&a.steering, &b.steering);
            }
        }
        sum
    }

    pub(super) fn is_finite(&self) -> bool {
        self.branches.iter().all(Controls::is_finite)
    }

    /// From the gradient of each branch's objective by its controls, that of the tree's by its: `p` times those of the branch, and in the
    /// trunk their sum.
    pub(super) fn add_up_gradient(&mut self, tree: &Tree<'_>) {
        for (gradient, branch) in self.branches.iter_mut().zip(tree.branches) {
            gradient.acceleration.iter_mut().chain(&mut gradient.steering).for_each(|g| *g *= branch.probability);
        }
        if let Some((first, others)) = self.branches.split_first_mut() {
            for t in 0..self.trunk {
                for other in &*others {
                    first.acceleration[t] += other.acceleration[t];
                    first.steering[t] += other.steering[t];
                }
            }
        }
        share_trunk(self.trunk, &mut self.branches);
    }
}

/// Gives every branch the first steps of the first.
pub(super) fn share_trunk(trunk: usize, branches: &mut [Controls]) {
    if let Some((first, others)) = branches.split_first_mut() {
        for other in others {
            other.acceleration[..trunk].copy_from_slice(&first.acceleration[..trunk]);
            other.steering[..trunk].copy_from_slice(&first.steering[..trunk]);
        }
    }
}

/// A branch as the normal equations see it.
#[derive(Clone, Copy)]
pub(super) struct Part<'a> {
    pub at: &'a Evaluation,
    pub weights: &'a [f64; TERMS],
    pub probability: f64,
}

impl<'a> Part<'a> {
    /// A chain: a tree of this alone.
    pub fn alone(at: &'a Evaluation, weights: &'a [f64; TERMS]) -> Self {
        Self { at, weights, probability: 1.0 }
    }
}
