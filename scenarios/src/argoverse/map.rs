//! The map: lanes by their boundaries, painted lines, road edges, crosswalks. Everything is flat, for agents have no heights.

use std::collections::{BTreeMap, BTreeSet};

use world::geometry::Point3;
use world::map::{
    Area, BoundarySegment, Lane, LaneNeighbor, Map, MapId, RoadEdge, RoadEdgeKind, RoadLine, RoadLineKind,
};

use super::archive::{Archive, LaneSegment, PedestrianCrossing, Place};
use super::{ArgoverseError, kinds, ladder, outlines};
use crate::budget::{Budget, TooLarge};
use crate::numbering::Numbering;

/// The map in the file's `bytes`.
pub(super) fn read(bytes: &[u8], budget: &Budget) -> Result<Map, ArgoverseError> {
    let archive: Archive = serde_json::from_slice(bytes).map_err(|error| ArgoverseError::Map(error.to_string()))?;
    let segments = &archive.lane_segments.0;
    let names: Vec<String> = segments.iter().map(|segment| segment.id.to_string()).collect();
    // 0 is what a boundary names where there is none.
    let mut numbers = Numbering::of(&names, 1, (1, i64::MAX));
    let mut lines = Lines::default();
    let mut map = Map::default();
    for segment in segments {
        map.lanes.push(lane(segment, &mut numbers, &mut lines, budget)?);
    }
    connect(segments, &mut map.lanes, &mut numbers, budget)?;
    map.road_lines = lines.lines;
    let lane_ids: BTreeSet<i64> = segments.iter().map(|segment| segment.id).collect();
    for crossing in &archive.pedestrian_crossings.0 {
        let is_taken = lane_ids.contains(&crossing.id);
        let name = if is_taken { format!("crossing {}", crossing.id) } else { crossing.id.to_string() };
        let polygon = polygon(crossing);
        budget.spend(polygon.len())?;
        map.crosswalks.push(Area { id: MapId(numbers.number(&name)), polygon });
    }
    let areas: Vec<Vec<Point3>> = archive.drivable_areas.0.iter().map(|area| points(&area.area_boundary)).collect();
    for (place, polyline) in outlines::road_edges(&areas, &map.lanes, budget)?.into_iter().enumerate() {
        let id = MapId(numbers.number(&format!("edge {place}")));
        map.road_edges.push(RoadEdge { id, kind: RoadEdgeKind::Boundary, polyline });
    }
    map.lanes.iter_mut().flat_map(|lane| &mut lane.centerline).for_each(flatten);
    map.road_lines.iter_mut().flat_map(|line| &mut line.polyline).for_each(flatten);
    map.crosswalks.iter_mut().flat_map(|area| &mut area.polygon).for_each(flatten);
    Ok(map)
}

fn flatten(point: &mut Point3) {
    point.z = 0.0;
}

fn points(places: &[Place]) -> Vec<Point3> {
    places.iter().map(|place| place.point()).collect()
}

fn lane(
    segment: &LaneSegment,
    numbers: &mut Numbering,
    lines: &mut Lines,
    budget: &Budget,
) -> Result<Lane, ArgoverseError> {
    let (left, right) = (points(&segment.left_lane_boundary), points(&segment.right_lane_boundary));
    let rungs = ladder::rungs(&left, &right);
    budget.spend(rungs as usize)?;
    let centerline = ladder::centerline(&left, &right, rungs as usize);
    let lane_end_index = centerline.len() as i32 - 1;
    let mut boundary = |line: Vec<Point3>, mark_type: &str| -> Result<Vec<BoundarySegment>, TooLarge> {
        let Some(kind) = kinds::line(mark_type).filter(|_| !line.is_empty()) else { return Ok(Vec::new()) };
        budget.spend(line.len())?;
        let line = lines.find(line, kind, numbers);
        Ok(vec![BoundarySegment { lane_start_index: 0, lane_end_index, feature: line.id, kind: line.kind }])
    };
    Ok(Lane {
        left_boundaries: boundary(left, &segment.left_lane_mark_type)?,
        right_boundaries: boundary(right, &segment.right_lane_mark_type)?,
        id: MapId(numbers.number(&segment.id.to_string())),
        kind: kinds::lane(&segment.lane_type),
        interpolating: segment.is_intersection,
        centerline,
        ..Lane::default()
    })
}

/// Painted lines: where two lanes share one, it is there once.
#[derive(Default)]
struct Lines {
    lines: Vec<RoadLine>,
    /// Places by the bits of what they go through, whichever way.
    known: BTreeMap<Vec<[u64; 2]>, usize>,
}

impl Lines {
    fn find(&mut self, polyline: Vec<Point3>, kind: RoadLineKind, numbers: &mut Numbering) -> &RoadLine {
        let there: Vec<[u64; 2]> = polyline.iter().map(|point| [point.x.to_bits(), point.y.to_bits()]).collect();
        let back: Vec<[u64; 2]> = there.iter().rev().copied().collect();
        let next = self.lines.len();
        let place = *self.known.entry(there.min(back)).or_insert(next);
        if place == next {
            let id = MapId(numbers.number(&format!("line {place}")));
            self.lines.push(RoadLine { id, kind, polyline });
        }
        &self.lines[place]
    }
}

/// Links and neighbours. Neighbours go the same way in ours; Argoverse's may be of oncoming traffic.
fn connect(
    segments: &[LaneSegment],
    lanes: &mut [Lane],
    numbers: &mut Numbering,
    budget: &Budget,
) -> Result<(), TooLarge> {
    let places: BTreeMap<i64, usize> =
        segments.iter().enumerate().map(|(place, segment)| (segment.id, place)).collect();
    let number = |id: &i64, numbers: &mut Numbering| MapId(numbers.number(&id.to_string()));
    for (place, segment) in segments.iter().enumerate() {
        budget.spend(segment.predecessors.len() + segment.successors.len() + 2)?;
        lanes[place].entries = segment.predecessors.iter().map(|id| number(id, numbers)).collect();
        lanes[place].exits = segment.successors.iter().map(|id| number(id, numbers)).collect();
        let beside = |id: Option<i64>| {
            let (own, other) = (&lanes[place], &lanes[*places.get(&id?)?]);
            goes_along(own, other).then(|| LaneNeighbor {
                lane: other.id,
                self_start_index: 0,
                self_end_index: own.centerline.len() as i32 - 1,
                neighbor_start_index: 0,
                neighbor_end_index: other.centerline.len() as i32 - 1,
                boundaries: Vec::new(),
            })
        };
        let (left, right) = (beside(segment.left_neighbor_id), beside(segment.right_neighbor_id));
        lanes[place].left_neighbors.extend(left);
        lanes[place].right_neighbors.extend(right);
    }
    Ok(())
}

fn goes_along(one: &Lane, other: &Lane) -> bool {
    let way = |lane: &Lane| Some(lane.centerline.last()?.xy() - lane.centerline.first()?.xy());
    way(one).zip(way(other)).is_some_and(|(one, other)| one.dot(other) > 0.0)
}

/// The area between two edges, which go the same way, as a rule.
fn polygon(crossing: &PedestrianCrossing) -> Vec<Point3> {
    let (mut one, mut other) = (points(&crossing.edge1), points(&crossing.edge2));
    let apart = |one: Option<&Point3>, other: Option<&Point3>| {
        one.zip(other).map_or(0.0, |(one, other)| one.xy().distance(other.xy()))
    };
    let along = apart(one.first(), other.first()) + apart(one.last(), other.last());
    let against = apart(one.first(), other.last()) + apart(one.last(), other.first());
    if along <= against {
        other.reverse();
    }
    one.append(&mut other);
    one
}
