//! Linear layers, norms and the feed-forward blocks that are made of them.

use pulp::{Arch, Simd, WithSimd};

use crate::activation::layer_norm;
use crate::gemm::{Begin, Finish, Left, Multiplier, Right};
use crate::weights::Weights;
use crate::weights::layout::{HIDDEN, WIDTH};

/// y = W x + b.
#[derive(Clone, Debug)]
pub(super) struct Linear {
    pub(super) weight: Right,
    pub(super) bias: Vec<f32>,
}

impl Linear {
    /// The layer whose tensors are `name`.weight and `name`.bias.
    pub(super) fn of(weights: &Weights, name: &str) -> Self {
        let bias = weights.get(&format!("{name}.bias")).to_vec();
        let weight = weights.get(&format!("{name}.weight"));
        Self { weight: Right::of_rows(weight, weight.len() / bias.len().max(1)), bias }
    }

    /// The layer over `rows` dense rows of `input`, appended to nothing: `output` is made as long as it must be.
    pub(super) fn apply(&self, multiplier: &mut Multiplier, input: Left<'_>, finish: Finish, output: &mut Vec<f32>) {
        let columns = self.weight.columns;
        output.resize(input.rows * columns, 0.0);
        multiplier.multiply(input, &self.weight, Begin::Bias(&self.bias), finish, output, columns);
    }
}

/// A layer norm.
#[derive(Clone, Debug)]
pub(super) struct Norm {
    scale: Vec<f32>,
    shift: Vec<f32>,
}

impl Norm {
    pub(super) fn of(weights: &Weights, name: &str) -> Self {
        let get = |part: &str| weights.get(&format!("{name}.{part}")).to_vec();
        Self { scale: get("weight"), shift: get("bias") }
    }

    /// Normalizes each row.
    pub(super) fn apply(&self, arch: Arch, rows: &mut [f32]) {
        arch.dispatch(Rows { norm: self, rows });
    }
}

struct Rows<'a> {
    norm: &'a Norm,
    rows: &'a mut [f32],
}

impl WithSimd for Rows<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        for row in self.rows.chunks_exact_mut(WIDTH) {
            layer_norm(row, &self.norm.scale, &self.norm.shift);
        }
    }
}

/// Norm, 1024 hidden units, norm: what follows every attention to the map, without a residual (paper's code).
#[derive(Clone, Debug)]
pub(super) struct Block {
    before: Norm,
    wide: Linear,
    narrow: Linear,
    after: Norm,
}

impl Block {
    pub(super) fn of(weights: &Weights, name: &str) -> Self {
        Self {
            before: Norm::of(weights, &format!("{name}.0")),
            wide: Linear::of(weights, &format!("{name}.1")),
            narrow: Linear::of(weights, &format!("{name}.4")),
            after: Norm::of(weights, &format!("{name}.5")),
        }
    }

    /// The block over `rows`, in place; `hidden` is memory.
    pub(super) fn apply(&self, multiplier: &mut Multiplier, rows: &mut Vec<f32>, hidden: &mut Vec<f32>) {
        self.before.apply(multiplier.arch(), rows);
        self.wide.apply(multiplier, Left::dense(rows, WIDTH), Finish::Relu, hidden);
        self.narrow.apply(multiplier, Left::dense(hidden, HIDDEN), Finish::Plain, rows);
        self.after.apply(multiplier.arch(), rows);
    }
}
