//! Writing and reading is the identity.

use proptest::collection::vec;
use proptest::prelude::*;
use scenarios::womd::{read, write};
use world::geometry::Point3;
use world::map::*;
use world::scene::*;
use world::signal::{Signal, SignalState};

const STEPS: usize = 4;

fn number() -> impl Strategy<Value = f64> {
    prop_oneof![Just(0.0), -1e4..1e4]
}

/// The format keeps sizes, headings and velocities in 32 bit.
fn short() -> impl Strategy<Value = f64> {
    number().prop_map(|v| f64::from(v as f32))
}

fn point() -> impl Strategy<Value = Point3> {
    (number(), number(), number()).prop_map(|(x, y, z)| Point3::new(x, y, z))
}

fn state() -> impl Strategy<Value = Option<AgentState>> {
    let size = || (0.0_f32..100.0).prop_map(f64::from);
    let state = (point(), (short(), short(), short()), (size(), size(), size()));
    proptest::option::of(state.prop_map(|(at, (heading, velocity_x, velocity_y), (length, width, height))| {
        AgentState { x: at.x, y: at.y, z: at.z, heading, velocity_x, velocity_y, length, width, height }
    }))
}

fn tracks() -> impl Strategy<Value = Vec<Track>> {
    let kinds = [AgentKind::Vehicle, AgentKind::Pedestrian, AgentKind::Cyclist, AgentKind::Other];
    let track = (proptest::sample::select(kinds.to_vec()), vec(state(), STEPS));
    vec(track, 1..4).prop_map(|tracks| {
        let track = |(index, (kind, states))| Track { id: TrackId(3 * index as i32), kind, states };
        tracks.into_iter().enumerate().map(track).collect()
    })
}

/// Ids and links from a small range, so that some dangle, and some features have one id.
fn id() -> impl Strategy<Value = MapId> {
    (-2_i64..12).prop_map(MapId)
}

fn boundaries() -> impl Strategy<Value = Vec<BoundarySegment>> {
    let segment = (0..3, -1..4, id()).prop_map(|(lane_start_index, lane_end_index, feature)| BoundarySegment {
        lane_start_index,
        lane_end_index,
        feature,
        kind: RoadLineKind::BrokenSingleWhite,
    });
    vec(segment, 0..3)
}

fn neighbors() -> impl Strategy<Value = Vec<LaneNeighbor>> {
    let neighbor = (id(), 0..3, 0..3, boundaries()).prop_map(|(lane, own, other, boundaries)| LaneNeighbor {
        lane,
        self_start_index: 0,
        self_end_index: own,
        neighbor_start_index: 0,
        neighbor_end_index: other,
        boundaries,
    });
    vec(neighbor, 0..2)
}

fn lane() -> impl Strategy<Value = Lane> {
    let kinds = [LaneKind::Undefined, LaneKind::Freeway, LaneKind::SurfaceStreet, LaneKind::BikeLane];
    let links = (vec(id(), 0..3), vec(id(), 0..3));
    let sides = (neighbors(), neighbors(), boundaries(), boundaries());
    (id(), proptest::sample::select(kinds.to_vec()), -5.0..220.0, any::<bool>(), vec(point(), 0..4), links, sides)
        .prop_map(|(id, kind, speed_limit_mph, interpolating, centerline, (entries, exits), sides)| Lane {
            id,
            kind,
            speed_limit_mph,
            interpolating,
            centerline,
            entries,
            exits,
            left_neighbors: sides.0,
            right_neighbors: sides.1,
            left_boundaries: sides.2,
            right_boundaries: sides.3,
        })
}

fn map() -> impl Strategy<Value = Map> {
    let polyline = || vec(point(), 1..4);
    let areas = || vec((id(), polyline()).prop_map(|(id, polygon)| Area { id, polygon }), 0..2);
    let lines = vec(
        (id(), polyline()).prop_map(|(id, polyline)| RoadLine { id, kind: RoadLineKind::SolidDoubleYellow, polyline }),
        0..3,
    );
    let edges =
        vec((id(), polyline()).prop_map(|(id, polyline)| RoadEdge { id, kind: RoadEdgeKind::Median, polyline }), 0..3);
    let signs =
        vec((id(), vec(id(), 0..3), point()).prop_map(|(id, lanes, position)| StopSign { id, lanes, position }), 0..2);
    (vec(lane(), 0..5), lines, edges, signs, areas(), areas(), areas()).prop_map(
        |(lanes, road_lines, road_edges, stop_signs, crosswalks, speed_bumps, driveways)| Map {
            lanes,
            road_lines,
            road_edges,
            stop_signs,
            crosswalks,
            speed_bumps,
            driveways,
        },
    )
}

fn signals() -> impl Strategy<Value = Vec<Vec<Signal>>> {
    let states = [SignalState::Unknown, SignalState::ArrowStop, SignalState::Go, SignalState::FlashingCaution];
    let signal = (id(), proptest::sample::select(states.to_vec()), point());
    vec(vec(signal.prop_map(|(lane, state, stop_point)| Signal { lane, state, stop_point }), 0..3), STEPS)
}

fn parts() -> impl Strategy<Value = SceneParts> {
    let tasks =
        vec((0_usize..5, 0..3).prop_map(|(track_index, difficulty)| TrackToPredict { track_index, difficulty }), 0..3);
    ("[a-z0-9]{1,20}", tracks(), signals(), map(), 0..2 * STEPS, vec((0..12).prop_map(TrackId), 0..3), tasks).prop_map(
        |(id, tracks, signals, map, current_time_index, objects_of_interest, tracks_to_predict)| SceneParts {
            id,
            timestamps: (0..STEPS).map(|step| step as f64 * 0.1).collect(),
            av_index: tracks.len() - 1,
            tracks,
            signals,
            map,
            current_time_index,
            objects_of_interest,
            tracks_to_predict,
        },
    )
}

proptest! {
    #[test]
    fn a_scene_survives_being_written_and_read(parts in parts()) {
        let Ok((scene, _)) = parts.check() else { return Ok(()) }; // the AV is valid nowhere
        let bytes = write(&scene);
        let (again, _) = read(&bytes).unwrap();
        prop_assert_eq!(&again, &scene);
        prop_assert_eq!(write(&again), bytes);
        prop_assert_eq!(scenarios::womd::scene_id(&write(&again)).unwrap(), scene.id().clone());
    }
}
