//! The normal equations, written out: the readable reference that the sweep is held to.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::constants::{SINGULAR, STEPS, TERMS};
use super::controls::Controls;
use super::motion::StateChange;
use super::objective::Evaluation;
use super::rows::Rows;
use super::sweep::BadPivot;
use super::tree::Part;

/// Unknowns: two a step, interleaved.
pub const UNKNOWNS: usize = 2 * STEPS;

/// The factorized normal matrix.
#[derive(Clone, Debug)]
pub struct Dense {
    factor: Option<Cholesky<f64, Dyn>>,
    unknowns: Unknowns,
    right: DVector<f64>,
}

impl Default for Dense {
    fn default() -> Self {
        let unknowns = Unknowns { trunk: STEPS, branches: 1 };
        Self { factor: None, unknowns, right: DVector::zeros(UNKNOWNS) }
    }
}

/// Those of a tree: the trunk's, then each branch's own.
#[derive(Clone, Copy, Debug)]
struct Unknowns {
    trunk: usize,
    branches: usize,
}

impl Unknowns {
    fn count(self) -> usize {
        2 * (self.trunk + self.branches * (STEPS - self.trunk))
    }

    /// The place of a branch's unknown.
    fn of_tree(self, branch: usize, unknown: usize) -> usize {
        if unknown < 2 * self.trunk { unknown } else { unknown + 2 * branch * (STEPS - self.trunk) }
    }

    /// The step of a place.
    fn step(self, place: usize) -> usize {
        let own = (STEPS - self.trunk).max(1);
        if place / 2 < self.trunk { place / 2 } else { self.trunk + (place / 2 - self.trunk) % own }
    }
}

/// Row weights in the order of [`Rows::parts`], flat.
fn flat<'a>(rows: &'a Rows, weights: &'a [f64; TERMS]) -> impl Iterator<Item = f64> + 'a {
    rows.parts().into_iter().flat_map(move |(term, rows)| rows.iter().map(move |v| weights[term as usize] * v))
}

/// The weighted Jacobian: a column for each unknown, rows in the order of [`Rows::parts`].
#[must_use]
pub fn jacobian(at: &Evaluation, weights: &[f64; TERMS]) -> DMatrix<f64> {
    let mut change = [StateChange::default(); STEPS];
    let mut rows = Rows { extent: at.rows.extent, ..Rows::ZERO };
    let height = flat(&rows, weights).count();
    let mut jacobian = DMatrix::zeros(height, UNKNOWNS);
    let mut unit = Controls::ZERO;
    for (i, mut column) in jacobian.column_iter_mut().enumerate() {
        let one = if i % 2 == 0 { &mut unit.acceleration[i / 2] } else { &mut unit.steering[i / 2] };
        *one = 1.0;
        at.push_forward(&unit, &mut change, &mut rows);
        column.iter_mut().zip(flat(&rows, weights)).for_each(|(entry, v)| *entry = v);
        unit = Controls::ZERO;
    }
    jacobian
}

impl Dense {
    /// Factorizes the normal matrix of a tree with these branches.
    ///
    /// # Errors
    /// [`BadPivot`], if the matrix is singular.
    pub(super) fn factorize(&mut self, parts: &[Part<'_>], trunk: usize) -> Result<(), BadPivot> {
        self.unknowns = Unknowns { trunk, branches: parts.len() };
        let count = self.unknowns.count();
        // The sum of p J'J, and J'J that of each row's products; most entries of a row are zero. The factorization reads the lower half.
        let mut normal: DMatrix<f64> = DMatrix::zeros(count, count);
        for (k, part) in parts.iter().enumerate() {
            for row in jacobian(part.at, part.weights).row_iter() {
                let there = row.iter().copied().enumerate().filter(|(_, v)| *v != 0.0);
                let entries: Vec<(usize, f64)> = there.map(|(i, v)| (self.unknowns.of_tree(k, i), v)).collect();
                for (i, a) in &entries {
                    for (j, b) in entries.iter().take_while(|(j, _)| j <= i) {
                        normal[(*i, *j)] += part.probability * a * b;
                    }
                }
            }
        }
        let diagonal = normal.diagonal();
        let factor = Cholesky::new(normal).ok_or(BadPivot { step: 0 })?;
        for i in 0..count {
            let root = factor.l_dirty()[(i, i)];
            if root * root <= SINGULAR * diagonal[i] || !root.is_finite() {
                return Err(BadPivot { step: self.unknowns.step(i) });
            }
        }
        self.factor = Some(factor);
        Ok(())
    }

    /// Solves `matrix * solution = right` for the tree that was factorized last, controls by branch.
    pub(super) fn solve(&mut self, right: &[Controls], solution: &mut [Controls]) {
        let unknowns = self.unknowns;
        self.right = DVector::zeros(unknowns.count());
        for (k, right) in right.iter().enumerate().rev() {
            right.interleaved().enumerate().for_each(|(i, v)| self.right[unknowns.of_tree(k, i)] = v);
        }
        if let Some(factor) = &self.factor {
            factor.solve_mut(&mut self.right);
        }
        for (k, solution) in solution.iter_mut().enumerate() {
            for t in 0..STEPS {
                solution.acceleration[t] = self.right[unknowns.of_tree(k, 2 * t)];
                solution.steering[t] = self.right[unknowns.of_tree(k, 2 * t + 1)];
            }
        }
    }
}
