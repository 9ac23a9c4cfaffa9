//! What is reckoned of a reference line once, at the start of an episode.

use std::sync::Arc;

use world::geometry::Point;
use world::reference_line::ReferenceLine;

/// Samples of a stretch.
const STRETCH: usize = 16;

/// More than what rounding makes of an offset (m).
const HAIR: f64 = 1e-6;

/// The whole reference line, with the lengths of its steps and its directions.
pub struct MeasuredLine {
    /// The line itself.
    pub line: Arc<ReferenceLine>,
    /// Distance of each sample from the one before it (m).
    pub steps: Vec<f64>,
    /// Unit vector to each sample's heading.
    pub directions: Vec<Point>,
    stretches: Vec<Stretch>,
}

/// Bounds of a few samples that follow each other: how far they are from the middle one, in place and in direction.
struct Stretch {
    middle: Point,
    radius: f64,
    direction: Point,
    spread: f64,
}

impl Stretch {
    /// Bounds of the offset (m, to the left) of what is within `radius` (m) of `center`, as told by any sample of the stretch.
    fn laterals(&self, center: Point, radius: f64) -> (f64, f64) {
        let offset = center - self.middle;
        let slack = self.spread * (offset.x.abs() + offset.y.abs()) + self.radius + radius + HAIR;
        let lateral = self.direction.cross(offset);
        (lateral - slack, lateral + slack)
    }
}

impl MeasuredLine {
    /// Measures a line.
    pub fn new(line: &Arc<ReferenceLine>) -> Self {
        let points = || line.x.iter().zip(&line.y).map(|(x, y)| Point::new(*x, *y));
        let before = points().take(1).chain(points());
        let directions: Vec<_> = line.heading.iter().map(|heading| Point::unit(*heading)).collect();
        let stretch = |from: usize| {
            let samples = from..(from + STRETCH).min(line.len());
            let middle = samples.start.midpoint(samples.end);
            let most = |of: fn(Point, Point) -> f64, all: &dyn Fn(usize) -> Point| {
                samples.clone().map(|sample| of(all(sample), all(middle))).fold(0.0, f64::max)
            };
            Stretch {
                middle: line.point(middle),
                radius: most(Point::distance, &|sample| line.point(sample)),
                direction: directions[middle],
                spread: most(Point::distance, &|sample| directions[sample]),
            }
        };
        Self {
            steps: points().zip(before).map(|(point, before)| point.distance(before)).collect(),
            stretches: (0..line.len()).step_by(STRETCH).map(stretch).collect(),
            directions,
            line: Arc::clone(line),
        }
    }

    /// Bounds of the offset (m, to the left) of what is within `radius` (m) of `center`, as told by any sample from `from` to `to`.
    pub fn laterals(&self, center: Point, radius: f64, from: usize, to: usize) -> (f64, f64) {
        let stretches = self.stretches.iter().skip(from / STRETCH).take(to / STRETCH + 1 - from / STRETCH);
        stretches
            .map(|stretch| stretch.laterals(center, radius))
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(least, greatest), (low, high)| {
                (least.min(low), greatest.max(high))
            })
    }
}
