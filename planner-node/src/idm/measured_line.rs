//! What is reckoned of a reference line once, at the start of an episode.

use std::ops::Range;
use std::sync::Arc;

use world::geometry::{Point, angle_difference};
use world::reference_line::{ReferenceLine, SAMPLE_SPACING};

/// Samples of a stretch.
const STRETCH: usize = 16;

/// The whole reference line, with the lengths of its steps, its directions, and bounds of its stretches.
pub struct MeasuredLine {
    /// The line itself.
    pub line: Arc<ReferenceLine>,
    /// Distance of each sample from the one before it (m).
    pub steps: Vec<f64>,
    /// Unit vector to each sample's heading.
    pub directions: Vec<Point>,
    /// How far the line has turned by each sample (rad), either way.
    pub turned: Vec<f64>,
    /// Whether samples are as far apart as they should be, to a tenth.
    pub even: bool,
    /// Bounds of every [`STRETCH`] samples.
    stretches: Vec<Stretch>,
}

impl MeasuredLine {
    /// Measures a line.
    pub fn new(line: &Arc<ReferenceLine>) -> Self {
        let points: Vec<_> = (0..line.len()).map(|sample| line.point(sample)).collect();
        let directions: Vec<_> = line.heading.iter().map(|heading| Point::unit(*heading)).collect();
        let after_first = points.windows(2).map(|pair| pair[1].distance(pair[0]));
        let steps: Vec<_> = std::iter::once(0.0).chain(after_first).collect();
        let mut turned = 0.0;
        let turns = line.heading.windows(2).map(|pair| {
            turned += angle_difference(pair[0], pair[1]).abs();
            turned
        });
        Self {
            turned: std::iter::once(0.0).chain(turns).collect(),
            even: steps.iter().skip(1).all(|step| (step / SAMPLE_SPACING - 1.0).abs() < 0.1),
            stretches: points.chunks(STRETCH).zip(directions.chunks(STRETCH)).map(Stretch::of).collect(),
            line: Arc::clone(line),
            steps,
            directions,
        }
    }

    /// Bounds of the offset (m, to the left) of what is within `radius` (m) of `center`, as told by any of these samples.
    pub fn laterals(&self, center: Point, radius: f64, samples: Range<usize>) -> (f64, f64) {
        let stretches = &self.stretches[samples.start / STRETCH..samples.end.div_ceil(STRETCH)];
        let (mut least, mut greatest) = (f64::INFINITY, f64::NEG_INFINITY);
        for (low, high) in stretches.iter().map(|stretch| stretch.laterals(center, radius)) {
            (least, greatest) = (least.min(low), greatest.max(high));
        }
        (least, greatest)
    }
}

/// Bounds of a few samples that follow each other: how far they are from the middle one, in place and in direction.
struct Stretch {
    middle: Point,
    radius: f64,
    direction: Point,
    spread: f64,
}

impl Stretch {
    fn of((points, directions): (&[Point], &[Point])) -> Self {
        let (middle, direction) = (points[points.len() / 2], directions[points.len() / 2]);
        let most = |all: &[Point], of: Point| all.iter().map(|one| one.distance(of)).fold(0.0, f64::max);
        Self { middle, radius: most(points, middle), direction, spread: most(directions, direction) }
    }

    /// With u the direction at a sample, u' that in the middle and d the offset from there: |u x d - u' x d| <= |u - u'| |d|.
    fn laterals(&self, center: Point, radius: f64) -> (f64, f64) {
        /// More than what rounding makes of an offset (m).
        const HAIR: f64 = 1e-6;
        let offset = center - self.middle;
        let slack = self.spread * (offset.x.abs() + offset.y.abs()) + self.radius + radius + HAIR;
        let lateral = self.direction.cross(offset);
        (lateral - slack, lateral + slack)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn no_offset_is_beyond_its_bounds(
            turns in prop::collection::vec(-0.1..0.1, 40), (x, y) in (-40.0..40.0, -40.0..40.0), radius in 0.0..5.0,
            towards in -3.0..3.0, from in 0..800_usize, samples in 1..400_usize,
        ) {
            let mut line = ReferenceLine::default();
            let (mut place, mut heading) = (Point::default(), 0.0);
            for turn in turns.iter().flat_map(|turn| [turn; 30]) {
                line.x.push(place.x);
                line.y.push(place.y);
                line.heading.push(heading);
                place = place + Point::unit(heading) * SAMPLE_SPACING;
                heading += turn;
            }
            let measured = MeasuredLine::new(&Arc::new(line));
            let center = measured.line.point(from) + Point::new(x, y);
            let point = center + Point::unit(towards) * radius;
            let (least, greatest) = measured.laterals(center, radius, from..from + samples);
            for sample in from..from + samples {
                let lateral = measured.directions[sample].cross(point - measured.line.point(sample));
                prop_assert!(least <= lateral && lateral <= greatest, "{least} {lateral} {greatest}");
            }
        }
    }
}
