//! Lanes: how many, how long, how bent, how wide, how linked.

use std::collections::BTreeMap;

use world::geometry::{Point, Polyline, SegmentGrid, angle_difference};
use world::map::{BoundarySegment, Lane, LaneKind, Map, MapId};
use world::scene::Scene;

use super::every;
use super::quantity::{Quantity, Share};
use super::roadway::{counts, course};
use super::samples::Samples;

/// A curvature is measured over so many metres, and that often.
const BASE: usize = 4;

/// A shorter lane (m) has no bend: it has too few pieces to tell.
const SHORTEST: f64 = 6.0;

/// Points of a lane between two looks at its width: about 5 m.
const WIDTH_STRIDE: usize = 10;

/// A boundary further (m) from the centre line is none of this lane's.
const WIDEST: f64 = 10.0;

pub(super) fn measure(scene: &Scene, samples: &mut Samples) {
    let map = scene.map();
    samples.add_count(Quantity::LanesPerScene, map.lanes.iter().filter(|lane| counts(lane)).count());
    let boundaries = Boundaries::of(map);
    for lane in &map.lanes {
        samples.look(Share::SurfaceStreet, lane.kind == LaneKind::SurfaceStreet);
        samples.look(Share::BikeLane, lane.kind == LaneKind::BikeLane);
        samples.look(Share::Freeway, lane.kind == LaneKind::Freeway);
        samples.look(Share::LimitUnknown, lane.speed_limit().is_none());
        samples.look(Share::LeftNeighbor, !lane.left_neighbors.is_empty());
        samples.look(Share::RightNeighbor, !lane.right_neighbors.is_empty());
        samples.look(Share::Interpolating, lane.interpolating);
        let Some(course) = course(lane).filter(|course| course.points().len() > 1) else { continue };
        if !counts(lane) {
            samples.add(Quantity::BikeLaneLength, course.length());
            continue;
        }
        samples.add(Quantity::LaneLength, course.length());
        links(lane, samples);
        bends(&course, samples);
        widths(lane, &course, &boundaries, samples);
    }
}

fn links(lane: &Lane, samples: &mut Samples) {
    if lane.speed_limit().is_some() {
        samples.add(Quantity::SpeedLimit, lane.speed_limit_mph);
    }
    samples.add_count(Quantity::Exits, lane.exits.len());
    samples.add_count(Quantity::Entries, lane.entries.len());
}

/// Bends of a lane that is long enough to have one: by the directions of pieces of 1 m.
fn bends(course: &Polyline, samples: &mut Samples) {
    if course.length() < SHORTEST {
        return;
    }
    let points: Vec<Point> = (0..=course.length() as usize).map(|meters| course.point_at(meters as f64)).collect();
    let headings: Vec<f64> = points.windows(2).map(|pair| (pair[1] - pair[0]).heading()).collect();
    let turn = |from: f64, to: f64| angle_difference(from, to).abs();
    // At least six pieces, so that there are more than BASE.
    let curvatures: Vec<f64> =
        headings.iter().zip(&headings[BASE..]).map(|(from, to)| turn(*from, *to) / BASE as f64).collect();
    for index in every(BASE, curvatures.len()) {
        samples.add(Quantity::Curvature, curvatures[index]);
    }
    samples.add(Quantity::LargestCurvature, curvatures.iter().copied().fold(0.0, f64::max));
    samples.add(Quantity::Turn, turn(headings[0], headings[headings.len() - 1]).to_degrees());
}

/// What lies beside lanes, by id.
struct Boundaries {
    grids: BTreeMap<MapId, SegmentGrid>,
}

impl Boundaries {
    fn of(map: &Map) -> Self {
        let lines = map.road_lines.iter().map(|line| (line.id, &line.polyline));
        let edges = map.road_edges.iter().map(|edge| (edge.id, &edge.polyline));
        let grid = |points: &Vec<world::geometry::Point3>| SegmentGrid::new([(0, points.iter().map(|p| p.xy()))], 4.0);
        Self { grids: lines.chain(edges).map(|(id, points)| (id, grid(points))).collect() }
    }

    /// The nearest point of what bounds point `index` of a lane.
    fn beside(&self, bounds: &[BoundarySegment], index: usize, point: Point) -> Option<Point> {
        let within =
            |bound: &&BoundarySegment| (bound.lane_start_index..=bound.lane_end_index).contains(&(index as i32));
        let grid = self.grids.get(&bounds.iter().find(within)?.feature)?;
        grid.nearest(point, WIDEST).map(|nearest| nearest.point)
    }
}

fn widths(lane: &Lane, course: &Polyline, boundaries: &Boundaries, samples: &mut Samples) {
    for index in every(WIDTH_STRIDE, course.points().len()) {
        let point = course.points()[index];
        let left = boundaries.beside(&lane.left_boundaries, index, point);
        let right = boundaries.beside(&lane.right_boundaries, index, point);
        if let (Some(left), Some(right)) = (left, right) {
            samples.add(Quantity::LaneWidth, left.distance(right));
        }
    }
}
