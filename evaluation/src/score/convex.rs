//! Convex polygons, and boxes with round corners.

use world::geometry::{OrientedBox, Point, Segment};

/// Straight pieces that stand for a quarter of a circle, as GEOS has them.
const PIECES: u32 = 16;

/// The distance between two convex polygons (m), 0 where they meet. Corners in either sense of rotation; two corners are a segment.
#[must_use]
pub fn distance(a: &[Point], b: &[Point]) -> f64 {
    if !separated(a, b) && !separated(b, a) {
        return 0.0;
    }
    nearest(a, b).min(nearest(b, a)).sqrt()
}

/// Whether a side of `a` parts them.
fn separated(a: &[Point], b: &[Point]) -> bool {
    sides(a).any(|side| {
        let along = side.vector();
        let across = Point::new(-along.y, along.x);
        let extent = |points: &[Point]| {
            points
                .iter()
                .map(|point| point.dot(across))
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), at| {
                    (if at < least { at } else { least }, if at > most { at } else { most })
                })
        };
        let (one, other) = (extent(a), extent(b));
        one.1 < other.0 || other.1 < one.0
    })
}

/// The least squared distance (m^2) of a corner of `b` to a side of `a`.
fn nearest(a: &[Point], b: &[Point]) -> f64 {
    let distances = b.iter().flat_map(|corner| sides(a).map(move |side| side.nearest_to(*corner).distance_squared));
    distances.fold(f64::INFINITY, |least, next| if next < least { next } else { least })
}

fn sides(polygon: &[Point]) -> impl Iterator<Item = Segment> {
    let next = |index: usize| (index + 1) % polygon.len();
    (0..polygon.len()).map(move |index| Segment { start: polygon[index], end: polygon[next(index)] })
}

/// A box whose corners are round: all that is within `radius` of the box `inner`.
#[derive(Clone, Copy, Debug)]
pub struct RoundedBox {
    outline: OrientedBox,
    inner: OrientedBox,
    radius: f64,
}

impl RoundedBox {
    /// The box shrunk by the share `shrink` of its sides, with corners of the share `roundness` of half its shorter side.
    #[must_use]
    pub fn of(outline: &OrientedBox, shrink: f64, roundness: f64) -> Self {
        let factor = 1.0 - shrink;
        let (half_length, half_width) = (outline.half_length * factor, outline.half_width * factor);
        let radius = roundness * if half_length < half_width { half_length } else { half_width };
        Self {
            outline: OrientedBox { half_length, half_width, ..*outline },
            inner: OrientedBox { half_length: half_length - radius, half_width: half_width - radius, ..*outline },
            radius,
        }
    }

    /// How far from its centre it may reach (m).
    #[must_use]
    pub fn reach(&self) -> f64 {
        self.outline.radius()
    }

    /// Whether two of them meet, be it in a point.
    #[must_use]
    pub fn meets(&self, other: &Self) -> bool {
        let centers = self.outline.center.distance(other.outline.center);
        centers <= self.reach() + other.reach()
            && distance(&self.inner.corners(), &other.inner.corners()) <= self.radius + other.radius
    }

    /// The part of it within a corner's radius of its front edge, which it has as its bumper; with `-1` of its rear edge.
    #[must_use]
    pub fn bumper(&self, side: f64) -> Vec<Point> {
        let arc = |from: f64, across: f64| {
            (0..=PIECES).map(move |piece| {
                let angle = from + std::f64::consts::FRAC_PI_2 * f64::from(piece) / f64::from(PIECES);
                Point::new(self.inner.half_length, across) + Point::unit(angle) * self.radius
            })
        };
        let right = arc(-std::f64::consts::FRAC_PI_2, -self.inner.half_width);
        let body = right.chain(arc(0.0, self.inner.half_width));
        let world = |point: Point| {
            self.outline.center + self.outline.forward * (side * point.x) + self.outline.left() * point.y
        };
        body.map(world).collect()
    }

    /// Points around it.
    #[must_use]
    pub fn rim(&self) -> Vec<Point> {
        self.bumper(1.0).into_iter().chain(self.bumper(-1.0)).collect()
    }

    /// Whether a convex polygon meets it.
    #[must_use]
    pub fn meets_polygon(&self, polygon: &[Point]) -> bool {
        distance(&self.inner.corners(), polygon) <= self.radius
    }

    /// Its distance to a segment (m), 0 where they meet.
    #[must_use]
    pub fn distance_to(&self, segment: &Segment) -> f64 {
        (distance(&self.inner.corners(), &[segment.start, segment.end]) - self.radius).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use world::geometry::{Pose, boxes_overlap};

    use super::*;

    fn square(x: f64, y: f64, heading: f64) -> OrientedBox {
        OrientedBox::new(Pose::new(x, y, heading), 2.0, 2.0)
    }

    #[test]
    fn distances_are_those_of_the_closed_form() {
        let at = |x, y, heading| distance(&square(0.0, 0.0, 0.0).corners(), &square(x, y, heading).corners());
        assert!((at(5.0, 0.0, 0.0) - 3.0).abs() < 1e-12);
        assert!((at(5.0, 6.0, 0.0) - 5.0).abs() < 1e-12, "corner to corner, 3 and 4");
        assert!((at(5.0, 0.0, std::f64::consts::FRAC_PI_4) - (4.0 - 2.0_f64.sqrt())).abs() < 1e-12, "side to corner");
        assert_eq!((at(1.0, 1.0, 0.3), at(0.0, 0.0, 0.0)), (0.0, 0.0));
    }

    #[test]
    fn round_corners_meet_where_their_circles_do() {
        // Unshrunk, half round: circles of 0.5 m around (0.5, 0.5) and (x - 0.5, y - 0.5).
        let meets = |x: f64, y: f64| {
            let [one, other] = [square(0.0, 0.0, 0.0), square(x, y, 0.0)].map(|a| RoundedBox::of(&a, 0.0, 0.5));
            one.meets(&other)
        };
        let corner = 1.0 + 0.5_f64.sqrt();
        assert!(meets(corner - 1e-9, corner - 1e-9) && !meets(corner + 1e-9, corner + 1e-9));
        assert!(meets(2.0, 0.0) && !meets(2.0 + 1e-9, 0.0), "sides meet as those of sharp boxes do");
        let shrunk = RoundedBox::of(&square(0.0, 0.0, 0.0), 0.02, 0.5);
        assert!((shrunk.radius - 0.49).abs() < 1e-12 && (shrunk.outline.half_length - 0.98).abs() < 1e-12);
    }

    #[test]
    fn the_bumper_is_the_front_of_the_box_and_no_more() {
        let car = RoundedBox::of(&OrientedBox::new(Pose::new(0.0, 0.0, 0.0), 4.0, 2.0), 0.0, 0.5);
        let touches = |x: f64, y: f64| distance(&car.bumper(1.0), &[Point::new(x, y), Point::new(x + 0.01, y)]) == 0.0;
        assert!(touches(1.99, 0.0) && touches(1.5, 0.9) && !touches(1.48, 0.0) && !touches(1.98, 0.95));
        assert!(distance(&car.bumper(-1.0), &[Point::new(-2.0, 0.0), Point::new(-3.0, 0.0)]) < 1e-12);
    }

    proptest! {
        #[test]
        fn sharp_boxes_meet_where_they_overlap(
            (x, y, a, b) in (-5.0..5.0, -5.0..5.0, -3.2..3.2, -3.2..3.2), length in 0.5..5.0,
        ) {
            let one = OrientedBox::new(Pose::new(0.0, 0.0, a), length, 2.0);
            let other = OrientedBox::new(Pose::new(x, y, b), 4.0, 1.5);
            let apart = distance(&one.corners(), &other.corners());
            prop_assume!(apart == 0.0 || apart > 1e-9);
            prop_assert_eq!(apart == 0.0, boxes_overlap(&one, &other));
        }
    }
}
