//! Attention of one query: an agent to the points of a lane or crosswalk, or to its lanes and crosswalks.
//!
//! With one query for many keys the keys need not be projected: the projection is folded into the query (the keys' bias adds the same
//! to each score, which the softmax takes out again), and the values are projected after they are pooled, since the weights sum to 1.

use pulp::{Arch, Simd, WithSimd};

use crate::gemm::{Begin, Finish, Left, Multiplier, Right};
use crate::weights::Weights;
use crate::weights::layout::WIDTH;

use super::linear::Linear;

/// A multi-head attention with a single query.
#[derive(Clone, Debug)]
pub(super) struct Attention {
    heads: usize,
    query: Linear,
    /// For each head the keys' projection, transposed: from the head's query to the width.
    keys: Vec<Right>,
    /// For each head the values' projection.
    values: Vec<Right>,
    value_bias: Vec<f32>,
    nothing: Vec<f32>,
    output: Linear,
}

impl Attention {
    pub(super) fn of(weights: &Weights, name: &str, heads: usize) -> Self {
        let (projection, bias) =
            (weights.get(&format!("{name}.in_proj_weight")), weights.get(&format!("{name}.in_proj_bias")));
        let width = WIDTH / heads;
        // The scores' scale goes into the query.
        let scale = 1.0 / (width as f32).sqrt();
        let scaled = |values: &[f32]| values.iter().map(|value| value * scale).collect::<Vec<_>>();
        let query = Linear {
            weight: Right::of_rows(&scaled(&projection[..WIDTH * WIDTH]), WIDTH),
            bias: scaled(&bias[..WIDTH]),
        };
        let block = |part: usize, head: usize| {
            let begin = (part * WIDTH + head * width) * WIDTH;
            &projection[begin..begin + width * WIDTH]
        };
        let transposed = |rows: &[f32]| -> Vec<f32> {
            (0..WIDTH).flat_map(|column| rows.iter().skip(column).step_by(WIDTH).copied()).collect()
        };
        Self {
            heads,
            query,
            keys: (0..heads).map(|head| Right::of_rows(&transposed(block(1, head)), width)).collect(),
            values: (0..heads).map(|head| Right::of_rows(block(2, head), WIDTH)).collect(),
            value_bias: bias[2 * WIDTH..].to_vec(),
            nothing: vec![0.0; WIDTH],
            output: Linear::of(weights, &format!("{name}.out_proj")),
        }
    }

    /// The queries of `agents` (rows of 256), as rows to be multiplied with what is attended to: agent by agent, head by head.
    pub(super) fn queries(
        &self,
        multiplier: &mut Multiplier,
        agents: &[f32],
        memory: &mut Vec<f32>,
        queries: &mut Vec<f32>,
    ) {
        let agents = Left::dense(agents, WIDTH);
        self.query.apply(multiplier, agents, Finish::Plain, memory);
        queries.resize(agents.rows * self.heads * WIDTH, 0.0);
        let width = WIDTH / self.heads;
        for (head, keys) in self.keys.iter().enumerate() {
            let query = Left { values: &memory[head * width..], stride: WIDTH, rows: agents.rows };
            let result = &mut queries[head * WIDTH..];
            multiplier.multiply(query, keys, Begin::Bias(&self.nothing), Finish::Plain, result, self.heads * WIDTH);
        }
    }

    /// What comes of `pooled` rows, each of `heads` x 256: projected, joined and projected again, in `output`.
    pub(super) fn project(
        &self,
        multiplier: &mut Multiplier,
        pooled: &[f32],
        memory: &mut Vec<f32>,
        output: &mut Vec<f32>,
    ) {
        let stride = self.heads * WIDTH;
        let rows = pooled.len() / stride;
        memory.resize(rows * WIDTH, 0.0);
        let width = WIDTH / self.heads;
        for (head, values) in self.values.iter().enumerate() {
            let pooled = Left { values: pooled.get(head * WIDTH..).unwrap_or_default(), stride, rows };
            let bias = Begin::Bias(&self.value_bias[head * width..(head + 1) * width]);
            let result = memory.get_mut(head * width..).unwrap_or_default();
            multiplier.multiply(pooled, values, bias, Finish::Plain, result, WIDTH);
        }
        self.output.apply(multiplier, Left::dense(memory, WIDTH), Finish::Plain, output);
    }
}

/// `pooled` (`HEADS` rows of 256) = the sum of `rows` of `values`, weighted for each head; `weights` hold a row of `HEADS` for each.
pub(super) fn pool<const HEADS: usize>(
    arch: Arch,
    values: &[f32],
    rows: &[u16],
    weights: &[[f32; HEADS]],
    pooled: &mut [f32],
) {
    arch.dispatch(Pool { values, rows, weights, pooled });
}

struct Pool<'a, const HEADS: usize> {
    values: &'a [f32],
    rows: &'a [u16],
    weights: &'a [[f32; HEADS]],
    pooled: &'a mut [f32],
}

impl<const HEADS: usize> WithSimd for Pool<'_, HEADS> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        match S::F32_LANES {
            16 => self.run::<S, 2>(simd),
            8 => self.run::<S, 1>(simd),
            4 => self.run::<S, 1>(simd),
            _ => self.run::<S, 4>(simd),
        }
    }
}

impl<const HEADS: usize> Pool<'_, HEADS> {
    #[inline(always)]
    fn run<S: Simd, const VECTORS: usize>(self, simd: S) {
        let per_row = WIDTH / (VECTORS * S::F32_LANES);
        let (values, _) = S::as_simd_f32s(self.values);
        let (values, _) = values.as_chunks::<VECTORS>();
        for column in 0..per_row {
            let mut sums = [[simd.splat_f32s(0.0); VECTORS]; HEADS];
            for (row, weights) in self.rows.iter().zip(self.weights) {
                let values = &values[usize::from(*row) * per_row + column];
                for (sums, weight) in sums.iter_mut().zip(weights) {
                    let weight = simd.splat_f32s(*weight);
                    for (sum, value) in sums.iter_mut().zip(values) {
                        *sum = simd.mul_add_f32s(weight, *value, *sum);
                    }
                }
            }
            for (sums, pooled) in sums.iter().zip(self.pooled.chunks_exact_mut(WIDTH)) {
                let (pooled, _) = S::as_mut_simd_f32s(pooled);
                pooled[column * VECTORS..(column + 1) * VECTORS].copy_from_slice(sums);
            }
        }
    }
}
