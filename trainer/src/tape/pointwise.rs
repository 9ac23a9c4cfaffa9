//! What is done number by number, and row by row.

use super::{Scalar, Tape, Var};

/// PyTorch's, in a layer norm.
const EPSILON: f64 = 1e-5;

impl<'a, T: Scalar> Tape<'a, T> {
    /// `f` of each number, whose derivative `slope` is a function of the result.
    fn each(&mut self, x: Var, f: impl Fn(T) -> T, slope: impl Fn(T) -> T + Send + 'a) -> Var {
        let (rows, columns) = (self.value(x).rows, self.value(x).columns);
        let y: Vec<T> = self.value(x).data.iter().map(|x| f(*x)).collect();
        let this = Var(self.backs.len());
        self.result(
            &[x],
            rows,
            columns,
            y,
            Box::new(move |values, gradient, gradients| {
                if let Some(dx) = gradients.by(values, x) {
                    let y = &values.get(this).data;
                    dx.iter_mut().zip(gradient).zip(&**y).for_each(|((dx, g), y)| *dx = *dx + *g * slope(*y));
                }
            }),
        )
    }

    /// What is positive; a slope of 0 at 0.
    pub fn relu(&mut self, x: Var) -> Var {
        self.each(x, |x| if x > T::ZERO { x } else { T::ZERO }, |y| if y > T::ZERO { T::ONE } else { T::ZERO })
    }

    /// Exponential linear unit.
    pub fn elu(&mut self, x: Var) -> Var {
        let below = |x: T| x.exponential() - T::ONE;
        self.each(x, |x| if x > T::ZERO { x } else { below(x) }, |y| if y > T::ZERO { T::ONE } else { y + T::ONE })
    }

    /// `a + b`.
    pub fn sum(&mut self, a: Var, b: Var) -> Var {
        let (rows, columns) = (self.value(a).rows, self.value(a).columns);
        let y = self.value(a).data.iter().zip(&*self.value(b).data).map(|(a, b)| *a + *b).collect();
        self.result(
            &[a, b],
            rows,
            columns,
            y,
            Box::new(move |values, gradient, gradients| {
                for var in [a, b] {
                    if let Some(sum) = gradients.by(values, var) {
                        sum.iter_mut().zip(gradient).for_each(|(sum, g)| *sum = *sum + *g);
                    }
                }
            }),
        )
    }

    /// Numbers are dropped at random, and the others made as much greater.
    pub fn dropout(&mut self, x: Var) -> Var {
        let (rows, columns) = (self.value(x).rows, self.value(x).columns);
        let Some(factors) = self.kept(rows * columns) else { return x };
        let y = self.value(x).data.iter().zip(&factors).map(|(x, factor)| *x * *factor).collect();
        self.result(
            &[x],
            rows,
            columns,
            y,
            Box::new(move |values, gradient, gradients| {
                if let Some(dx) = gradients.by(values, x) {
                    dx.iter_mut().zip(gradient).zip(&factors).for_each(|((dx, g), factor)| *dx = *dx + *g * *factor);
                }
            }),
        )
    }

    /// For each of `count` numbers 0 where it is dropped, else what it is multiplied with; none without dropout.
    pub(super) fn kept(&mut self, count: usize) -> Option<Vec<T>> {
        let dropout = self.dropout.as_mut()?;
        let (threshold, factor) = ((dropout.rate * 65_536.0) as u64, T::of(1.0 / (1.0 - dropout.rate)));
        let mut factors = Vec::with_capacity(count.next_multiple_of(4));
        while factors.len() < count {
            let bits = dropout.random.u64(..);
            let factor_of = |shift: u32| if (bits >> shift) & 0xffff < threshold { T::ZERO } else { factor };
            factors.extend([0, 16, 32, 48].map(factor_of));
        }
        factors.truncate(count);
        Some(factors)
    }

    /// Each row brought to mean 0 and variance 1, then scaled and shifted.
    pub fn norm(&mut self, x: Var, weight: Var, bias: Var) -> Var {
        let (n, width) = (self.value(x).rows, self.value(x).columns);
        let count = T::of(width as f64);
        let mut normed = vec![T::ZERO; n * width];
        let mut scales = Vec::with_capacity(n);
        for (row, normed) in self.value(x).data.chunks_exact(width).zip(normed.chunks_exact_mut(width)) {
            let mean = total(row.iter().copied()) / count;
            normed.iter_mut().zip(row).for_each(|(normed, x)| *normed = *x - mean);
            let variance = total(normed.iter().map(|x| *x * *x)) / count;
            let scale = T::ONE / (variance + T::of(EPSILON)).root();
            normed.iter_mut().for_each(|x| *x = *x * scale);
            scales.push(scale);
        }
        let (w, b) = (&self.value(weight).data, &self.value(bias).data);
        let y = normed
            .chunks_exact(width)
            .flat_map(|row| row.iter().zip(&**w).zip(&**b).map(|((x, w), b)| *x * *w + *b))
            .collect();
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
                    super::products::add_columns(gradient, width, db);
                }
                let w = values.get(weight).data.clone();
                let Some(dx) = gradients.by(values, x) else { return };
                let mut scaled = vec![T::ZERO; width];
                for (row, dx) in dx.chunks_exact_mut(width).enumerate() {
                    let (g, x) = (&gradient[row * width..][..width], &normed[row * width..][..width]);
                    scaled.iter_mut().zip(g.iter().zip(&*w)).for_each(|(scaled, (g, w))| *scaled = *g * *w);
                    let mean = total(scaled.iter().copied()) / count;
                    let along = total(scaled.iter().zip(x).map(|(s, x)| *s * *x)) / count;
                    let scale = scales[row];
                    for ((dx, s), x) in dx.iter_mut().zip(&scaled).zip(x) {
                        *dx = *dx + (*s - mean - *x * along) * scale;
                    }
                }
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
