//! The still part of a picture: the map and the route as layers of lines, the same for every kind of file.

use wire::proto;

use crate::origin::Origin;
use crate::outline::outline;
use crate::palette::{self, Rgba};

/// Every how many samples of 0.1 m the route is drawn.
const ROUTE_STRIDE: usize = 10;

/// Lines of one kind.
pub struct Layer {
    /// Its name; in Rerun the entity's path below `/world`.
    pub name: &'static str,
    /// Each with its own colour.
    pub lines: Vec<(Vec<[f32; 3]>, Rgba)>,
    /// Width on the screen (points).
    pub width: f32,
}

/// The layers of `scene`, from the ground up; those without a line are left out.
#[must_use]
pub fn layers(scene: &proto::Scene, origin: &Origin) -> Vec<Layer> {
    let empty = proto::Map::default();
    let map = scene.map.as_ref().unwrap_or(&empty);
    let mut layers = Vec::new();
    let mut layer = |name, width, lines: Vec<(Vec<[f32; 3]>, Rgba)>| {
        let lines: Vec<_> = lines.into_iter().filter(|(points, _)| points.len() > 1).collect();
        if !lines.is_empty() {
            layers.push(Layer { name, lines, width });
        }
    };
    let closed = |area: &proto::Area, color| {
        let mut points = polyline(area.polygon.as_ref(), origin);
        points.extend(points.first().copied());
        (points, color)
    };
    layer("map/driveways", 1.0, map.driveways.iter().map(|area| closed(area, palette::AREA)).collect());
    layer("map/speed_bumps", 1.0, map.speed_bumps.iter().map(|area| closed(area, palette::AREA)).collect());
    layer("map/crosswalks", 1.6, map.crosswalks.iter().map(|area| closed(area, palette::CROSSWALK)).collect());
    let lane = |lane: &proto::Lane| {
        let bike = lane.kind() == proto::LaneKind::BikeLane;
        (polyline(lane.centerline.as_ref(), origin), if bike { palette::BIKE_LANE } else { palette::LANE })
    };
    layer("map/lanes", 1.2, map.lanes.iter().map(lane).collect());
    let road_line =
        |line: &proto::RoadLine| (polyline(line.polyline.as_ref(), origin), palette::road_line(line.kind()));
    layer("map/road_lines", 1.3, map.road_lines.iter().map(road_line).collect());
    let road_edge = |edge: &proto::RoadEdge| (polyline(edge.polyline.as_ref(), origin), palette::ROAD_EDGE);
    layer("map/road_edges", 2.2, map.road_edges.iter().map(road_edge).collect());
    layer("route", 5.0, vec![(route(scene.reference_line.as_ref(), origin), palette::ROUTE)]);
    layers
}

/// Where stop signs stand.
#[must_use]
pub fn stop_signs(scene: &proto::Scene, origin: &Origin) -> Vec<[f32; 3]> {
    let signs = scene.map.iter().flat_map(|map| &map.stop_signs);
    signs.map(|sign| origin.place(sign.x, sign.y, sign.z)).collect()
}

fn polyline(line: Option<&proto::Polyline>, origin: &Origin) -> Vec<[f32; 3]> {
    line.map_or_else(Vec::new, |line| points(&line.x, &line.y, &line.z, 1, origin))
}

fn route(line: Option<&proto::ReferenceLine>, origin: &Origin) -> Vec<[f32; 3]> {
    line.map_or_else(Vec::new, |line| points(&line.x, &line.y, &line.z, ROUTE_STRIDE, origin))
}

/// The columns as points: every `stride`-th and the last.
fn points(x: &[f64], y: &[f64], z: &[f64], stride: usize, origin: &Origin) -> Vec<[f32; 3]> {
    let columns = x.iter().zip(y).zip(z);
    let last = columns.len().saturating_sub(1);
    let kept = columns.enumerate().filter(|(index, _)| index % stride == 0 || *index == last);
    let points: Vec<_> = kept.map(|(_, ((x, y), z))| origin.place(*x, *y, *z)).collect();
    outline(&points)
}
