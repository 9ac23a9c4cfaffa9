//! Crosswalks, and how much else is drawn on the ground.

use world::geometry::Point;
use world::map::{Area, RoadEdgeKind, RoadLineKind};
use world::scene::Scene;

use super::quantity::{Quantity, Share};
use super::samples::Samples;

pub(super) fn measure(scene: &Scene, samples: &mut Samples) {
    let map = scene.map();
    for (short, long) in map.crosswalks.iter().filter_map(sides) {
        samples.add(Quantity::CrosswalkShort, short);
        samples.add(Quantity::CrosswalkLong, long);
    }
    samples.add_count(Quantity::Crosswalks, map.crosswalks.len());
    samples.add_count(Quantity::StopSigns, map.stop_signs.len());
    samples.add_count(Quantity::SpeedBumps, map.speed_bumps.len());
    samples.add_count(Quantity::Driveways, map.driveways.len());
    samples.add_count(Quantity::RoadLines, map.road_lines.len());
    samples.add_count(Quantity::RoadEdges, map.road_edges.len());
    for line in &map.road_lines {
        for (share, kind) in [
            (Share::SolidSingleWhite, RoadLineKind::SolidSingleWhite),
            (Share::BrokenSingleWhite, RoadLineKind::BrokenSingleWhite),
            (Share::SolidDoubleYellow, RoadLineKind::SolidDoubleYellow),
            (Share::SolidSingleYellow, RoadLineKind::SolidSingleYellow),
            (Share::PassingDoubleYellow, RoadLineKind::PassingDoubleYellow),
        ] {
            samples.look(share, line.kind == kind);
        }
    }
    for edge in &map.road_edges {
        samples.look(Share::EdgeBoundary, edge.kind == RoadEdgeKind::Boundary);
        samples.look(Share::EdgeMedian, edge.kind == RoadEdgeKind::Median);
    }
}

/// Short and long side (m) of the smallest rectangle around an area that lies along one of its sides: around a convex area, as
/// crosswalks are, the smallest of all. None of an area without sides.
fn sides(area: &Area) -> Option<(f64, f64)> {
    let corners: Vec<Point> = area.polygon.iter().map(|corner| corner.xy()).collect();
    let pairs = corners.iter().zip(corners.iter().cycle().skip(1));
    let boxes = pairs.filter(|(from, to)| from != to).map(|(from, to)| {
        let along = (*to - *from) * (1.0 / from.distance(*to));
        let across = Point::new(-along.y, along.x);
        let extent = |axis: Point| {
            let (low, high) = corners
                .iter()
                .map(|corner| axis.dot(*corner - corners[0]))
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
            high - low
        };
        (extent(along), extent(across))
    });
    let smallest = boxes.min_by(|a, b| (a.0 * a.1).total_cmp(&(b.0 * b.1)))?;
    Some((smallest.0.min(smallest.1), smallest.0.max(smallest.1)))
}
