//! Attention of one query to a few or many rows (`network.md` 5.5, 5.6), folded: the projection of the keys goes into the query
//! (their bias cancels in the softmax), that of the values is applied after the rows are pooled.

use super::functions::Norm;
use super::product::{End, Kernel, Linear, Rows};
use super::source::Source;
use crate::constants::WIDTH;
use crate::weights::WeightsError;

/// The projections of an attention with as many heads as there are in `keys`.
#[derive(Debug)]
pub(super) struct SingleQuery {
    query: Linear,
    /// For each head from its part of the query to what rows are multiplied with.
    keys: Vec<Linear>,
    /// For each head from the pooled row to its part of the answer.
    values: Vec<Linear>,
    out: Linear,
}

impl SingleQuery {
    pub fn new(source: Source<'_>, name: &str, heads: usize) -> Result<Self, WeightsError> {
        let weight = source.tensor(&format!("{name}.in_proj_weight"))?;
        let bias = source.tensor(&format!("{name}.in_proj_bias"))?;
        let (size, kernel) = (WIDTH / heads, source.kernel);
        let scale = 1.0 / (size as f32).sqrt();
        let query = |n: usize, k: usize| weight[n * WIDTH + k] * scale;
        let key = |head: usize| {
            let row = move |j: usize| (WIDTH + head * size + j) * WIDTH;
            Linear::new(kernel, (WIDTH, size), |n, j| weight[row(j) + n], |_| 0.0)
        };
        let value = |head: usize| {
            let row = move |n: usize| 2 * WIDTH + head * size + n;
            Linear::new(kernel, (size, WIDTH), |n, k| weight[row(n) * WIDTH + k], |n| bias[row(n)])
        };
        Ok(Self {
            query: Linear::new(kernel, (WIDTH, WIDTH), query, |n| bias[n] * scale),
            keys: (0..heads).map(key).collect(),
            values: (0..heads).map(value).collect(),
            out: source.linear(&format!("{name}.out_proj"))?,
        })
    }

    pub fn heads(&self) -> usize {
        self.keys.len()
    }

    /// What each head multiplies rows with, for queries from `rows`: `[query][head][number]`.
    pub fn queries(&self, rows: &[f32], count: usize, projected: &mut [f32], queries: &mut [f32]) {
        self.query.apply_packed(rows, count, projected, End::Sum);
        let (size, stride) = (WIDTH / self.heads(), self.heads() * WIDTH);
        for (head, key) in self.keys.iter().enumerate() {
            let rows = Rows { numbers: &projected[head * size..], stride: WIDTH };
            key.apply(rows, count, &mut queries[head * WIDTH..], stride, End::Sum);
        }
    }

    /// Answers from rows pooled by each head, `[query][head][number]`.
    pub fn answers(&self, pooled: &[f32], count: usize, joined: &mut [f32], answers: &mut [f32]) {
        let (size, stride) = (WIDTH / self.heads(), self.heads() * WIDTH);
        for (head, value) in self.values.iter().enumerate() {
            let rows = Rows { numbers: &pooled[head * WIDTH..], stride };
            value.apply(rows, count, &mut joined[head * size..], WIDTH, End::Sum);
        }
        self.out.apply_packed(joined, count, answers, End::Sum);
    }

    /// Multiply-adds of a query by itself, and of an answer.
    pub fn multiply_adds(&self) -> (u64, u64) {
        let sum = |layers: &[Linear]| layers.iter().map(Linear::multiply_adds).sum::<u64>();
        (self.query.multiply_adds() + sum(&self.keys), sum(&self.values) + self.out.multiply_adds())
    }
}

/// Norm, two layers, norm; nothing is added to what came in.
#[derive(Debug)]
pub(super) struct FeedForward {
    kernel: Kernel,
    before: Norm,
    widen: Linear,
    narrow: Linear,
    after: Norm,
}

impl FeedForward {
    pub fn new(source: Source<'_>, name: &str) -> Result<Self, WeightsError> {
        Ok(Self {
            kernel: source.kernel,
            before: source.norm(&format!("{name}.0"))?,
            widen: source.linear(&format!("{name}.1"))?,
            narrow: source.linear(&format!("{name}.4"))?,
            after: source.norm(&format!("{name}.5"))?,
        })
    }

    /// Through it, in place.
    pub fn run(&self, rows: &mut [f32], count: usize, wide: &mut [f32]) {
        let each = |rows: &mut [f32], norm: &Norm| {
            self.kernel.run(|| rows.as_chunks_mut::<WIDTH>().0.iter_mut().take(count).for_each(|row| norm.apply(row)));
        };
        each(rows, &self.before);
        self.widen.apply_packed(rows, count, wide, End::Relu);
        self.narrow.apply_packed(wide, count, rows, End::Sum);
        each(rows, &self.after);
    }

    /// Multiply-adds of a row.
    pub fn multiply_adds(&self) -> u64 {
        self.widen.multiply_adds() + self.narrow.multiply_adds()
    }
}
