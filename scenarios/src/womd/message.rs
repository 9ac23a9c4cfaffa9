//! WOMD's messages as they lie in a file. Field numbers and types are those of the public definition; the comments are in
//! the `world` types that they become.
//!
//! Absent scalars are 0, as the data set means them. Repeated scalars are read packed and unpacked, and written as the
//! originals have them. Fields that no driver needs (lidar, camera tokens) are skipped unread.
#![allow(
    missing_docs,
    reason = "the fields are the data set's; world::scene, world::map and world::signal explain them"
)]

#[derive(Clone, PartialEq, prost::Message)]
pub struct Scenario {
    #[prost(double, repeated, packed = "false", tag = "1")]
    pub timestamps_seconds: Vec<f64>,
    #[prost(message, repeated, tag = "2")]
    pub tracks: Vec<Track>,
    #[prost(int32, repeated, packed = "false", tag = "4")]
    pub objects_of_interest: Vec<i32>,
    #[prost(string, tag = "5")]
    pub scenario_id: String,
    #[prost(int32, tag = "6")]
    pub sdc_track_index: i32,
    #[prost(message, repeated, tag = "7")]
    pub dynamic_map_states: Vec<DynamicMapState>,
    #[prost(message, repeated, tag = "8")]
    pub map_features: Vec<MapFeature>,
    #[prost(int32, tag = "10")]
    pub current_time_index: i32,
    #[prost(message, repeated, tag = "11")]
    pub tracks_to_predict: Vec<RequiredPrediction>,
}

#[derive(Clone, PartialEq, prost::Message)]
pub struct Track {
    #[prost(int32, tag = "1")]
    pub id: i32,
    #[prost(int32, tag = "2")]
    pub object_type: i32,
    #[prost(message, repeated, tag = "3")]
    pub states: Vec<ObjectState>,
}

#[derive(Clone, Copy, PartialEq, prost::Message)]
pub struct ObjectState {
    #[prost(double, tag = "2")]
    pub center_x: f64,
    #[prost(double, tag = "3")]
    pub center_y: f64,
    #[prost(double, tag = "4")]
    pub center_z: f64,
    #[prost(float, tag = "5")]
    pub length: f32,
    #[prost(float, tag = "6")]
    pub width: f32,
    #[prost(float, tag = "7")]
    pub height: f32,
    #[prost(float, tag = "8")]
    pub heading: f32,
    #[prost(float, tag = "9")]
    pub velocity_x: f32,
    #[prost(float, tag = "10")]
    pub velocity_y: f32,
    #[prost(bool, tag = "11")]
    pub valid: bool,
}

#[derive(Clone, PartialEq, prost::Message)]
pub struct DynamicMapState {
    #[prost(message, repeated, tag = "1")]
    pub lane_states: Vec<TrafficSignalLaneState>,
}

#[derive(Clone, Copy, PartialEq, prost::Message)]
pub struct TrafficSignalLaneState {
    #[prost(int64, tag = "1")]
    pub lane: i64,
    #[prost(int32, tag = "2")]
    pub state: i32,
    #[prost(message, optional, tag = "3")]
    pub stop_point: Option<MapPoint>,
}

#[derive(Clone, Copy, PartialEq, prost::Message)]
pub struct RequiredPrediction {
    #[prost(int32, tag = "1")]
    pub track_index: i32,
    #[prost(int32, tag = "2")]
    pub difficulty: i32,
}

#[derive(Clone, PartialEq, prost::Message)]
pub struct MapFeature {
    #[prost(int64, tag = "1")]
    pub id: i64,
    #[prost(oneof = "FeatureData", tags = "3, 4, 5, 7, 8, 9, 10")]
    pub feature_data: Option<FeatureData>,
}

#[derive(Clone, PartialEq, prost::Oneof)]
pub enum FeatureData {
    #[prost(message, tag = "3")]
    Lane(LaneCenter),
    #[prost(message, tag = "4")]
    RoadLine(Line),
    #[prost(message, tag = "5")]
    RoadEdge(Line),
    #[prost(message, tag = "7")]
    StopSign(StopSign),
    #[prost(message, tag = "8")]
    Crosswalk(Polygon),
    #[prost(message, tag = "9")]
    SpeedBump(Polygon),
    #[prost(message, tag = "10")]
    Driveway(Polygon),
}

#[derive(Clone, Copy, PartialEq, prost::Message)]
pub struct MapPoint {
    #[prost(double, tag = "1")]
    pub x: f64,
    #[prost(double, tag = "2")]
    pub y: f64,
    #[prost(double, tag = "3")]
    pub z: f64,
}

#[derive(Clone, PartialEq, prost::Message)]
pub struct LaneCenter {
    #[prost(double, tag = "1")]
    pub speed_limit_mph: f64,
    #[prost(int32, tag = "2")]
    pub r#type: i32,
    #[prost(bool, tag = "3")]
    pub interpolating: bool,
    #[prost(message, repeated, tag = "8")]
    pub polyline: Vec<MapPoint>,
    #[prost(int64, repeated, tag = "9")]
    pub entry_lanes: Vec<i64>,
    #[prost(int64, repeated, tag = "10")]
    pub exit_lanes: Vec<i64>,
    #[prost(message, repeated, tag = "11")]
    pub left_neighbors: Vec<LaneNeighbor>,
    #[prost(message, repeated, tag = "12")]
    pub right_neighbors: Vec<LaneNeighbor>,
    #[prost(message, repeated, tag = "13")]
    pub left_boundaries: Vec<BoundarySegment>,
    #[prost(message, repeated, tag = "14")]
    pub right_boundaries: Vec<BoundarySegment>,
}

#[derive(Clone, PartialEq, prost::Message)]
pub struct LaneNeighbor {
    #[prost(int64, tag = "1")]
    pub feature_id: i64,
    #[prost(int32, tag = "2")]
    pub self_start_index: i32,
    #[prost(int32, tag = "3")]
    pub self_end_index: i32,
    #[prost(int32, tag = "4")]
    pub neighbor_start_index: i32,
    #[prost(int32, tag = "5")]
    pub neighbor_end_index: i32,
    #[prost(message, repeated, tag = "6")]
    pub boundaries: Vec<BoundarySegment>,
}

#[derive(Clone, Copy, PartialEq, prost::Message)]
pub struct BoundarySegment {
    #[prost(int32, tag = "1")]
    pub lane_start_index: i32,
    #[prost(int32, tag = "2")]
    pub lane_end_index: i32,
    #[prost(int64, tag = "3")]
    pub boundary_feature_id: i64,
    #[prost(int32, tag = "4")]
    pub boundary_type: i32,
}

/// Both `RoadLine` and `RoadEdge`: they differ in what the type means.
#[derive(Clone, PartialEq, prost::Message)]
pub struct Line {
    #[prost(int32, tag = "1")]
    pub r#type: i32,
    #[prost(message, repeated, tag = "2")]
    pub polyline: Vec<MapPoint>,
}

#[derive(Clone, PartialEq, prost::Message)]
pub struct StopSign {
    #[prost(int64, repeated, packed = "false", tag = "1")]
    pub lane: Vec<i64>,
    #[prost(message, optional, tag = "2")]
    pub position: Option<MapPoint>,
}

/// `Crosswalk`, `SpeedBump` and `Driveway`.
#[derive(Clone, PartialEq, prost::Message)]
pub struct Polygon {
    #[prost(message, repeated, tag = "1")]
    pub polygon: Vec<MapPoint>,
}
