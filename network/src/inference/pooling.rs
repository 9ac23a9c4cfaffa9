//! The two products of one query with many rows: its scores, and the rows pooled by their shares of it. As in `product`, every sum runs
//! in the order of its terms on any machine.

use pulp::{Simd, WithSimd};

use super::product::{End, Kernel, Rows, Start, tile};

/// Scores of points by the heads of one query: `scores[point][head]` is the product of the point's row with the head's.
pub(super) struct Scores<'a> {
    /// `[input][lane]`, a vector a head where a machine has no more lanes: see [`Kernel::pack_heads`].
    pub heads: &'a [f32],
    /// Points, [`crate::constants::WIDTH`] apart; a multiple of [`ROWS`].
    pub points: &'a [f32],
    pub count: usize,
    /// [`HEAD_STRIDE`] apart.
    pub scores: &'a mut [f32],
}

/// From the scores of one point to the next's.
pub(super) const HEAD_STRIDE: usize = 16;
const HEADS: usize = crate::constants::HEADS;
const WIDTH: usize = crate::constants::WIDTH;

impl Kernel {
    /// Numbers that [`Scores::heads`] has.
    pub const PACKED_HEADS: usize = WIDTH * HEAD_STRIDE;

    /// The rows of eight heads, turned for [`Scores`].
    pub(super) fn pack_heads(self, heads: &[f32], packed: &mut [f32]) {
        let lanes = self.lanes.min(HEAD_STRIDE);
        for (head, row) in heads.as_chunks::<WIDTH>().0.iter().enumerate().take(HEADS) {
            let (panel, lane) = (head / lanes, head % lanes);
            for (input, value) in row.iter().enumerate() {
                packed[(panel * WIDTH + input) * lanes + lane] = *value;
            }
        }
    }

    pub(super) fn scores(self, scores: Scores<'_>) {
        self.arch.dispatch(scores);
    }

    /// `sums[head][k]` = the sum over points of their weight by that head times their row's `k`, first point first.
    pub(super) fn pool(self, weights: &[[f32; HEADS]], points: &[f32], sums: &mut [f32]) {
        self.arch.dispatch(Pool { weights, points, sums });
    }
}

impl WithSimd for Scores<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let lanes = S::F32_LANES;
        let panels = HEADS.div_ceil(lanes);
        for (index, panel) in self.heads.chunks_exact(lanes * WIDTH).take(panels).enumerate() {
            let panel = S::as_simd_f32s(panel).0.as_chunks::<1>().0;
            let mut row = 0;
            while row < self.count {
                let a = Rows { numbers: &self.points[row * WIDTH..], stride: WIDTH };
                let c = &mut self.scores[row * HEAD_STRIDE + index * lanes..];
                if S::F32_LANES >= 16 && self.count - row >= 12 {
                    tile::<S, 12, 1>(simd, a, panel, c, HEAD_STRIDE, Start::Zero, End::Sum);
                    row += 12;
                } else {
                    tile::<S, 4, 1>(simd, a, panel, c, HEAD_STRIDE, Start::Zero, End::Sum);
                    row += 4;
                }
            }
        }
    }
}

struct Pool<'a> {
    weights: &'a [[f32; HEADS]],
    points: &'a [f32],
    sums: &'a mut [f32],
}

impl WithSimd for Pool<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let width = 2 * S::F32_LANES;
        for column in (0..WIDTH).step_by(width) {
            if S::F32_LANES >= 16 {
                pool_tile::<S, 8>(simd, self.weights, 0, self.points, self.sums, column);
            } else {
                pool_tile::<S, 4>(simd, self.weights, 0, self.points, self.sums, column);
                pool_tile::<S, 4>(simd, self.weights, 4, self.points, self.sums, column);
            }
        }
    }
}

#[inline(always)]
fn pool_tile<S: Simd, const H: usize>(
    simd: S,
    weights: &[[f32; HEADS]],
    first: usize,
    points: &[f32],
    sums: &mut [f32],
    column: usize,
) {
    let mut pooled = [[simd.splat_f32s(0.0); 2]; H];
    for (weights, point) in weights.iter().zip(points.as_chunks::<WIDTH>().0) {
        let numbers = S::as_simd_f32s(&point[column..column + 2 * S::F32_LANES]).0;
        for (head, pooled) in pooled.iter_mut().enumerate() {
            let weight = simd.splat_f32s(weights[first + head]);
            for (number, pooled) in numbers.iter().zip(pooled) {
                *pooled = simd.mul_add_f32s(weight, *number, *pooled);
            }
        }
    }
    for (head, pooled) in pooled.iter().enumerate() {
        let row = &mut sums[(first + head) * WIDTH + column..][..2 * S::F32_LANES];
        S::as_mut_simd_f32s(row).0.copy_from_slice(pooled);
    }
}

#[cfg(test)]
mod tests {
    use super::super::product::{kernels, numbers};
    use super::*;

    #[test]
    fn scores_and_pools_have_the_same_bytes_on_any_machine() {
        let (heads, points) = (numbers(HEADS * WIDTH, 4), numbers(100 * WIDTH, 5));
        let of = |kernel: Kernel| {
            let mut packed = vec![0.0; Kernel::PACKED_HEADS];
            kernel.pack_heads(&heads, &mut packed);
            let mut scores = vec![0.0; 100 * HEAD_STRIDE];
            kernel.scores(Scores { heads: &packed, points: &points, count: 100, scores: &mut scores });
            let weights: Vec<[f32; HEADS]> =
                scores.as_chunks::<HEAD_STRIDE>().0.iter().map(|row| std::array::from_fn(|head| row[head])).collect();
            let mut sums = vec![0.0; HEADS * WIDTH];
            kernel.pool(&weights, &points, &mut sums);
            (weights, sums)
        };
        let all: Vec<_> = kernels().into_iter().map(of).collect();
        assert!(all.windows(2).all(|pair| pair[0] == pair[1]));
        let dot: f32 = heads[..WIDTH].iter().zip(&points[WIDTH..]).map(|(u, e)| u * e).sum();
        assert!((all[0].0[1][0] - dot).abs() < 1e-4);
    }
}
