//! The box that stands for a road user seen from above.

use super::{Point, Pose};

/// A rectangle in the plane with a heading; its direction is kept as a unit vector, so that tests need no trigonometry.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrientedBox {
    /// Centre (m).
    pub center: Point,
    /// Unit vector of the long axis, towards the front.
    pub forward: Point,
    /// Half the length (m).
    pub half_length: f64,
    /// Half the width (m).
    pub half_width: f64,
}

impl OrientedBox {
    /// The box of `length` by `width` (m) whose centre and heading are `pose`'s.
    #[must_use]
    pub fn new(pose: Pose, length: f64, width: f64) -> Self {
        Self {
            center: pose.position(),
            forward: Point::unit(pose.heading),
            half_length: 0.5 * length,
            half_width: 0.5 * width,
        }
    }

    /// Unit vector to the left.
    #[must_use]
    pub fn left(&self) -> Point {
        Point::new(-self.forward.y, self.forward.x)
    }

    /// The corners, counter-clockwise from the front left: front left, rear left, rear right, front right.
    #[must_use]
    pub fn corners(&self) -> [Point; 4] {
        let along = self.forward * self.half_length;
        let across = self.left() * self.half_width;
        [
            self.center + along + across,
            self.center - along + across,
            self.center - along - across,
            self.center + along - across,
        ]
    }

    /// The middle of the front edge.
    #[must_use]
    pub fn front(&self) -> Point {
        self.center + self.forward * self.half_length
    }

    /// Radius of the circle around the centre that holds the box (m).
    #[must_use]
    pub fn radius(&self) -> f64 {
        (self.half_length * self.half_length + self.half_width * self.half_width).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use super::*;

    #[test]
    fn corners_run_counter_clockwise_from_the_front_left() {
        let north = OrientedBox::new(Pose::new(10.0, 20.0, FRAC_PI_2), 4.0, 2.0);
        let expected = [(9.0, 22.0), (9.0, 18.0), (11.0, 18.0), (11.0, 22.0)];
        for (corner, (x, y)) in north.corners().into_iter().zip(expected) {
            assert!(corner.distance(Point::new(x, y)) < 1e-12, "{corner:?}");
        }
        assert!(north.front().distance(Point::new(10.0, 22.0)) < 1e-12);
        assert!(north.corners().iter().all(|corner| (corner.distance(north.center) - north.radius()).abs() < 1e-12));
    }
}
