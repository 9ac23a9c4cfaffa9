//! Products of matrices of f32, fast and the same everywhere.
//!
//! Every element is summed in the order of the inner index, each term by one fused multiply-add, whatever the width of the core's
//! vectors and however many rows there are: so a row's result does not depend on the rows beside it, nor on the machine.

use pulp::{Arch, Simd, WithSimd};

/// Columns that are computed together.
const PANEL: usize = 32;

/// Rows of the left matrix that are packed together: what stays in the second cache.
const BLOCK: usize = 96;

/// A matrix on the right-hand side, packed.
#[derive(Clone, Debug, Default)]
pub struct Right {
    /// Rows, the length of the sums.
    pub inner: usize,
    /// Columns.
    pub columns: usize,
    /// Panel by panel, row by row.
    panels: Vec<f32>,
}

impl Right {
    /// The transpose of `weight`, whose rows of length `inner` are the columns of the product, as linear layers keep them.
    #[must_use]
    pub fn of_rows(weight: &[f32], inner: usize) -> Self {
        let columns = weight.len() / inner.max(1);
        let mut right = Self { inner, columns, panels: Vec::new() };
        right.pack(weight, inner, columns);
        right
    }

    /// As [`Right::of_rows`], in the memory that this one has.
    pub fn pack(&mut self, weight: &[f32], inner: usize, columns: usize) {
        (self.inner, self.columns) = (inner, columns);
        self.panels.clear();
        self.panels.resize(columns.div_ceil(PANEL) * inner * PANEL, 0.0);
        for (column, row) in weight.chunks_exact(inner).take(columns).enumerate() {
            let panel = &mut self.panels[column / PANEL * inner * PANEL..];
            for (k, value) in row.iter().enumerate() {
                panel[k * PANEL + column % PANEL] = *value;
            }
        }
    }

    fn panel(&self, index: usize) -> &[f32] {
        &self.panels[index * self.inner * PANEL..(index + 1) * self.inner * PANEL]
    }
}

/// What becomes of each element.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Finish {
    /// Nothing.
    Plain,
    /// Zero where it is negative.
    Relu,
}

/// What the sums begin with.
#[derive(Clone, Copy, Debug)]
pub enum Begin<'a> {
    /// A number for each column.
    Bias(&'a [f32]),
    /// What the result's memory holds.
    Result,
}

/// The left matrix of a product: `rows` of them, `stride` apart.
#[derive(Clone, Copy, Debug)]
pub struct Left<'a> {
    /// Its elements.
    pub values: &'a [f32],
    /// Elements from one row's start to the next one's.
    pub stride: usize,
    /// Rows.
    pub rows: usize,
}

impl<'a> Left<'a> {
    /// Rows without anything between them.
    #[must_use]
    pub fn dense(values: &'a [f32], columns: usize) -> Self {
        Self { values, stride: columns, rows: values.len() / columns.max(1) }
    }
}

/// Multiplies, with the memory that it needs.
#[derive(Clone, Debug)]
pub struct Multiplier {
    arch: Arch,
    packed: Vec<f32>,
}

impl Default for Multiplier {
    fn default() -> Self {
        Self { arch: Arch::new(), packed: Vec::new() }
    }
}

impl Multiplier {
    /// The core's instructions.
    #[must_use]
    pub fn arch(&self) -> Arch {
        self.arch
    }

    /// `result` = `finish`(`begin` + `left` x `right`), its rows `stride` apart.
    pub fn multiply(
        &mut self,
        left: Left<'_>,
        right: &Right,
        begin: Begin<'_>,
        finish: Finish,
        result: &mut [f32],
        stride: usize,
    ) {
        let packed = &mut self.packed;
        self.arch.dispatch(Product { left, right, begin, finish, result, stride, packed });
    }
}

struct Product<'a> {
    left: Left<'a>,
    right: &'a Right,
    begin: Begin<'a>,
    finish: Finish,
    result: &'a mut [f32],
    stride: usize,
    packed: &'a mut Vec<f32>,
}

impl WithSimd for Product<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        // As many sums at once as there are registers for.
        match S::F32_LANES {
            16 => self.run::<S, 12, 2>(simd),
            8 => self.run::<S, 3, 4>(simd),
            4 => self.run::<S, 1, 8>(simd),
            _ => self.run::<S, 1, PANEL>(simd),
        }
    }
}

impl Product<'_> {
    #[inline(always)]
    fn run<S: Simd, const ROWS: usize, const VECTORS: usize>(mut self, simd: S) {
        let mut first = 0;
        while first < self.left.rows {
            let rows = (self.left.rows - first).min(BLOCK / ROWS * ROWS);
            let mut packed = std::mem::take(self.packed);
            packed.clear();
            let mut at = 0;
            while at < rows {
                self.pack(first + at, ROWS.min(rows - at), &mut packed);
                at += ROWS;
            }
            for panel in 0..self.right.columns.div_ceil(PANEL) {
                self.block::<S, ROWS, VECTORS>(simd, first, rows, panel, &packed);
            }
            *self.packed = packed;
            first += rows;
        }
    }

    /// Rows side by side, so that what is needed together lies together.
    #[inline(always)]
    fn pack(&self, first: usize, rows: usize, packed: &mut Vec<f32>) {
        let inner = self.right.inner;
        let begin = packed.len();
        packed.resize(begin + rows * inner, 0.0);
        let packed = &mut packed[begin..];
        for row in 0..rows {
            let start = (first + row) * self.left.stride;
            let values = &self.left.values[start..start + inner];
            for (to, value) in packed[row..].iter_mut().step_by(rows).zip(values) {
                *to = *value;
            }
        }
    }

    #[inline(always)]
    fn block<S: Simd, const ROWS: usize, const VECTORS: usize>(
        &mut self,
        simd: S,
        first: usize,
        rows: usize,
        panel: usize,
        packed: &[f32],
    ) {
        let inner = self.right.inner;
        let mut at = 0;
        while at < rows {
            let count = ROWS.min(rows - at);
            let left = &packed[at * inner..(at + count) * inner];
            match count {
                12 => self.sums::<S, 12, VECTORS>(simd, first + at, panel, left),
                11 => self.sums::<S, 11, VECTORS>(simd, first + at, panel, left),
                10 => self.sums::<S, 10, VECTORS>(simd, first + at, panel, left),
                9 => self.sums::<S, 9, VECTORS>(simd, first + at, panel, left),
                8 => self.sums::<S, 8, VECTORS>(simd, first + at, panel, left),
                7 => self.sums::<S, 7, VECTORS>(simd, first + at, panel, left),
                6 => self.sums::<S, 6, VECTORS>(simd, first + at, panel, left),
                5 => self.sums::<S, 5, VECTORS>(simd, first + at, panel, left),
                4 => self.sums::<S, 4, VECTORS>(simd, first + at, panel, left),
                3 => self.sums::<S, 3, VECTORS>(simd, first + at, panel, left),
                2 => self.sums::<S, 2, VECTORS>(simd, first + at, panel, left),
                _ => self.sums::<S, 1, VECTORS>(simd, first + at, panel, left),
            }
            at += count;
        }
    }

    #[inline(always)]
    fn sums<S: Simd, const ROWS: usize, const VECTORS: usize>(
        &mut self,
        simd: S,
        first: usize,
        panel: usize,
        left: &[f32],
    ) {
        let column = panel * PANEL;
        let width = PANEL.min(self.right.columns - column);
        let mut begins = [[0.0; PANEL]; ROWS];
        for (row, begin) in begins.iter_mut().enumerate() {
            let from = match self.begin {
                Begin::Bias(bias) => &bias[column..column + width],
                Begin::Result => &self.result[(first + row) * self.stride + column..][..width],
            };
            begin[..width].copy_from_slice(from);
        }
        let mut sums = [[simd.splat_f32s(0.0); VECTORS]; ROWS];
        for (sums, begin) in sums.iter_mut().zip(&begins) {
            sums.copy_from_slice(S::as_simd_f32s(begin).0);
        }
        let (right, _) = S::as_simd_f32s(self.right.panel(panel));
        for (right, left) in right.as_chunks::<VECTORS>().0.iter().zip(left.as_chunks::<ROWS>().0) {
            for (sums, left) in sums.iter_mut().zip(left) {
                let left = simd.splat_f32s(*left);
                for (sum, right) in sums.iter_mut().zip(right) {
                    *sum = simd.mul_add_f32s(left, *right, *sum);
                }
            }
        }
        if self.finish == Finish::Relu {
            let zero = simd.splat_f32s(0.0);
            sums.iter_mut().flatten().for_each(|sum| *sum = simd.max_f32s(*sum, zero));
        }
        for (row, sums) in sums.iter().enumerate() {
            let result = &mut self.result[(first + row) * self.stride + column..][..width];
            S::as_mut_simd_f32s(&mut begins[row]).0.copy_from_slice(sums);
            result.copy_from_slice(&begins[row][..width]);
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::activation::fused;

    /// The same, element by element.
    fn plain(left: &[f32], weight: &[f32], bias: &[f32], inner: usize) -> Vec<f32> {
        let element = |row: &[f32], column: &[f32], begin: f32| {
            row.iter().zip(column).fold(begin, |sum, (a, b)| fused(*a, *b, sum))
        };
        let rows = left.chunks_exact(inner);
        let columns = || weight.chunks_exact(inner).zip(bias);
        rows.flat_map(|row| columns().map(move |(column, bias)| element(row, column, *bias))).collect()
    }

    fn numbers(count: usize, seed: u32) -> Vec<f32> {
        let number = |index: usize| {
            let mixed = (index as u32 ^ seed).wrapping_mul(2_654_435_761).rotate_left(13).wrapping_mul(40_503);
            (mixed >> 8) as f32 / 8_388_608.0 - 1.0
        };
        (0..count).map(number).collect()
    }

    proptest! {
        #[test]
        fn each_element_is_summed_in_order_by_fused_multiply_adds(
            rows in 1_usize..110, inner in 1_usize..40, columns in 1_usize..80, seed in any::<u32>(),
        ) {
            let (left, weight) = (numbers(rows * inner, seed), numbers(columns * inner, !seed));
            let bias = numbers(columns, seed ^ 77);
            let wanted = plain(&left, &weight, &bias, inner);
            let right = Right::of_rows(&weight, inner);
            let mut result = vec![f32::NAN; rows * columns];
            let mut multiplier = Multiplier::default();
            let left = Left::dense(&left, inner);
            multiplier.multiply(left, &right, Begin::Bias(&bias), Finish::Plain, &mut result, columns);
            prop_assert_eq!(&result, &wanted);
            // On from what is there, and without what is negative.
            let twice: Vec<f32> = result.clone();
            multiplier.multiply(left, &right, Begin::Result, Finish::Relu, &mut result, columns);
            let sum = plain(left.values, &weight, &vec![0.0; columns], inner);
            for ((got, before), added) in result.iter().zip(&twice).zip(sum) {
                prop_assert!((got - (before + added).max(0.0)).abs() < 1e-4);
            }
        }
    }
}
