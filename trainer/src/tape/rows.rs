//! Rows picked, and matrices put together.

use super::{Scalar, Tape, Var};

impl<'a, T: Scalar> Tape<'a, T> {
    /// The rows of these numbers, which may come several times.
    pub fn pick(&mut self, x: Var, rows: Vec<usize>) -> Var {
        let width = self.value(x).columns;
        let mut y = self.spare.any(rows.len() * width);
        for (y, row) in y.chunks_exact_mut(width).zip(&rows) {
            y.copy_from_slice(&self.value(x).data[row * width..][..width]);
        }
        self.result(
            &[x],
            rows.len(),
            width,
            y,
            Box::new(move |values, gradient, gradients| {
                if let Some(dx) = gradients.by(values, x) {
                    for (row, g) in rows.iter().zip(gradient.chunks_exact(width)) {
                        dx[row * width..][..width].iter_mut().zip(g).for_each(|(dx, g)| *dx = *dx + *g);
                    }
                }
                gradients.spare.keep(gradient);
            }),
        )
    }

    /// The same numbers in rows of another length.
    pub fn reshaped(&mut self, x: Var, rows: usize, columns: usize) -> Var {
        let mut y = self.spare.any(rows * columns);
        y.copy_from_slice(&self.value(x).data);
        self.result(
            &[x],
            rows,
            columns,
            y,
            Box::new(move |values, gradient, gradients| gradients.give(values, x, gradient)),
        )
    }

    /// Matrices of one width, one below the other.
    pub fn stack(&mut self, parts: Vec<Var>) -> Var {
        let width = parts.first().map_or(0, |part| self.value(*part).columns);
        let rows = parts.iter().map(|part| self.value(*part).rows).sum();
        let mut y = self.spare.any(rows * width);
        let mut rest = &mut y[..];
        for part in &parts {
            let (own, after) = rest.split_at_mut(self.value(*part).data.len());
            own.copy_from_slice(&self.value(*part).data);
            rest = after;
        }
        self.result(
            &parts.clone(),
            rows,
            width,
            y,
            Box::new(move |values, gradient, gradients| {
                let mut rest = &gradient[..];
                for part in parts {
                    let (own, after) = rest.split_at(values.get(part).data.len());
                    rest = after;
                    let own = gradients.spare.copied(own);
                    gradients.give(values, part, own);
                }
                gradients.spare.keep(gradient);
            }),
        )
    }

    /// Two matrices side by side.
    pub fn beside(&mut self, a: Var, b: Var) -> Var {
        let (n, left, right) = (self.value(a).rows, self.value(a).columns, self.value(b).columns);
        let width = left + right;
        let mut y = self.spare.any(n * width);
        for (row, y) in y.chunks_exact_mut(width).enumerate() {
            y[..left].copy_from_slice(&self.value(a).data[row * left..][..left]);
            y[left..].copy_from_slice(&self.value(b).data[row * right..][..right]);
        }
        self.result(
            &[a, b],
            n,
            width,
            y,
            Box::new(move |values, gradient, gradients| {
                for (var, from, count) in [(a, 0, left), (b, left, right)] {
                    if let Some(sum) = gradients.by(values, var) {
                        for (sum, g) in sum.chunks_exact_mut(count).zip(gradient.chunks_exact(width)) {
                            sum.iter_mut().zip(&g[from..from + count]).for_each(|(sum, g)| *sum = *sum + *g);
                        }
                    }
                }
                gradients.spare.keep(gradient);
            }),
        )
    }

    /// A matrix of `rows` x `columns` in which parts stand at places (row, column), transposed or not, and else 0. The first row of a part
    /// may be fixed: no gradient goes there.
    pub fn assembled(&mut self, rows: usize, columns: usize, parts: Vec<Part>) -> Var {
        let mut y = vec![T::ZERO; rows * columns];
        for part in &parts {
            let matrix = self.value(part.var);
            for r in 0..matrix.rows {
                for c in 0..matrix.columns {
                    y[part.place(r, c, columns)] = matrix.data[r * matrix.columns + c];
                }
            }
        }
        let of: Vec<Var> = parts.iter().map(|part| part.var).collect();
        self.result(
            &of,
            rows,
            columns,
            y,
            Box::new(move |values, gradient, gradients| {
                for part in &parts {
                    let (own_rows, own_columns) = (values.get(part.var).rows, values.get(part.var).columns);
                    let Some(sum) = gradients.by(values, part.var) else { continue };
                    for r in usize::from(part.first_is_fixed)..own_rows {
                        for c in 0..own_columns {
                            sum[r * own_columns + c] = sum[r * own_columns + c] + gradient[part.place(r, c, columns)];
                        }
                    }
                }
            }),
        )
    }
}

/// A part of an assembled matrix.
#[derive(Clone, Copy, Debug)]
pub struct Part {
    /// What it is.
    pub var: Var,
    /// Where its first number stands.
    pub at: (usize, usize),
    /// Its rows are columns there.
    pub transposed: bool,
    /// Its first row has no gradient.
    pub first_is_fixed: bool,
}

impl Part {
    fn place(&self, row: usize, column: usize, columns: usize) -> usize {
        let (row, column) = if self.transposed { (column, row) } else { (row, column) };
        (self.at.0 + row) * columns + self.at.1 + column
    }
}
