//! The level of the route: maps have bridges, and what is above or below the AV is not where it drives.
//!
//! Heights are known along the route. Where a setting lets the AV go farther from it, what lies out there is taken to be on its
//! level.

use world::geometry::{Bounds, Point3, SegmentGrid};
use world::reference_line::ReferenceLine;

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
    /// The lowest and the highest of them.
    span: [f64; 2],
    /// Where something of the map is of interest.
    bounds: Bounds,
    /// Beyond these no point is within [`REACH`] of the route.
    reach: Bounds,
}

impl Level {
    /// The level along `route`, for an AV that may go `corridor` metres away from it.
    #[must_use]
    pub fn along(route: &[Point3], corridor: f64) -> Self {
        // The grid drops repeated points; so do we, to keep its numbers ours.
        let mut points: Vec<Point3> = route.to_vec();
        points.dedup_by(|a, b| a.xy() == b.xy());
        let route = Bounds::of(points.iter().map(|point| point.xy()));
        let heights: Vec<f64> = points.iter().map(|point| point.z).collect();
        Self {
            grid: SegmentGrid::new([(0, points.iter().map(|point| point.xy()))], CELL),
            span: [
                heights.iter().copied().fold(f64::INFINITY, f64::min),
                heights.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            ],
            bounds: route.grown(corridor + MARGIN),
            // A hair more than it must be: distances are rounded.
            reach: route.grown(REACH + 1e-3),
            heights,
        }
    }

    /// The level along a reference line, from a point a metre.
    #[must_use]
    pub fn of_line(line: &ReferenceLine, corridor: f64) -> Self {
        let every_metre = (0..line.len()).step_by(10);
        let points: Vec<Point3> = every_metre.map(|at| Point3::new(line.x[at], line.y[at], line.z[at])).collect();
        Self::along(&points, corridor)
    }

    /// Whether a point of the map is where the AV may come, and on its level: on one of them, where the route passes over itself.
    #[must_use]
    pub fn holds(&self, point: Point3) -> bool {
        let is_at = |height: f64| (height - point.z).abs() <= STOREY;
        let in_bounds = self.bounds.hold(point.xy());
        // Most maps are flat: then the place alone tells.
        if in_bounds && self.span.into_iter().all(is_at) {
            return true;
        }
        if !in_bounds && !self.reach.hold(point.xy()) {
            return false;
        }
        let is_level = |segment: usize| is_at(self.heights[segment]);
        match self.grid.nearest(point.xy(), REACH) {
            Some(nearest) if is_level(nearest.segment) => true,
            Some(nearest) => {
                let mut other_pass = false;
                let reach = nearest.distance() + OVER_ITSELF;
                self.grid.for_each_near(point.xy(), reach, |segment| other_pass |= is_level(segment));
                other_pass
            }
            None => in_bounds,
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// The rule without short cuts.
    fn holds(level: &Level, route: &[Point3], corridor: f64, point: Point3) -> bool {
        let nearest = level.grid.nearest(point.xy(), REACH);
        let at = |height: f64| (height - point.z).abs() <= STOREY;
        let Some(nearest) = nearest else {
            let reach = corridor + MARGIN;
            let spans = |of: fn(&Point3) -> f64, at: f64| {
                let least = route.iter().map(of).fold(f64::INFINITY, f64::min);
                let greatest = route.iter().map(of).fold(f64::NEG_INFINITY, f64::max);
                (least - reach..=greatest + reach).contains(&at)
            };
            return spans(|p| p.x, point.x) && spans(|p| p.y, point.y);
        };
        let within = nearest.distance() + OVER_ITSELF;
        let mut passes = vec![nearest.segment];
        level.grid.for_each_near(point.xy(), within, |segment| passes.push(segment));
        passes.into_iter().any(|segment| at(level.heights[segment]))
    }

    proptest! {
        #[test]
        fn short_cuts_say_what_the_whole_search_says(
            route in prop::collection::vec((-40.0..40.0, -40.0..40.0, -4.0..4.0), 0..8), corridor in 0.0..30.0,
            (x, y, z) in (-120.0..120.0, -120.0..120.0, -6.0..6.0),
        ) {
            let mut route: Vec<Point3> = route.into_iter().map(|(x, y, z)| Point3::new(x, y, z)).collect();
            let point = Point3::new(x, y, z);
            for flat in [1.0, 0.1] {
                route.iter_mut().for_each(|point| point.z *= flat);
                let level = Level::along(&route, corridor);
                prop_assert_eq!(level.holds(point), holds(&level, &route, corridor, point));
            }
        }
    }
}
