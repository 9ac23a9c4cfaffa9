//! The point of a segment that is nearest to a point, and on which side of a chain of segments a point lies.

use super::Point;

/// A straight piece between two points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// Where it begins.
    pub start: Point,
    /// Where it ends.
    pub end: Point,
}

/// The point of a segment that is nearest to a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SegmentPoint {
    /// Where along the segment: 0 its start, 1 its end.
    pub fraction: f64,
    /// The point itself.
    pub point: Point,
    /// Squared distance to it (m^2).
    pub distance_squared: f64,
}

impl Segment {
    /// From start to end.
    #[must_use]
    pub fn vector(&self) -> Point {
        self.end - self.start
    }

    /// Length (m).
    #[must_use]
    pub fn length(&self) -> f64 {
        self.vector().norm()
    }

    /// The point of the segment that is nearest to `point`; its start, if it has no length.
    #[must_use]
    pub fn nearest_to(&self, point: Point) -> SegmentPoint {
        let along = self.vector();
        let length_squared = along.norm_squared();
        let fraction =
            if length_squared > 0.0 { ((point - self.start).dot(along) / length_squared).clamp(0.0, 1.0) } else { 0.0 };
        // The end exactly, so that neighbours agree on a shared corner to the last bit.
        let nearest = if fraction >= 1.0 { self.end } else { self.start + along * fraction };
        SegmentPoint { fraction, point: nearest, distance_squared: nearest.distance_squared(point) }
    }

    /// Whether `point` lies to the left of the line through the segment: positive left, negative right, 0 on it.
    #[must_use]
    pub fn side(&self, point: Point) -> f64 {
        self.vector().cross(point - self.start)
    }
}

/// Whether `point`, whose nearest point on a chain is the corner between `before` and `after`, lies to the chain's left.
///
/// At a corner that turns left, left is what lies left of both pieces; at one that turns right, what lies left of either.
#[must_use]
pub(super) fn is_left_of_corner(before: &Segment, after: &Segment, point: Point) -> bool {
    let (left_of_before, left_of_after) = (before.side(point) > 0.0, after.side(point) > 0.0);
    if before.vector().cross(after.vector()) >= 0.0 {
        left_of_before && left_of_after
    } else {
        left_of_before || left_of_after
    }
}
