//! ScenarioNet's pickles: what is read and what is refused, folders and databases, every real layout, and scenes that were converted from
//! WOMD both ways.

use std::fs;
use std::path::Path;
use std::sync::Arc;

use scenarios::fuzzing::pickled::{self, Python, dict, text};
use scenarios::generated::{FAMILIES, Family};
use scenarios::scenarionet::pickle::{Pickle, Value};
use scenarios::scenarionet::{self, PickleProblem, ScenarioNetError};
use scenarios::{SceneSet, SetError, lint, tfrecord, womd};
use world::geometry::Point3;
use world::map::{LaneKind, MapId, RoadEdgeKind, RoadLineKind};
use world::scene::{AgentKind, Scene};
use world::signal::SignalState;

use crate::real_data;

fn generated(family: &str) -> Scene {
    let payload = Family::named(family).unwrap().payload(family, 1, 0, &Default::default()).unwrap();
    womd::read(&payload).unwrap().0
}

fn read(scene: &Python) -> Result<Scene, ScenarioNetError> {
    scenarionet::read(&scene.pickle()).map(|(scene, _)| scene)
}

fn text_of<'a>(pickle: &'a Pickle<'a>, key: &str) -> Value<'a> {
    pickle.get(pickle.root(), key).unwrap_or_else(|| panic!("no {key}"))
}

#[test]
fn every_protocol_of_pythons_is_read() {
    let files: [&[u8]; 6] = [
        include_bytes!("pickles/values-0.pkl"),
        include_bytes!("pickles/values-1.pkl"),
        include_bytes!("pickles/values-2.pkl"),
        include_bytes!("pickles/values-3.pkl"),
        include_bytes!("pickles/values-4.pkl"),
        include_bytes!("pickles/values-5.pkl"),
    ];
    for (protocol, file) in files.into_iter().enumerate() {
        let pickle = Pickle::read(file).unwrap();
        let [one, two, large, larger, half, none, truth, tuple, empty, accented, long] =
            pickle.items(text_of(&pickle, "a")).unwrap()
        else {
            panic!("protocol {protocol}")
        };
        assert_eq!([*one, *two, *large, *larger], [1, -2, 70_000, 1 << 40].map(Value::Int));
        assert_eq!([*half, *none, *truth], [Value::Float(2.5), Value::None, Value::Bool(true)]);
        assert_eq!(pickle.items(*tuple), Some(&[Value::Int(1)][..]));
        assert_eq!(pickle.items(*empty), Some(&[][..]));
        assert_eq!(pickle.text(*accented), Some("é~ \\ ☃\n"), "protocol {protocol}");
        assert_eq!(pickle.text(*long), Some("longlong"));
        assert_eq!(pickle.bytes(text_of(&pickle, "b")), Some(&b"\x00\xff"[..]));
        let all = pickle.dict(pickle.root()).unwrap();
        assert_eq!(pickle.items(all[2].1).map(|set| pickle.text(set[0])), Some(Some("x")));
        assert_eq!(pickle.items(text_of(&pickle, "d")), Some(&[1, 2, 3, 4].map(Value::Int)[..]));
    }
}

#[test]
fn numpys_arrays_are_read_as_every_protocol_writes_them() {
    let files: [&[u8]; 4] = [
        include_bytes!("pickles/arrays-2.pkl"),
        include_bytes!("pickles/arrays-3.pkl"),
        include_bytes!("pickles/arrays-4.pkl"),
        include_bytes!("pickles/arrays-5.pkl"),
    ];
    for file in files {
        let pickle = Pickle::read(file).unwrap();
        let array = |key: &str| {
            let numbers = pickle.numbers(text_of(&pickle, key)).unwrap();
            let at = |row| (0..numbers.columns).map(move |column| numbers.at(row, column));
            ((numbers.rows, numbers.columns), (0..numbers.rows).flat_map(at).collect::<Vec<f64>>())
        };
        for key in ["f4", "F"] {
            assert_eq!(array(key), ((3, 2), vec![1.0, 2.0, 3.0, 4.5, 5.0, 6.0]), "{key}");
        }
        assert_eq!(array("b"), ((2, 1), vec![1.0, 0.0]));
        assert_eq!(array("big"), ((2, 1), vec![1.5, 2.5]));
        assert_eq!(array("f2"), ((3, 1), vec![0.5, -65504.0, f64::from_bits((1023 - 24) << 52)]));
        assert_eq!((array("u1").1, array("i2").1), (vec![200.0], vec![-200.0]));
        assert_eq!([text_of(&pickle, "s"), text_of(&pickle, "i")], [Value::Float(2.5), Value::Int(-3)]);
        assert_eq!(pickle.numbers(text_of(&pickle, "U")).map(|array| array.rows), None, "texts are no numbers");
        assert_eq!(pickle.get(text_of(&pickle, "d"), "k"), Some(Value::Int(1)));
        assert_eq!(pickle.get(text_of(&pickle, "o"), "k"), Some(Value::Int(2)));
    }
}

fn problem(bytes: &[u8]) -> (usize, PickleProblem) {
    let error = Pickle::read(bytes).unwrap_err();
    (error.byte, error.problem)
}

#[test]
fn what_a_pickle_would_run_is_refused_by_name() {
    let refused = |module: &str, name: &str| PickleProblem::Refused { module: module.into(), name: name.into() };
    assert_eq!(problem(b"cos\nsystem\n(S'echo harm'\ntR."), (0, refused("os", "system")));
    assert_eq!(
        problem(b"\x80\x04\x8c\x08builtins\x94\x8c\x04eval\x94\x93\x94\x8c\x011\x85R."),
        (20, refused("builtins", "eval"))
    );
    assert_eq!(problem(b"\x80\x02cnumpy\nload\n."), (2, refused("numpy", "load")));
    assert_eq!(problem(b"(S'x'\nios\nsystem\n.").1, PickleProblem::Unwanted("objects of classes of its own"));
    assert_eq!(problem(b"\x80\x02\x82\x01.").1, PickleProblem::Unwanted("classes by registered numbers"));
    // What is known is made, never called: its arguments are those that it is written with, or none.
    assert_eq!(problem(b"cbuiltins\nint\nX\x01\0\0\x001\x85R.").1, PickleProblem::Call { class: "int" });
    let error = scenarionet::read(b"cos\nsystem\n(S'echo harm'\ntR.").unwrap_err();
    assert_eq!(error.to_string(), "byte 0: the pickle calls for os.system, which no scene needs: it was not run");
    assert!(error.hint().starts_with("only NumPy's arrays and plain values are read"), "{}", error.hint());
}

#[test]
fn damage_is_told_with_its_byte() {
    assert_eq!(problem(b""), (0, PickleProblem::CutOff { wanted: 1 }));
    assert_eq!(problem(b"\x80\x04X\x05\0\0\0ab"), (2, PickleProblem::CutOff { wanted: 3 }));
    assert_eq!(problem(b"\x80\x06N."), (0, PickleProblem::Protocol(6)));
    assert_eq!(problem(b"\x80\x04\xff"), (2, PickleProblem::Operation(0xff)));
    assert_eq!(problem(b"\x80\x04h\x07."), (2, PickleProblem::Memo(7)));
    assert_eq!(problem(b"]e."), (1, PickleProblem::NoMark));
    assert_eq!(problem(b"(K\x01a."), (3, PickleProblem::NoValue));
    assert_eq!(problem(b"NK\x01a."), (3, PickleProblem::NoContainer("container")));
    assert_eq!(problem(b"\x8a\x09\0\0\0\0\0\0\0\0\x01."), (0, PickleProblem::LargeInteger));
    assert!(matches!(problem(&[&b"X\xff\xff\xff\xff"[..], b"a"].concat()).1, PickleProblem::CutOff { .. }));
    assert!(matches!(problem(b"\x8e\xff\xff\xff\xff\xff\xff\xff\xffa").1, PickleProblem::CutOff { .. }));
}

#[test]
fn a_small_file_takes_little_memory_whatever_it_claims() {
    // Deep, long, and multiplied: each ends at its bound.
    assert_eq!(problem(&b"(".repeat(5000)).1, PickleProblem::TooDeep);
    assert_eq!(problem(&b"N".repeat(9_000_000)).1, PickleProblem::TooManyValues);
    assert_eq!(problem(&b"]".repeat(3_000_000)).1, PickleProblem::TooManyObjects);
    let copies =
        [&b"cbuiltins\nlist\nq\x01]("[..], &b"N".repeat(100_000), b"eq\x02", &b"h\x01h\x02\x85R".repeat(1000), b"."]
            .concat();
    assert_eq!(problem(&copies).1, PickleProblem::TooManyValues);
    // An array's shape is held to its bytes; a list within itself is a list.
    let array = b"cnumpy.core.multiarray\n_reconstruct\ncnumpy\nndarray\nK\0\x85C\x01b\x87R(K\x01J\xff\xff\xff\x7f\x85cnumpy\ndtype\n\x8c\x02f8\x85R\x89C\x01atb.";
    assert_eq!(problem(array).1, PickleProblem::ArrayBytes { shape: vec![i32::MAX as usize], item: 8, bytes: 1 });
    let mut scene = pickled::current(&generated("following"));
    let track = scene.at("tracks").pairs()[0].1.clone();
    let shared = [b"}(".to_vec(), many(&track, 20_000), b"u".to_vec()].concat();
    *scene.at("tracks") = Python::Raw(shared);
    assert!(matches!(read(&scene).unwrap_err(), ScenarioNetError::TooLarge(_)));
    assert!(Pickle::read(b"]q\x01h\x01a.").is_ok());
}

/// Many tracks by one value, which is stored once.
fn many(track: &Python, count: usize) -> Vec<u8> {
    let pickle = track.pickle();
    let value = &pickle[2..pickle.len() - 1];
    let first = [b"K\0", value, b"r\x01\x01\0\0"].concat();
    let again = (1..count as u16).flat_map(|id| [&[b'M'][..], &id.to_le_bytes(), b"j\x01\x01\0\0"].concat());
    first.into_iter().chain(again).collect()
}

#[test]
fn a_scene_written_as_a_pickle_is_the_same_scene() {
    for family in FAMILIES {
        let scene = generated(family.name);
        let pickle = pickled::current(&scene).pickle();
        let (again, _) = scenarionet::read(&pickle).unwrap();
        let (mut one, mut other) = (scene.into_parts(), again.into_parts());
        // Signals of a step have an order in WOMD's alone.
        for signals in one.signals.iter_mut().chain(&mut other.signals) {
            signals.sort_by_key(|signal| signal.lane);
        }
        assert_eq!(one, other, "{}", family.name);
    }
}

#[test]
fn scenes_of_the_first_converters_are_read() {
    let scene = generated("red-light");
    let (mut old, steps) = (pickled::current(&scene), scene.steps());
    let state = |track: usize, step: usize| scene.logged(track, step).copied();
    let tracks = scene.tracks().iter().enumerate().map(|(index, track)| {
        let row = |step| match state(index, step) {
            Some(s) => [s.x, s.y, s.z, s.length, s.width, s.height, s.heading, s.velocity_x, s.velocity_y, 1.0],
            None => [0.0; 10],
        };
        let kind = match track.kind {
            AgentKind::Vehicle => 1,
            AgentKind::Pedestrian => 2,
            AgentKind::Cyclist => 3,
            AgentKind::Other => 4,
        };
        let kind = pickled::call("__main__", "AgentType", &Python::Int(kind));
        let states = Python::Array(vec![steps, 10], (0..steps).flat_map(row).collect());
        (Python::Int(track.id.0.into()), dict([("type", kind), ("state", states)]))
    });
    let at = |x: f64| Point3::new(x, 1.0, 0.5);
    let line = pickled::points(&[at(0.0), at(5.0)]);
    let member = |class: &str, number| pickled::call("__main__", class, &Python::Int(number));
    let int = |number| Python::List(vec![Python::Int(number)]);
    let boundary = dict([
        ("index", Python::List(vec![Python::Int(0), Python::Int(1)])),
        ("type", member("RoadLineType", 7)),
        ("id", Python::Int(2)),
    ]);
    let indexes = Python::List([0, 1, 0, 1].map(Python::Int).to_vec());
    let lane = dict([
        ("type", text("center_lane")),
        ("polyline", line.clone()),
        ("interpolating", Python::Bool(true)),
        ("entry", int(1)),
        ("exit", int(1)),
        ("left_boundaries", Python::List(vec![boundary.clone()])),
        ("left_neighbor", Python::List(vec![dict([("id", Python::Int(1)), ("indexes", indexes)])])),
        ("right_neighbor", Python::List(vec![dict([("id", Python::Int(1))])])),
    ]);
    // A bump is in its own type.
    let bump = [
        &b"}r\xff\xff\0\0(X\x04\0\0\0typej\xff\xff\0\0X\x07\0\0\0polygon"[..],
        &line.pickle()[2..line.pickle().len() - 1],
        b"u",
    ]
    .concat();
    let map = [
        (1, lane),
        (2, dict([("type", member("RoadLineType", 7)), ("polyline", line.clone())])),
        (3, dict([("type", member("RoadEdgeType", 2)), ("polyline", line.clone())])),
        (4, dict([("sign", text("cross_walk")), ("polygon", line.clone())])),
        (5, Python::Raw(bump)),
        (
            6,
            dict([
                ("type", text("stop_sign")),
                ("lanes", int(1)),
                ("pos", Python::List(vec![Python::Float(1.0), Python::Float(2.0), Python::Float(3.0)])),
            ]),
        ),
    ];
    let signal = dict([("state", Python::Int(4)), ("stop_point", Python::List(vec![Python::Float(0.0); 3]))]);
    let pairs = old.pairs();
    pairs.retain(|(key, _)| matches!(key, Python::Text(key) if key == "id"));
    let times = scene.timestamps().iter().map(|time| Python::Float(*time)).collect();
    pairs.extend([
        (text("ts"), Python::List(times)),
        (text("tracks"), Python::Dict(tracks.collect())),
        (text("dynamic_map_states"), Python::List(vec![Python::Dict(vec![(Python::Int(1), signal)])])),
        (text("sdc_index"), Python::Int(scene.av().id.0.into())),
        (text("map"), Python::Dict(map.into_iter().map(|(id, feature)| (Python::Int(id), feature)).collect())),
    ]);
    let read = read(&old).unwrap();
    assert_eq!((read.tracks(), read.av_index()), (scene.tracks(), scene.av_index()));
    assert!((0..steps).all(|step| read.signals(step).is_empty()), "one step's signals are none");
    let map = read.map();
    let lane = &map.lanes[0];
    assert_eq!(
        (lane.id, lane.kind, lane.interpolating, lane.speed_limit_mph),
        (MapId(1), LaneKind::Undefined, true, 0.0)
    );
    assert_eq!((&lane.entries[..], &lane.exits[..]), (&[MapId(1)][..], &[MapId(1)][..]));
    assert_eq!(
        (lane.left_boundaries[0].feature, lane.left_boundaries[0].kind),
        (MapId(2), RoadLineKind::SolidDoubleYellow)
    );
    assert_eq!((lane.left_neighbors[0].neighbor_end_index, lane.right_neighbors[0].self_end_index), (1, 1));
    assert_eq!(map.road_lines[0].kind, RoadLineKind::SolidDoubleYellow);
    assert_eq!(map.road_edges[0].kind, RoadEdgeKind::Median);
    assert_eq!((map.crosswalks.len(), map.speed_bumps.len()), (1, 1));
    assert_eq!(
        (map.stop_signs[0].position, &map.stop_signs[0].lanes[..]),
        (Point3::new(1.0, 2.0, 3.0), &[MapId(1)][..])
    );
}

#[test]
fn signals_by_step_and_by_name_are_read() {
    let scene = generated("following");
    let (lane, steps) = (scene.map().lanes[0].id, scene.steps());
    let mut old = pickled::current(&scene);
    let column = |number: f64| Python::Array(vec![steps], vec![number; steps]);
    let shown = dict([
        ("object_state", column(4.0)),
        ("lane", column(lane.0 as f64)),
        ("stop_point", Python::Array(vec![steps, 3], vec![7.0; 3 * steps])),
    ]);
    *old.at("dynamic_map_states") = Python::Dict(vec![(text(lane), dict([("state", shown)]))]);
    let read_old = read(&old).unwrap();
    let signal = read_old.signals(3)[0];
    assert_eq!((signal.lane, signal.state, signal.stop_point), (lane, SignalState::Stop, Point3::new(7.0, 7.0, 7.0)));
    // nuPlan's stand 8 m into their lanes, have no height, and names of their own.
    let names = ["TRAFFIC_LIGHT_GREEN", "TRAFFIC_LIGHT_RED", "TRAFFIC_LIGHT_UNKNOWN"];
    let list = Python::List(names.into_iter().cycle().take(steps).map(text).collect());
    let stop = Python::List(vec![Python::Float(1.0), Python::Float(2.0)]);
    let signal = dict([("state", dict([("object_state", list)])), ("lane", text(lane)), ("stop_point", stop)]);
    *old.at("dynamic_map_states") = Python::Dict(vec![(text(lane), signal)]);
    *old.at("metadata").at("dataset") = text("nuplan");
    let nuplan = read(&old).unwrap();
    let states: Vec<SignalState> = (0..3).map(|step| nuplan.signals(step)[0].state).collect();
    assert_eq!(states, [SignalState::Go, SignalState::Stop, SignalState::Unknown]);
    assert_eq!(nuplan.signals(0)[0].stop_point, nuplan.map().lanes[0].centerline[0]);
}

/// Two lanes in a row and one across, outlines with a hole, as nuScenes' converter writes them.
fn nuscenes() -> Python {
    let scene = generated("following");
    let mut python = pickled::current(&scene);
    let rows = |rows: &[[f64; 2]]| {
        Python::List(rows.iter().map(|row| Python::List(row.map(Python::Float).to_vec())).collect())
    };
    let lane = |points: &[[f64; 3]]| {
        let points = points.iter().map(|[x, y, heading]| Point3::new(*x, *y, *heading)).collect::<Vec<_>>();
        dict([
            ("type", text("LANE_SURFACE_STREET")),
            ("polyline", pickled::points(&points)),
            ("speed_limit_kmh", Python::Int(100)),
        ])
    };
    let outline =
        |corners: &[[f64; 2]]| dict([("type", text("ROAD_LINE_SOLID_SINGLE_WHITE")), ("polyline", rows(corners))]);
    // Clockwise around the area, counter-clockwise around the hole.
    let area = outline(&[[-50.0, -50.0], [-50.0, 50.0], [50.0, 50.0], [50.0, -50.0], [-50.0, -50.0]]);
    let hole = outline(&[[10.0, 10.0], [20.0, 10.0], [20.0, 20.0], [10.0, 10.0]]);
    *python.at("map_features") = Python::Dict(vec![
        (text("boundary_0"), area),
        (text("boundary_1"), hole),
        (text("token-a"), lane(&[[0.0, 0.0, 0.0], [5.0, 0.0, 0.0], [5.0, 0.0, 0.0]])),
        (text("token-b"), lane(&[[5.0, 0.0, 0.0], [10.0, 1.0, 0.2]])),
        (text("token-c"), lane(&[[5.0, 0.0, 1.6], [5.0, 9.0, 1.6]])),
    ]);
    *python.at("metadata").at("dataset") = text("nuscenes");
    for (number, (key, _)) in python.at("tracks").pairs().iter_mut().enumerate() {
        *key = text(if number == scene.av_index() { "ego".to_owned() } else { format!("token-{number}") });
    }
    let ego = python.at("tracks").pairs()[scene.av_index()].1.at("state");
    let (length, width) = (ego.at("length").clone(), ego.at("width").clone());
    (*ego.at("length"), *ego.at("width")) = (width, length);
    *python.at("metadata").at("sdc_id") = text("ego");
    *python.at("metadata").at("objects_of_interest") = Python::List(vec![text("token-1")]);
    python
}

#[test]
fn what_nuscenes_converter_did_is_undone() {
    let scene = read(&nuscenes()).unwrap();
    let map = scene.map();
    let [a, b, c] = &map.lanes[..] else { panic!("{} lanes", map.lanes.len()) };
    assert_eq!(a.centerline, [Point3::new(0.0, 0.0, 0.0), Point3::new(5.0, 0.0, 0.0)], "no heights, no point twice");
    assert_eq!(
        (&a.exits[..], &b.entries[..], c.entries.len()),
        (&[b.id][..], &[a.id][..], 0),
        "lanes that go on are linked"
    );
    assert_eq!(a.speed_limit_mph, 0.0, "100 km/h is nobody's limit");
    let area = |edge: &world::map::RoadEdge| -> f64 {
        edge.polyline.windows(2).map(|pair| pair[0].x * pair[1].y - pair[1].x * pair[0].y).sum::<f64>() / 2.0
    };
    let [around, hole] = &map.road_edges[..] else { panic!() };
    assert_eq!((area(around), area(hole)), (10_000.0, -50.0), "the road is on the left of both");
    let numbers: Vec<i32> = scene.tracks().iter().map(|track| track.id.0).collect();
    assert_eq!(numbers, (0..numbers.len() as i32).collect::<Vec<_>>());
    assert_eq!(scene.objects_of_interest()[0].0, 1);
    let state = scene.av().states.iter().flatten().next().unwrap();
    assert_eq!(state.z, state.height / 2.0);
    // The car was there at a right angle to itself, and by its rear axle.
    let logged = generated("following");
    let before = logged.av().states[0].unwrap();
    assert_eq!((state.length, state.width), (before.length, before.width));
    assert!((state.position().distance(before.position()) - 1.385).abs() < 1e-9);
    assert!(before.pose().to_body(state.position()).x > 1.38, "it moved ahead");
}

#[test]
fn a_velocity_that_has_no_next_state_goes_on() {
    let mut python = nuscenes();
    let (steps, av) = (generated("following").steps(), generated("following").av_index());
    let other = usize::from(av == 0);
    let state = python.at("tracks").pairs()[other].1.at("state");
    *state.at("valid") = Python::Array(vec![steps], (0..steps).map(|step| f64::from(u8::from(step < 3))).collect());
    let velocities = (0..steps).flat_map(|step| if step < 2 { [step as f64 + 1.0, 0.5] } else { [0.0, 0.0] });
    *state.at("velocity") = Python::Array(vec![steps, 2], velocities.collect());
    let scene = read(&python).unwrap();
    let speeds: Vec<f64> = scene.tracks()[other].states.iter().flatten().map(|state| state.velocity_x).collect();
    assert_eq!(speeds, [1.0, 2.0, 2.0]);
    let last: Vec<f64> = scene.av().states[steps - 2..].iter().flatten().map(|state| state.speed()).collect();
    assert!(last[0] == last[1] && last[0] > 0.0, "{last:?}");
}

#[test]
fn what_is_no_scene_says_what_it_is() {
    let error = |python: &Python| read(python).unwrap_err().to_string();
    assert_eq!(error(&text("hello")), "the pickle is no scene: it holds no dict");
    assert_eq!(
        error(&dict([("all_agent", Python::None)])),
        "the pickle is no scene: it is a training sample of TrafficGen's"
    );
    assert!(error(&dict([("sd_a.pkl", text(""))])).contains("the mapping of a database"));
    let good = pickled::current(&generated("following"));
    let with = |change: &dyn Fn(&mut Python)| {
        let mut python = good.clone();
        change(&mut python);
        error(&python)
    };
    insta::assert_snapshot!([
        with(&|scene| *scene.at("metadata").at("sdc_id") = text("nobody")),
        with(&|scene| *scene.at("id") = text("../x")),
        with(&|scene| *scene.at("tracks").pairs()[0].1.at("state").at("position") = text("here")),
        with(&|scene| *scene.at("tracks").pairs()[0].1.at("state").at("velocity") = Python::Array(vec![2], vec![0.0; 2])),
        with(&|scene| scene.at("tracks").pairs()[0].1.at("state").pairs().clear()),
        with(&|scene| *scene.at("metadata").at("ts") = Python::Array(vec![1], vec![0.0])),
        with(&|scene| *scene.at("metadata").at("ts") = Python::Array(vec![500], (0..500).map(f64::from).collect())),
        with(&|scene| *scene.at("map_features") = text("no map")),
    ].join("\n"), @r#"
    sdc_id: there is no track nobody
    the scene cannot be used: scene id "../x" is not 1 to 128 of A-Z a-z 0-9 _ . - beginning with something but a dot
    track 1: position: it is a text, where numbers should be
    track 1: velocity: it has 2 rows of 1 numbers, where rows of 2 or 3 should be
    track 1: position: it is missing
    ts: it has 1 rows of 1 numbers, where a time a step should be
    steps are 1.000 s apart, and scenes are driven in steps of 0.1 s
    map_features: it is a text, where a dict should be
    "#);
}

fn put(folder: &Path, name: &str, bytes: &[u8]) {
    let path = folder.join(name);
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(path, bytes).unwrap();
}

fn named(id: &str) -> Vec<u8> {
    let mut python = pickled::current(&generated("following"));
    *python.at("id") = text(id);
    python.pickle()
}

fn open(folder: &Path, input: &str) -> Result<SceneSet, SetError> {
    SceneSet::open(&[folder.join(input).to_string_lossy().into_owned()])
}

fn ids(folder: &Path, input: &str) -> Vec<String> {
    open(folder, input).unwrap().entries().iter().map(|entry| entry.id.to_string()).collect()
}

fn notes(folder: &Path, input: &str) -> Vec<String> {
    let set = open(folder, input).unwrap();
    set.notes().iter().map(|note| note.to_string().replace(&*folder.to_string_lossy(), "HERE")).collect()
}

#[test]
fn a_folder_without_shards_gives_its_pickles_by_number_and_a_database_those_of_its_index() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for (name, id) in
        [("flat/10.pkl", "ten"), ("flat/9.pkl", "nine"), ("flat/sd_x.tfrecord-0_b.pkl", "b"), ("flat/more/0.pkl", "c")]
    {
        put(folder, name, &named(id));
    }
    assert_eq!(ids(folder, "flat"), ["nine", "ten", "b", "c"]);
    assert_eq!(ids(folder, "flat/*.pkl"), ["nine", "ten", "b"]);
    assert_eq!(ids(folder, "flat/9.pkl"), ["nine"]);
    assert!(notes(folder, "flat").is_empty());
    // The mapping says which, and where.
    let mapping = dict([
        ("2.pkl", text("")),
        ("10.pkl", text("part")),
        ("gone.pkl", text("part")),
        ("up.pkl", text("../flat/more")),
    ]);
    for (name, id) in
        [("db/2.pkl", "two"), ("db/3.pkl", "unlisted"), ("db/part/10.pkl", "ten"), ("flat/more/up.pkl", "up")]
    {
        put(folder, name, &named(id));
    }
    put(folder, "db/dataset_mapping.pkl", &mapping.pickle());
    put(folder, "db/dataset_summary.pkl", b"not looked at");
    assert_eq!(ids(folder, "db"), ["two", "ten", "up"]);
    assert_eq!(notes(folder, "db"), ["HERE/db/dataset_mapping.pkl: names files that are not there: part/gone.pkl"]);
    assert_eq!(notes(folder, "db/*.pkl"), ["HERE/db/*.pkl: passed over dataset_mapping.pkl, dataset_summary.pkl"]);
    // Without one, the summary; without any use in it, all.
    fs::remove_file(folder.join("db/dataset_mapping.pkl")).unwrap();
    put(folder, "db/dataset_summary.pkl", &dict([("3.pkl", dict([])), ("2.pkl", dict([]))]).pickle());
    assert_eq!(ids(folder, "db"), ["two", "unlisted"]);
    put(folder, "db/dataset_summary.pkl", &dict([("old.pkl", dict([]))]).pickle());
    assert_eq!(ids(folder, "db"), ["two", "unlisted", "ten"]);
    assert_eq!(
        notes(folder, "db"),
        ["HERE/db/dataset_summary.pkl: no file that it names is there; all pickles of its folder are taken"]
    );
    for (key, to) in [("a.pkl", "/etc"), ("../a.pkl", ""), ("a/b.pkl", "")] {
        put(folder, "db/dataset_mapping.pkl", &dict([(key, text(to))]).pickle());
        let error = open(folder, "db").unwrap_err();
        assert!(matches!(&error, SetError::Database { .. }), "{error}");
    }
}

#[test]
fn pickles_beside_shards_are_passed_over() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let mut shard = Vec::new();
    tfrecord::append_record(&mut shard, &womd::write(&generated("curve")));
    put(folder, "all/a.tfrecord", &shard);
    put(folder, "all/deep/0.pkl", &named("zero"));
    put(folder, "all/1.pkl", &named("one"));
    assert_eq!(ids(folder, "all"), ["curve"]);
    assert_eq!(notes(folder, "all"), ["HERE/all: passed over 0.pkl, 1.pkl"]);
    assert_eq!(ids(folder, "all/*.*"), ["curve"]);
    assert_eq!(ids(folder, "all/deep"), ["zero"]);
}

#[test]
fn a_pickle_is_loaded_hashed_indexed_and_exported_as_any_scene() {
    use sha2::Digest as _;
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    put(folder, "scenes/0.pkl", &named("zero"));
    put(folder, "scenes/bad.pkl", &dict([("id", text("bad")), ("version", text("x"))]).pickle());
    put(folder, "scenes/harm.pkl", b"\x80\x02cos\nsystem\n.");
    let (set, bad) = SceneSet::survey(&[folder.join("scenes").to_string_lossy().into_owned()]).unwrap();
    assert_eq!(set.entries().iter().map(|entry| entry.id.as_str()).collect::<Vec<_>>(), ["zero", "bad"]);
    let told = bad[0].to_string();
    assert!(
        told.ends_with("scenes/harm.pkl: byte 2: the pickle calls for os.system, which no scene needs: it was not run"),
        "{told}"
    );
    let digest: String = sha2::Sha256::digest(named("zero")).iter().map(|byte| format!("{byte:02x}")).collect();
    assert_eq!(set.sha256(0).unwrap(), digest);
    let (scene, findings) = set.load_hashed(0).unwrap();
    assert!(lint::lint(&scene, &findings).iter().all(|lint| lint.severity() < lint::Severity::Warning));
    assert_eq!(womd::read(&set.payload(0).unwrap()).unwrap().0.tracks().len(), scene.tracks().len());
    assert!(set.load(1).unwrap_err().to_string().ends_with("bad.pkl: the pickle is no scene: it has no tracks"));
    fs::remove_file(folder.join("scenes/harm.pkl")).unwrap();
    fs::write(folder.join("scenes.index"), set.index(folder)).unwrap();
    let indexed = open(folder, "scenes.index").unwrap();
    assert_eq!(indexed.entries(), set.entries());
    assert_eq!(indexed.load(0).unwrap().0, scene);
    // Another file in its place is noticed, also where it tells the same id.
    let mut other = named("zero");
    other.push(0);
    put(folder, "scenes/0.pkl", &other);
    assert!(set.load(0).unwrap_err().to_string().ends_with("0.pkl: the file has changed since it was opened"));
    assert!(matches!(open(folder, "scenes.index"), Err(SetError::Index { .. })));
}

fn scene(data: &Path, file: &str) -> Arc<Scene> {
    let set = open(data, file).unwrap();
    assert_eq!(set.entries().len(), 1, "{file}");
    set.load(0).unwrap().0
}

#[test]
fn a_real_scene_is_the_same_by_both_ways() {
    let Some(data) = real_data() else { return };
    let database = "scenarionet/database-waymo-9s-nomapping/sd_training.tfrecord-00000-of-01000_";
    for (pickle, record) in [
        ("scenarionet/flat-waymo-20s/0.pkl".to_owned(), "20s/6f85f27e0243fc10"),
        ("scenarionet/flat-waymo-20s/1.pkl".to_owned(), "20s/b36a6d0bc9e525bc"),
        (
            "scenarionet/single/sd_training_20s.tfrecord-00000-of-01000_53e9adfdac0eb822.pkl".to_owned(),
            "20s/53e9adfdac0eb822",
        ),
        ("scenarionet/single/sd_waymo_v1.2_eb4b91b10ca94ff2.pkl".to_owned(), "20s/eb4b91b10ca94ff2"),
        (format!("{database}2a1e44d405a6833f.pkl"), "9s/2a1e44d405a6833f"),
        (format!("{database}8a346109094cd5aa.pkl"), "9s/8a346109094cd5aa"),
        (format!("{database}c403d5992cab9e0.pkl"), "9s/c403d5992cab9e0"),
        ("scenarionet/legacy/class-wrapped_8799c31b5be1f312.pkl".to_owned(), "20s-partial/8799c31b5be1f312"),
    ] {
        assert!(scene(&data, &pickle) == scene(&data, &format!("womd-derived/{record}.tfrecord")), "{pickle}");
    }
}

#[test]
fn every_real_layout_loads_and_has_a_route() {
    let Some(data) = real_data() else { return };
    let count = |folder: &str| {
        let set = open(&data, &format!("scenarionet/{folder}")).unwrap();
        for (index, entry) in set.entries().iter().enumerate() {
            let (scene, findings) = set.load(index).unwrap();
            assert_eq!(scene.id(), &entry.id);
            assert!(scene.av().states.iter().all(Option::is_some), "{}", entry.id);
            let found = lint::lint(&scene, &findings);
            assert!(found.iter().all(|lint| lint.severity() < lint::Severity::Error), "{}: {found:?}", entry.id);
            // The AV is as it was: no box in another's, none beyond the road's edge.
            assert!(!found.iter().any(|lint| ["av-overlaps", "av-off-road"].contains(&lint.code())), "{}", entry.id);
        }
        (set.entries().len(), set.notes().len())
    };
    assert_eq!(count("single"), (2, 0));
    assert_eq!(count("flat-waymo-20s"), (2, 0));
    assert_eq!(count("legacy"), (2, 0));
    assert_eq!(count("database-waymo-9s-nomapping"), (3, 0));
    assert_eq!(count("database-nuscenes-2"), (2, 1), "its index names what is not there");
    assert_eq!(count("database-nuscenes-4"), (2, 0));
    assert_eq!(count("database-nested-nuscenes"), (1, 1), "nine of ten are not there");
}
