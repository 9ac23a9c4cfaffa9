//! WOMD's other format: scenes written in it come back, as far as it holds them; and what is refused.

use std::collections::BTreeSet;
use std::fs;

use scenarios::fuzzing::exampled::{self, Room, USUAL};
use scenarios::generated::{FAMILIES, Family};
use scenarios::tf_example::ExampleError;
use scenarios::{SceneSet, lint, tfrecord, womd};
use world::geometry::Point3;
use world::map::{Lane, LaneKind, Map};
use world::route::{Route, RouteStyle};
use world::scene::bridged::Bridged;
use world::scene::{AgentState, Finding, Scene, TrackToPredict};

use crate::real_data;

/// Room for all that a scene has.
const AMPLE: Room = Room { agents: 700, points: 120_000, signals: 70, past: 10 };

/// A generated scene, or as many steps of it.
fn scene(family: &str, steps: usize) -> Scene {
    let payload = Family::named(family).unwrap().payload(family, 1, 0, &Default::default()).unwrap();
    let mut parts = womd::read(&payload).unwrap().0.into_parts();
    parts.timestamps.truncate(steps);
    parts.signals.truncate(steps);
    parts.tracks.iter_mut().for_each(|track| track.states.truncate(steps));
    parts.tracks.retain(|track| track.states.iter().any(Option::is_some));
    parts.av_index = parts.tracks.len() - 1;
    parts.objects_of_interest = vec![parts.tracks[0].id];
    parts.tracks_to_predict = vec![TrackToPredict { track_index: 1, difficulty: 2 }];
    parts.current_time_index = 10;
    parts.check().unwrap().0
}

fn through(scene: &Scene, room: Room) -> (Scene, Vec<Finding>) {
    womd::read(&exampled::payload(scene, room)).unwrap()
}

fn rounded(state: &AgentState) -> [f32; 9] {
    let AgentState { x, y, z, heading, velocity_x, velocity_y, length, width, height } = *state;
    [x, y, z, heading, velocity_x, velocity_y, length, width, height].map(|value| value as f32)
}

/// Holds all but the map to what it was.
fn hold_log(again: &Scene, scene: &Scene) {
    assert_eq!((again.id(), again.steps(), again.tracks().len()), (scene.id(), scene.steps(), scene.tracks().len()));
    assert_eq!(again.av().id, scene.av().id);
    for track in scene.tracks() {
        let other = again.tracks().iter().find(|other| other.id == track.id).unwrap();
        assert_eq!(other.kind, track.kind);
        for (other, state) in other.states.iter().zip(&track.states) {
            assert_eq!(other.as_ref().map(rounded), state.as_ref().map(rounded), "track {}", track.id);
        }
    }
    for (other, time) in again.timestamps().iter().zip(scene.timestamps()) {
        assert!((other - time).abs() < 1e-6);
    }
    let seen = |scene: &Scene, step| -> Vec<_> {
        let place = |point: Point3| [point.x, point.y, point.z].map(|value| value as f32);
        scene.signals(step).iter().map(|signal| (signal.lane, signal.state, place(signal.stop_point))).collect()
    };
    (0..scene.steps()).for_each(|step| assert_eq!(seen(again, step), seen(scene, step)));
    // Marks have the order of the tracks.
    let of_interest = |scene: &Scene| scene.objects_of_interest().iter().copied().collect::<BTreeSet<_>>();
    assert_eq!(of_interest(again), of_interest(scene));
    let tasks = |scene: &Scene| -> BTreeSet<_> {
        scene.tracks_to_predict().iter().map(|task| (scene.tracks()[task.track_index].id, task.difficulty)).collect()
    };
    assert_eq!((tasks(again), again.current_time_index()), (tasks(scene), 10));
}

/// How many links of lanes for cars are made that are the map's, how many are made, and how many the map has. WOMD's bike lanes have none.
fn links(again: &Map, map: &Map) -> (usize, usize, usize) {
    let all = |map: &Map| -> BTreeSet<_> {
        let cars: BTreeSet<_> = map.lanes.iter().filter(|lane| lane.kind.is_drivable()).map(|lane| lane.id).collect();
        let all = map.lanes.iter().flat_map(|lane| lane.exits.iter().map(|exit| (lane.id, *exit)));
        all.filter(|(from, to)| cars.contains(from) && cars.contains(to)).collect()
    };
    let (made, there) = (all(again), all(map));
    (made.intersection(&there).count(), made.len(), there.len())
}

#[test]
fn generated_scenes_come_back_but_for_what_the_format_leaves_out() {
    let (mut right, mut made, mut there) = (0, 0, 0);
    for family in FAMILIES {
        let scene = scene(family.name, 91);
        let (again, findings) = through(&scene, AMPLE);
        hold_log(&again, &scene);
        let (ours, map) = (again.map(), scene.map());
        assert_eq!(ours.lanes.len(), map.lanes.len());
        for lane in &ours.lanes {
            let other = map.lanes.iter().find(|other| other.id == lane.id).unwrap();
            assert_eq!((lane.kind, lane.centerline.len()), (other.kind, other.centerline.len()));
            assert!(lane.left_neighbors.is_empty() && lane.left_boundaries.is_empty());
            let limit = if lane.kind == LaneKind::Freeway { 65.0 } else { 0.0 };
            assert_eq!(lane.speed_limit_mph, limit);
        }
        let count = |map: &Map| {
            let kinds = (map.road_lines.len(), map.road_edges.len(), map.stop_signs.len());
            (kinds, map.crosswalks.len(), map.speed_bumps.len(), map.driveways.len())
        };
        assert_eq!(count(ours), count(map));
        for (line, other) in ours.road_lines.iter().map(|line| (line, map.road_lines.iter().find(|o| o.id == line.id)))
        {
            assert_eq!(Some(line.kind), other.map(|other| other.kind));
        }
        for (edge, other) in ours.road_edges.iter().map(|edge| (edge, map.road_edges.iter().find(|o| o.id == edge.id)))
        {
            assert_eq!(Some(edge.kind), other.map(|other| other.kind));
        }
        let linked = links(ours, map);
        (right, made, there) = (right + linked.0, made + linked.1, there + linked.2);
        let links = ours.lanes.iter().map(|lane| lane.exits.len()).sum();
        assert!(findings.contains(&Finding::LinkedByPlace { lanes: map.lanes.len(), links }), "{findings:?}");
        assert!(!findings.iter().any(|finding| matches!(finding, Finding::Full { .. })), "{findings:?}");
    }
    assert!(right as f64 > 0.99 * made as f64 && right as f64 > 0.99 * there as f64, "{right} of {made} and {there}");
}

#[test]
fn real_scenes_come_back_with_their_routes() {
    let Some(data) = real_data() else { return };
    let set = SceneSet::open(&[data.join("womd-derived/9s").display().to_string()]).unwrap();
    let (mut right, mut made, mut there) = (0, 0, 0);
    let (mut signs, mut ruled, mut rightly, mut ruling) = (0, 0, 0, 0);
    let (mut routes, mut same) = (0, 0);
    for index in 0..set.entries().len() {
        let scene = set.load(index).unwrap().0;
        let (again, _) = through(&scene, AMPLE);
        hold_log(&again, &scene);
        let linked = links(again.map(), scene.map());
        (right, made, there) = (right + linked.0, made + linked.1, there + linked.2);
        for sign in &again.map().stop_signs {
            let other = scene.map().stop_signs.iter().find(|other| other.id == sign.id).unwrap();
            signs += 1;
            ruled += sign.lanes.len();
            ruling += other.lanes.len();
            rightly += sign.lanes.iter().filter(|lane| other.lanes.contains(lane)).count();
        }
        let route = |scene: Scene| {
            let bridged = Bridged::of(&std::sync::Arc::new(scene));
            Route::of_log(bridged.judged(), RouteStyle::Strict).map(|route| route.lanes).ok()
        };
        let ours = route(again);
        routes += usize::from(ours.is_some());
        same += usize::from(ours == route(scene.as_ref().clone()));
    }
    eprintln!(
        "links: {right} of {made} made, of {there}; signs: {signs}, {rightly} of {ruled} lanes, of {ruling}; routes: {same} of {routes}"
    );
    assert!(right as f64 > 0.99 * made as f64 && right as f64 > 0.99 * there as f64, "{right} of {made} and {there}");
    assert!(rightly as f64 > 0.9 * ruled as f64 && rightly as f64 > 0.8 * ruling as f64);
    assert!(routes == set.entries().len() && same as f64 > 0.9 * routes as f64, "{same} of {routes}");
}

#[test]
fn a_record_of_the_data_sets_own_is_driven_and_what_it_leaves_out_is_told() {
    let Some(data) = real_data() else { return };
    let set = SceneSet::open(&[data.join("womd/tf-example").display().to_string()]).unwrap();
    let (scene, findings) = set.load(0).unwrap();
    assert_eq!((scene.id().as_str(), scene.steps(), scene.tracks().len()), ("a3bb37c25ce56418", 91, 128));
    assert_eq!((scene.av().id.0, scene.current_time_index(), scene.tracks_to_predict().len()), (336, 10, 8));
    assert_eq!((scene.map().lanes.len(), scene.map().road_edges.len()), (131, 45));
    let codes: Vec<&str> = lint::lint(&scene, &findings).iter().map(lint::Lint::code).collect();
    assert_eq!(codes.iter().filter(|code| **code == "file-full").count(), 3, "{codes:?}");
    assert!(codes.contains(&"links-by-place") && codes.contains(&"no-speed-limits"), "{codes:?}");
}

#[test]
fn what_there_is_no_room_for_is_told() {
    let scene = scene("urban", 91);
    let room = Room { agents: 12, points: USUAL.points, signals: 3, past: 10 };
    let (again, findings) = through(&scene, room);
    assert_eq!((again.tracks().len(), again.av_index()), (12, 0));
    let full = |what, most| findings.contains(&Finding::Full { what, most });
    assert!(full("road users", 12) && full("signals", 3), "{findings:?}");
    let points: usize = scene.map().lanes.iter().map(|lane: &Lane| lane.centerline.len()).sum();
    assert_eq!(
        full("points of the map", 20_000),
        points > 20_000 || again.map().road_edges.len() < scene.map().road_edges.len()
    );
}

#[test]
fn files_of_it_are_skimmed_packed_indexed_and_exported_as_scenarios() {
    let folder = tempfile::tempdir().unwrap();
    let scenes = ["following", "curve"].map(|family| scene(family, 91));
    let mut file = Vec::new();
    scenes.iter().for_each(|scene| tfrecord::append_record(&mut file, &exampled::payload(scene, AMPLE)));
    fs::write(folder.path().join("tf_example.tfrecord-00000-of-00001"), &file).unwrap();
    let packed = miniz_oxide::deflate::compress_to_vec_zlib(&file, 1);
    fs::write(folder.path().join("packed"), packed).unwrap();
    let open = |name: &str| SceneSet::open(&[folder.path().join(name).display().to_string()]).unwrap();
    for name in ["tf_example.tfrecord-00000-of-00001", "packed"] {
        let set = open(name);
        let ids: Vec<&str> = set.entries().iter().map(|entry| entry.id.as_str()).collect();
        assert_eq!(ids, ["following", "curve"]);
        set.verify().unwrap();
        fs::write(folder.path().join("scenes.index"), set.index(folder.path())).unwrap();
        let loaded = open("scenes.index").load(1).unwrap();
        assert_eq!(loaded, set.load(1).unwrap());
        // What is exported is in the other format, links and all.
        let (exported, _) = womd::read(&set.payload(1).unwrap()).unwrap();
        assert_eq!(exported.map().lanes, loaded.0.map().lanes);
        assert_eq!(exported.av_index(), loaded.0.av_index());
    }
}

#[test]
fn what_is_wrong_with_a_record_is_told() {
    let mut scene = scene("following", 91);
    let room = Room { points: 200, ..USUAL };
    let whole = exampled::payload(&scene, room);
    let problem = |payload: &[u8]| match womd::read(payload).unwrap_err() {
        womd::WomdError::TfExample(error) => error,
        other => panic!("{other}"),
    };
    let renamed = |name: &str| {
        let place = whole.windows(name.len()).position(|bytes| bytes == name.as_bytes()).unwrap();
        let mut payload = whole.clone();
        payload[place + name.len() - 1] ^= 1;
        payload
    };
    assert_eq!(problem(&renamed("state/type")), ExampleError::Missing("state/type".into()));
    assert_eq!(problem(&renamed("roadgraph_samples/id")).to_string(), "the feature roadgraph_samples/id is missing");
    assert_eq!(problem(&renamed("state/past/x")), ExampleError::Twice("state/past/y".into()));
    let cut = problem(&whole[..whole.len() - 10]);
    assert_eq!(cut.to_string(), "the record is malformed");
    // Two of one name, and none.
    let small = exampled::payload(&scene, Room { agents: 1, ..room });
    let [one, other] = [&whole, &small].map(|payload| &payload[..]);
    assert!(matches!(problem(&[one, other].concat()), ExampleError::Twice(_)));
    let mut parts = scene.clone().into_parts();
    parts.tracks.iter_mut().for_each(|track| track.states[11..].iter_mut().for_each(|state| *state = None));
    scene = parts.check().unwrap().0;
    let withheld = problem(&exampled::payload(&scene, room));
    assert_eq!(
        withheld.to_string(),
        "nobody is there after step 10: it is of the test split, which withholds the future"
    );
}
