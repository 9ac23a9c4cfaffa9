//! The level of the route: maps have bridges, and what is above or below the AV is not where it drives.
//!
//! Heights are known along the route. Where a setting lets the AV go farther from it, what lies out there is taken to be on its
//! level.

use world::geometry::{Point, Point3, SegmentGrid};

use super::STOREY;

/// The route tells the ground's height up to this distance (m) from it.
const REACH: f64 = 40.0;

/// What of the map is of interest lies up to this far (m) beyond where the AV may go.
const MARGIN: f64 = 35.0;

/// A route that passes over itself is not farther (m) from a point on the one pass than on the other.
const OVER_ITSELF: f64 = 10.0;

/// Side of a grid cell (m).
const CELL: f64 = 10.0;

/// The height of the ground along the route.
#[derive(Clone, Debug)]
pub struct Level {
    grid: SegmentGrid,
    /// Height (m) of each segment's start.
    heights: Vec<f64>,
    /// The least and the greatest x and y at which something of the map is of interest.
    bounds: (Point, Point),
}

impl Level {
    /// The level along `route`, for an AV that may go `corridor` metres away from it.
    #[must_use]
    pub fn along(route: &[Point3], corridor: f64) -> Self {
        // The grid drops repeated points; so do we, to keep its numbers ours.
        let mut points: Vec<Point3> = route.to_vec();
        points.dedup_by(|a, b| a.xy() == b.xy());
        let heights = points.iter().map(|point| point.z).collect();
        let reach = corridor + MARGIN;
        let least = |of: fn(&Point3) -> f64| points.iter().map(of).fold(f64::INFINITY, f64::min) - reach;
        let greatest = |of: fn(&Point3) -> f64| points.iter().map(of).fold(f64::NEG_INFINITY, f64::max) + reach;
        let bounds = (Point::new(least(|p| p.x), least(|p| p.y)), Point::new(greatest(|p| p.x), greatest(|p| p.y)));
        Self { grid: SegmentGrid::new([(0, points.iter().map(|point| point.xy()))], CELL), heights, bounds }
    }

    /// Whether a point of the map is where the AV may come, and on its level: on one of them, where the route passes over itself.
    #[must_use]
    pub fn holds(&self, point: Point3) -> bool {
        let (least, greatest) = self.bounds;
        let is_level = |segment: usize| (self.heights[segment] - point.z).abs() <= STOREY;
        match self.grid.nearest(point.xy(), REACH) {
            Some(nearest) if is_level(nearest.segment) => true,
            Some(nearest) => {
                let mut other_pass = false;
                let reach = nearest.distance() + OVER_ITSELF;
                self.grid.for_each_near(point.xy(), reach, |segment| other_pass |= is_level(segment));
                other_pass
            }
            None => (least.x..=greatest.x).contains(&point.x) && (least.y..=greatest.y).contains(&point.y),
        }
    }
}
