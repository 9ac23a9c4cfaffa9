//! Centre lines of few points. Matching and routes look at points, and expect them about half a metre apart.

use std::collections::BTreeMap;

use crate::geometry::Point3;
use crate::map::{BoundarySegment, Lane, Map, MapId};

/// Points farther apart than this (m) are sparse. In 500 real scenes no two points of a lane are more than 0.502 m apart.
pub const SPARSE: f64 = 1.0;

/// The distance of points that are put in between (m), at most.
pub const SPACING: f64 = 0.5;

/// So many points are put into a map at most, 250 km: a lane that needs more is left as it is.
const MOST_POINTS: usize = 500_000;

/// The map with points put into its sparse lanes, and these; no map where there are none.
pub(super) fn resampled(map: &Map) -> (Option<Map>, Vec<MapId>) {
    let sparse: Vec<MapId> = map.lanes.iter().filter(|lane| is_sparse(lane)).map(|lane| lane.id).collect();
    if sparse.is_empty() {
        return (None, sparse);
    }
    let mut map = map.clone();
    let mut places: BTreeMap<MapId, Vec<i32>> = BTreeMap::new();
    let mut left = MOST_POINTS;
    for lane in map.lanes.iter_mut().filter(|lane| is_sparse(lane)) {
        let before = lane.centerline.len();
        if let Some((dense, moved)) = dense(&lane.centerline, left) {
            left -= dense.len() - before;
            lane.centerline = dense;
            places.insert(lane.id, moved);
        }
    }
    for lane in &mut map.lanes {
        renumber(lane, &places);
    }
    (Some(map), sparse)
}

fn is_sparse(lane: &Lane) -> bool {
    lane.centerline.windows(2).any(|pair| pair[0].xy().distance(pair[1].xy()) > SPARSE)
}

/// The line with points put in, and where each of its own points is now; `None` where more than `most` would have to be put in.
fn dense(line: &[Point3], most: usize) -> Option<(Vec<Point3>, Vec<i32>)> {
    let (mut points, mut places) = (vec![*line.first()?], vec![0]);
    for pair in line.windows(2) {
        let (from, to) = (pair[0], pair[1]);
        let length = from.xy().distance(to.xy());
        let parts = if length > SPARSE { (length / SPACING).ceil() } else { 1.0 };
        if parts > (line.len() + most - points.len()) as f64 {
            return None;
        }
        let mix = |a: f64, b: f64, part: f64| a + (b - a) * part / parts;
        let between = (1..parts as usize).map(|part| part as f64);
        let put_in = between.map(|p| Point3::new(mix(from.x, to.x, p), mix(from.y, to.y, p), mix(from.z, to.z, p)));
        points.extend(put_in);
        points.push(to);
        places.push(i32::try_from(points.len() - 1).ok()?);
    }
    Some((points, places))
}

/// Brings the indices into centre lines up to date.
fn renumber(lane: &mut Lane, places: &BTreeMap<MapId, Vec<i32>>) {
    let moved = |lane: MapId, index: &mut i32| {
        let new = places.get(&lane).zip(usize::try_from(*index).ok()).and_then(|(places, index)| places.get(index));
        *index = new.copied().unwrap_or(*index);
    };
    let own = lane.id;
    let boundaries = |segments: &mut [BoundarySegment]| {
        for segment in segments {
            moved(own, &mut segment.lane_start_index);
            moved(own, &mut segment.lane_end_index);
        }
    };
    boundaries(&mut lane.left_boundaries);
    boundaries(&mut lane.right_boundaries);
    for neighbor in lane.left_neighbors.iter_mut().chain(&mut lane.right_neighbors) {
        moved(own, &mut neighbor.self_start_index);
        moved(own, &mut neighbor.self_end_index);
        moved(neighbor.lane, &mut neighbor.neighbor_start_index);
        moved(neighbor.lane, &mut neighbor.neighbor_end_index);
        boundaries(&mut neighbor.boundaries);
    }
}
