//! The reference line, and the exact search for its nearest sample.
//!
//! The answer is that of a look at every sample: the smallest squared distance, and of equal ones the first. Most samples are
//! not looked at. They lie in blocks with a bounding box each:
//!
//! - Around the hint three blocks are looked at. Where the nearest of them is in the middle block, less than half as far away as
//!   all other blocks are from that one, no other sample is as near.
//! - Else boxes tell where to look, in groups with a bounding box of their own. The distance to a box, computed by the same operations
//!   as that to a sample, never rounds to more than that to a sample within; so what is skipped could not win.

use world::trigonometry::sincos_all;

/// Samples of a block.
const BLOCK: usize = 16;
/// Boxes that are looked at together.
const GROUP: usize = 8;

/// The samples to search, as columns.
#[derive(Clone, Debug, Default)]
pub struct Line {
    /// The samples' places, after a block of what is infinitely far away, and before another and what lacks to a whole one.
    x: Vec<f64>,
    y: Vec<f64>,
    heading: Vec<f64>,
    /// Sine and cosine of the heading.
    sine: Vec<f64>,
    cosine: Vec<f64>,
    /// The blocks' boxes, and the boxes of these groups; what lacks to a whole group is nowhere.
    blocks: Vec<Boxes>,
    groups: Vec<Boxes>,
    /// For each block a squared distance (m^2): less than that of half the way to any block that is not next to it.
    apart: Vec<f64>,
}

/// A place told by the line.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Frenet {
    /// The nearest sample.
    pub sample: usize,
    /// Distance to that sample (m), negative to the right of the line.
    pub lateral: f64,
}

impl Line {
    /// Makes these columns the line. All are of one length; nothing is allocated where the line before was as long.
    #[inline(always)]
    pub(super) fn set(&mut self, x: &[f64], y: &[f64], heading: &[f64]) {
        let samples = heading.len();
        for (column, with) in [(&mut self.x, x), (&mut self.y, y)] {
            column.clear();
            column.resize(BLOCK, f64::INFINITY);
            column.extend_from_slice(with);
            column.resize((samples.div_ceil(BLOCK) + 2) * BLOCK, f64::INFINITY);
        }
        self.heading.clear();
        self.heading.extend_from_slice(heading);
        self.sine.resize(samples, 0.0);
        self.cosine.resize(samples, 0.0);
        sincos_all(heading, &mut self.sine, &mut self.cosine);
        self.set_boxes(x, y);
        self.set_apart();
    }

    #[inline(always)]
    fn set_boxes(&mut self, x: &[f64], y: &[f64]) {
        self.blocks.clear();
        self.groups.clear();
        for (block, (x, y)) in x.chunks(BLOCK).zip(y.chunks(BLOCK)).enumerate() {
            let (group, place) = (block / GROUP, block % GROUP);
            if place == 0 {
                self.blocks.push(Boxes::NOWHERE);
                if group % GROUP == 0 {
                    self.groups.push(Boxes::NOWHERE);
                }
            }
            let bounds = Bounds::of(x, y);
            self.blocks[group].add(place, &bounds);
            self.groups[group / GROUP].add(group % GROUP, &bounds);
        }
    }

    #[inline(always)]
    fn set_apart(&mut self) {
        /// A little less than half, squared: more than rounding could be.
        const SHARE: f64 = 0.49 * 0.49;
        let blocks = self.heading.len().div_ceil(BLOCK);
        self.apart.clear();
        for block in 0..blocks {
            let bounds = self.blocks[block / GROUP].get(block % GROUP);
            let mut apart = f64::INFINITY;
            for (group, boxes) in self.blocks.iter().enumerate() {
                let distances = boxes.distances_to(&bounds);
                let next = |i: usize| (group * GROUP + i).abs_diff(block) <= 1;
                let others: [f64; GROUP] = std::array::from_fn(|i| if next(i) { f64::INFINITY } else { distances[i] });
                apart = less(apart, least(others));
            }
            self.apart.push(SHARE * apart);
        }
    }

    /// How many samples there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.heading.len()
    }

    /// Whether there is no sample.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.heading.is_empty()
    }

    /// x, y and heading of a sample.
    #[must_use]
    #[inline(always)]
    pub fn sample(&self, k: usize) -> (f64, f64, f64) {
        (self.x[BLOCK + k], self.y[BLOCK + k], self.heading[k])
    }

    /// Cosine and sine of a sample's heading.
    #[must_use]
    #[inline(always)]
    pub fn direction(&self, k: usize) -> (f64, f64) {
        (self.cosine[k], self.sine[k])
    }

    /// The sample nearest to (x, y), the first of equally near ones. `hint` only makes it faster. The line is not empty.
    #[must_use]
    #[inline(always)]
    pub fn nearest(&self, x: f64, y: f64, hint: usize) -> usize {
        /// How often it is looked around, where the nearest is in another block than the middle one.
        const LOOKS: usize = 3;
        let mut block = hint.min(self.len().saturating_sub(1)) / BLOCK;
        for _ in 0..LOOKS {
            let (distance, sample) = self.nearest_of::<{ 3 * BLOCK }>(block * BLOCK, x, y);
            if sample / BLOCK == block {
                if distance < self.apart[block] {
                    return sample;
                }
                break;
            }
            block = sample / BLOCK;
        }
        self.nearest_by_boxes(x, y, block)
    }

    /// Squared distance and sample of the nearest of so many places from `start` on in the columns, the first of equally near ones.
    #[inline(always)]
    fn nearest_of<const N: usize>(&self, start: usize, x: f64, y: f64) -> (f64, usize) {
        let (xs, ys) = (&self.x[start..start + N], &self.y[start..start + N]);
        let mut distances = [0.0; N];
        for i in 0..N {
            let (dx, dy) = (xs[i] - x, ys[i] - y);
            distances[i] = dx * dx + dy * dy;
        }
        let mut lanes = [f64::INFINITY; GROUP];
        for eight in distances.as_chunks::<GROUP>().0 {
            for i in 0..GROUP {
                lanes[i] = less(lanes[i], eight[i]);
            }
        }
        let distance = least(lanes);
        let mut found = 0_u64;
        for (i, d) in distances.iter().enumerate() {
            found |= u64::from(*d == distance) << i;
        }
        // None is found where there are no distances: the place is no number.
        let sample = (start + found.trailing_zeros() as usize).saturating_sub(BLOCK);
        (distance, sample.min(self.len() - 1))
    }

    #[inline(always)]
    fn nearest_by_boxes(&self, x: f64, y: f64, first: usize) -> usize {
        let block = |block: usize| {
            let (distance, sample) = self.nearest_of::<BLOCK>((block + 1) * BLOCK, x, y);
            Best { distance, sample }
        };
        let place = Bounds { low_x: x, low_y: y, high_x: x, high_y: y };
        let mut best = block(first);
        for (bundle, boxes) in self.groups.iter().enumerate() {
            for (g, distance) in boxes.distances_to(&place).into_iter().enumerate() {
                let group = bundle * GROUP + g;
                if !best.beaten_by(distance, group * GROUP * BLOCK) || group >= self.blocks.len() {
                    continue;
                }
                for (b, distance) in self.blocks[group].distances_to(&place).into_iter().enumerate() {
                    let other = group * GROUP + b;
                    if other != first && other < self.apart.len() && best.beaten_by(distance, other * BLOCK) {
                        let other = block(other);
                        if best.beaten_by(other.distance, other.sample) {
                            best = other;
                        }
                    }
                }
            }
        }
        best.sample
    }

    /// Where (x, y) is along and beside the line. The line is not empty.
    #[must_use]
    #[inline(always)]
    pub fn frenet(&self, x: f64, y: f64, hint: usize) -> Frenet {
        self.frenet_at(x, y, self.nearest(x, y, hint))
    }

    /// [`Line::frenet`] of a place whose nearest sample is known.
    #[must_use]
    #[inline(always)]
    pub fn frenet_at(&self, x: f64, y: f64, sample: usize) -> Frenet {
        let (dx, dy) = (x - self.x[BLOCK + sample], y - self.y[BLOCK + sample]);
        let (sin, cos) = (self.sine[sample], self.cosine[sample]);
        let side = dy * cos - dx * sin;
        let distance = (dx * dx + dy * dy).sqrt();
        Frenet { sample, lateral: if side == 0.0 { 0.0 } else { distance.copysign(side) } }
    }
}

/// What some points lie within.
#[derive(Clone, Copy, Debug)]
struct Bounds {
    low_x: f64,
    low_y: f64,
    high_x: f64,
    high_y: f64,
}

impl Bounds {
    #[inline(always)]
    fn of(x: &[f64], y: &[f64]) -> Self {
        Self {
            low_x: x.iter().copied().fold(f64::INFINITY, less),
            low_y: y.iter().copied().fold(f64::INFINITY, less),
            high_x: x.iter().copied().fold(f64::NEG_INFINITY, larger),
            high_y: y.iter().copied().fold(f64::NEG_INFINITY, larger),
        }
    }
}

/// Bounds, a column for each side.
#[derive(Clone, Copy, Debug)]
struct Boxes {
    low_x: [f64; GROUP],
    low_y: [f64; GROUP],
    high_x: [f64; GROUP],
    high_y: [f64; GROUP],
}

impl Boxes {
    const NOWHERE: Self = Self {
        low_x: [f64::INFINITY; GROUP],
        low_y: [f64::INFINITY; GROUP],
        high_x: [f64::NEG_INFINITY; GROUP],
        high_y: [f64::NEG_INFINITY; GROUP],
    };

    /// Makes box `i` hold these bounds too.
    #[inline(always)]
    fn add(&mut self, i: usize, bounds: &Bounds) {
        self.low_x[i] = less(self.low_x[i], bounds.low_x);
        self.low_y[i] = less(self.low_y[i], bounds.low_y);
        self.high_x[i] = larger(self.high_x[i], bounds.high_x);
        self.high_y[i] = larger(self.high_y[i], bounds.high_y);
    }

    #[inline(always)]
    fn get(&self, i: usize) -> Bounds {
        Bounds { low_x: self.low_x[i], low_y: self.low_y[i], high_x: self.high_x[i], high_y: self.high_y[i] }
    }

    /// Squared distances to other bounds: no more than those between any points within, also as rounded.
    #[inline(always)]
    fn distances_to(&self, other: &Bounds) -> [f64; GROUP] {
        std::array::from_fn(|i| {
            let dx = larger(larger(self.low_x[i] - other.high_x, other.low_x - self.high_x[i]), 0.0);
            let dy = larger(larger(self.low_y[i] - other.high_y, other.low_y - self.high_y[i]), 0.0);
            dx * dx + dy * dy
        })
    }
}

/// The least of some numbers, in few steps one after the other.
#[inline(always)]
fn least(numbers: [f64; GROUP]) -> f64 {
    let halves: [f64; GROUP / 2] = std::array::from_fn(|i| less(numbers[i], numbers[i + GROUP / 2]));
    less(less(halves[0], halves[2]), less(halves[1], halves[3]))
}

/// The larger of two numbers; `f64::max` also asks whether they are numbers.
#[inline(always)]
fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

#[inline(always)]
fn less(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

struct Best {
    distance: f64,
    sample: usize,
}

impl Best {
    /// Whether something at this distance, whose first sample is `first`, could take its place.
    #[inline(always)]
    fn beaten_by(&self, distance: f64, first: usize) -> bool {
        distance < self.distance || (distance == self.distance && first < self.sample)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn first_minimum(line: &Line, x: f64, y: f64) -> usize {
        let mut best = (f64::INFINITY, 0);
        for k in 0..line.len() {
            let (sx, sy, _) = line.sample(k);
            let distance = (sx - x) * (sx - x) + (sy - y) * (sy - y);
            if distance < best.0 {
                best = (distance, k);
            }
        }
        best.1
    }

    proptest! {
        #[test]
        fn the_nearest_sample_is_that_of_a_look_at_every_one_whatever_the_hint(
            samples in 1..400_usize, turns in prop::collection::vec(-0.3..0.3, 8), repeated in 0..40_usize,
            grid in any::<bool>(), queries in prop::collection::vec(((-30.0..30.0, -30.0..30.0), 0..500_usize), 20),
        ) {
            let (mut x, mut y, mut heading) = (vec![0.0], vec![0.0], vec![0.0]);
            for k in 1..samples {
                let h: f64 = heading[k - 1] + turns[k * turns.len() / samples] * 0.3;
                x.push(x[k - 1] + 0.1 * libm::cos(h));
                y.push(y[k - 1] + 0.1 * libm::sin(h));
                heading.push(h);
            }
            for column in [&mut x, &mut y, &mut heading] {
                column.extend(std::iter::repeat_n(column[samples - 1], repeated));
                if grid {
                    // Many ties.
                    column.iter_mut().for_each(|v| *v = v.round());
                }
            }
            let mut line = Line::default();
            line.set(&x, &y, &heading);
            for ((x, y), hint) in queries {
                let halves = |v: f64| if grid { (2.0 * v).round() / 2.0 } else { v };
                let (x, y) = (halves(x), halves(y));
                prop_assert_eq!(line.nearest(x, y, hint), first_minimum(&line, x, y));
            }
        }
    }
}
