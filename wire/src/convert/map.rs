//! The map.

use world::geometry::Point3;
use world::map::{Area, BoundarySegment, Lane, LaneNeighbor, Map, MapId, RoadEdge, RoadLine, StopSign};

use super::agents::{lane_kind, road_edge_kind, road_line_kind};
use super::{
    Checked, FieldError, Problem, Within, all_finite, each, finite, not_negative, required, same_length, unsigned,
};
use crate::proto;

/// Features of one kind in a map. Waymo's largest maps have some thousands.
const MAX_FEATURES: usize = 100_000;
/// Links, neighbours or boundaries of one lane.
const MAX_LINKS: usize = 10_000;

impl From<&Map> for proto::Map {
    fn from(map: &Map) -> Self {
        Self {
            lanes: map.lanes.iter().map(proto::Lane::from).collect(),
            road_lines: map
                .road_lines
                .iter()
                .map(|line| proto::RoadLine {
                    id: line.id.0,
                    kind: proto::RoadLineKind::from(line.kind).into(),
                    polyline: Some(columns(&line.polyline)),
                })
                .collect(),
            road_edges: map
                .road_edges
                .iter()
                .map(|edge| proto::RoadEdge {
                    id: edge.id.0,
                    kind: proto::RoadEdgeKind::from(edge.kind).into(),
                    polyline: Some(columns(&edge.polyline)),
                })
                .collect(),
            stop_signs: map
                .stop_signs
                .iter()
                .map(|sign| proto::StopSign {
                    id: sign.id.0,
                    lanes: numbers(&sign.lanes),
                    x: sign.position.x,
                    y: sign.position.y,
                    z: sign.position.z,
                })
                .collect(),
            crosswalks: map.crosswalks.iter().map(proto::Area::from).collect(),
            speed_bumps: map.speed_bumps.iter().map(proto::Area::from).collect(),
            driveways: map.driveways.iter().map(proto::Area::from).collect(),
        }
    }
}

impl From<&Lane> for proto::Lane {
    fn from(lane: &Lane) -> Self {
        Self {
            id: lane.id.0,
            kind: proto::LaneKind::from(lane.kind).into(),
            speed_limit_mph: lane.speed_limit_mph,
            interpolating: lane.interpolating,
            centerline: Some(columns(&lane.centerline)),
            entries: numbers(&lane.entries),
            exits: numbers(&lane.exits),
            left_neighbors: lane.left_neighbors.iter().map(proto::LaneNeighbor::from).collect(),
            right_neighbors: lane.right_neighbors.iter().map(proto::LaneNeighbor::from).collect(),
            left_boundaries: lane.left_boundaries.iter().map(proto::BoundarySegment::from).collect(),
            right_boundaries: lane.right_boundaries.iter().map(proto::BoundarySegment::from).collect(),
        }
    }
}

impl From<&LaneNeighbor> for proto::LaneNeighbor {
    fn from(neighbor: &LaneNeighbor) -> Self {
        Self {
            lane: neighbor.lane.0,
            self_start_index: neighbor.self_start_index,
            self_end_index: neighbor.self_end_index,
            neighbor_start_index: neighbor.neighbor_start_index,
            neighbor_end_index: neighbor.neighbor_end_index,
            boundaries: neighbor.boundaries.iter().map(proto::BoundarySegment::from).collect(),
        }
    }
}

impl From<&BoundarySegment> for proto::BoundarySegment {
    fn from(segment: &BoundarySegment) -> Self {
        Self {
            lane_start_index: segment.lane_start_index,
            lane_end_index: segment.lane_end_index,
            feature: segment.feature.0,
            kind: proto::RoadLineKind::from(segment.kind).into(),
        }
    }
}

impl From<&Area> for proto::Area {
    fn from(area: &Area) -> Self {
        Self { id: area.id.0, polygon: Some(columns(&area.polygon)) }
    }
}

pub(super) fn columns(points: &[Point3]) -> proto::Polyline {
    proto::Polyline {
        x: points.iter().map(|p| p.x).collect(),
        y: points.iter().map(|p| p.y).collect(),
        z: points.iter().map(|p| p.z).collect(),
    }
}

fn numbers(ids: &[MapId]) -> Vec<i64> {
    ids.iter().map(|id| id.0).collect()
}

pub(super) fn map(map: proto::Map) -> Checked<Map> {
    Ok(Map {
        lanes: each("lanes", MAX_FEATURES, map.lanes, lane)?,
        road_lines: each("road_lines", MAX_FEATURES, map.road_lines, |line| {
            Ok(RoadLine {
                id: MapId(line.id),
                kind: road_line_kind("kind", line.kind)?,
                polyline: points("polyline", line.polyline)?,
            })
        })?,
        road_edges: each("road_edges", MAX_FEATURES, map.road_edges, |edge| {
            Ok(RoadEdge {
                id: MapId(edge.id),
                kind: road_edge_kind("kind", edge.kind)?,
                polyline: points("polyline", edge.polyline)?,
            })
        })?,
        stop_signs: each("stop_signs", MAX_FEATURES, map.stop_signs, |sign| {
            Ok(StopSign {
                id: MapId(sign.id),
                lanes: ids("lanes", sign.lanes)?,
                position: Point3 { x: finite("x", sign.x)?, y: finite("y", sign.y)?, z: finite("z", sign.z)? },
            })
        })?,
        crosswalks: each("crosswalks", MAX_FEATURES, map.crosswalks, area)?,
        speed_bumps: each("speed_bumps", MAX_FEATURES, map.speed_bumps, area)?,
        driveways: each("driveways", MAX_FEATURES, map.driveways, area)?,
    })
}

fn lane(lane: proto::Lane) -> Checked<Lane> {
    Ok(Lane {
        id: MapId(lane.id),
        kind: lane_kind("kind", lane.kind)?,
        speed_limit_mph: not_negative("speed_limit_mph", lane.speed_limit_mph)?,
        interpolating: lane.interpolating,
        centerline: points("centerline", lane.centerline)?,
        entries: ids("entries", lane.entries)?,
        exits: ids("exits", lane.exits)?,
        left_neighbors: each("left_neighbors", MAX_LINKS, lane.left_neighbors, neighbor)?,
        right_neighbors: each("right_neighbors", MAX_LINKS, lane.right_neighbors, neighbor)?,
        left_boundaries: each("left_boundaries", MAX_LINKS, lane.left_boundaries, boundary)?,
        right_boundaries: each("right_boundaries", MAX_LINKS, lane.right_boundaries, boundary)?,
    })
}

fn neighbor(neighbor: proto::LaneNeighbor) -> Checked<LaneNeighbor> {
    Ok(LaneNeighbor {
        lane: MapId(neighbor.lane),
        self_start_index: neighbor.self_start_index,
        self_end_index: neighbor.self_end_index,
        neighbor_start_index: neighbor.neighbor_start_index,
        neighbor_end_index: neighbor.neighbor_end_index,
        boundaries: each("boundaries", MAX_LINKS, neighbor.boundaries, boundary)?,
    })
}

fn boundary(segment: proto::BoundarySegment) -> Checked<BoundarySegment> {
    Ok(BoundarySegment {
        lane_start_index: segment.lane_start_index,
        lane_end_index: segment.lane_end_index,
        feature: MapId(segment.feature),
        kind: road_line_kind("kind", segment.kind)?,
    })
}

fn area(area: proto::Area) -> Checked<Area> {
    Ok(Area { id: MapId(area.id), polygon: points("polygon", area.polygon)? })
}

fn ids(field: &str, numbers: Vec<i64>) -> Checked<Vec<MapId>> {
    super::bounded(field, MAX_LINKS, numbers.len())?;
    Ok(numbers.into_iter().map(MapId).collect())
}

fn point(x: f64, y: f64, z: f64) -> Point3 {
    Point3 { x: unsigned(x), y: unsigned(y), z: unsigned(z) }
}

pub(super) fn points(field: &str, polyline: Option<proto::Polyline>) -> Checked<Vec<Point3>> {
    let line = required(field, polyline)?;
    let check = || {
        same_length("y", line.x.len(), line.y.len())?;
        same_length("z", line.x.len(), line.z.len())?;
        if line.x.is_empty() {
            return Err(FieldError::new("x", Problem::Missing));
        }
        all_finite("x", &line.x)?;
        all_finite("y", &line.y)?;
        all_finite("z", &line.z)
    };
    check().within(field)?;
    Ok(line.x.iter().zip(&line.y).zip(&line.z).map(|((&x, &y), &z)| point(x, y, z)).collect())
}
