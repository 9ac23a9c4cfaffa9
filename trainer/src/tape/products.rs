//! Products of matrices.

use super::scalar::Side::{Plain, Transposed};
use super::{Scalar, Tape, Var};

impl<'a, T: Scalar> Tape<'a, T> {
    /// `x w' + b`: a linear layer, its weight [outputs, inputs] as PyTorch keeps it; `bias` [1, outputs].
    pub fn linear(&mut self, x: Var, weight: Var, bias: Option<Var>) -> Var {
        let (n, inputs, outputs) = (self.value(x).rows, self.value(x).columns, self.value(weight).rows);
        debug_assert_eq!(inputs, self.value(weight).columns);
        let mut y = self.biased(bias, n, outputs);
        let (a, w) = (&self.value(x).data, &self.value(weight).data);
        T::multiply(bias.is_some(), Plain(a), Transposed(w), [n, inputs, outputs], &mut y);
        let of: Vec<Var> = [x, weight].into_iter().chain(bias).collect();
        self.result(
            &of,
            n,
            outputs,
            y,
            Box::new(move |values, gradient, gradients| {
                if let Some(dx) = gradients.by(values, x) {
                    T::multiply(true, Plain(gradient), Plain(&values.get(weight).data), [n, outputs, inputs], dx);
                }
                if let Some(dw) = gradients.by(values, weight) {
                    T::multiply(true, Transposed(gradient), Plain(&values.get(x).data), [outputs, n, inputs], dw);
                }
                if let Some(db) = bias.and_then(|bias| gradients.by(values, bias)) {
                    add_columns(gradient, outputs, db);
                }
            }),
        )
    }

    /// Rows that begin as the bias, or as nothing.
    fn biased(&self, bias: Option<Var>, rows: usize, columns: usize) -> Vec<T> {
        bias.map_or_else(|| vec![T::ZERO; rows * columns], |bias| self.value(bias).data.repeat(rows))
    }

    /// `a b`.
    pub fn product(&mut self, a: Var, b: Var) -> Var {
        let size @ [n, inner, m] = [self.value(a).rows, self.value(a).columns, self.value(b).columns];
        debug_assert_eq!(inner, self.value(b).rows);
        let mut y = vec![T::ZERO; n * m];
        T::multiply(false, Plain(&self.value(a).data), Plain(&self.value(b).data), size, &mut y);
        self.result(
            &[a, b],
            n,
            m,
            y,
            Box::new(move |values, gradient, gradients| {
                if let Some(da) = gradients.by(values, a) {
                    T::multiply(true, Plain(gradient), Transposed(&values.get(b).data), [n, m, inner], da);
                }
                if let Some(db) = gradients.by(values, b) {
                    T::multiply(true, Transposed(&values.get(a).data), Plain(gradient), [inner, n, m], db);
                }
            }),
        )
    }

    /// Queries folded with the projection of the keys, so that keys need none (`network.md` 5.9): of a query of each head [n, width], and the
    /// projection [width, inputs], what is multiplied with the inputs themselves, [n, heads x inputs], over the root of a head's width.
    pub fn folded_queries(&mut self, query: Var, keys: Var, heads: usize) -> Var {
        let (n, width, inputs) = (self.value(query).rows, self.value(query).columns, self.value(keys).columns);
        let head = width / heads;
        let scale = T::ONE / T::of(head as f64).root();
        let mut y = vec![T::ZERO; n * heads * inputs];
        let mut part = vec![T::ZERO; n * inputs];
        for h in 0..heads {
            let q: Vec<T> = columns(&self.value(query).data, width, h * head, head).map(|q| q * scale).collect();
            let w = &self.value(keys).data[h * head * inputs..][..head * inputs];
            T::multiply(false, Plain(&q), Plain(w), [n, head, inputs], &mut part);
            set_columns(&mut y, heads * inputs, h * inputs, &part, inputs);
        }
        self.result(
            &[query, keys],
            n,
            heads * inputs,
            y,
            Box::new(move |values, gradient, gradients| {
                for h in 0..heads {
                    let g: Vec<T> = columns(gradient, heads * inputs, h * inputs, inputs).map(|g| g * scale).collect();
                    let w = &values.get(keys).data[h * head * inputs..][..head * inputs];
                    let mut dq = vec![T::ZERO; n * head];
                    T::multiply(false, Plain(&g), Transposed(w), [n, inputs, head], &mut dq);
                    if let Some(sum) = gradients.by(values, query) {
                        add_to_columns(sum, width, h * head, &dq, head);
                    }
                    let q: Vec<T> = columns(&values.get(query).data, width, h * head, head).collect();
                    if let Some(dw) = gradients.by(values, keys) {
                        let dw = &mut dw[h * head * inputs..][..head * inputs];
                        T::multiply(true, Transposed(&q), Plain(&g), [head, n, inputs], dw);
                    }
                }
            }),
        )
    }

    /// Values of what was pooled: of each head's pooled inputs and the sum of its shares [n, heads x inputs + heads], the projection
    /// [width, inputs] and its bias, each head's value: [n, width].
    pub fn pooled_values(&mut self, pooled: Var, weight: Var, bias: Var, heads: usize) -> Var {
        let (n, inputs, width) = (self.value(pooled).rows, self.value(weight).columns, self.value(weight).rows);
        let (head, wide) = (width / heads, heads * (inputs + 1));
        debug_assert_eq!(wide, self.value(pooled).columns);
        let mut y = vec![T::ZERO; n * width];
        let mut part = vec![T::ZERO; n * head];
        for h in 0..heads {
            let p: Vec<T> = columns(&self.value(pooled).data, wide, h * inputs, inputs).collect();
            let sums = columns(&self.value(pooled).data, wide, heads * inputs + h, 1);
            let b = &self.value(bias).data[h * head..][..head];
            part.chunks_exact_mut(head)
                .zip(sums)
                .for_each(|(part, sum)| part.iter_mut().zip(b).for_each(|(y, b)| *y = *b * sum));
            let w = &self.value(weight).data[h * head * inputs..][..head * inputs];
            T::multiply(true, Plain(&p), Transposed(w), [n, inputs, head], &mut part);
            set_columns(&mut y, width, h * head, &part, head);
        }
        self.result(
            &[pooled, weight, bias],
            n,
            width,
            y,
            Box::new(move |values, gradient, gradients| {
                let mut dp = vec![T::ZERO; n * inputs];
                for h in 0..heads {
                    let g: Vec<T> = columns(gradient, width, h * head, head).collect();
                    let w = &values.get(weight).data[h * head * inputs..][..head * inputs];
                    let b = &values.get(bias).data[h * head..][..head];
                    if let Some(sum) = gradients.by(values, pooled) {
                        T::multiply(false, Plain(&g), Plain(w), [n, head, inputs], &mut dp);
                        add_to_columns(sum, wide, h * inputs, &dp, inputs);
                        for (row, g) in g.chunks_exact(head).enumerate() {
                            let by_sum: T = g.iter().zip(b).map(|(g, b)| *g * *b).sum();
                            sum[row * wide + heads * inputs + h] = sum[row * wide + heads * inputs + h] + by_sum;
                        }
                    }
                    let (p, sums): (Vec<T>, Vec<T>) = {
                        let data = &values.get(pooled).data;
                        (
                            columns(data, wide, h * inputs, inputs).collect(),
                            columns(data, wide, heads * inputs + h, 1).collect(),
                        )
                    };
                    if let Some(dw) = gradients.by(values, weight) {
                        let dw = &mut dw[h * head * inputs..][..head * inputs];
                        T::multiply(true, Transposed(&g), Plain(&p), [head, n, inputs], dw);
                    }
                    if let Some(db) = gradients.by(values, bias) {
                        for (g, sum) in g.chunks_exact(head).zip(&sums) {
                            db[h * head..][..head].iter_mut().zip(g).for_each(|(db, g)| *db = *db + *g * *sum);
                        }
                    }
                }
            }),
        )
    }
}

/// Adds all rows up.
pub(super) fn add_columns<T: Scalar>(rows: &[T], width: usize, sum: &mut [T]) {
    for row in rows.chunks_exact(width) {
        sum.iter_mut().zip(row).for_each(|(sum, value)| *sum = *sum + *value);
    }
}

/// Columns `from..from + count` of rows of `width`.
fn columns<T: Scalar>(data: &[T], width: usize, from: usize, count: usize) -> impl Iterator<Item = T> {
    data.chunks_exact(width).flat_map(move |row| row[from..from + count].iter().copied())
}

fn set_columns<T: Scalar>(data: &mut [T], width: usize, from: usize, part: &[T], count: usize) {
    for (row, part) in data.chunks_exact_mut(width).zip(part.chunks_exact(count)) {
        row[from..from + count].copy_from_slice(part);
    }
}

fn add_to_columns<T: Scalar>(data: &mut [T], width: usize, from: usize, part: &[T], count: usize) {
    for (row, part) in data.chunks_exact_mut(width).zip(part.chunks_exact(count)) {
        row[from..from + count].iter_mut().zip(part).for_each(|(sum, value)| *sum = *sum + *value);
    }
}
