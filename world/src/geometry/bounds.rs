//! The upright rectangle around points, and what of a line may pass through it.

use super::{Point, Point3};

/// The least and the greatest x and y of an area.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Lower left corner (m).
    pub least: Point,
    /// Upper right corner (m).
    pub greatest: Point,
}

impl Bounds {
    /// The bounds of `points`; of none they hold nothing.
    #[must_use]
    pub fn of(points: impl IntoIterator<Item = Point>) -> Self {
        let least = Point::new(f64::INFINITY, f64::INFINITY);
        let nothing = Self { least, greatest: least * -1.0 };
        points.into_iter().fold(nothing, |Self { least, greatest }, p| Self {
            least: Point::new(least.x.min(p.x), least.y.min(p.y)),
            greatest: Point::new(greatest.x.max(p.x), greatest.y.max(p.y)),
        })
    }

    /// The same, larger by `by` metres on each side.
    #[inline]
    #[must_use]
    pub fn grown(self, by: f64) -> Self {
        let by = Point::new(by, by);
        Self { least: self.least - by, greatest: self.greatest + by }
    }

    /// Whether a point lies within, borders included.
    #[inline]
    #[must_use]
    pub fn hold(&self, point: Point) -> bool {
        (self.least.x..=self.greatest.x).contains(&point.x) && (self.least.y..=self.greatest.y).contains(&point.y)
    }

    /// The runs of `line` whose segments may come within: every segment that does is in one. A line of one point is a run if that is
    /// within.
    pub fn runs<'a>(&self, line: &'a [Point3]) -> impl Iterator<Item = &'a [Point3]> + use<'a> {
        let bounds = *self;
        let mut next = 0;
        std::iter::from_fn(move || {
            let may = |start: usize| {
                let end = (start + 1).min(line.len() - 1);
                bounds.may_pass(line[start].xy(), line[end].xy())
            };
            let segments = line.len().saturating_sub(1).max(line.len().min(1));
            let first = (next..segments).find(|start| may(*start))?;
            next = (first..segments).find(|start| !may(*start)).unwrap_or(segments);
            Some(&line[first..(next + 1).min(line.len())])
        })
    }

    /// Whether the segment from `a` to `b` may come within.
    fn may_pass(&self, a: Point, b: Point) -> bool {
        let beside =
            |a: f64, b: f64, least: f64, greatest: f64| (a < least && b < least) || (a > greatest && b > greatest);
        !beside(a.x, b.x, self.least.x, self.greatest.x) && !beside(a.y, b.y, self.least.y, self.greatest.y)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::geometry::Segment;

    #[test]
    fn bounds_of_nothing_hold_nothing() {
        let nothing = Bounds::of([]).grown(1e9);
        assert!(!nothing.hold(Point::default()));
        assert_eq!(nothing.runs(&[Point3::default()]).count() + Bounds::of([Point::default()]).runs(&[]).count(), 0);
    }

    #[test]
    fn a_line_that_comes_by_twice_has_two_runs() {
        let line: Vec<Point3> = (-9..=9).map(|x| Point3::new(f64::from(x), f64::from(x * x), 0.0)).collect();
        let bounds = Bounds { least: Point::new(-9.0, 40.0), greatest: Point::new(9.0, 60.0) };
        let xs = |run: &[Point3]| (run[0].x, run[run.len() - 1].x);
        assert_eq!(bounds.runs(&line).map(xs).collect::<Vec<_>>(), [(-8.0, -6.0), (6.0, 8.0)]);
        assert_eq!(bounds.runs(&line[1..2]).count() + bounds.runs(&line[2..3]).count(), 1);
    }

    proptest! {
        #[test]
        fn what_is_near_a_point_within_is_as_near_in_the_runs(
            line in prop::collection::vec((-40.0..40.0, -40.0..40.0), 1..12), (x, y) in (-10.0..10.0, -10.0..10.0),
        ) {
            let line: Vec<Point3> = line.into_iter().map(|(x, y)| Point3::new(x, y, 0.0)).collect();
            let point = Point::new(x, y);
            let distance = |line: &[Point3]| {
                let end = |at: usize| line[(at + 1).min(line.len() - 1)].xy();
                let segments = (0..line.len()).map(|at| Segment { start: line[at].xy(), end: end(at) });
                segments.map(|segment| segment.nearest_to(point).distance_squared.sqrt()).fold(f64::INFINITY, f64::min)
            };
            let near = Bounds::of([Point::new(-10.0, -10.0), Point::new(10.0, 10.0)]).grown(8.0);
            let whole = distance(&line);
            let runs = near.runs(&line).map(distance).fold(f64::INFINITY, f64::min);
            prop_assert!(runs == whole || (whole > 8.0 && runs >= whole));
        }
    }
}
