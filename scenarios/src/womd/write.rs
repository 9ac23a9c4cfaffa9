//! From a scene to a record's payload.
//!
//! Reading what was written gives the same scene, as far as the format goes: sizes, headings and velocities are 32 bit.

use prost::Message;
use world::geometry::Point3;
use world::map::{Area, BoundarySegment, Lane, LaneNeighbor, Map, MapId};
use world::scene::{AgentState, Scene, Track};
use world::signal::Signal;

use super::kinds::Numbered;
use super::message::{self, FeatureData, Scenario};

/// `scene` as a record's payload. [`crate::tfrecord::append_record`] makes a file of it.
#[must_use]
pub fn write(scene: &Scene) -> Vec<u8> {
    message(scene).encode_to_vec()
}

/// `scene` as WOMD's message.
#[must_use]
pub fn message(scene: &Scene) -> Scenario {
    Scenario {
        timestamps_seconds: scene.timestamps().to_vec(),
        tracks: (0..scene.tracks().len()).map(|index| track(scene, index)).collect(),
        objects_of_interest: scene.objects_of_interest().iter().map(|id| id.0).collect(),
        scenario_id: scene.id().to_string(),
        sdc_track_index: number(scene.av_index()),
        dynamic_map_states: (0..scene.steps()).map(|step| signals(scene.signals(step))).collect(),
        map_features: features(scene.map()),
        current_time_index: number(scene.current_time_index()),
        tracks_to_predict: scene
            .tracks_to_predict()
            .iter()
            .map(|task| message::RequiredPrediction {
                track_index: number(task.track_index),
                difficulty: task.difficulty,
            })
            .collect(),
    }
}

fn track(scene: &Scene, index: usize) -> message::Track {
    let Track { id, kind, .. } = scene.tracks()[index];
    let state = |step| scene.logged(index, step).map(object_state).unwrap_or_default();
    message::Track { id: id.0, object_type: kind.number(), states: (0..scene.steps()).map(state).collect() }
}

#[allow(clippy::cast_possible_truncation, reason = "the format's sizes, headings and velocities are 32 bit")]
fn object_state(state: &AgentState) -> message::ObjectState {
    message::ObjectState {
        center_x: state.x,
        center_y: state.y,
        center_z: state.z,
        length: state.length as f32,
        width: state.width as f32,
        height: state.height as f32,
        heading: state.heading as f32,
        velocity_x: state.velocity_x as f32,
        velocity_y: state.velocity_y as f32,
        valid: true,
    }
}

fn signals(signals: &[Signal]) -> message::DynamicMapState {
    let signal = |signal: &Signal| message::TrafficSignalLaneState {
        lane: signal.lane.0,
        state: signal.state.number(),
        stop_point: Some(point(&signal.stop_point)),
    };
    message::DynamicMapState { lane_states: signals.iter().map(signal).collect() }
}

fn features(map: &Map) -> Vec<message::MapFeature> {
    let feature = |id: MapId, data| message::MapFeature { id: id.0, feature_data: Some(data) };
    let line = |kind, polyline: &[Point3]| message::Line { r#type: kind, polyline: points(polyline) };
    let polygon = |area: &Area| message::Polygon { polygon: points(&area.polygon) };
    let lanes = map.lanes.iter().map(|lane| feature(lane.id, FeatureData::Lane(lane_center(lane))));
    let lines = map.road_lines.iter().map(|l| feature(l.id, FeatureData::RoadLine(line(l.kind.number(), &l.polyline))));
    let edges = map.road_edges.iter().map(|e| feature(e.id, FeatureData::RoadEdge(line(e.kind.number(), &e.polyline))));
    let signs = map.stop_signs.iter().map(|sign| {
        let (lane, position) = (ids(&sign.lanes), Some(point(&sign.position)));
        feature(sign.id, FeatureData::StopSign(message::StopSign { lane, position }))
    });
    let crosswalks = map.crosswalks.iter().map(|a| feature(a.id, FeatureData::Crosswalk(polygon(a))));
    let bumps = map.speed_bumps.iter().map(|a| feature(a.id, FeatureData::SpeedBump(polygon(a))));
    let driveways = map.driveways.iter().map(|a| feature(a.id, FeatureData::Driveway(polygon(a))));
    lanes.chain(lines).chain(edges).chain(signs).chain(crosswalks).chain(bumps).chain(driveways).collect()
}

fn lane_center(lane: &Lane) -> message::LaneCenter {
    message::LaneCenter {
        speed_limit_mph: lane.speed_limit_mph,
        r#type: lane.kind.number(),
        interpolating: lane.interpolating,
        polyline: points(&lane.centerline),
        entry_lanes: ids(&lane.entries),
        exit_lanes: ids(&lane.exits),
        left_neighbors: lane.left_neighbors.iter().map(neighbor).collect(),
        right_neighbors: lane.right_neighbors.iter().map(neighbor).collect(),
        left_boundaries: boundaries(&lane.left_boundaries),
        right_boundaries: boundaries(&lane.right_boundaries),
    }
}

fn neighbor(neighbor: &LaneNeighbor) -> message::LaneNeighbor {
    message::LaneNeighbor {
        feature_id: neighbor.lane.0,
        self_start_index: neighbor.self_start_index,
        self_end_index: neighbor.self_end_index,
        neighbor_start_index: neighbor.neighbor_start_index,
        neighbor_end_index: neighbor.neighbor_end_index,
        boundaries: boundaries(&neighbor.boundaries),
    }
}

fn boundaries(segments: &[BoundarySegment]) -> Vec<message::BoundarySegment> {
    let segment = |segment: &BoundarySegment| message::BoundarySegment {
        lane_start_index: segment.lane_start_index,
        lane_end_index: segment.lane_end_index,
        boundary_feature_id: segment.feature.0,
        boundary_type: segment.kind.number(),
    };
    segments.iter().map(segment).collect()
}

fn points(points: &[Point3]) -> Vec<message::MapPoint> {
    points.iter().map(point).collect()
}

fn point(point: &Point3) -> message::MapPoint {
    message::MapPoint { x: point.x, y: point.y, z: point.z }
}

fn ids(ids: &[MapId]) -> Vec<i64> {
    ids.iter().map(|id| id.0).collect()
}

/// A place in a list as the format's 32 bits; a list of two thousand million tracks fits no record.
fn number(index: usize) -> i32 {
    i32::try_from(index).unwrap_or(i32::MAX)
}
