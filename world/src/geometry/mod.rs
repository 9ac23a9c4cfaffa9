//! Plane geometry: points, poses, angles, oriented boxes.
//!
//! Convention of the whole product: metres, radians, heading counter-clockwise from +x. Sine and cosine come from
//! `libm`, so that every machine computes the same bits.

mod angle;
mod oriented_box;
mod point;

pub use angle::{angle_difference, wrap_angle};
pub use oriented_box::OrientedBox;
pub use point::{Point, Point3, Pose};
