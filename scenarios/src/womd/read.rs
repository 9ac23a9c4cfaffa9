//! From a record's payload to a checked scene.

use prost::Message;
use world::geometry::Point3;
use world::map::{Area, BoundarySegment, Lane, LaneNeighbor, Map, MapId, RoadEdge, RoadLine, StopSign};
use world::scene::{AgentState, Finding, Scene, SceneError, SceneId, SceneParts, Track, TrackId, TrackToPredict};
use world::signal::Signal;

use super::WomdError;
use super::kinds::Numbered;
use super::message::{self, FeatureData, Scenario};
use crate::tf_example;
use crate::wire::{self, Field};

/// The scene in `payload`, of either format, and what was found odd in it and mended.
///
/// # Errors
/// [`WomdError`], by preference the one that says what else the payload is.
pub fn read(payload: &[u8]) -> Result<(Scene, Vec<Finding>), WomdError> {
    if tf_example::looks_like_example(payload) {
        return Ok(tf_example::read(payload)?);
    }
    let read = || -> Result<_, WomdError> {
        let scenario = Scenario::decode(payload).map_err(|error| WomdError::Protobuf(error.to_string()))?;
        scene(scenario)
    };
    read().map_err(|error| super::diagnose(payload).unwrap_or(error))
}

/// Numbers of a Scenario's fields.
pub(super) const TIMES: u64 = 1;
pub(super) const TRACKS: u64 = 2;
pub(super) const ID: u64 = 5;
const LASER_DATA: u64 = 12;
const CAMERA_TOKENS: u64 = 13;

/// The id of the scene in `payload`; the rest is stepped over, not decoded.
///
/// # Errors
/// [`WomdError`] as of [`read`].
pub fn scene_id(payload: &[u8]) -> Result<SceneId, WomdError> {
    if tf_example::looks_like_example(payload) {
        return Ok(tf_example::scene_id(payload)?);
    }
    let find = || -> Result<_, WomdError> {
        let (mut ids, mut laser, mut scene) = ([None; 2], false, false);
        for field in wire::fields(payload) {
            let (number, field) = field.map_err(|error| WomdError::Protobuf(error.to_string()))?;
            match (number, field) {
                (ID, Field::Bytes(bytes)) => ids = [ids[0].or(Some(bytes)), Some(bytes)],
                (TIMES | TRACKS, _) => scene = true,
                (LASER_DATA | CAMERA_TOKENS, _) => laser = true,
                _ => {}
            }
        }
        let [first, last] = ids.map(|id| String::from_utf8_lossy(id.unwrap_or_default()).into_owned());
        if first != last {
            return Err(WomdError::TwoIds { first, last });
        }
        let id = SceneId::new(last)?;
        if laser && !scene { Err(WomdError::LaserOnly { id }) } else { Ok(id) }
    };
    find().map_err(|error| super::diagnose(payload).unwrap_or(error))
}

fn scene(scenario: Scenario) -> Result<(Scene, Vec<Finding>), WomdError> {
    let mut findings = Vec::new();
    let Ok(av_index) = usize::try_from(scenario.sdc_track_index) else {
        let (index, tracks) = (i64::from(scenario.sdc_track_index), scenario.tracks.len());
        return Err(SceneError::AvIndex { index, tracks }.into());
    };
    let current_time_index = usize::try_from(scenario.current_time_index).unwrap_or_else(|_| {
        findings.push(Finding::CurrentTimeIndex { index: i64::from(scenario.current_time_index) });
        0
    });
    let mut tracks_to_predict = Vec::with_capacity(scenario.tracks_to_predict.len());
    for task in scenario.tracks_to_predict {
        match usize::try_from(task.track_index) {
            Ok(track_index) => tracks_to_predict.push(TrackToPredict { track_index, difficulty: task.difficulty }),
            Err(_) => findings.push(Finding::UnknownTrackToPredict { index: i64::from(task.track_index) }),
        }
    }
    let parts = SceneParts {
        id: scenario.scenario_id,
        timestamps: scenario.timestamps_seconds,
        tracks: scenario.tracks.into_iter().map(track).collect(),
        av_index,
        signals: scenario.dynamic_map_states.iter().map(signals).collect(),
        map: map(scenario.map_features),
        current_time_index,
        objects_of_interest: scenario.objects_of_interest.into_iter().map(TrackId).collect(),
        tracks_to_predict,
    };
    let (scene, found) = parts.check()?;
    findings.extend(found);
    Ok((scene, findings))
}

fn track(track: message::Track) -> Track {
    Track {
        id: TrackId(track.id),
        kind: Numbered::from_number(track.object_type),
        states: track.states.iter().map(|state| state.valid.then(|| agent_state(state))).collect(),
    }
}

fn agent_state(state: &message::ObjectState) -> AgentState {
    AgentState {
        x: state.center_x,
        y: state.center_y,
        z: state.center_z,
        heading: f64::from(state.heading),
        velocity_x: f64::from(state.velocity_x),
        velocity_y: f64::from(state.velocity_y),
        length: f64::from(state.length),
        width: f64::from(state.width),
        height: f64::from(state.height),
    }
}

fn signals(state: &message::DynamicMapState) -> Vec<Signal> {
    let signal = |signal: &message::TrafficSignalLaneState| Signal {
        lane: MapId(signal.lane),
        state: Numbered::from_number(signal.state),
        stop_point: point(&signal.stop_point.unwrap_or_default()),
    };
    state.lane_states.iter().map(signal).collect()
}

fn map(features: Vec<message::MapFeature>) -> Map {
    let mut map = Map::default();
    for feature in features {
        let id = MapId(feature.id);
        match feature.feature_data {
            Some(FeatureData::Lane(center)) => map.lanes.push(lane(id, center)),
            Some(FeatureData::RoadLine(line)) => map.road_lines.push(RoadLine {
                id,
                kind: Numbered::from_number(line.r#type),
                polyline: points(&line.polyline),
            }),
            Some(FeatureData::RoadEdge(line)) => map.road_edges.push(RoadEdge {
                id,
                kind: Numbered::from_number(line.r#type),
                polyline: points(&line.polyline),
            }),
            Some(FeatureData::StopSign(sign)) => map.stop_signs.push(StopSign {
                id,
                lanes: ids(sign.lane),
                position: point(&sign.position.unwrap_or_default()),
            }),
            Some(FeatureData::Crosswalk(area)) => map.crosswalks.push(polygon(id, &area)),
            Some(FeatureData::SpeedBump(area)) => map.speed_bumps.push(polygon(id, &area)),
            Some(FeatureData::Driveway(area)) => map.driveways.push(polygon(id, &area)),
            None => {} // a kind that is not known to us
        }
    }
    map
}

fn lane(id: MapId, lane: message::LaneCenter) -> Lane {
    Lane {
        id,
        kind: Numbered::from_number(lane.r#type),
        speed_limit_mph: lane.speed_limit_mph,
        interpolating: lane.interpolating,
        centerline: points(&lane.polyline),
        entries: ids(lane.entry_lanes),
        exits: ids(lane.exit_lanes),
        left_neighbors: lane.left_neighbors.iter().map(neighbor).collect(),
        right_neighbors: lane.right_neighbors.iter().map(neighbor).collect(),
        left_boundaries: boundaries(&lane.left_boundaries),
        right_boundaries: boundaries(&lane.right_boundaries),
    }
}

fn neighbor(neighbor: &message::LaneNeighbor) -> LaneNeighbor {
    LaneNeighbor {
        lane: MapId(neighbor.feature_id),
        self_start_index: neighbor.self_start_index,
        self_end_index: neighbor.self_end_index,
        neighbor_start_index: neighbor.neighbor_start_index,
        neighbor_end_index: neighbor.neighbor_end_index,
        boundaries: boundaries(&neighbor.boundaries),
    }
}

fn boundaries(segments: &[message::BoundarySegment]) -> Vec<BoundarySegment> {
    let segment = |segment: &message::BoundarySegment| BoundarySegment {
        lane_start_index: segment.lane_start_index,
        lane_end_index: segment.lane_end_index,
        feature: MapId(segment.boundary_feature_id),
        kind: Numbered::from_number(segment.boundary_type),
    };
    segments.iter().map(segment).collect()
}

fn polygon(id: MapId, area: &message::Polygon) -> Area {
    Area { id, polygon: points(&area.polygon) }
}

fn points(points: &[message::MapPoint]) -> Vec<Point3> {
    points.iter().map(point).collect()
}

fn point(point: &message::MapPoint) -> Point3 {
    Point3::new(point.x, point.y, point.z)
}

fn ids(ids: Vec<i64>) -> Vec<MapId> {
    ids.into_iter().map(MapId).collect()
}
