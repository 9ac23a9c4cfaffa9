//! Points and poses.

use std::ops::{Add, Mul, Sub};

use super::wrap_angle;

/// A point, or a vector, in the plane (m).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Point {
    /// East in the log's frame, or forward in a body's.
    pub x: f64,
    /// North in the log's frame, or left in a body's.
    pub y: f64,
}

impl Point {
    /// The point (`x`, `y`).
    #[must_use]
    pub const fn new(x: f64, y: f64) -> Self {
        Self { x, y }
    }

    /// The unit vector that points to `heading` (rad).
    #[must_use]
    pub fn unit(heading: f64) -> Self {
        let (sine, cosine) = libm::sincos(heading);
        Self::new(cosine, sine)
    }

    /// Scalar product.
    #[must_use]
    pub fn dot(self, other: Self) -> f64 {
        self.x * other.x + self.y * other.y
    }

    /// The z component of the cross product: positive where `other` lies counter-clockwise of `self`.
    #[must_use]
    pub fn cross(self, other: Self) -> f64 {
        self.x * other.y - self.y * other.x
    }

    /// Squared length.
    #[must_use]
    pub fn norm_squared(self) -> f64 {
        self.dot(self)
    }

    /// Length.
    #[must_use]
    pub fn norm(self) -> f64 {
        self.norm_squared().sqrt() // correctly rounded by IEEE 754, the same everywhere
    }

    /// Distance to `other` (m).
    #[must_use]
    pub fn distance(self, other: Self) -> f64 {
        (other - self).norm()
    }

    /// Squared distance to `other` (m^2).
    #[must_use]
    pub fn distance_squared(self, other: Self) -> f64 {
        (other - self).norm_squared()
    }

    /// The direction of this vector (rad, in (-pi, pi]); 0 for the zero vector.
    #[must_use]
    pub fn heading(self) -> f64 {
        libm::atan2(self.y, self.x)
    }
}

impl Add for Point {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self::new(self.x + other.x, self.y + other.y)
    }
}

impl Sub for Point {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self::new(self.x - other.x, self.y - other.y)
    }
}

impl Mul<f64> for Point {
    type Output = Self;
    fn mul(self, factor: f64) -> Self {
        Self::new(self.x * factor, self.y * factor)
    }
}

/// A point of the map, with its height (m).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Point3 {
    /// East (m).
    pub x: f64,
    /// North (m).
    pub y: f64,
    /// Up (m).
    pub z: f64,
}

impl Point3 {
    /// The point (`x`, `y`, `z`).
    #[must_use]
    pub const fn new(x: f64, y: f64, z: f64) -> Self {
        Self { x, y, z }
    }

    /// The same point without its height.
    #[must_use]
    pub const fn xy(self) -> Point {
        Point::new(self.x, self.y)
    }
}

/// A place and a direction in the plane.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pose {
    /// x (m).
    pub x: f64,
    /// y (m).
    pub y: f64,
    /// Heading (rad); not necessarily wrapped.
    pub heading: f64,
}

impl Pose {
    /// The pose at (`x`, `y`) that looks to `heading`.
    #[must_use]
    pub const fn new(x: f64, y: f64, heading: f64) -> Self {
        Self { x, y, heading }
    }

    /// The place.
    #[must_use]
    pub const fn position(self) -> Point {
        Point::new(self.x, self.y)
    }

    /// `point` of this pose's body frame, in the frame that the pose is given in.
    #[must_use]
    pub fn to_world(self, point: Point) -> Point {
        let forward = Point::unit(self.heading);
        Point::new(
            forward.x * point.x - forward.y * point.y + self.x,
            forward.y * point.x + forward.x * point.y + self.y,
        )
    }

    /// `point` as seen from this pose: x forward, y left.
    #[must_use]
    pub fn to_body(self, point: Point) -> Point {
        let forward = Point::unit(self.heading);
        let offset = point - self.position();
        Point::new(forward.dot(offset), forward.cross(offset))
    }

    /// `other` as seen from this pose, heading wrapped to [-pi, pi).
    #[must_use]
    pub fn pose_to_body(self, other: Self) -> Self {
        let position = self.to_body(other.position());
        Self::new(position.x, position.y, wrap_angle(other.heading - self.heading))
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use proptest::prelude::*;

    use super::*;

    #[test]
    fn ahead_of_a_pose_that_looks_north_is_north_and_its_left_is_west() {
        let pose = Pose::new(1.0, 2.0, FRAC_PI_2);
        assert!(pose.to_world(Point::new(3.0, 1.0)).distance(Point::new(0.0, 5.0)) < 1e-12);
        assert!(pose.to_body(Point::new(0.0, 5.0)).distance(Point::new(3.0, 1.0)) < 1e-12);
        assert_eq!(pose.pose_to_body(pose), Pose::default());
    }

    proptest! {
        #[test]
        fn to_the_body_and_back_is_the_identity(
            (x, y, heading) in (-99.0..99.0, -99.0..99.0, -9.0..9.0), (px, py) in (-99.0..99.0, -99.0..99.0),
        ) {
            let (pose, point) = (Pose::new(x, y, heading), Point::new(px, py));
            prop_assert!(pose.to_world(pose.to_body(point)).distance(point) < 1e-9);
        }
    }
}
