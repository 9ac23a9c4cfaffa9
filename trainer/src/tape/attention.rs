//! Attention, with dropout of its shares.

use std::ops::Range;

use super::scalar::Side::{Plain, Transposed};
use super::{Scalar, Tape, Var};

/// One look: a query, and the rows that it looks at, which may come several times.
#[derive(Clone, Debug)]
pub struct Slot {
    /// Which query.
    pub query: usize,
    /// Which rows.
    pub rows: Vec<u32>,
}

impl<'a, T: Scalar> Tape<'a, T> {
    /// For each slot and head the rows it looks at, weighted by the shares that the query gives them, and the sum of those shares (which
    /// dropout changes): [slots, heads x width + heads], of folded queries [n, heads x width] and rows [m, width].
    pub fn pooled(&mut self, queries: Var, points: Var, heads: usize, slots: Vec<Slot>) -> Var {
        let width = self.value(points).columns;
        let wide = heads * (width + 1);
        let mut y = self.spare.any(slots.len() * wide);
        // Of each slot the shares before and after dropout, `[head][row]`.
        let mut shares: Vec<(Vec<T>, Option<Vec<T>>)> = Vec::with_capacity(slots.len());
        let mut seen = Vec::new();
        for (slot, y) in slots.iter().zip(y.chunks_exact_mut(wide)) {
            let count = slot.rows.len();
            let kept = self.kept(heads * count);
            gather(&self.value(points).data, width, &slot.rows, &mut seen);
            let query = &self.value(queries).data[slot.query * heads * width..][..heads * width];
            let mut share = vec![T::ZERO; heads * count];
            T::multiply(false, Plain(query), Transposed(&seen), [heads, width, count], &mut share);
            share.chunks_exact_mut(count).for_each(softmax);
            let dropped = kept
                .as_ref()
                .map(|kept| share.iter().zip(kept).map(|(share, kept)| *share * *kept).collect::<Vec<T>>());
            let used = dropped.as_ref().unwrap_or(&share);
            let (pooled, sums) = y.split_at_mut(heads * width);
            T::multiply(false, Plain(used), Plain(&seen), [heads, count, width], pooled);
            sums.iter_mut().zip(used.chunks_exact(count)).for_each(|(sum, share)| *sum = share.iter().copied().sum());
            shares.push((share, kept));
        }
        self.result(
            &[queries, points],
            slots.len(),
            wide,
            y,
            Box::new(move |values, gradient, gradients| {
                let (mut seen, mut by_seen) = (Vec::new(), Vec::new());
                for ((slot, (share, kept)), gradient) in slots.iter().zip(&shares).zip(gradient.chunks_exact(wide)) {
                    let count = slot.rows.len();
                    let (by_pooled, by_sums) = gradient.split_at(heads * width);
                    gather(&values.get(points).data, width, &slot.rows, &mut seen);
                    let mut by_shares = vec![T::ZERO; heads * count];
                    T::multiply(false, Plain(by_pooled), Transposed(&seen), [heads, width, count], &mut by_shares);
                    for (by_shares, by_sum) in by_shares.chunks_exact_mut(count).zip(by_sums) {
                        by_shares.iter_mut().for_each(|g| *g = *g + *by_sum);
                    }
                    let mut used = share.clone();
                    if let Some(kept) = kept {
                        used.iter_mut().zip(kept).for_each(|(used, kept)| *used = *used * *kept);
                        by_shares.iter_mut().zip(kept).for_each(|(g, kept)| *g = *g * *kept);
                    }
                    for (g, share) in by_shares.chunks_exact_mut(count).zip(share.chunks_exact(count)) {
                        softmax_back(g, share);
                    }
                    let query = &values.get(queries).data[slot.query * heads * width..][..heads * width];
                    if let Some(sum) = gradients.by(values, queries) {
                        let sum = &mut sum[slot.query * heads * width..][..heads * width];
                        T::multiply(true, Plain(&by_shares), Plain(&seen), [heads, count, width], sum);
                    }
                    if let Some(sum) = gradients.by(values, points) {
                        by_seen.resize(count * width, T::ZERO);
                        T::multiply(false, Transposed(&used), Plain(by_pooled), [count, heads, width], &mut by_seen);
                        T::multiply(true, Transposed(&by_shares), Plain(query), [count, heads, width], &mut by_seen);
                        for (row, g) in slot.rows.iter().zip(by_seen.chunks_exact(width)) {
                            sum[*row as usize * width..][..width]
                                .iter_mut()
                                .zip(g)
                                .for_each(|(sum, g)| *sum = *sum + *g);
                        }
                    }
                }
                gradients.spare.keep(gradient);
            }),
        )
    }

    /// Attention within groups of rows, of projected queries, keys and values side by side [n, 3 x width]; only rows that are `seen` are
    /// looked at. Gives [n, width].
    pub fn among(&mut self, projected: Var, heads: usize, groups: Vec<Range<usize>>, seen: Vec<bool>) -> Var {
        let (n, width) = (self.value(projected).rows, self.value(projected).columns / 3);
        let head = width / heads;
        let scale = T::ONE / T::of(head as f64).root();
        let mut y = self.spare.zeros(n * width);
        // For each row and head, shares of the rows of its group that are seen.
        let mut shares: Vec<(Vec<T>, Option<Vec<T>>)> = Vec::new();
        // Where a row's query (0), key (1) or value (2) of a head begins.
        let parts = move |row: usize, part: usize, h: usize| (3 * row + part) * width + h * head;
        for group in &groups {
            let keys: Vec<usize> = group.clone().filter(|row| seen[*row]).collect();
            for row in group.clone() {
                for h in 0..heads {
                    let kept = self.kept(keys.len());
                    let data = &self.value(projected).data;
                    let query = &data[parts(row, 0, h)..][..head];
                    let mut share: Vec<T> =
                        keys.iter().map(|key| dot(query, &data[parts(*key, 1, h)..][..head]) * scale).collect();
                    softmax(&mut share);
                    for (index, key) in keys.iter().enumerate() {
                        let used = kept.as_ref().map_or(share[index], |kept| share[index] * kept[index]);
                        let value = &data[parts(*key, 2, h)..][..head];
                        y[row * width + h * head..][..head]
                            .iter_mut()
                            .zip(value)
                            .for_each(|(y, value)| *y = *y + used * *value);
                    }
                    shares.push((share, kept));
                }
            }
        }
        self.result(
            &[projected],
            n,
            width,
            y,
            Box::new(move |values, gradient, gradients| {
                let Some(sum) = gradients.by(values, projected) else { return };
                let data = &values.get(projected).data;
                let mut shares = shares.iter();
                for group in &groups {
                    let keys: Vec<usize> = group.clone().filter(|row| seen[*row]).collect();
                    for row in group.clone() {
                        for h in 0..heads {
                            let Some((share, kept)) = shares.next() else { return };
                            let g = &gradient[row * width + h * head..][..head];
                            let mut by_shares: Vec<T> =
                                keys.iter().map(|key| dot(g, &data[parts(*key, 2, h)..][..head])).collect();
                            for (index, key) in keys.iter().enumerate() {
                                let factor = kept.as_ref().map_or(T::ONE, |kept| kept[index]);
                                by_shares[index] = by_shares[index] * factor;
                                let used = share[index] * factor;
                                let by_value = &mut sum[parts(*key, 2, h)..][..head];
                                by_value.iter_mut().zip(g).for_each(|(sum, g)| *sum = *sum + used * *g);
                            }
                            softmax_back(&mut by_shares, share);
                            for (by_share, key) in by_shares.iter().zip(&keys) {
                                let by_score = *by_share * scale;
                                let (query, key) = (parts(row, 0, h), parts(*key, 1, h));
                                for k in 0..head {
                                    sum[query + k] = sum[query + k] + by_score * data[key + k];
                                    sum[key + k] = sum[key + k] + by_score * data[query + k];
                                }
                            }
                        }
                    }
                }
            }),
        )
    }
}

fn gather<T: Scalar>(points: &[T], width: usize, rows: &[u32], seen: &mut Vec<T>) {
    seen.clear();
    rows.iter().for_each(|row| seen.extend_from_slice(&points[*row as usize * width..][..width]));
}

fn dot<T: Scalar>(a: &[T], b: &[T]) -> T {
    super::pointwise::total(a.iter().zip(b).map(|(a, b)| *a * *b))
}

/// Scores into shares that sum to 1.
pub(super) fn softmax<T: Scalar>(scores: &mut [T]) {
    let most = scores
        .iter()
        .copied()
        .fold(None, |most: Option<T>, score| Some(most.map_or(score, |most| if score > most { score } else { most })));
    let Some(most) = most else { return };
    scores.iter_mut().for_each(|score| *score = (*score - most).exponential());
    let sum: T = scores.iter().copied().sum();
    scores.iter_mut().for_each(|score| *score = *score / sum);
}

/// The gradient by shares into that by scores.
fn softmax_back<T: Scalar>(gradient: &mut [T], shares: &[T]) {
    let along: T = gradient.iter().zip(shares).map(|(g, share)| *g * *share).sum();
    gradient.iter_mut().zip(shares).for_each(|(g, share)| *g = *share * (*g - along));
}
