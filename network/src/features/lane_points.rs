//! The lanes of a map, prepared once a scene: every point with its boundaries (`network.md` 3.6).

use std::collections::BTreeMap;

use world::geometry::{Point, Point3, Pose, wrap_angle};
use world::map::{BoundarySegment, LaneKind, Map, MapId, RoadLineKind};
use world::signal::{Signal, SignalState};

use super::av_frame::{AvFrame, unless_missing};
use super::settings::Settings;
use crate::constants::LANE_ROW;

/// Miles an hour in a metre a second, as the authors have it.
const MPH: f64 = 2.237;
/// A point this near to a signal's stop point is one (m).
const STOP_RADIUS: f64 = 1.0;
/// The largest code of a boundary that the network has a row for.
const LARGEST_BOUNDARY: u8 = 10;

/// A lane.
#[derive(Clone, Debug)]
pub(super) struct PreparedLane {
    pub points: Vec<LanePoint>,
    pub exits: Vec<usize>,
    pub entries: Vec<usize>,
    /// Left ones, then right ones, in the map's order: lane, first and last index on this lane.
    pub neighbors: [Vec<(usize, usize, usize)>; 2],
    speed_limit: f32,
    kind: f32,
    interpolating: bool,
    has_stop_sign: bool,
}

/// A point of a lane.
#[derive(Clone, Copy, Debug)]
pub(super) struct LanePoint {
    pub pose: Pose,
    /// Left and right: the boundary's nearest vertex, its direction there, its code.
    boundaries: [Option<(Pose, u8)>; 2],
}

/// What a lane is shown at a step.
#[derive(Clone, Copy, Debug)]
pub(super) struct Light {
    state: u8,
    stop: Point,
}

/// Every lane of `map`.
pub(super) fn prepare(map: &Map, indices: &BTreeMap<MapId, usize>) -> Vec<PreparedLane> {
    let lines = map.road_lines.iter().map(|line| (line.id, (poses(&line.polyline), line_code(line.kind))));
    let edges = map.road_edges.iter().map(|edge| (edge.id, (poses(&edge.polyline), edge.kind as u8)));
    let bounds: BTreeMap<MapId, (Vec<Pose>, u8)> = lines.chain(edges).collect();
    let known = |ids: &[MapId]| ids.iter().filter_map(|id| indices.get(id).copied()).collect();
    let signed = map.stop_signs.iter().flat_map(|sign| &sign.lanes).collect::<std::collections::BTreeSet<_>>();
    let lane = |lane: &world::map::Lane| {
        let mut points: Vec<LanePoint> =
            poses(&lane.centerline).into_iter().map(|pose| LanePoint { pose, boundaries: [None; 2] }).collect();
        for (side, segments) in [&lane.left_boundaries, &lane.right_boundaries].into_iter().enumerate() {
            segments.iter().for_each(|segment| bound(&mut points, side, segment, &bounds));
        }
        let beside = |neighbors: &[world::map::LaneNeighbor]| {
            let index = |index: i32| usize::try_from(index).unwrap_or(0);
            let neighbor = |neighbor: &world::map::LaneNeighbor| {
                let lane = *indices.get(&neighbor.lane)?;
                Some((lane, index(neighbor.self_start_index), index(neighbor.self_end_index)))
            };
            neighbors.iter().filter_map(neighbor).collect()
        };
        PreparedLane {
            points,
            exits: known(&lane.exits),
            entries: known(&lane.entries),
            neighbors: [beside(&lane.left_neighbors), beside(&lane.right_neighbors)],
            speed_limit: (lane.speed_limit_mph / MPH) as f32,
            kind: match lane.kind {
                LaneKind::Undefined => 0.0,
                LaneKind::Freeway => 1.0,
                LaneKind::SurfaceStreet => 2.0,
                LaneKind::BikeLane => 3.0,
            },
            interpolating: lane.interpolating,
            has_stop_sign: signed.contains(&lane.id),
        }
    };
    map.lanes.iter().map(lane).collect()
}

/// Of several segments at a point the last one counts.
fn bound(points: &mut [LanePoint], side: usize, segment: &BoundarySegment, bounds: &BTreeMap<MapId, (Vec<Pose>, u8)>) {
    let Some((polyline, kind)) = bounds.get(&segment.feature) else { return };
    let index = |index: i32| usize::try_from(index).unwrap_or(0);
    let (first, last) = (index(segment.lane_start_index), index(segment.lane_end_index));
    let code = match line_code(segment.kind) {
        // An edge of the road. A line whose segment does not say which has no code of its own.
        0 => (8 + kind).min(LARGEST_BOUNDARY),
        code => code,
    };
    for point in points.iter_mut().take(last.saturating_add(1)).skip(first) {
        let place = point.pose.position();
        let mut best: Option<(f64, Pose)> = None;
        for vertex in polyline {
            let distance = vertex.position().distance(place);
            if best.is_none_or(|(least, _)| distance < least) {
                best = Some((distance, *vertex));
            }
        }
        point.boundaries[side] = best.map(|(_, vertex)| (vertex, code));
    }
}

/// Each point with the direction to the next; the last one's is that of the one before, a single one's 0.
pub(super) fn poses(points: &[Point3]) -> Vec<Pose> {
    let heading = |index: usize| {
        let index = index.min(points.len().saturating_sub(2));
        points.get(index + 1).map_or(0.0, |next| wrap_angle((next.xy() - points[index].xy()).heading()))
    };
    points.iter().enumerate().map(|(index, point)| Pose::new(point.x, point.y, heading(index))).collect()
}

fn line_code(kind: RoadLineKind) -> u8 {
    match kind {
        RoadLineKind::Unknown => 0,
        RoadLineKind::BrokenSingleWhite => 1,
        RoadLineKind::SolidSingleWhite => 2,
        RoadLineKind::SolidDoubleWhite => 3,
        RoadLineKind::BrokenSingleYellow => 4,
        RoadLineKind::BrokenDoubleYellow => 5,
        RoadLineKind::SolidSingleYellow => 6,
        RoadLineKind::SolidDoubleYellow => 7,
        RoadLineKind::PassingDoubleYellow => 8,
    }
}

fn light_code(state: SignalState) -> u8 {
    match state {
        SignalState::Unknown => 0,
        SignalState::ArrowStop => 1,
        SignalState::ArrowCaution => 2,
        SignalState::ArrowGo => 3,
        SignalState::Stop => 4,
        SignalState::Caution => 5,
        SignalState::Go => 6,
        SignalState::FlashingStop => 7,
        SignalState::FlashingCaution => 8,
    }
}

/// What each lane is shown. The authors show it to all that lead into the signal's lane as well; the last signal wins.
pub(super) fn lights(
    signals: &[Signal],
    lanes: &[PreparedLane],
    indices: &BTreeMap<MapId, usize>,
    settings: Settings,
) -> BTreeMap<usize, Light> {
    let mut lights = BTreeMap::new();
    for signal in signals {
        let Some(lane) = indices.get(&signal.lane) else { continue };
        let light = Light { state: light_code(signal.state), stop: signal.stop_point.xy() };
        lights.insert(*lane, light);
        if settings == Settings::Authors {
            lights.extend(lanes[*lane].entries.iter().map(|entry| (*entry, light)));
        }
    }
    lights
}

impl PreparedLane {
    /// The row of a point; `is_normed` as for the whole sequence, see [`AvFrame`].
    pub fn row(&self, point: usize, light: Option<&Light>, frame: &AvFrame, is_normed: bool) -> [f32; LANE_ROW] {
        let LanePoint { pose, boundaries } = &self.points[point];
        let mut row = [0.0; LANE_ROW];
        let place = |pose: &Pose, row: &mut [f32]| {
            if is_normed {
                row[..2].copy_from_slice(&frame.place(pose.position()));
                row[2] = frame.heading(pose.heading);
            } else {
                row.copy_from_slice(&[pose.x as f32, pose.y as f32, pose.heading as f32]);
            }
        };
        place(pose, &mut row[..3]);
        for (side, boundary) in boundaries.iter().enumerate() {
            if let Some((vertex, code)) = boundary {
                let own = &mut row[3 + 3 * side..6 + 3 * side];
                place(vertex, own);
                if frame.settings == Settings::Authors {
                    own[2] = unless_missing(vertex.heading as f32, own[2]);
                }
                row[11 + side] = f32::from(*code);
            }
        }
        row[9] = self.speed_limit;
        row[10] = self.kind;
        if let Some(light) = light {
            row[13] = f32::from(light.state);
            row[14] = f32::from(u8::from(pose.position().distance(light.stop) < STOP_RADIUS));
        }
        row[15] = f32::from(u8::from(self.interpolating));
        row[16] = f32::from(u8::from(self.has_stop_sign));
        row
    }
}
