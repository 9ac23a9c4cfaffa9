//! The level of the route: maps have bridges, and what is above or below the AV is not where it drives.

use world::geometry::{Point, Point3, SegmentGrid};

use super::STOREY;

/// The map is of interest up to this distance (m) from the route.
const REACH: f64 = 40.0;

/// Side of a grid cell (m).
const CELL: f64 = 10.0;

/// The height of the ground along the route.
#[derive(Clone, Debug)]
pub struct Level {
    grid: SegmentGrid,
    /// Height (m) of each segment's start.
    heights: Vec<f64>,
}

impl Level {
    /// The level along `route`.
    #[must_use]
    pub fn along(route: &[Point3]) -> Self {
        // The grid drops repeated points; so do we, to keep its numbers ours.
        let mut points: Vec<Point3> = route.to_vec();
        points.dedup_by(|a, b| a.xy() == b.xy());
        let heights = points.iter().map(|point| point.z).collect();
        Self { grid: SegmentGrid::new([(0, points.iter().map(|point| point.xy()))], CELL), heights }
    }

    /// The ground's height (m) where the route is nearest to `point`, if that is within reach.
    #[must_use]
    pub fn height(&self, point: Point) -> Option<f64> {
        self.grid.nearest(point, REACH).map(|nearest| self.heights[nearest.segment])
    }

    /// Whether a point of the map is near the route and on its level.
    #[must_use]
    pub fn holds(&self, point: Point3) -> bool {
        self.height(point.xy()).is_some_and(|height| (height - point.z).abs() <= STOREY)
    }
}
