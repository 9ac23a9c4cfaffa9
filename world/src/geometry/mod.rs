//! Plane geometry: points, poses, angles, oriented boxes, polylines.
//!
//! Convention of the whole product: metres, radians, heading counter-clockwise from +x. Sine and cosine come from
//! `libm`, so that every machine computes the same bits. One file holds one algorithm for one pair of shapes.

mod angle;
mod bounds;
mod box_box;
mod cells;
mod oriented_box;
mod point;
mod point_grid;
mod polygon;
mod polyline;
mod segment;
mod segment_grid;

pub use angle::{angle_difference, wrap_angle, wrap_angle_single};
pub use bounds::Bounds;
pub use box_box::boxes_overlap;
pub use oriented_box::OrientedBox;
pub use point::{Point, Point3, Pose};
pub use point_grid::PointGrid;
pub use polygon::polygon_contains;
pub use polyline::{Polyline, Projection};
pub use segment::{Segment, SegmentPoint};
pub use segment_grid::{About, NearestSegment, SegmentGrid};
