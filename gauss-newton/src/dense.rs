//! The normal equations, written out: the readable reference that the sweep is held to.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::constants::{SINGULAR, STEPS, TERMS};
use super::controls::Controls;
use super::motion::StateChange;
use super::objective::Evaluation;
use super::rows::Rows;
use super::sweep::BadPivot;

/// Unknowns: two a step, interleaved.
pub const UNKNOWNS: usize = 2 * STEPS;

/// The factorized normal matrix.
#[derive(Clone, Debug)]
pub struct Dense {
    factor: Option<Cholesky<f64, Dyn>>,
    right: DVector<f64>,
}

impl Default for Dense {
    fn default() -> Self {
        Self { factor: None, right: DVector::zeros(UNKNOWNS) }
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
    /// Factorizes the normal matrix at this point.
    ///
    /// # Errors
    /// [`BadPivot`], if the matrix is singular.
    pub fn factorize(&mut self, at: &Evaluation, weights: &[f64; TERMS]) -> Result<(), BadPivot> {
        let jacobian = jacobian(at, weights);
        // J'J as the sum of each row's products; most entries of a row are zero. The factorization reads the lower half.
        let mut normal: DMatrix<f64> = DMatrix::zeros(UNKNOWNS, UNKNOWNS);
        for row in jacobian.row_iter() {
            let entries: Vec<(usize, f64)> = row.iter().copied().enumerate().filter(|(_, v)| *v != 0.0).collect();
            for (i, a) in &entries {
                for (j, b) in entries.iter().take_while(|(j, _)| j <= i) {
                    normal[(*i, *j)] += a * b;
                }
            }
        }
        let diagonal = normal.diagonal();
        let factor = Cholesky::new(normal).ok_or(BadPivot { step: 0 })?;
        for i in 0..UNKNOWNS {
            let root = factor.l_dirty()[(i, i)];
            if root * root <= SINGULAR * diagonal[i] || !root.is_finite() {
                return Err(BadPivot { step: i / 2 });
            }
        }
        self.factor = Some(factor);
        Ok(())
    }

    /// Solves `matrix * solution = right`.
    pub fn solve(&mut self, right: &Controls, solution: &mut Controls) {
        self.right.iter_mut().zip(right.interleaved()).for_each(|(entry, v)| *entry = v);
        if let Some(factor) = &self.factor {
            factor.solve_mut(&mut self.right);
        }
        for t in 0..STEPS {
            solution.acceleration[t] = self.right[2 * t];
            solution.steering[t] = self.right[2 * t + 1];
        }
    }
}
