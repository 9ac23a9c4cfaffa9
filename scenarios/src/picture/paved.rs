//! What lies between road edges, where the map says so: within some metres on the left of the edge that is nearest.

use world::geometry::{Point, SegmentGrid};
use world::map::Map;

use super::canvas::Path;
use super::frame::Frame;

/// How far from an edge there is road where nothing else is nearer (m), as over the bays of a parking lot.
const REACH: f64 = 8.0;
/// How far beyond the free end of an edge it still tells its sides (m).
const BEYOND: f64 = 1.0;
/// Sides of the squares that are looked at (m): curbs are drawn more exactly by others.
const SQUARE: f64 = 1.0;
/// The most squares to a side.
const MOST: f64 = 700.0;

/// The areas, all turning the same way.
pub fn paved(frame: &Frame, map: &Map) -> Path {
    let edges = map.road_edges.iter().map(|edge| (0, edge.polyline.iter().map(|point| point.xy())));
    let edges = SegmentGrid::new(edges, REACH);
    let mut path = Path::default();
    if edges.is_empty() {
        return path;
    }
    let size = frame.pixels(SQUARE).max(4.0).max(frame.width.max(frame.height) / MOST);
    let columns = (frame.width / size).ceil() as usize;
    let rows = (frame.height / size).ceil() as usize;
    let row_of = |row: usize| -> Vec<Corner> {
        let corner = |column: usize| {
            let at = Point::new(column as f64 * size, row as f64 * size);
            Corner { at, depth: depth(&edges, frame.log_point(at)) }
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
    /// How deep in what is paved it lies (m); negative outside.
    depth: f64,
}

fn depth(edges: &SegmentGrid, point: Point) -> f64 {
    match edges.nearest(point, REACH + SQUARE) {
        Some(nearest) if !nearest.beyond_end || nearest.distance() < BEYOND => {
            nearest.signed_distance.min(REACH - nearest.signed_distance)
        }
        _ => -SQUARE,
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
