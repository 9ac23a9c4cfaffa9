//! Whether a point lies within a polygon.

use super::{Point, Segment};

/// Whether `point` lies strictly inside the polygon of `corners` (closed by implication, either winding, even-odd rule).
/// A point on the edge is outside.
#[must_use]
pub fn polygon_contains(corners: impl ExactSizeIterator<Item = Point> + Clone, point: Point) -> bool {
    let Some(mut previous) = corners.clone().last() else {
        return false;
    };
    let mut inside = false;
    for corner in corners {
        let edge = Segment { start: previous, end: corner };
        let side = edge.side(point);
        if side == 0.0 && (point - edge.start).dot(point - edge.end) <= 0.0 {
            return false;
        }
        let crosses = (edge.start.y > point.y) != (edge.end.y > point.y);
        // Upward edges are crossed by a ray to +x where the point lies to their left, downward ones to their right.
        if crosses && (side > 0.0) == (edge.end.y > edge.start.y) {
            inside = !inside;
        }
        previous = corner;
    }
    inside
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn contains(corners: &[(f64, f64)], x: f64, y: f64) -> bool {
        polygon_contains(corners.iter().map(|(x, y)| Point::new(*x, *y)), Point::new(x, y))
    }

    const SQUARE: [(f64, f64); 4] = [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)];

    #[test]
    fn a_point_on_an_edge_or_corner_is_outside() {
        assert!(contains(&SQUARE, 1.0, 1.0) && contains(&SQUARE, 1e-9, 1.0));
        for (x, y) in [(0.0, 1.0), (1.0, 2.0), (2.0, 1.0), (1.0, 0.0), (0.0, 0.0), (2.0, 2.0), (2.5, 1.0), (3.0, 2.0)] {
            assert!(!contains(&SQUARE, x, y), "({x}, {y})");
        }
    }

    #[test]
    fn the_notch_of_a_horseshoe_is_outside() {
        let horseshoe =
            [(0.0, 0.0), (3.0, 0.0), (3.0, 3.0), (2.0, 3.0), (2.0, 1.0), (1.0, 1.0), (1.0, 3.0), (0.0, 3.0)];
        assert!(!contains(&horseshoe, 1.5, 2.0) && contains(&horseshoe, 0.5, 2.0) && contains(&horseshoe, 1.5, 0.5));
    }

    #[test]
    fn nothing_lies_within_less_than_three_corners() {
        assert!(!contains(&[], 0.0, 0.0) && !contains(&[(0.0, 0.0)], 0.0, 0.0));
        assert!(!contains(&[(0.0, 0.0), (2.0, 0.0)], 1.0, 0.0));
    }

    proptest! {
        #[test]
        fn winding_and_first_corner_do_not_matter(
            corners in prop::collection::vec((-9.0..9.0, -9.0..9.0), 3..9),
            start in 0_usize..9,
            (x, y) in (-9.0..9.0, -9.0..9.0),
        ) {
            let mut other = corners.clone();
            other.rotate_left(start % corners.len());
            other.reverse();
            prop_assert_eq!(contains(&corners, x, y), contains(&other, x, y));
        }
    }
}
