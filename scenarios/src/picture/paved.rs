//! What lies between road edges, where the map says so: on the left of the edge that is nearest, and within some metres of it, or of a lane.

use world::geometry::{Point, SegmentGrid};
use world::map::{LaneKind, Map};

use super::canvas::Path;
use super::frame::Frame;

/// How far from an edge there is road where nothing else is nearer (m), as over the bays of a parking lot.
const REACH: f64 = 8.0;
/// How far beyond the free end of an edge it still tells its sides (m).
const BEYOND: f64 = 1.0;
/// How far from a lane's middle there is road (m), on the road's side of the nearest edge: junctions are wide, and edges far from their middle.
const LANE_REACH: f64 = 5.0;
/// How far from an edge that holds (m).
const FAR: f64 = 40.0;
/// Sides of the squares that are looked at (m): curbs are drawn more exactly by others.
const SQUARE: f64 = 1.0;
/// The most squares to a side.
const MOST: f64 = 700.0;

/// The areas, all turning the same way.
pub fn paved(frame: &Frame, map: &Map) -> Path {
    let edges = map.road_edges.iter().map(|edge| (0, edge.polyline.iter().map(|point| point.xy())));
    let lanes = map.lanes.iter().filter(|lane| lane.kind != LaneKind::BikeLane);
    let lanes = lanes.map(|lane| (0, lane.centerline.iter().map(|point| point.xy())));
    let ground = Ground { edges: SegmentGrid::new(edges, REACH), lanes: SegmentGrid::new(lanes, REACH) };
    let mut path = Path::default();
    if ground.edges.is_empty() {
        return path;
    }
    let size = frame.pixels(SQUARE).max(4.0).max(frame.width.max(frame.height) / MOST);
    let columns = (frame.width / size).ceil() as usize;
    let rows = (frame.height / size).ceil() as usize;
    let row_of = |row: usize| -> Vec<Corner> {
        let corner = |column: usize| {
            let at = Point::new(column as f64 * size, row as f64 * size);
            Corner { at, depth: ground.depth(frame.log_point(at)) }
        };
        (0..=columns).map(corner).collect()
    };
    let mut above = row_of(0);
    for row in 1..=rows {
        let below = row_of(row);
        squares(&above, &below, &mut path);
        above = below;
    }
    path
}

/// A corner of a square.
#[derive(Clone, Copy)]
struct Corner {
    at: Point,
    /// See [`Ground::depth`].
    depth: f64,
}

/// What the map knows of the ground.
struct Ground {
    edges: SegmentGrid,
    lanes: SegmentGrid,
}

impl Ground {
    /// How deep in what is paved a point lies (m); negative outside.
    fn depth(&self, point: Point) -> f64 {
        self.by_edge(point).max(self.by_lane(point))
    }

    fn by_edge(&self, point: Point) -> f64 {
        match self.edges.nearest(point, REACH + SQUARE) {
            Some(edge) if !edge.beyond_end || edge.distance() < BEYOND => {
                edge.signed_distance.min(REACH - edge.signed_distance)
            }
            _ => -SQUARE,
        }
    }

    fn by_lane(&self, point: Point) -> f64 {
        let lane = self.lanes.nearest(point, LANE_REACH + SQUARE).filter(|lane| !lane.beyond_end);
        let Some(lane) = lane else { return -SQUARE };
        match self.edges.nearest(point, FAR) {
            Some(edge) => edge.signed_distance.min(LANE_REACH - lane.distance()),
            None => -SQUARE,
        }
    }
}

/// What is paved of a row of squares (marching squares); those that are paved as a whole are one area as long as they go on.
fn squares(above: &[Corner], below: &[Corner], path: &mut Path) {
    let mut whole: Option<[Point; 2]> = None; // where such a run begins, above and below
    for (top, bottom) in above.windows(2).zip(below.windows(2)) {
        let corners = [top[0], top[1], bottom[1], bottom[0]];
        if corners.iter().all(|corner| corner.depth > 0.0) {
            whole.get_or_insert([top[0].at, bottom[0].at]);
            continue;
        }
        if let Some([start_above, start_below]) = whole.take() {
            path.area(&[start_above, top[0].at, bottom[0].at, start_below]);
        }
        path.area(&paved_part(corners));
    }
    if let (Some([start_above, start_below]), Some(top), Some(bottom)) = (whole, above.last(), below.last()) {
        path.area(&[start_above, top.at, bottom.at, start_below]);
    }
}

fn paved_part(corners: [Corner; 4]) -> Vec<Point> {
    let mut part = Vec::new();
    for (from, to) in corners.iter().zip(corners.iter().cycle().skip(1)) {
        if from.depth > 0.0 {
            part.push(from.at);
        }
        if (from.depth > 0.0) != (to.depth > 0.0) {
            part.push(from.at + (to.at - from.at) * (from.depth / (from.depth - to.depth)));
        }
    }
    part
}
