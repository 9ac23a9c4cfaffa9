//! What of a map does not change within a scene: made once, so that a step only looks up.

use std::collections::BTreeMap;

use world::geometry::{Point, Point3};
use world::map::{Area, BoundarySegment, Lane, Map, MapId, RoadLineKind};

use super::Style;
use super::sampling::sampled;
use crate::frame::POINTS;

/// Miles per hour in one meter per second, as the authors have it.
const MPH_PER_MPS: f64 = 2.237;

/// A road edge's code is this and its kind.
const ROAD_EDGES: u8 = 8;

/// A point with the direction to the next one; x = y = heading = 0 where there is none.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Vertex {
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) heading: f64,
}

impl Vertex {
    pub(super) fn point(&self) -> Point {
        Point::new(self.x, self.y)
    }
}

/// A boundary beside a lane point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Side {
    pub(super) nearest: Vertex,
    pub(super) code: u8,
    /// Whether there is one.
    pub(super) known: bool,
}

/// A point of a lane, in the log's frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct LaneVertex {
    pub(super) center: Vertex,
    /// Left, right.
    pub(super) sides: [Side; 2],
}

/// A lane, and where it leads.
#[derive(Clone, Debug)]
pub(super) struct PreparedLane {
    pub(super) id: MapId,
    /// Number of its first point.
    pub(super) first: usize,
    /// How many it has.
    pub(super) count: usize,
    pub(super) exits: Vec<usize>,
    pub(super) entries: Vec<usize>,
    /// Left, right: lanes, and from which to which point of this one they are beside it.
    pub(super) neighbors: [Vec<(usize, [i32; 2])>; 2],
    /// The least and the greatest x and y.
    pub(super) bounds: [Point; 2],
    /// m/s.
    pub(super) speed_limit: f32,
    pub(super) kind: u8,
    pub(super) interpolating: bool,
    pub(super) stop_sign: bool,
}

/// A crosswalk.
#[derive(Clone, Debug)]
pub(super) struct PreparedCrosswalk {
    pub(super) polygon: Vec<Point>,
    pub(super) outline: [Vertex; POINTS],
}

/// A map, prepared.
#[derive(Clone, Debug)]
pub(super) struct PreparedMap {
    pub(super) lanes: Vec<PreparedLane>,
    pub(super) points: Vec<LaneVertex>,
    pub(super) crosswalks: Vec<PreparedCrosswalk>,
    pub(super) lane_of: BTreeMap<MapId, usize>,
}

impl PreparedMap {
    pub(super) fn of(map: &Map, style: Style) -> Self {
        let lane_of = map.lane_indices();
        let boundaries = Boundaries::of(map);
        let mut points = Vec::new();
        let lanes = map.lanes.iter().map(|lane| {
            let first = points.len();
            points.extend(boundaries.beside(lane, style));
            let linked = |ids: &[MapId]| ids.iter().filter_map(|id| lane_of.get(id).copied()).collect();
            let neighbors = [&lane.left_neighbors, &lane.right_neighbors].map(|neighbors| {
                let beside = neighbors.iter().map(|n| (n.lane, [n.self_start_index, n.self_end_index]));
                beside.filter_map(|(id, range)| Some((*lane_of.get(&id)?, range))).collect()
            });
            let xs = || lane.centerline.iter().map(|point| point.x);
            let ys = || lane.centerline.iter().map(|point| point.y);
            let least = |values: &mut dyn Iterator<Item = f64>| values.fold(f64::INFINITY, f64::min);
            let most = |values: &mut dyn Iterator<Item = f64>| values.fold(f64::NEG_INFINITY, f64::max);
            PreparedLane {
                id: lane.id,
                first,
                count: lane.centerline.len(),
                exits: linked(&lane.exits),
                entries: linked(&lane.entries),
                neighbors,
                bounds: [Point::new(least(&mut xs()), least(&mut ys())), Point::new(most(&mut xs()), most(&mut ys()))],
                speed_limit: (lane.speed_limit_mph / MPH_PER_MPS) as f32,
                kind: lane.kind as u8,
                interpolating: lane.interpolating,
                stop_sign: map.stop_signs.iter().any(|sign| sign.lanes.contains(&lane.id)),
            }
        });
        let lanes = lanes.collect();
        Self { lanes, points, crosswalks: map.crosswalks.iter().filter_map(prepared).collect(), lane_of }
    }

    pub(super) fn points_of(&self, lane: usize) -> &[LaneVertex] {
        let PreparedLane { first, count, .. } = self.lanes[lane];
        &self.points[first..first + count]
    }
}

/// The points of a line, each with its direction to the next; the last has that of the one before.
fn vertices(line: &[Point3]) -> Vec<Vertex> {
    let mut vertices: Vec<Vertex> = line.iter().map(|point| Vertex { x: point.x, y: point.y, heading: 0.0 }).collect();
    for index in 1..vertices.len() {
        let (from, to) = (vertices[index - 1], vertices[index]);
        vertices[index - 1].heading = libm::atan2(to.y - from.y, to.x - from.x);
    }
    if let [.., before, last] = vertices.as_mut_slice() {
        last.heading = before.heading;
    }
    vertices
}

/// Lines and edges by their ids.
struct Boundaries {
    lines: BTreeMap<MapId, (Vec<Vertex>, u8)>,
}

impl Boundaries {
    fn of(map: &Map) -> Self {
        let lines = map.road_lines.iter().map(|line| (line.id, (vertices(&line.polyline), line.kind as u8)));
        let edges =
            map.road_edges.iter().map(|edge| (edge.id, (vertices(&edge.polyline), ROAD_EDGES + edge.kind as u8)));
        Self { lines: lines.chain(edges).collect() }
    }

    fn beside<'a>(&'a self, lane: &'a Lane, style: Style) -> impl Iterator<Item = LaneVertex> + 'a {
        vertices(&lane.centerline).into_iter().enumerate().map(move |(index, center)| {
            let sides = [&lane.left_boundaries, &lane.right_boundaries];
            LaneVertex { center, sides: sides.map(|segments| self.side(segments, index, center, style)) }
        })
    }

    fn side(&self, segments: &[BoundarySegment], index: usize, center: Vertex, style: Style) -> Side {
        let covers = |segment: &&BoundarySegment| {
            i32::try_from(index).is_ok_and(|at| (segment.lane_start_index..=segment.lane_end_index).contains(&at))
        };
        // Of several the last one counts.
        let Some(segment) = segments.iter().rev().find(covers) else { return Side::default() };
        let Some((line, own)) = self.lines.get(&segment.feature) else { return Side::default() };
        let distance = |vertex: &Vertex| vertex.point().distance_squared(center.point());
        let nearest = line.iter().copied().reduce(|a, b| if distance(&b) < distance(&a) { b } else { a });
        let code = match segment.kind {
            // A line named by a segment that knows no kind would be beyond the table.
            RoadLineKind::Unknown if style == Style::Mended => (*own).min(10),
            RoadLineKind::Unknown => *own,
            kind => kind as u8,
        };
        nearest.map_or_else(Side::default, |nearest| Side { nearest, code, known: true })
    }
}

fn prepared(area: &Area) -> Option<PreparedCrosswalk> {
    let polygon: Vec<Point> = area.polygon.iter().map(|corner| corner.xy()).collect();
    let mut outline = Vec::new();
    for (index, from) in polygon.iter().enumerate() {
        let to = polygon[(index + 1) % polygon.len()];
        let parts = 2.0 * from.distance(to).ceil() + 1.0;
        // A map's sides are tens of metres; a hostile one's are bounded by the reader.
        outline.extend((0..parts as usize).map(|part| *from + (to - *from) * (part as f64 / parts)));
    }
    let points: Vec<Point3> = outline.iter().map(|point| Point3::new(point.x, point.y, 0.0)).collect();
    let vertices = vertices(&points);
    (!vertices.is_empty()).then(|| PreparedCrosswalk { polygon, outline: sampled(vertices.len(), |at| vertices[at]) })
}
