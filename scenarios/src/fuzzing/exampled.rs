//! Scenes in WOMD's other format, TensorFlow's `Example`, written for tests and as seeds of fuzzing.

use prost::Message;
use world::map::{LaneKind, MapId};
use world::scene::{AgentKind, AgentState, Scene};

use crate::womd::kinds::Numbered;

#[derive(Clone, PartialEq, Message)]
struct Example {
    #[prost(message, optional, tag = "1")]
    features: Option<List>,
}

#[derive(Clone, PartialEq, Message)]
struct List {
    #[prost(message, repeated, tag = "1")]
    entries: Vec<Named>,
}

#[derive(Clone, PartialEq, Message)]
struct Named {
    #[prost(string, tag = "1")]
    name: String,
    #[prost(message, optional, tag = "2")]
    feature: Option<Feature>,
}

#[derive(Clone, PartialEq, Message)]
struct Feature {
    #[prost(message, optional, tag = "1")]
    bytes: Option<Bytes>,
    #[prost(message, optional, tag = "2")]
    floats: Option<Floats>,
    #[prost(message, optional, tag = "3")]
    ints: Option<Ints>,
}

#[derive(Clone, PartialEq, Message)]
struct Bytes {
    #[prost(bytes = "vec", repeated, tag = "1")]
    value: Vec<Vec<u8>>,
}

#[derive(Clone, PartialEq, Message)]
struct Floats {
    #[prost(float, repeated, tag = "1")]
    value: Vec<f32>,
}

#[derive(Clone, PartialEq, Message)]
struct Ints {
    #[prost(int64, repeated, tag = "1")]
    value: Vec<i64>,
}

/// How much a record has room for.
#[derive(Clone, Copy, Debug)]
pub struct Room {
    /// Road users.
    pub agents: usize,
    /// Points of the map.
    pub points: usize,
    /// Signals at a step.
    pub signals: usize,
    /// Steps before the current one.
    pub past: usize,
}

/// The data set's own.
pub const USUAL: Room = Room { agents: 128, points: 20_000, signals: 16, past: 10 };

/// Features that are being written.
#[derive(Default)]
struct Features(Vec<Named>);

impl Features {
    fn put(&mut self, name: impl ToString, feature: Feature) {
        self.0.push(Named { name: name.to_string(), feature: Some(feature) });
    }

    fn floats(&mut self, name: impl ToString, value: Vec<f32>) {
        self.put(name, Feature { floats: Some(Floats { value }), ..Feature::default() });
    }

    fn ints(&mut self, name: impl ToString, value: Vec<i64>) {
        self.put(name, Feature { ints: Some(Ints { value }), ..Feature::default() });
    }
}

/// The payload of a record of `scene`: as much of it as there is room for, the AV first, the rest in its order.
#[must_use]
pub fn payload(scene: &Scene, room: Room) -> Vec<u8> {
    let mut features = Features::default();
    let id = Bytes { value: vec![scene.id().to_string().into_bytes()] };
    features.put(crate::tf_example::ID, Feature { bytes: Some(id), ..Feature::default() });
    let others = (0..scene.tracks().len()).filter(|track| *track != scene.av_index());
    let tracks: Vec<usize> = std::iter::once(scene.av_index()).chain(others).take(room.agents).collect();
    let steps = [0..room.past, room.past..room.past + 1, room.past + 1..scene.steps()];
    for (part, steps) in ["past", "current", "future"].into_iter().zip(steps) {
        states(&mut features, scene, part, steps.clone(), &tracks, room);
        signals(&mut features, scene, part, steps, room);
    }
    of_tracks(&mut features, scene, &tracks, room);
    roadgraph(&mut features, scene, room);
    Example { features: Some(List { entries: features.0 }) }.encode_to_vec()
}

fn states(
    features: &mut Features,
    scene: &Scene,
    part: &str,
    steps: std::ops::Range<usize>,
    tracks: &[usize],
    room: Room,
) {
    let at = |slot: usize, step: usize| tracks.get(slot).and_then(|track| scene.tracks()[*track].states[step]);
    let all = || (0..room.agents).flat_map(|slot| steps.clone().map(move |step| (slot, step)));
    type Column = (&'static str, fn(&AgentState) -> f64);
    let columns: [Column; 9] = [
        ("x", |state| state.x),
        ("y", |state| state.y),
        ("z", |state| state.z),
        ("bbox_yaw", |state| state.heading),
        ("velocity_x", |state| state.velocity_x),
        ("velocity_y", |state| state.velocity_y),
        ("length", |state| state.length),
        ("width", |state| state.width),
        ("height", |state| state.height),
    ];
    for (name, of) in columns {
        let value = |(slot, step)| at(slot, step).map_or(-1.0, |state| of(&state) as f32);
        features.floats(format!("state/{part}/{name}"), all().map(value).collect());
    }
    let valid = all().map(|(slot, step)| i64::from(at(slot, step).is_some()));
    features.ints(format!("state/{part}/valid"), valid.collect());
    let micros = |(slot, step): (usize, usize)| match at(slot, step) {
        Some(_) => (scene.timestamps()[step] * 1e6).round() as i64,
        None => -1,
    };
    features.ints(format!("state/{part}/timestamp_micros"), all().map(micros).collect());
}

fn signals(features: &mut Features, scene: &Scene, part: &str, steps: std::ops::Range<usize>, room: Room) {
    let all: Vec<_> =
        steps.flat_map(|step| (0..room.signals).map(move |light| scene.signals(step).get(light))).collect();
    let name = |column: &str| format!("traffic_light_state/{part}/{column}");
    let ints = |of: fn(&world::signal::Signal) -> i64| all.iter().map(|signal| signal.map_or(-1, of)).collect();
    features.ints(name("id"), ints(|signal| signal.lane.0));
    features.ints(name("state"), ints(|signal| i64::from(signal.state.number())));
    features.ints(name("valid"), all.iter().map(|signal| i64::from(signal.is_some())).collect());
    let floats =
        |of: fn(&world::signal::Signal) -> f64| all.iter().map(|signal| signal.map_or(-1.0, of) as f32).collect();
    features.floats(name("x"), floats(|signal| signal.stop_point.x));
    features.floats(name("y"), floats(|signal| signal.stop_point.y));
    features.floats(name("z"), floats(|signal| signal.stop_point.z));
}

fn of_tracks(features: &mut Features, scene: &Scene, tracks: &[usize], room: Room) {
    let slots = || (0..room.agents).map(|slot| tracks.get(slot));
    let id = |slot: Option<&usize>| slot.map_or(-1.0, |track| scene.tracks()[*track].id.0 as f32);
    features.floats("state/id", slots().map(id).collect());
    let kind = |slot: Option<&usize>| slot.map_or(-1.0, |track| AgentKind::number(scene.tracks()[*track].kind) as f32);
    features.floats("state/type", slots().map(kind).collect());
    let mut marks = |name: &str, is_marked: &dyn Fn(usize) -> bool| {
        let mark = |slot: Option<&usize>| slot.map_or(-1, |track| i64::from(is_marked(*track)));
        features.ints(format!("state/{name}"), slots().map(mark).collect());
    };
    marks("is_sdc", &|track| track == scene.av_index());
    marks("objects_of_interest", &|track| scene.objects_of_interest().contains(&scene.tracks()[track].id));
    let task = |track: usize| scene.tracks_to_predict().iter().find(|task| task.track_index == track);
    marks("tracks_to_predict", &|track| task(track).is_some());
    let difficulty =
        |slot: Option<&usize>| slot.and_then(|track| task(*track)).map_or(0, |task| i64::from(task.difficulty));
    features.ints("state/difficulty_level", slots().map(difficulty).collect());
}

fn roadgraph(features: &mut Features, scene: &Scene, room: Room) {
    let map = scene.map();
    let mut points: Vec<(MapId, i64, [f64; 3])> = Vec::new();
    let mut put = |id: MapId, kind: i64, line: &[world::geometry::Point3]| {
        points.extend(line.iter().map(|point| (id, kind, [point.x, point.y, point.z])));
    };
    map.lanes.iter().for_each(|lane| put(lane.id, i64::from(LaneKind::number(lane.kind)), &lane.centerline));
    map.road_lines.iter().for_each(|line| put(line.id, 5 + i64::from(line.kind.number()), &line.polyline));
    map.road_edges.iter().for_each(|edge| put(edge.id, 14 + i64::from(edge.kind.number()), &edge.polyline));
    map.stop_signs.iter().for_each(|sign| put(sign.id, 17, &[sign.position]));
    map.crosswalks.iter().for_each(|area| put(area.id, 18, &area.polygon));
    map.speed_bumps.iter().for_each(|area| put(area.id, 19, &area.polygon));
    map.driveways.iter().for_each(|area| put(area.id, 20, &area.polygon));
    // The data set's are in the order of their numbers.
    points.sort_by_key(|(id, ..)| *id);
    points.truncate(room.points);
    let slots = || (0..room.points).map(|slot| points.get(slot));
    features.ints("roadgraph_samples/id", slots().map(|point| point.map_or(-1, |point| point.0.0)).collect());
    features.ints("roadgraph_samples/type", slots().map(|point| point.map_or(-1, |point| point.1)).collect());
    features.ints("roadgraph_samples/valid", slots().map(|point| i64::from(point.is_some())).collect());
    let xyz = slots().flat_map(|point| point.map_or([-1.0; 3], |point| point.2).map(|value| value as f32));
    features.floats("roadgraph_samples/xyz", xyz.collect());
}
