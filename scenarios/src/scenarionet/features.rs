//! The map.

use world::geometry::Point3;
use world::map::{Area, BoundarySegment, Lane, LaneNeighbor, Map, MapId, RoadEdge, RoadLine, StopSign};

use super::dataset::Dataset;
use super::form::{self, Form};
use super::layout::Layout;
use super::pickle::Value;
use super::{ScenarioNetError, outlines};
use crate::joints;
use crate::numbering::Numbering;

const MPH_PER_KMH: f64 = 1.0 / 1.609_344;

/// Stands for "to the other lane's end", until that lane is known.
const TO_ITS_END: i32 = i32::MAX;

/// The map's features in their order, and their numbers by name.
pub(super) fn map<'p>(
    layout: &Layout<'p>,
    features: &'p [(Value<'p>, Value<'p>)],
    dataset: Dataset,
) -> Result<(Map, Numbering), ScenarioNetError> {
    layout.spend(features.len())?;
    let name = |(key, _): &(Value<'p>, Value<'p>)| layout.pickle.name(*key).map(|name| name.into_owned());
    let names: Vec<String> = features.iter().map(|pair| name(pair).unwrap_or_default()).collect();
    // 0 is what a boundary names where there is none.
    let mut numbers = Numbering::of(&names, 1, (0, i64::MAX));
    let (mut map, mut rings, mut linked) = (Map::default(), Vec::new(), false);
    for (name, (_, feature)) in names.iter().zip(features) {
        let id = MapId(numbers.number(name));
        let points = |keys: &[&str]| -> Result<Vec<Point3>, ScenarioNetError> {
            let Some(value) = layout.find(*feature, keys) else { return Ok(Vec::new()) };
            let mut points = layout.points(format_args!("map feature {name}"), value)?;
            if dataset.is_flat() {
                points.iter_mut().for_each(|point| point.z = 0.0);
            }
            Ok(points)
        };
        let polyline = ["polyline", "polygon"];
        let polygon = ["polygon", "polyline"];
        match Form::of(layout, *feature) {
            Form::Lane { kind, interpolating } => {
                let mut centerline = points(&polyline)?;
                if dataset.is_flat() {
                    // nuScenes' end with the last point twice.
                    centerline.dedup_by(|one, other| one.xy().distance(other.xy()) < 1e-3);
                }
                linked |= LINKS.iter().any(|key| layout.pickle.get(*feature, key).is_some());
                let lane = Lane { id, kind, interpolating, centerline, ..Lane::default() };
                map.lanes.push(lane_of(layout, *feature, lane, dataset, &mut numbers)?);
            }
            Form::RoadLine(_) if dataset.has_outlines() && name.starts_with("boundary_") => {
                rings.push(RoadEdge { id, kind: world::map::RoadEdgeKind::Boundary, polyline: points(&polyline)? });
            }
            Form::RoadLine(kind) => map.road_lines.push(RoadLine { id, kind, polyline: points(&polyline)? }),
            Form::RoadEdge(kind) => map.road_edges.push(RoadEdge { id, kind, polyline: points(&polyline)? }),
            Form::StopSign => {
                let position = layout.find(*feature, &["position", "pos"]).and_then(|value| layout.point(value));
                let lanes = links(layout, *feature, &["lane", "lanes"], &mut numbers)?;
                map.stop_signs.push(StopSign { id, lanes, position: position.unwrap_or(NOWHERE) });
            }
            Form::Crosswalk => map.crosswalks.push(Area { id, polygon: points(&polygon)? }),
            Form::SpeedBump => map.speed_bumps.push(Area { id, polygon: points(&polygon)? }),
            Form::Driveway => map.driveways.push(Area { id, polygon: points(&polygon)? }),
            Form::Nothing => {}
        }
    }
    map.road_edges.extend(outlines::with_the_road_on_their_left(rings));
    reach_the_ends(&mut map.lanes);
    if !linked {
        joints::link(&mut map.lanes, &layout.budget)?;
    }
    Ok((map, numbers))
}

/// A place that no scene has: the check drops what is there, and says so.
pub(super) const NOWHERE: Point3 = Point3 { x: f64::NAN, y: f64::NAN, z: f64::NAN };

/// Keys of links between lanes, in all generations.
const LINKS: [&str; 4] = ["entry_lanes", "exit_lanes", "entry", "exit"];

fn lane_of<'p>(
    layout: &Layout<'p>,
    feature: Value<'p>,
    lane: Lane,
    dataset: Dataset,
    numbers: &mut Numbering,
) -> Result<Lane, ScenarioNetError> {
    let limit = match (layout.float(feature, &["speed_limit_mph"]), layout.float(feature, &["speed_limit_kmh"])) {
        _ if !dataset.has_speed_limits() => 0.0,
        (Some(mph), _) => mph,
        (None, Some(kmh)) => kmh * MPH_PER_KMH,
        (None, None) => 0.0,
    };
    let interpolating = layout.find(feature, &["interpolating"]).map(|value| value == Value::Bool(true));
    Ok(Lane {
        speed_limit_mph: limit,
        interpolating: interpolating.unwrap_or(lane.interpolating),
        entries: links(layout, feature, &LINKS_IN, numbers)?,
        exits: links(layout, feature, &LINKS_OUT, numbers)?,
        left_neighbors: neighbors(layout, feature, &["left_neighbor", "left_neighbors"], numbers)?,
        right_neighbors: neighbors(layout, feature, &["right_neighbor", "right_neighbors"], numbers)?,
        left_boundaries: boundaries(layout, feature, &["left_boundaries"], numbers)?,
        right_boundaries: boundaries(layout, feature, &["right_boundaries"], numbers)?,
        ..lane
    })
}

const LINKS_IN: [&str; 2] = ["entry_lanes", "entry"];
const LINKS_OUT: [&str; 2] = ["exit_lanes", "exit"];

fn links<'p>(
    layout: &Layout<'p>,
    feature: Value<'p>,
    keys: &[&str],
    numbers: &mut Numbering,
) -> Result<Vec<MapId>, ScenarioNetError> {
    let links = layout.items(feature, keys);
    layout.spend(links.len())?;
    let names = links.iter().filter_map(|link| layout.pickle.name(*link));
    Ok(names.map(|name| MapId(numbers.number(&name))).collect())
}

/// The number of the feature that `dict` names.
fn named<'p>(layout: &Layout<'p>, dict: Value<'p>, keys: &[&str], numbers: &mut Numbering) -> Option<MapId> {
    let name = layout.pickle.name(layout.find(dict, keys)?)?;
    Some(MapId(if name == "0" { 0 } else { numbers.number(&name) }))
}

/// A place on a lane's centre line.
fn index<'p>(layout: &Layout<'p>, dict: Value<'p>, key: &str, in_list: (&str, usize)) -> Option<i32> {
    let listed = || layout.pickle.int(*layout.items(dict, &[in_list.0]).get(in_list.1)?);
    let index = layout.int(dict, &[key]).or_else(listed)?;
    // What does not fit is no place on a lane; the check drops it.
    Some(i32::try_from(index).unwrap_or(-1))
}

fn boundaries<'p>(
    layout: &Layout<'p>,
    feature: Value<'p>,
    keys: &[&str],
    numbers: &mut Numbering,
) -> Result<Vec<BoundarySegment>, ScenarioNetError> {
    let segments = layout.items(feature, keys);
    layout.spend(segments.len())?;
    let segment = |segment: &Value<'p>| {
        Some(BoundarySegment {
            lane_start_index: index(layout, *segment, "lane_start_index", ("index", 0))?,
            lane_end_index: index(layout, *segment, "lane_end_index", ("index", 1))?,
            feature: named(layout, *segment, &["boundary_feature_id", "id"], numbers)?,
            kind: form::boundary(layout, layout.find(*segment, &["boundary_type", "type"])),
        })
    };
    Ok(segments.iter().filter_map(segment).collect())
}

fn neighbors<'p>(
    layout: &Layout<'p>,
    feature: Value<'p>,
    keys: &[&str],
    numbers: &mut Numbering,
) -> Result<Vec<LaneNeighbor>, ScenarioNetError> {
    let listed = layout.items(feature, keys);
    layout.spend(listed.len())?;
    let mut neighbors = Vec::with_capacity(listed.len());
    for neighbor in listed {
        let at = |key, place| index(layout, *neighbor, key, ("indexes", place));
        let Some(lane) = named(layout, *neighbor, &["feature_id", "id"], numbers) else { continue };
        // Some name the lane alone: then all of it, and all of this one, is meant.
        neighbors.push(LaneNeighbor {
            lane,
            self_start_index: at("self_start_index", 0).unwrap_or(0),
            self_end_index: at("self_end_index", 1).unwrap_or(TO_ITS_END),
            neighbor_start_index: at("neighbor_start_index", 2).unwrap_or(0),
            neighbor_end_index: at("neighbor_end_index", 3).unwrap_or(TO_ITS_END),
            boundaries: boundaries(layout, *neighbor, &["boundaries"], numbers)?,
        });
    }
    Ok(neighbors)
}

/// Puts in the ends that were not said.
fn reach_the_ends(lanes: &mut [Lane]) {
    let ends: std::collections::BTreeMap<MapId, i32> =
        lanes.iter().map(|lane| (lane.id, lane.centerline.len() as i32 - 1)).collect();
    for lane in lanes {
        let own_end = lane.centerline.len() as i32 - 1;
        for neighbor in lane.left_neighbors.iter_mut().chain(&mut lane.right_neighbors) {
            if neighbor.self_end_index == TO_ITS_END {
                neighbor.self_end_index = own_end;
            }
            if neighbor.neighbor_end_index == TO_ITS_END {
                neighbor.neighbor_end_index = ends.get(&neighbor.lane).copied().unwrap_or(-1);
            }
        }
    }
}
