//! The points of the road's edges as they lie in the scene, of all levels: what Waymax and AlpaSim ask.

use std::ops::Range;

use world::geometry::{Point, Point3, PointGrid, Segment};
use world::map::{Map, RoadEdgeKind};

/// Side of a grid cell (m), and how far is looked at first.
const CELL: f64 = 8.0;

/// The points of all road edges.
pub struct EdgePoints {
    grid: PointGrid,
    points: Vec<Point3>,
    /// Of each point, to the next one of its edge; at the last that of the one before.
    directions: Vec<Point>,
    /// Of each point, which edge it is of.
    edges: Vec<usize>,
    /// The points of each edge.
    ranges: Vec<Range<usize>>,
}

impl EdgePoints {
    /// Those of `map` that are curbs or medians.
    #[must_use]
    pub fn of(map: &Map) -> Self {
        let (mut points, mut directions, mut edges, mut ranges) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let kinds = [RoadEdgeKind::Boundary, RoadEdgeKind::Median];
        for edge in map.road_edges.iter().filter(|edge| kinds.contains(&edge.kind)) {
            let first = points.len();
            let mut direction = Point::default();
            for (index, point) in edge.polyline.iter().enumerate() {
                if let Some(next) = edge.polyline.get(index + 1) {
                    let way = next.xy() - point.xy();
                    let length = way.norm();
                    if length > 0.0 {
                        direction = way * (1.0 / length);
                    }
                }
                points.push(*point);
                directions.push(direction);
                edges.push(ranges.len());
            }
            ranges.push(first..points.len());
        }
        Self {
            grid: PointGrid::new(points.iter().map(|point| point.xy()).collect(), CELL),
            points,
            directions,
            edges,
            ranges,
        }
    }

    /// The point nearest to `place`, heights counting `stretch` times; the first of equals. None where there is no edge.
    #[must_use]
    pub fn nearest(&self, place: Point3, stretch: f64) -> Option<usize> {
        let distance_squared = |index: usize| {
            let point = self.points[index];
            let up = stretch * (point.z - place.z);
            point.xy().distance_squared(place.xy()) + up * up
        };
        let better = |best: Option<(f64, usize)>, index: usize| {
            let found = (distance_squared(index), index);
            match best {
                Some(best) if (best.0, best.1) <= found => Some(best),
                _ => Some(found),
            }
        };
        let mut radius = CELL;
        for _ in 0..6 {
            let mut best = None;
            self.grid.for_each_near(place.xy(), radius, |index| best = better(best, index));
            if let Some((distance_squared, index)) = best
                && distance_squared <= radius * radius
            {
                return Some(index);
            }
            radius *= 2.0;
        }
        (0..self.points.len()).fold(None, better).map(|(_, index)| index)
    }

    /// How far `place` is beyond its nearest edge point (m, Waymax's signed distance): negative on the road, positive off it.
    #[must_use]
    pub fn beyond(&self, place: Point3, stretch: f64) -> Option<f64> {
        let nearest = self.nearest(place, stretch)?;
        let offset = place.xy() - self.points[nearest].xy();
        let side = |index: usize| offset.cross(self.directions[index]);
        let own = side(nearest);
        // At a corner of the edge both of its pieces are asked, and the one is believed that calls it road.
        let prior = nearest.checked_sub(1).filter(|prior| self.edges[*prior] == self.edges[nearest]).map(side);
        let side = prior.filter(|prior| *prior < own).unwrap_or(own);
        let sign = if side > 0.0 {
            1.0
        } else if side < 0.0 {
            -1.0
        } else {
            0.0
        };
        Some(offset.norm() * sign)
    }

    /// The pieces of the edge of point `index`.
    pub fn pieces(&self, index: usize) -> impl Iterator<Item = Segment> {
        let range = self.ranges[self.edges[index]].clone();
        range.clone().map(move |at| {
            let end = (at + 1).min(range.end - 1);
            Segment { start: self.points[at].xy(), end: self.points[end].xy() }
        })
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use world::map::{MapId, RoadEdge};

    use super::*;

    fn edges(polylines: &[&[(f64, f64, f64)]]) -> EdgePoints {
        let edge = |line: &&[(f64, f64, f64)]| RoadEdge {
            id: MapId(1),
            kind: RoadEdgeKind::Boundary,
            polyline: line.iter().map(|(x, y, z)| Point3::new(*x, *y, *z)).collect(),
        };
        EdgePoints::of(&Map { road_edges: polylines.iter().map(edge).collect(), ..Map::default() })
    }

    #[test]
    fn the_left_of_an_edge_is_road_and_the_distance_is_that_to_a_point() {
        let road = edges(&[&[(0.0, 0.0, 0.0), (4.0, 0.0, 0.0), (8.0, 0.0, 0.0)]]);
        let beyond = |x, y| road.beyond(Point3::new(x, y, 0.0), 2.0).unwrap();
        assert_eq!((beyond(4.0, 3.0), beyond(4.0, -3.0), beyond(7.0, 0.0)), (-3.0, 3.0, 0.0));
        assert!((beyond(5.0, -3.0) - 10.0_f64.sqrt()).abs() < 1e-12, "no foot on the segment between");
        assert_eq!(beyond(4.0, 300.0), -300.0, "however far away");
    }

    #[test]
    fn heights_count_twice_and_the_road_above_is_another() {
        let roads = edges(&[&[(0.0, 0.0, 0.0), (4.0, 0.0, 0.0)], &[(4.0, 1.0, 5.0), (0.0, 1.0, 5.0)]]);
        let beyond = |z| roads.beyond(Point3::new(0.0, 3.0, z), 2.0).unwrap();
        assert_eq!((beyond(0.0), beyond(5.0)), (-3.0, 2.0));
    }

    #[test]
    fn at_a_corner_the_piece_before_counts_too() {
        // An edge that turns right by a right angle: what lies left of either piece is road.
        let road = edges(&[&[(-4.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, -4.0, 0.0)]]);
        let beyond = |x, y| road.beyond(Point3::new(x, y, 0.0), 2.0).unwrap();
        assert!(beyond(1.0, 1.0) < 0.0 && beyond(1.0, -0.5) < 0.0 && beyond(-0.5, -0.5) > 0.0);
    }

    #[test]
    fn without_an_edge_there_is_no_answer() {
        assert_eq!(edges(&[]).beyond(Point3::default(), 2.0), None);
    }
}
