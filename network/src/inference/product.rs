//! Products of matrices: rows of activations with weights that were packed once.
//!
//! `c[r][n] = start[n] + sum over k of a[r][k] w[n][k]`, each sum from `k = 0` upwards, one fused multiply-add a term. That order
//! depends neither on the machine's vectors (they run along `n`) nor on how many rows there are, so that a row's answer has the
//! same bytes wherever it is computed and whatever is computed beside it.
//!
//! Weights lie in panels of two vectors: `[panel][k][n in panel]`, so that the innermost loop reads them in a straight line and
//! twelve rows share each read. Nothing is packed and nothing is allocated in a call.

use pulp::{Arch, Simd, WithSimd};

use super::aligned::Aligned;

/// The vector instructions of this machine.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Kernel {
    pub arch: Arch,
    /// Numbers in a vector.
    pub lanes: usize,
}

/// Columns are padded to a multiple of this: two vectors of the widest machine.
const COLUMNS: usize = 32;
/// Rows come in multiples of this.
pub(crate) const ROWS: usize = 4;
/// So many rows go through all panels before the next ones do: they stay in the cache.
const BLOCK: usize = 96;

/// What a sum begins with.
#[derive(Clone, Copy)]
pub(crate) enum Start<'a> {
    /// The bias of its column.
    Bias(&'a [f32]),
    /// What is in its place.
    There,
    /// Nothing.
    Zero,
}

/// What becomes of a sum.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum End {
    Sum,
    /// No less than 0.
    Relu,
}

/// Rows of a matrix: the first at the start of `numbers`, each `stride` after the one before.
#[derive(Clone, Copy)]
pub(crate) struct Rows<'a> {
    pub numbers: &'a [f32],
    pub stride: usize,
}

impl Kernel {
    /// The widest vectors that this machine has.
    pub fn new() -> Self {
        Self::of(Arch::new())
    }

    pub fn of(arch: Arch) -> Self {
        struct Lanes;
        impl WithSimd for Lanes {
            type Output = usize;
            #[inline(always)]
            fn with_simd<S: Simd>(self, _: S) -> usize {
                S::F32_LANES
            }
        }
        Self { arch, lanes: arch.dispatch(Lanes) }
    }

    /// Runs `what` compiled for this machine's vectors.
    #[inline(always)]
    pub fn run<T>(self, what: impl FnOnce() -> T) -> T {
        self.arch.dispatch(what)
    }
}

/// A linear layer, packed for one machine.
#[derive(Clone, Debug)]
pub(crate) struct Linear {
    kernel: Kernel,
    inputs: usize,
    outputs: usize,
    panels: Aligned,
    bias: Aligned,
}

impl Linear {
    /// The layer of weight `weight(output, input)` and bias `bias(output)`.
    pub fn new(
        kernel: Kernel,
        (outputs, inputs): (usize, usize),
        weight: impl Fn(usize, usize) -> f32,
        bias: impl Fn(usize) -> f32,
    ) -> Self {
        let stride = outputs.next_multiple_of(COLUMNS);
        let width = 2 * kernel.lanes;
        let mut panels = Aligned::new(stride * inputs);
        for output in 0..outputs {
            let (panel, column) = (output / width, output % width);
            for input in 0..inputs {
                panels[(panel * inputs + input) * width + column] = weight(output, input);
            }
        }
        let mut biases = Aligned::new(stride);
        (0..outputs).for_each(|output| biases[output] = bias(output));
        Self { kernel, inputs, outputs, panels, bias: biases }
    }

    /// From one row of the result to the next, where nothing else lies between them.
    pub fn stride(&self) -> usize {
        self.outputs.next_multiple_of(COLUMNS)
    }

    /// Multiply-adds of a row.
    pub fn multiply_adds(&self) -> u64 {
        (self.inputs * self.outputs) as u64
    }

    /// `rows` rows of `a` through the layer into those of `c`, `c_stride` apart. Both must have room for a multiple of [`ROWS`]; what
    /// the rows past the last become is of no account.
    pub fn apply(&self, a: Rows<'_>, rows: usize, c: &mut [f32], c_stride: usize, end: End) {
        self.product(a, rows, c, c_stride, Start::Bias(&self.bias), end);
    }

    /// The same, added to what is there instead of to the bias.
    pub fn add(&self, a: Rows<'_>, rows: usize, c: &mut [f32], c_stride: usize, end: End) {
        self.product(a, rows, c, c_stride, Start::There, end);
    }

    /// The same, rows one after another.
    pub fn apply_packed(&self, a: &[f32], rows: usize, c: &mut [f32], end: End) {
        self.apply(Rows { numbers: a, stride: self.inputs }, rows, c, self.stride(), end);
    }

    fn product(&self, a: Rows<'_>, rows: usize, c: &mut [f32], c_stride: usize, start: Start<'_>, end: End) {
        self.kernel.arch.dispatch(Product {
            a,
            rows: rows.next_multiple_of(ROWS),
            inputs: self.inputs,
            columns: self.stride(),
            panels: &self.panels,
            c,
            c_stride,
            start,
            end,
        });
    }
}

struct Product<'a> {
    a: Rows<'a>,
    rows: usize,
    inputs: usize,
    columns: usize,
    panels: &'a [f32],
    c: &'a mut [f32],
    c_stride: usize,
    start: Start<'a>,
    end: End,
}

impl WithSimd for Product<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let width = 2 * S::F32_LANES;
        let mut block = 0;
        while block < self.rows {
            let end = (block + BLOCK).min(self.rows);
            for (index, panel) in self.panels.chunks_exact(width * self.inputs).enumerate() {
                let column = index * width;
                if column >= self.columns {
                    break;
                }
                let panel = S::as_simd_f32s(panel).0.as_chunks::<2>().0;
                let start = match self.start {
                    Start::Bias(bias) => Start::Bias(&bias[column..column + width]),
                    other => other,
                };
                let mut row = block;
                while row < end {
                    let a = Rows { numbers: &self.a.numbers[row * self.a.stride..], stride: self.a.stride };
                    let c = &mut self.c[row * self.c_stride + column..];
                    // Twelve rows of two vectors fill the registers of a machine with 32 of them, four those of one with 16.
                    if S::F32_LANES >= 16 && end - row >= 12 {
                        tile::<S, 12, 2>(simd, a, panel, c, self.c_stride, start, self.end);
                        row += 12;
                    } else if S::F32_LANES >= 16 && end - row >= 8 {
                        tile::<S, 8, 2>(simd, a, panel, c, self.c_stride, start, self.end);
                        row += 8;
                    } else {
                        tile::<S, 4, 2>(simd, a, panel, c, self.c_stride, start, self.end);
                        row += 4;
                    }
                }
            }
            block = end;
        }
    }
}

/// `R` rows by `V` vectors of columns.
#[inline(always)]
pub(super) fn tile<S: Simd, const R: usize, const V: usize>(
    simd: S,
    a: Rows<'_>,
    panel: &[[S::f32s; V]],
    c: &mut [f32],
    c_stride: usize,
    start: Start<'_>,
    end: End,
) {
    let inputs = panel.len();
    let rows: [&[f32]; R] = std::array::from_fn(|row| &a.numbers[row * a.stride..][..inputs]);
    let width = V * S::F32_LANES;
    let mut sums = [[simd.splat_f32s(0.0); V]; R];
    for (row, sums) in sums.iter_mut().enumerate() {
        let from = match start {
            Start::Bias(bias) => bias,
            Start::There => &c[row * c_stride..][..width],
            Start::Zero => continue,
        };
        sums.copy_from_slice(&S::as_simd_f32s(&from[..width]).0[..V]);
    }
    for (input, weights) in panel.iter().enumerate() {
        for (row, sums) in rows.iter().zip(&mut sums) {
            let activation = simd.splat_f32s(row[input]);
            for (weight, sum) in weights.iter().zip(sums) {
                *sum = simd.mul_add_f32s(activation, *weight, *sum);
            }
        }
    }
    let zero = simd.splat_f32s(0.0);
    for (row, sums) in sums.iter().enumerate() {
        let out = S::as_mut_simd_f32s(&mut c[row * c_stride..][..width]).0;
        for (sum, out) in sums.iter().zip(out) {
            *out = if end == End::Relu { simd.max_f32s(*sum, zero) } else { *sum };
        }
    }
}

/// Numbers in [-1, 1) that are not round.
#[cfg(test)]
pub(super) fn numbers(count: usize, seed: u64) -> Vec<f32> {
    let mixed = |i: u64| (i + seed).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40;
    (0..count as u64).map(|i| mixed(i) as f32 / 8_388_608.0 - 1.0).collect()
}

/// Every set of instructions that this machine has.
#[cfg(test)]
pub(super) fn kernels() -> Vec<Kernel> {
    let mut all = vec![Kernel::of(Arch::Scalar), Kernel::new()];
    #[cfg(target_arch = "x86_64")]
    all.extend(pulp::x86::V3::try_new().map(|simd| Kernel::of(Arch::V3(simd))));
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_product_is_the_sum_of_its_terms_in_order_on_any_machine() {
        for (rows, inputs, outputs) in [(1_usize, 8, 9), (11, 256, 100), (104, 10, 384), (7, 3, 64)] {
            let a = numbers(rows.next_multiple_of(ROWS) * inputs, 1);
            let (w, b) = (numbers(inputs * outputs, 2), numbers(outputs, 3));
            for kernel in kernels() {
                let linear = Linear::new(kernel, (outputs, inputs), |n, k| w[n * inputs + k], |n| b[n]);
                let mut c = vec![0.0; rows.next_multiple_of(ROWS) * linear.stride()];
                linear.apply_packed(&a, rows, &mut c, End::Relu);
                for row in 0..rows {
                    for n in 0..outputs {
                        #[allow(
                            clippy::disallowed_methods,
                            reason = "fused is what is meant, and Rust's is everywhere"
                        )]
                        let sum = (0..inputs).fold(b[n], |sum, k| a[row * inputs + k].mul_add(w[n * inputs + k], sum));
                        assert_eq!(c[row * linear.stride() + n].to_bits(), sum.max(0.0).to_bits());
                    }
                }
            }
        }
    }
}
