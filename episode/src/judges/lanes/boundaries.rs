//! How far a lane reaches to either side: to the lines and edges that the map names as its boundaries.

use std::collections::BTreeMap;
use std::sync::OnceLock;

use world::geometry::{Point, SegmentGrid};
use world::map::{BoundarySegment, Map, MapId};

/// Half the width (m) of a lane whose boundary the map does not name: half of a lane of 12 feet.
const HALF_WIDTH: f64 = 1.83;

/// A lane reaches at most this far (m) from its center line, wherever its boundary is.
pub(super) const WIDEST: f64 = 4.0;

/// The painted lines and road edges of a map by their numbers.
#[derive(Clone, Debug)]
pub(super) struct Boundaries(BTreeMap<MapId, Boundary>);

#[derive(Clone, Debug)]
struct Boundary {
    /// Its place among the map's lines, and its edges after them.
    place: usize,
    /// Its segments, once they were asked for.
    grid: OnceLock<SegmentGrid>,
}

impl Boundaries {
    /// Those of `map`.
    pub(super) fn of(map: &Map) -> Self {
        let ids = map.road_lines.iter().map(|line| line.id).chain(map.road_edges.iter().map(|edge| edge.id));
        Self(ids.enumerate().map(|(place, id)| (id, Boundary { place, grid: OnceLock::new() })).collect())
    }

    /// How far (m) a lane of `map` reaches to one side, of which it has these boundaries, at its `point` with this `number`.
    pub(super) fn half_width(&self, map: &Map, segments: &[BoundarySegment], number: usize, point: Point) -> f64 {
        let covers = |segment: &&BoundarySegment| {
            let range = segment.lane_start_index..=segment.lane_end_index;
            segment.feature != MapId(0) && i32::try_from(number).is_ok_and(|number| range.contains(&number))
        };
        let Some(segment) = segments.iter().find(covers) else { return HALF_WIDTH };
        let Some(boundary) = self.0.get(&segment.feature) else { return WIDEST };
        let grid = boundary.grid.get_or_init(|| boundary.grid(map));
        grid.nearest(point, WIDEST).map_or(WIDEST, |nearest| nearest.distance())
    }
}

impl Boundary {
    fn grid(&self, map: &Map) -> SegmentGrid {
        let edge = || map.road_edges.get(self.place - map.road_lines.len()).map(|edge| edge.polyline.as_slice());
        let line = map.road_lines.get(self.place).map(|line| line.polyline.as_slice()).or_else(edge);
        SegmentGrid::new([(0, line.unwrap_or_default().iter().map(|point| point.xy()))], 4.0)
    }
}
