//! A chain of points with the distance along it.

use super::segment::{Segment, is_left_of_corner};
use super::{Point, wrap_angle};

/// A chain of one or more points, and how far along it each of them lies.
#[derive(Clone, Debug, PartialEq)]
pub struct Polyline {
    points: Vec<Point>,
    stations: Vec<f64>,
}

/// Where a point lies beside a polyline.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projection {
    /// Distance along the polyline of the nearest point of it (m).
    pub station: f64,
    /// Distance to it, positive to the left (m).
    pub lateral: f64,
    /// Distance to it (m).
    pub distance: f64,
    /// The segment that it lies on: from point `segment` to the next. The first of equals.
    pub segment: usize,
}

impl Polyline {
    /// The chain of `points`; `None` without a point.
    #[must_use]
    pub fn new(points: Vec<Point>) -> Option<Self> {
        let first = points.first()?;
        let mut stations = Vec::with_capacity(points.len());
        let (mut previous, mut station) = (*first, 0.0);
        for point in &points {
            station += previous.distance(*point);
            stations.push(station);
            previous = *point;
        }
        Some(Self { points, stations })
    }

    /// Its points; at least one.
    #[must_use]
    pub fn points(&self) -> &[Point] {
        &self.points
    }

    /// How far along each point lies (m), from 0.
    #[must_use]
    pub fn stations(&self) -> &[f64] {
        &self.stations
    }

    /// Its length (m).
    #[must_use]
    pub fn length(&self) -> f64 {
        self.stations[self.stations.len() - 1]
    }

    /// The segment from point `index` to the next; of no length at the last point.
    #[must_use]
    pub fn segment(&self, index: usize) -> Segment {
        let last = self.points.len() - 1;
        Segment { start: self.points[index.min(last)], end: self.points[(index + 1).min(last)] }
    }

    fn last_segment(&self) -> usize {
        self.points.len().saturating_sub(2)
    }

    /// The nearest point of the polyline, and on which side `point` lies of it. Looks at every segment.
    #[must_use]
    pub fn project(&self, point: Point) -> Projection {
        let (mut nearest, mut best) = (0, self.segment(0).nearest_to(point));
        for index in 1..=self.last_segment() {
            let candidate = self.segment(index).nearest_to(point);
            if candidate.distance_squared < best.distance_squared {
                (nearest, best) = (index, candidate);
            }
        }
        let segment = self.segment(nearest);
        let is_left = if best.fraction >= 1.0 && nearest < self.last_segment() {
            is_left_of_corner(&segment, &self.segment(nearest + 1), point)
        } else {
            segment.side(point) > 0.0
        };
        let distance = best.distance_squared.sqrt();
        Projection {
            station: self.stations[nearest] + segment.length() * best.fraction,
            lateral: if is_left { distance } else { -distance },
            distance,
            segment: nearest,
        }
    }

    fn segment_at(&self, station: f64) -> usize {
        self.stations.partition_point(|s| *s <= station).saturating_sub(1).min(self.last_segment())
    }

    /// The point `station` metres along; before the start the first, past the end the last.
    #[must_use]
    pub fn point_at(&self, station: f64) -> Point {
        let index = self.segment_at(station);
        let segment = self.segment(index);
        let length = segment.length();
        if length > 0.0 {
            let fraction = ((station - self.stations[index]) / length).clamp(0.0, 1.0);
            segment.start + segment.vector() * fraction
        } else {
            segment.start
        }
    }

    /// The direction of the segment at `station` (rad, in [-pi, pi)).
    #[must_use]
    pub fn heading_at(&self, station: f64) -> f64 {
        wrap_angle(self.segment(self.segment_at(station)).vector().heading())
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn polyline(points: &[(f64, f64)]) -> Polyline {
        Polyline::new(points.iter().map(|(x, y)| Point::new(*x, *y)).collect()).unwrap()
    }

    #[test]
    fn a_point_beside_a_segment_projects_onto_it() {
        let line = polyline(&[(0.0, 0.0), (10.0, 0.0), (10.0, 10.0)]);
        let left = line.project(Point::new(4.0, 1.5));
        assert_eq!((left.station, left.lateral, left.segment), (4.0, 1.5, 0));
        let right = line.project(Point::new(12.0, 5.0));
        assert_eq!((right.station, right.lateral, right.segment), (15.0, -2.0, 1));
    }

    #[test]
    fn a_point_outside_a_corner_projects_onto_it_with_the_right_sign() {
        let left_turn = polyline(&[(0.0, 0.0), (10.0, 0.0), (10.0, 10.0)]);
        let outside = left_turn.project(Point::new(13.0, -4.0));
        assert_eq!((outside.station, outside.lateral), (10.0, -5.0));
        let right_turn = polyline(&[(0.0, 0.0), (10.0, 0.0), (10.0, -10.0)]);
        assert_eq!(right_turn.project(Point::new(13.0, 4.0)).lateral, 5.0);
        // Left of the second piece only, but right of the hairpin's first: still outside, to the right of a left turn.
        let hairpin = polyline(&[(0.0, 0.0), (10.0, 0.0), (0.0, 1.0)]);
        assert!(hairpin.project(Point::new(11.0, 0.05)).lateral < 0.0);
    }

    #[test]
    fn a_single_point_is_a_polyline_without_length() {
        let line = polyline(&[(1.0, 1.0)]);
        assert_eq!((line.length(), line.project(Point::new(4.0, 5.0)).distance), (0.0, 5.0));
        assert_eq!((line.point_at(3.0), line.heading_at(3.0)), (Point::new(1.0, 1.0), 0.0));
        assert!(Polyline::new(Vec::new()).is_none());
    }

    #[test]
    fn repeated_points_do_no_harm() {
        let line = polyline(&[(0.0, 0.0), (1.0, 0.0), (1.0, 0.0), (2.0, 0.0)]);
        assert_eq!(line.point_at(1.5), Point::new(1.5, 0.0));
        assert_eq!(line.project(Point::new(1.5, 1.0)).lateral, 1.0);
    }

    proptest! {
        #[test]
        fn no_vertex_is_nearer_than_the_projection(
            points in prop::collection::vec((-50.0..50.0, -50.0..50.0), 1..20),
            (x, y) in (-60.0..60.0, -60.0..60.0),
        ) {
            let line = polyline(&points);
            let point = Point::new(x, y);
            let projection = line.project(point);
            for vertex in line.points() {
                prop_assert!(projection.distance <= vertex.distance(point) + 1e-9);
            }
            prop_assert!((line.point_at(projection.station).distance(point) - projection.distance).abs() < 1e-6);
        }
    }
}
