//! The reference line, and the exact search for its nearest sample.
//!
//! The answer is that of a look at every sample: the smallest squared distance, and of equal ones the first. Most samples are
//! not looked at: they lie in blocks, and blocks in groups, with a bounding box each. The distance to a box, computed by the
//! same operations as that to a sample, never rounds to more than that to a sample within; so what is skipped could not win.

/// Samples of a block.
const BLOCK: usize = 16;
/// Blocks of a group.
const GROUP: usize = 8;

/// The samples to search, as columns.
#[derive(Clone, Debug, Default)]
pub struct Line {
    x: Vec<f64>,
    y: Vec<f64>,
    heading: Vec<f64>,
    /// Sine and cosine of the heading.
    direction: Vec<(f64, f64)>,
    blocks: Vec<Bounds>,
    groups: Vec<Bounds>,
}

#[derive(Clone, Copy, Debug)]
struct Bounds {
    low_x: f64,
    low_y: f64,
    high_x: f64,
    high_y: f64,
}

impl Bounds {
    const EMPTY: Self =
        Self { low_x: f64::INFINITY, low_y: f64::INFINITY, high_x: f64::NEG_INFINITY, high_y: f64::NEG_INFINITY };

    fn add(self, other: Self) -> Self {
        Self {
            low_x: self.low_x.min(other.low_x),
            low_y: self.low_y.min(other.low_y),
            high_x: self.high_x.max(other.high_x),
            high_y: self.high_y.max(other.high_y),
        }
    }

    /// Squared distance: no more than that of any point within, also as rounded.
    #[inline]
    fn distance(&self, x: f64, y: f64) -> f64 {
        let dx = larger(larger(self.low_x - x, x - self.high_x), 0.0);
        let dy = larger(larger(self.low_y - y, y - self.high_y), 0.0);
        dx * dx + dy * dy
    }
}

/// The larger of two numbers; `f64::max` also asks whether they are numbers.
#[inline]
fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
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
    pub(super) fn set(&mut self, x: &[f64], y: &[f64], heading: &[f64]) {
        let refill = |column: &mut Vec<f64>, with: &[f64]| {
            column.clear();
            column.extend_from_slice(with);
        };
        refill(&mut self.x, x);
        refill(&mut self.y, y);
        refill(&mut self.heading, heading);
        self.direction.clear();
        self.direction.extend(heading.iter().map(|h| libm::sincos(*h)));
        self.blocks.clear();
        self.blocks.extend(x.chunks(BLOCK).zip(y.chunks(BLOCK)).map(|(x, y)| {
            let points = x.iter().zip(y).map(|(&x, &y)| Bounds { low_x: x, low_y: y, high_x: x, high_y: y });
            points.fold(Bounds::EMPTY, Bounds::add)
        }));
        self.groups.clear();
        self.groups
            .extend(self.blocks.chunks(GROUP).map(|blocks| blocks.iter().copied().fold(Bounds::EMPTY, Bounds::add)));
    }

    /// How many samples there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.x.len()
    }

    /// Whether there is no sample.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.x.is_empty()
    }

    /// x, y and heading of a sample.
    #[must_use]
    #[inline]
    pub fn sample(&self, k: usize) -> (f64, f64, f64) {
        (self.x[k], self.y[k], self.heading[k])
    }

    /// The sample nearest to (x, y), the first of equally near ones. `hint` only makes it faster. The line is not empty.
    #[must_use]
    pub fn nearest(&self, x: f64, y: f64, hint: usize) -> usize {
        let mut best = Best { distance: f64::INFINITY, sample: usize::MAX };
        let hinted = hint.min(self.len().saturating_sub(1)) / BLOCK;
        self.search_block(hinted, x, y, &mut best);
        for (g, group) in self.groups.iter().enumerate() {
            if !best.beaten_by(group.distance(x, y), g * GROUP * BLOCK) {
                continue;
            }
            let blocks = g * GROUP..self.blocks.len().min((g + 1) * GROUP);
            for b in blocks {
                if b != hinted && best.beaten_by(self.blocks[b].distance(x, y), b * BLOCK) {
                    self.search_block(b, x, y, &mut best);
                }
            }
        }
        best.sample
    }

    /// Where (x, y) is along and beside the line. The line is not empty.
    #[must_use]
    pub fn frenet(&self, x: f64, y: f64, hint: usize) -> Frenet {
        self.frenet_at(x, y, self.nearest(x, y, hint))
    }

    /// [`Line::frenet`] of a place whose nearest sample is known.
    #[must_use]
    pub fn frenet_at(&self, x: f64, y: f64, sample: usize) -> Frenet {
        let (dx, dy) = (x - self.x[sample], y - self.y[sample]);
        let (sin, cos) = self.direction[sample];
        let side = dy * cos - dx * sin;
        let distance = (dx * dx + dy * dy).sqrt();
        Frenet { sample, lateral: if side == 0.0 { 0.0 } else { distance.copysign(side) } }
    }

    #[inline]
    fn search_block(&self, block: usize, x: f64, y: f64, best: &mut Best) {
        let start = block * BLOCK;
        let end = (start + BLOCK).min(self.len());
        let mut nearest = Best { distance: f64::INFINITY, sample: start };
        for (i, (sx, sy)) in self.x[start..end].iter().zip(&self.y[start..end]).enumerate() {
            let (dx, dy) = (sx - x, sy - y);
            let distance = dx * dx + dy * dy;
            if distance < nearest.distance {
                nearest = Best { distance, sample: start + i };
            }
        }
        if best.beaten_by(nearest.distance, nearest.sample) {
            *best = nearest;
        }
    }
}

struct Best {
    distance: f64,
    sample: usize,
}

impl Best {
    /// Whether something at this distance, whose first sample is `first`, could take its place.
    #[inline]
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
