//! Products of matrices.

use super::scalar::Side::{Plain, Transposed};
use super::wide::{Wide, widely};
use super::{Scalar, Tape, Var};

/// What follows a linear layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Activation {
    /// Nothing.
    None,
    /// What is positive; a slope of 0 at 0.
    Relu,
    /// Exponential linear unit.
    Elu,
}

impl Activation {
    /// Of each number.
    fn apply<T: Scalar>(self, numbers: &mut [T]) {
        match self {
            Self::None => {}
            Self::Relu => numbers.iter_mut().for_each(|y| *y = if *y > T::ZERO { *y } else { T::ZERO }),
            Self::Elu => numbers.iter_mut().filter(|y| **y <= T::ZERO).for_each(|y| *y = y.exponential() - T::ONE),
        }
    }

    /// The gradient by results into that by what they are of: slopes are functions of the results.
    fn back<T: Scalar>(self, gradient: &mut [T], results: &[T]) {
        let pairs = gradient.iter_mut().zip(results);
        match self {
            Self::None => {}
            Self::Relu => pairs.for_each(|(g, y)| *g = if *y > T::ZERO { *g } else { T::ZERO }),
            Self::Elu => pairs.for_each(|(g, y)| *g = if *y > T::ZERO { *g } else { *g * (*y + T::ONE) }),
        }
    }
}

impl<'a, T: Scalar> Tape<'a, T> {
    /// `f(x w' + b)`: a linear layer, its weight [outputs, inputs] as PyTorch keeps it; `bias` [1, outputs].
    pub fn linear(&mut self, x: Var, weight: Var, bias: Option<Var>, activation: Activation) -> Var {
        let (n, inputs, outputs) = (self.value(x).rows, self.value(x).columns, self.value(weight).rows);
        debug_assert_eq!(inputs, self.value(weight).columns);
        let mut y = self.spare.any(n * outputs);
        if let Some(bias) = bias {
            let bias = &self.value(bias).data;
            y.chunks_exact_mut(outputs).for_each(|row| row.copy_from_slice(bias));
        }
        let (a, w) = (&self.value(x).data, &self.value(weight).data);
        T::multiply(bias.is_some(), Plain(a), Transposed(w), [n, inputs, outputs], &mut y);
        activation.apply(&mut y);
        let of: Vec<Var> = [x, weight].into_iter().chain(bias).collect();
        let this = Var(self.backs.len());
        self.result(
            &of,
            n,
            outputs,
            y,
            Box::new(move |values, mut gradient, gradients| {
                activation.back(&mut gradient, &values.get(this).data);
                if let Some((adds, dx)) = gradients.place(values, x) {
                    T::multiply(adds, Plain(&gradient), Plain(&values.get(weight).data), [n, outputs, inputs], dx);
                }
                if let Some((adds, dw)) = gradients.place(values, weight) {
                    T::multiply(adds, Transposed(&gradient), Plain(&values.get(x).data), [outputs, n, inputs], dw);
                }
                if let Some(db) = bias.and_then(|bias| gradients.by(values, bias)) {
                    add_columns(&gradient, outputs, db);
                }
                gradients.spare.keep(gradient);
            }),
        )
    }

    /// `f(x)`, number by number.
    pub fn activated(&mut self, x: Var, activation: Activation) -> Var {
        let (rows, columns) = (self.value(x).rows, self.value(x).columns);
        let mut y = self.spare.any(rows * columns);
        y.copy_from_slice(&self.value(x).data);
        activation.apply(&mut y);
        let this = Var(self.backs.len());
        self.result(
            &[x],
            rows,
            columns,
            y,
            Box::new(move |values, mut gradient, gradients| {
                activation.back(&mut gradient, &values.get(this).data);
                gradients.give(values, x, gradient);
            }),
        )
    }

    /// `a b`.
    pub fn product(&mut self, a: Var, b: Var) -> Var {
        let size @ [n, inner, m] = [self.value(a).rows, self.value(a).columns, self.value(b).columns];
        debug_assert_eq!(inner, self.value(b).rows);
        let mut y = self.spare.any(n * m);
        T::multiply(false, Plain(&self.value(a).data), Plain(&self.value(b).data), size, &mut y);
        self.result(
            &[a, b],
            n,
            m,
            y,
            Box::new(move |values, gradient, gradients| {
                if let Some((adds, da)) = gradients.place(values, a) {
                    T::multiply(adds, Plain(&gradient), Transposed(&values.get(b).data), [n, m, inner], da);
                }
                if let Some((adds, db)) = gradients.place(values, b) {
                    T::multiply(adds, Transposed(&values.get(a).data), Plain(&gradient), [inner, n, m], db);
                }
                gradients.spare.keep(gradient);
            }),
        )
    }

    /// Queries folded with the projection of the keys, so that keys need none (`network.md` 5.9): of a query of each head [n, width], and the
    /// projection [width, inputs], what is multiplied with the inputs themselves, [n, heads x inputs], over the root of a head's width.
    pub fn folded_queries(&mut self, query: Var, keys: Var, heads: usize) -> Var {
        let (n, width, inputs) = (self.value(query).rows, self.value(query).columns, self.value(keys).columns);
        let head = width / heads;
        let scale = T::ONE / T::of(head as f64).root();
        let mut y = self.spare.any(n * heads * inputs);
        let mut part = vec![T::ZERO; n * inputs];
        for h in 0..heads {
            let q = scaled_columns(&self.value(query).data, width, h * head, head, scale);
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
                    let g = scaled_columns(&gradient, heads * inputs, h * inputs, inputs, scale);
                    let w = &values.get(keys).data[h * head * inputs..][..head * inputs];
                    let mut dq = vec![T::ZERO; n * head];
                    T::multiply(false, Plain(&g), Transposed(w), [n, inputs, head], &mut dq);
                    if let Some(sum) = gradients.by(values, query) {
                        add_to_columns(sum, width, h * head, &dq, head);
                    }
                    let q = columns(&values.get(query).data, width, h * head, head);
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
        let mut y = self.spare.any(n * width);
        let mut part = vec![T::ZERO; n * head];
        for h in 0..heads {
            let p = columns(&self.value(pooled).data, wide, h * inputs, inputs);
            let sums = columns(&self.value(pooled).data, wide, heads * inputs + h, 1);
            let b = &self.value(bias).data[h * head..][..head];
            part.chunks_exact_mut(head)
                .zip(&sums)
                .for_each(|(part, sum)| part.iter_mut().zip(b).for_each(|(y, b)| *y = *b * *sum));
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
                    let g = columns(&gradient, width, h * head, head);
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
                    let data = &values.get(pooled).data;
                    let (p, sums) =
                        (columns(data, wide, h * inputs, inputs), columns(data, wide, heads * inputs + h, 1));
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
    widely(Columns { rows, width, sum });
}

struct Columns<'s, T> {
    rows: &'s [T],
    width: usize,
    sum: &'s mut [T],
}

impl<T: Scalar> Wide for Columns<'_, T> {
    #[inline(always)]
    fn run(self) {
        for row in self.rows.chunks_exact(self.width) {
            self.sum.iter_mut().zip(row).for_each(|(sum, value)| *sum = *sum + *value);
        }
    }
}

/// Columns `from..from + count` of rows of `width`.
fn columns<T: Scalar>(data: &[T], width: usize, from: usize, count: usize) -> Vec<T> {
    let mut part = Vec::with_capacity(data.len() / width * count);
    data.chunks_exact(width).for_each(|row| part.extend_from_slice(&row[from..from + count]));
    part
}

/// The same, each times `scale`.
fn scaled_columns<T: Scalar>(data: &[T], width: usize, from: usize, count: usize, scale: T) -> Vec<T> {
    let mut part = columns(data, width, from, count);
    part.iter_mut().for_each(|value| *value = *value * scale);
    part
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
