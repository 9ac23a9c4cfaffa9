//! What is done number by number, and row by row.

use super::{Scalar, Tape, Var};

/// PyTorch's, in a layer norm.
const EPSILON: f64 = 1e-5;

impl<'a, T: Scalar> Tape<'a, T> {
    /// `a + b`.
    pub fn sum(&mut self, a: Var, b: Var) -> Var {
        let (rows, columns) = (self.value(a).rows, self.value(a).columns);
        let mut y = self.spare.any(rows * columns);
        let both = self.value(a).data.iter().zip(&*self.value(b).data);
        y.iter_mut().zip(both).for_each(|(y, (a, b))| *y = *a + *b);
        self.result(
            &[a, b],
            rows,
            columns,
            y,
            Box::new(move |values, gradient, gradients| {
                let copy = gradients.spare.copied(&gradient);
                gradients.give(values, a, copy);
                gradients.give(values, b, gradient);
            }),
        )
    }

    /// Numbers are dropped at random, and the others made as much greater.
    pub fn dropout(&mut self, x: Var) -> Var {
        let (rows, columns) = (self.value(x).rows, self.value(x).columns);
        let Some(factors) = self.kept(rows * columns) else { return x };
        let mut y = self.spare.any(rows * columns);
        y.iter_mut().zip(self.value(x).data.iter().zip(&factors)).for_each(|(y, (x, factor))| *y = *x * *factor);
        self.result(
            &[x],
            rows,
            columns,
            y,
            Box::new(move |values, mut gradient, gradients| {
                gradient.iter_mut().zip(&factors).for_each(|(g, factor)| *g = *g * *factor);
                gradients.give(values, x, gradient);
                gradients.spare.keep(factors);
            }),
        )
    }

    /// For each of `count` numbers 0 where it is dropped, else what it is multiplied with; none without dropout.
    pub(super) fn kept(&mut self, count: usize) -> Option<Vec<T>> {
        let dropout = self.dropout.as_mut()?;
        let (threshold, factor) = ((dropout.rate * 65_536.0) as u64, T::of(1.0 / (1.0 - dropout.rate)));
        let mut factors = self.spare.any(count);
        for four in factors.chunks_mut(4) {
            let bits = dropout.random.u64(..);
            for (value, shift) in four.iter_mut().zip([0, 16, 32, 48]) {
                *value = if (bits >> shift) & 0xffff < threshold { T::ZERO } else { factor };
            }
        }
        Some(factors)
    }

    /// Each row brought to mean 0 and variance 1, then scaled and shifted.
    pub fn norm(&mut self, x: Var, weight: Var, bias: Var) -> Var {
        let (n, width) = (self.value(x).rows, self.value(x).columns);
        let count = T::of(width as f64);
        let mut normed = self.spare.any(n * width);
        let mut scales = Vec::with_capacity(n);
        for (row, normed) in self.value(x).data.chunks_exact(width).zip(normed.chunks_exact_mut(width)) {
            let mean = total(row.iter().copied()) / count;
            normed.iter_mut().zip(row).for_each(|(normed, x)| *normed = *x - mean);
            let variance = total(normed.iter().map(|x| *x * *x)) / count;
            let scale = T::ONE / (variance + T::of(EPSILON)).root();
            normed.iter_mut().for_each(|x| *x = *x * scale);
            scales.push(scale);
        }
        let mut y = self.spare.any(n * width);
        let (w, b) = (&self.value(weight).data, &self.value(bias).data);
        for (y, row) in y.chunks_exact_mut(width).zip(normed.chunks_exact(width)) {
            y.iter_mut().zip(row.iter().zip(&**w).zip(&**b)).for_each(|(y, ((x, w), b))| *y = *x * *w + *b);
        }
        self.result(
            &[x, weight, bias],
            n,
            width,
            y,
            Box::new(move |values, gradient, gradients| {
                if let Some(dw) = gradients.by(values, weight) {
                    for (g, x) in gradient.chunks_exact(width).zip(normed.chunks_exact(width)) {
                        dw.iter_mut().zip(g.iter().zip(x)).for_each(|(dw, (g, x))| *dw = *dw + *g * *x);
                    }
                }
                if let Some(db) = gradients.by(values, bias) {
                    super::products::add_columns(&gradient, width, db);
                }
                let w = values.get(weight).data.clone();
                let mut dx = gradients.spare.any(n * width);
                let mut scaled = vec![T::ZERO; width];
                for (row, dx) in dx.chunks_exact_mut(width).enumerate() {
                    let (g, x) = (&gradient[row * width..][..width], &normed[row * width..][..width]);
                    scaled.iter_mut().zip(g.iter().zip(&*w)).for_each(|(scaled, (g, w))| *scaled = *g * *w);
                    let mean = total(scaled.iter().copied()) / count;
                    let along = total(scaled.iter().zip(x).map(|(s, x)| *s * *x)) / count;
                    let scale = scales[row];
                    for ((dx, s), x) in dx.iter_mut().zip(&scaled).zip(x) {
                        *dx = (*s - mean - *x * along) * scale;
                    }
                }
                gradients.give(values, x, dx);
                gradients.spare.keep(gradient);
                gradients.spare.keep(normed);
            }),
        )
    }
}

/// A sum in eight strands, so that it can be done with vectors.
pub(super) fn total<T: Scalar>(values: impl Iterator<Item = T>) -> T {
    let mut strands = [T::ZERO; 8];
    for (index, value) in values.enumerate() {
        strands[index % 8] = strands[index % 8] + value;
    }
    strands.into_iter().sum()
}
