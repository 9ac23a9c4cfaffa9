//! Whether the AV leaves the road: the signed distance of each of its box's corners to the nearest road edge.
//!
//! WOMD has no drivable polygons. What stands for them is the left side of its road edges: that is how the data set draws
//! them. Edges on another level than the route are left out. Driveways are road, though they lie beyond an edge.

use world::geometry::{Point, Point3, SegmentGrid};
use world::map::{Area, Map};

use super::level::Level;
use super::{Body, STOREY};

/// A corner that far (m) beyond the edge, and from the AV's lanes, is outside the drivable area (nuPlan's tolerance).
pub const TOLERANCE: f64 = 0.3;

/// Edges further from a corner than this (m) say nothing.
const SEARCH_RADIUS: f64 = 10.0;

/// Side of a grid cell (m).
const CELL: f64 = 4.0;

/// The edges of the road.
#[derive(Clone, Debug)]
pub struct RoadEdges {
    grid: SegmentGrid,
    /// Height (m) of each segment's start.
    heights: Vec<f64>,
    driveways: Vec<Area>,
}

impl RoadEdges {
    /// The edges of `map` that are on the route's level.
    #[must_use]
    pub fn of(map: &Map, level: &Level) -> Self {
        let mut chains = chains(map, level);
        // The grid drops points that repeat; so do we, to keep its numbers ours.
        chains.iter_mut().for_each(|chain| chain.dedup_by(|a, b| a.xy() == b.xy()));
        let heights = chains.iter().flat_map(|chain| chain[..(chain.len() - 1).max(1)].iter().map(|point| point.z));
        let heights = heights.collect();
        let lines = chains.iter().map(|chain| chain.iter().map(|point| point.xy())).enumerate();
        let on_level = |area: &&Area| area.polygon.iter().any(|corner| level.holds(*corner));
        Self {
            grid: SegmentGrid::new(lines.map(|(index, line)| (index as u32, line)), CELL),
            heights,
            driveways: map.driveways.iter().filter(on_level).cloned().collect(),
        }
    }

    /// How far each of the box's corners, in their order, is beyond the road's edge (m): negative on the road, `None` where no edge is
    /// within 10 m of it on its level; the ground is at the height `ground` (m).
    #[must_use]
    pub fn beyond(&self, av: &Body, ground: f64) -> [Option<f64>; 4] {
        let is_level = |segment: usize| (self.heights[segment] - ground).abs() <= STOREY;
        av.outline.corners().map(|corner| {
            let nearest = self.grid.nearest_where(corner, SEARCH_RADIUS, is_level)?;
            // Past the free end of an edge there is no side to be on.
            let is_road = nearest.beyond_end || nearest.signed_distance > 0.0 || self.is_driveway(corner);
            Some(if is_road { -nearest.distance() } else { nearest.distance() })
        })
    }

    fn is_driveway(&self, point: Point) -> bool {
        self.driveways.iter().any(|driveway| driveway.contains(point))
    }
}

/// The road edges of `map`, as far as they are on the route's level: a run of points that are is a chain; one alone is no edge.
#[must_use]
pub fn chains(map: &Map, level: &Level) -> Vec<Vec<Point3>> {
    let runs = map.road_edges.iter().flat_map(|edge| edge.polyline.split(|point| !level.holds(*point)));
    runs.filter(|run| run.len() > 1).map(<[Point3]>::to_vec).collect()
}

/// How far the outermost of the corners is beyond the road's edge (m), if that is known of any.
#[must_use]
pub fn outermost(corners: [Option<f64>; 4]) -> Option<f64> {
    corners.into_iter().flatten().reduce(f64::max)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use world::geometry::Point3;
    use world::map::{MapId, RoadEdge, RoadEdgeKind};
    use world::scene::AgentState;

    use super::*;

    fn road(edges: &[(f64, f64, f64, f64, f64)]) -> RoadEdges {
        let edges = edges.iter().enumerate().map(|(index, (x1, y1, x2, y2, z))| RoadEdge {
            id: MapId(index as i64),
            kind: RoadEdgeKind::Boundary,
            polyline: vec![Point3::new(*x1, *y1, *z), Point3::new(*x2, *y2, *z)],
        });
        let map = Map { road_edges: edges.collect(), ..Map::default() };
        let route = [Point3::new(-50.0, 0.0, 0.0), Point3::new(50.0, 0.0, 0.0)];
        RoadEdges::of(&map, &Level::along(&route, 5.0))
    }

    fn av(y: f64) -> Body {
        Body::of(AgentState { y, length: 5.0, width: 2.0, ..AgentState::default() })
    }

    #[test]
    fn the_outermost_corner_is_measured_and_the_left_of_an_edge_is_road() {
        // The road runs along x between y = -4 and y = 4.
        let road = road(&[(-50.0, -4.0, 50.0, -4.0, 0.0), (50.0, 4.0, -50.0, 4.0, 0.0)]);
        assert_eq!(road.beyond(&av(0.5), 0.0), [-2.5, -2.5, -3.5, -3.5].map(Some));
        let outermost = |y: f64| outermost(road.beyond(&av(y), 0.0));
        assert_eq!([0.0, 2.5, -3.25].map(outermost), [-3.0, -0.5, 0.25].map(Some));
    }

    #[test]
    fn where_the_route_goes_over_itself_each_level_has_its_edges() {
        let edge = |id, y: f64, z| RoadEdge {
            id: MapId(id),
            kind: RoadEdgeKind::Boundary,
            polyline: vec![Point3::new(-50.0, y, z), Point3::new(50.0, y, z)],
        };
        let map = Map { road_edges: vec![edge(1, -4.0, 0.0), edge(2, -0.5, 6.0)], ..Map::default() };
        // Along the ground, up in a bow, and back above.
        let route = [(-50.0, 0.0, 0.0), (50.0, 0.0, 0.0), (90.0, 3.0, 3.0), (50.0, 1.0, 6.0), (-50.0, 1.0, 6.0)];
        let route = route.map(|(x, y, z)| Point3::new(x, y, z));
        let road = RoadEdges::of(&map, &Level::along(&route, 5.0));
        assert_eq!(outermost(road.beyond(&av(0.0), 0.0)), Some(-3.0), "below, the edge above is none");
        assert_eq!(outermost(road.beyond(&av(0.0), 6.0)), Some(0.5), "above, the one below is none");
    }

    #[test]
    fn a_driveway_beyond_the_edge_is_road() {
        let road_edges = vec![RoadEdge {
            id: MapId(1),
            kind: RoadEdgeKind::Boundary,
            polyline: vec![Point3::new(-50.0, -4.0, 0.0), Point3::new(50.0, -4.0, 0.0)],
        }];
        let corner = |x: f64, y: f64| Point3::new(x, y, 0.0);
        let polygon = vec![corner(-4.0, -3.0), corner(4.0, -3.0), corner(4.0, -9.0), corner(-4.0, -9.0)];
        let map = Map { road_edges, driveways: vec![Area { id: MapId(2), polygon }], ..Map::default() };
        let route = [Point3::new(-50.0, 0.0, 0.0), Point3::new(50.0, 0.0, 0.0)];
        let road = RoadEdges::of(&map, &Level::along(&route, 5.0));
        assert_eq!(outermost(road.beyond(&av(-6.0), 0.0)), Some(-1.0));
        let aside = Body::of(AgentState { x: 3.0, y: -6.0, length: 5.0, width: 2.0, ..AgentState::default() });
        assert_eq!(outermost(road.beyond(&aside, 0.0)), Some(3.0), "past its side the lawn begins");
    }

    #[test]
    fn far_from_any_edge_there_is_no_answer() {
        assert_eq!(road(&[(-50.0, -40.0, 50.0, -40.0, 0.0)]).beyond(&av(0.0), 0.0), [None; 4]);
    }

    #[test]
    fn the_edge_of_the_bridge_above_is_not_ours() {
        assert_eq!(road(&[(0.0, -50.0, 0.0, 50.0, 6.0)]).beyond(&av(0.0), 0.0), [None; 4]);
    }
}
