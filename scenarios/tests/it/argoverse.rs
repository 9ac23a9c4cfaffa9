//! Argoverse 2's scenes: what its own library writes and reads, folders, what is refused, and what a table claims.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;

use arrow_array::{Float64Array, Int64Array, StringArray};
use scenarios::argoverse::{self, ArgoverseError, TableError};
use scenarios::fuzzing::tabled::{self, Columns};
use scenarios::generated::Family;
use scenarios::{RecordProblem, SceneSet, SetError, Source, lint, womd};
use serde_json::Value;
use world::geometry::{Point, Point3, angle_difference, polygon_contains};
use world::map::{Lane, LaneKind, MapId, RoadLineKind};
use world::scene::{AgentKind, Scene};

/// What `checks/argoverse.py` wrote by Argoverse's own library, and what that reads in it.
fn written() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/argoverse")
}

fn open(path: &Path) -> SceneSet {
    SceneSet::open(&[path.display().to_string()]).unwrap()
}

fn bad(path: &Path) -> String {
    let (_, mut bad) = SceneSet::survey(&[path.display().to_string()]).unwrap();
    bad.remove(0).to_string()
}

fn floats(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

fn points(value: &Value) -> Vec<Point> {
    value.as_array().unwrap().iter().map(floats).map(|point| Point::new(point[0], point[1])).collect()
}

fn text<'a>(value: &'a Value, key: &str) -> &'a str {
    value[key].as_str().unwrap()
}

fn ids(value: &Value) -> Vec<MapId> {
    value.as_array().unwrap().iter().map(|id| MapId(id.as_i64().unwrap())).collect()
}

/// Holds the scene in `folder` to what Argoverse's own library reads there.
fn hold(folder: &Path) {
    let read: Value = serde_json::from_slice(&fs::read(folder.join("read.json")).unwrap()).unwrap();
    let set = open(&folder.join(text(&read, "folder")));
    assert_eq!(set.entries().len(), 1);
    let (scene, findings) = set.load(0).unwrap();
    assert_eq!(scene.id().as_str(), text(&read, "id"));
    for (ours, theirs) in scene.timestamps().iter().zip(floats(&read["seconds"])) {
        // Theirs pass through floats of 3e17 ns.
        assert!((ours - theirs).abs() < 1e-6, "{ours} s, not {theirs}");
    }
    assert_eq!(scene.current_time_index() as u64 + 1, read["observed"].as_u64().unwrap());
    hold_tracks(&scene, &read);
    hold_lanes(&scene, &read);
    hold_areas(&scene, &read);
    let lints = lint::lint(&scene, &findings);
    let codes: Vec<&str> = lints.iter().map(lint::Lint::code).collect();
    assert_eq!(codes, ["sizes-assumed", "no-speed-limits", "short", "no-signals"], "{lints:?}");
}

fn hold_tracks(scene: &Scene, read: &Value) {
    let tracks = read["tracks"].as_array().unwrap();
    assert_eq!(scene.tracks().len(), tracks.len());
    let mut focal = None;
    for theirs in tracks {
        let name = text(theirs, "id");
        let track = match name.parse::<i32>() {
            Ok(id) => scene.tracks().iter().find(|track| track.id.0 == id).unwrap(),
            Err(_) => scene.av(),
        };
        let (kind, length) = match text(theirs, "type") {
            _ if name == "AV" => (AgentKind::Vehicle, 4.9),
            "vehicle" => (AgentKind::Vehicle, 4.6),
            "bus" => (AgentKind::Vehicle, 11.2),
            "motorcyclist" => (AgentKind::Vehicle, 2.1),
            "pedestrian" => (AgentKind::Pedestrian, 0.9),
            "cyclist" => (AgentKind::Cyclist, 1.9),
            "riderless_bicycle" => (AgentKind::Other, 1.7),
            "construction" => (AgentKind::Other, 0.4),
            _ => (AgentKind::Other, 1.0),
        };
        assert_eq!(track.kind, kind, "{name}");
        let states = theirs["states"].as_array().unwrap();
        assert_eq!(track.states.iter().flatten().count(), states.len(), "{name}");
        let mut before: Option<f64> = None;
        for state in states.iter().map(floats) {
            let ours = track.states[state[0] as usize].unwrap();
            // Their texts are read to the last bit but one.
            for (ours, theirs) in [ours.x, ours.y, ours.velocity_x, ours.velocity_y].into_iter().zip([1, 2, 4, 5]) {
                assert!((ours - state[theirs]).abs() < 1e-12, "{name}");
            }
            assert!(angle_difference(ours.heading, state[3]).abs() < 1e-12, "{name}");
            assert!(before.is_none_or(|before| (ours.heading - before).abs() < 1.0), "{name}: headings go on");
            assert_eq!((ours.length, ours.z), (length, 0.5 * ours.height));
            before = Some(ours.heading);
        }
        let place = scene.tracks().iter().position(|other| other.id == track.id).unwrap();
        let is_asked_for = scene.tracks_to_predict().iter().any(|task| task.track_index == place);
        assert_eq!(is_asked_for, theirs["category"].as_u64().unwrap() >= 2, "{name}");
        if name == text(read, "focal") {
            focal = Some(track.id);
        }
    }
    assert_eq!(scene.objects_of_interest(), [focal.unwrap()]);
}

fn hold_lanes(scene: &Scene, read: &Value) {
    let lanes = read["lanes"].as_array().unwrap();
    assert_eq!(scene.map().lanes.len(), lanes.len());
    let neighbor = |theirs: &Value, side: &str| theirs[side].as_i64().map(MapId);
    let direction = |lane: &Lane| lane.centerline[lane.centerline.len() - 1].xy() - lane.centerline[0].xy();
    let of = |id: MapId| scene.map().lanes.iter().find(|lane| lane.id == id).unwrap();
    let mut oncoming = 0;
    for (lane, theirs) in scene.map().lanes.iter().zip(lanes) {
        assert_eq!(Some(lane.id.0), theirs["id"].as_i64());
        let line = points(&theirs["centerline"]);
        assert_eq!(lane.centerline.len(), line.len(), "lane {}", lane.id);
        for (ours, theirs) in lane.centerline.iter().zip(line) {
            assert!(ours.xy().distance(theirs) < 1e-9, "lane {}: {ours:?}, not {theirs:?}", lane.id);
            assert_eq!(ours.z, 0.0);
        }
        assert_eq!((&lane.entries, &lane.exits), (&ids(&theirs["predecessors"]), &ids(&theirs["successors"])));
        assert_eq!(lane.interpolating, theirs["inside"].as_bool().unwrap());
        let kind = if text(theirs, "type") == "BIKE" { LaneKind::BikeLane } else { LaneKind::SurfaceStreet };
        assert_eq!((lane.kind, lane.speed_limit()), (kind, None));
        for (side, ours) in [("left", &lane.left_neighbors), ("right", &lane.right_neighbors)] {
            let along = neighbor(theirs, side).filter(|id| direction(of(*id)).dot(direction(lane)) > 0.0);
            oncoming += usize::from(neighbor(theirs, side).is_some() && along.is_none());
            assert_eq!(ours.iter().map(|neighbor| neighbor.lane).next(), along, "lane {}, {side}", lane.id);
        }
        for (side, ours) in [("left_mark", &lane.left_boundaries), ("right_mark", &lane.right_boundaries)] {
            let kind = match text(theirs, side) {
                "NONE" => None,
                "DASHED_WHITE" => Some(RoadLineKind::BrokenSingleWhite),
                "SOLID_WHITE" => Some(RoadLineKind::SolidSingleWhite),
                "DOUBLE_SOLID_YELLOW" => Some(RoadLineKind::SolidDoubleYellow),
                "DASH_SOLID_YELLOW" => Some(RoadLineKind::PassingDoubleYellow),
                _ => Some(RoadLineKind::Unknown),
            };
            assert_eq!(ours.first().map(|boundary| boundary.kind), kind, "lane {}", lane.id);
        }
    }
    assert!(oncoming > 0, "no lane has one of oncoming traffic beside it: nothing was tried");
}

/// Edges are where the drivable areas end, as a union, and not where tiles meet or the map ends.
fn hold_areas(scene: &Scene, read: &Value) {
    let areas: Vec<Vec<Point>> = read["areas"].as_array().unwrap().iter().map(points).collect();
    let drivable = |point: Point| areas.iter().any(|area| polygon_contains(area.iter().copied(), point));
    let mut length = 0.0;
    for pair in scene.map().road_edges.iter().flat_map(|edge| edge.polyline.windows(2)) {
        let (from, to) = (pair[0].xy(), pair[1].xy());
        let (step, middle) = (to - from, Point::new(0.5 * (from.x + to.x), 0.5 * (from.y + to.y)));
        let beside = |meters: f64| {
            Point::new(middle.x - meters * step.y / step.norm(), middle.y + meters * step.x / step.norm())
        };
        assert!(drivable(beside(0.2)) && !drivable(beside(-0.2)), "no edge at {middle:?}");
        length += step.norm();
    }
    // All but the ends of the four arms, 17 and 7 m wide, and the two cuts from either side.
    let around: f64 = areas.iter().flat_map(|area| area.windows(2)).map(|pair| pair[0].distance(pair[1])).sum();
    assert!((around - length - (4.0 * 17.0 + 2.0 * 17.0 + 2.0 * 7.0)).abs() < 1e-6, "{around} {length}");
    let crossings: Vec<Vec<Point>> = read["crossings"].as_array().unwrap().iter().map(points).collect();
    assert_eq!(scene.map().crosswalks.len(), crossings.len());
    for (ours, theirs) in scene.map().crosswalks.iter().zip(crossings).take(2) {
        assert_eq!(ours.polygon.iter().map(|point| point.xy()).collect::<Vec<_>>(), theirs);
    }
    // The last has edges that run against each other: as theirs goes round it, it crosses itself.
    let last = &scene.map().crosswalks[2];
    assert!(last.contains(Point::new(3.0, 13.2)) && last.contains(Point::new(-3.0, 14.0)));
}

#[test]
fn what_argoverses_own_library_writes_is_read_as_that_reads_it() {
    hold(&written());
}

/// What its library imports where scenes are written and read; it asks for more, gigabytes of it.
const IMPORTS: [&str; 11] = [
    "numpy",
    "pandas",
    "pyarrow",
    "scipy",
    "pyproj",
    "polars",
    "numba",
    "pillow",
    "matplotlib",
    "universal-pathlib",
    "opencv-python-headless",
];

#[test]
#[ignore = "installs Argoverse's library, 700 MB with what it imports: minutes"]
fn the_library_of_today_writes_and_reads_the_same() {
    let environment = std::env::current_exe().unwrap().ancestors().nth(3).unwrap().join("argoverse-venv");
    let python = environment.join("bin/python");
    let ran = |command: &mut Command| command.output().is_ok_and(|output| output.status.success());
    let ready = ran(Command::new(&python).args(["-c", "import av2, cv2"]))
        || (ran(Command::new("python3").args(["-m", "venv"]).arg(&environment))
            && ran(Command::new(&python).args(["-m", "pip", "install", "--quiet"]).args(IMPORTS))
            && ran(Command::new(&python).args(["-m", "pip", "install", "--quiet", "--no-deps", "av2"])));
    if !ready {
        eprintln!("skipped: no python3 with venv, or no package index that has av2");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("checks/argoverse.py");
    let output = Command::new(&python).arg(script).arg(folder.path()).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    hold(folder.path());
}

#[test]
fn the_test_split_is_refused_for_it_withholds_the_future() {
    let set = open(&written().join("test"));
    let error = set.load(0).unwrap_err();
    assert!(
        error.to_string().ends_with(
            "the log is there up to step 49 of 110 alone: it is of the test split, which withholds the future"
        ),
        "{error}"
    );
    assert_eq!(error.hint(), "take scenes of the train or val split");
}

/// A scene of ours, as a table and a map.
fn scene(family: &str) -> Scene {
    let payload = Family::named(family).unwrap().payload(family, 1, 0, &Default::default()).unwrap();
    womd::read(&payload).unwrap().0
}

fn packed(scene: &Scene) -> (Columns, Vec<u8>) {
    (tabled::columns(scene, 50), tabled::archive(scene.map(), &[]).to_string().into_bytes())
}

fn table(columns: Columns) -> Vec<u8> {
    tabled::table(columns, Default::default()).unwrap()
}

/// Writes a scene's files into `folder`, under this name and the scene's.
fn write(folder: &Path, name: &str, scene: &Scene) {
    let (columns, map) = packed(scene);
    fs::create_dir_all(folder).unwrap();
    fs::write(folder.join(name), table(columns)).unwrap();
    fs::write(folder.join(format!("log_map_archive_{}.json", scene.id())), map).unwrap();
}

#[test]
fn every_way_to_name_scenes_finds_them() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    for family in ["following", "curve"] {
        write(&root.join("val").join(family), &format!("scenario_{family}.parquet"), &scene(family));
    }
    // A run's results are no scene.
    fs::write(root.join("results.parquet"), b"PAR1").unwrap();
    let ids = |input: &str| {
        let set = SceneSet::open(&[root.join(input).display().to_string()]).unwrap();
        assert!(set.notes().is_empty(), "{:?}", set.notes());
        set.entries().iter().map(|entry| entry.id.to_string()).collect::<Vec<_>>()
    };
    assert_eq!(ids(""), ["curve", "following"]);
    assert_eq!(ids("val/*"), ["curve", "following"]);
    assert_eq!(ids("val/curve"), ["curve"]);
    assert_eq!(ids("val/*/scenario_*.parquet"), ["curve", "following"]);
    assert_eq!(ids("val/curve/scenario_curve.parquet"), ["curve"]);
    let set = SceneSet::open(&[root.join("val/curve/*").display().to_string()]).unwrap();
    assert_eq!((set.entries().len(), set.notes().len()), (1, 1), "the map is passed over, and said so");
    // Under another name the table tells its id, and a map that is alone is its map.
    let moved = root.join("moved");
    fs::create_dir(&moved).unwrap();
    fs::copy(root.join("val/curve/scenario_curve.parquet"), moved.join("a.parquet")).unwrap();
    fs::copy(root.join("val/curve/scenario_curve.parquet"), moved.join("b")).unwrap();
    fs::copy(root.join("val/curve/log_map_archive_curve.json"), moved.join("log_map_archive_x.json")).unwrap();
    assert_eq!((ids("moved/a.parquet"), ids("moved/b")), (vec!["curve".to_owned()], vec!["curve".to_owned()]));
    open(&moved.join("a.parquet")).load(0).unwrap();
}

#[test]
fn a_set_of_tables_is_indexed_verified_and_noticed_to_change() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "scenario_curve.parquet", &scene("curve"));
    let set = open(folder.path());
    set.verify().unwrap();
    let index = folder.path().join("scenes.index");
    fs::write(&index, set.index(folder.path())).unwrap();
    let indexed = open(&index);
    assert_eq!(indexed.entries(), set.entries());
    assert_eq!(indexed.load(0).unwrap(), set.load_hashed(0).unwrap());
    assert_eq!(indexed.sha256(0).unwrap(), set.known_sha256(0).unwrap());
    // What is exported is the scene.
    let exported = womd::read(&set.payload(0).unwrap()).unwrap().0;
    assert_eq!(exported.tracks().len(), set.load(0).unwrap().0.tracks().len());
    let Source::Table { map, .. } = &set.entries()[0].source else { panic!("no table") };
    fs::write(&map.path, b"{}").unwrap();
    assert!(matches!(set.load(0), Err(SetError::Record(error)) if matches!(error.problem, RecordProblem::Changed)));
    assert!(matches!(SceneSet::open(&[index.display().to_string()]), Err(SetError::Index { .. })));
}

#[test]
fn a_scene_without_its_map_or_by_another_name_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    write(root, "scenario_other.parquet", &scene("curve"));
    let error = open(root).load(0).unwrap_err().to_string();
    assert!(error.ends_with("the file is of the scene other by its name, and of curve by its content"), "{error}");
    fs::write(root.join("log_map_archive_a.json"), b"{").unwrap();
    assert!(
        bad(root).ends_with("there is no map beside it: no log_map_archive_other.json"),
        "two, of which none is its: {}",
        bad(root)
    );
    fs::rename(root.join("log_map_archive_a.json"), root.join("log_map_archive_other.json")).unwrap();
    fs::rename(root.join("scenario_other.parquet"), root.join("scenario_curve.parquet")).unwrap();
    fs::rename(root.join("log_map_archive_other.json"), root.join("log_map_archive_curve.json")).unwrap();
    let error = open(root).load(0).unwrap_err().to_string();
    assert!(error.contains("the map beside it cannot be used: EOF while parsing an object at line 1"), "{error}");
}

fn refused(change: impl FnOnce(&mut Columns)) -> ArgoverseError {
    let (mut columns, map) = packed(&scene("following"));
    change(&mut columns);
    argoverse::read(&table(columns), &map).unwrap_err()
}

/// The column of this name, changed.
fn ints(columns: &mut Columns, name: &str, change: impl Fn(usize, i64) -> i64) {
    let column = &mut columns.iter_mut().find(|(column, _)| *column == name).unwrap().1;
    let values = column.as_any().downcast_ref::<Int64Array>().unwrap().values().to_vec();
    *column =
        Arc::new(Int64Array::from_iter_values(values.into_iter().enumerate().map(|(row, value)| change(row, value))));
}

#[test]
fn what_is_wrong_with_a_table_is_told() {
    let said = |change: fn(&mut Columns)| refused(change).to_string();
    assert_eq!(said(|columns| drop(columns.remove(6))), "the table cannot be used: it has no column position_y");
    assert_eq!(
        said(|columns| columns.iter_mut().for_each(|(_, column)| *column = column.slice(0, 0))),
        "the table has no rows"
    );
    let no_av =
        |columns: &mut Columns| columns[1].1 = Arc::new(StringArray::from_iter_values(vec!["1"; columns[1].1.len()]));
    assert!(matches!(refused(no_av), ArgoverseError::Twice { .. }), "all states are of one track");
    assert_eq!(
        said(|columns| {
            let names = columns[1].1.as_any().downcast_ref::<StringArray>().unwrap();
            let renamed = names.iter().map(|name| name.map(|name| name.replace("AV", "ego")));
            columns[1].1 = Arc::new(renamed.collect::<StringArray>());
        }),
        "no track is called AV"
    );
    let far = said(|columns| ints(columns, "timestep", |row, step| if row == 0 { -1 } else { step }));
    assert!(far.ends_with("has a state at step -1, but the scene has 200 steps"), "{far}");
    assert_eq!(
        said(|columns| ints(columns, "end_timestamp", |_, end| 2 * end)),
        "steps are 0.205 s apart, and scenes are driven in steps of 0.1 s"
    );
    assert_eq!(
        said(|columns| columns[4].1 = columns[5].1.clone()),
        "the table cannot be used: its column timestep has no whole numbers"
    );
    let nothing = said(|columns| columns[4].1 = Arc::new(Int64Array::from(vec![None; columns[4].1.len()])));
    assert_eq!(nothing, "the table cannot be used: its column timestep has nothing in row 0");
}

#[test]
fn a_small_table_takes_little_memory_whatever_it_claims() {
    // More steps than any scene has, for every track.
    let steps = |columns: &mut Columns| {
        ints(columns, "num_timestamps", |_, _| 1 << 30);
        ints(columns, "end_timestamp", |_, _| (1 << 30) * 100_000_000);
    };
    assert!(matches!(refused(steps), ArgoverseError::TooLarge(_)));
    // A text of a megabyte.
    let text = |columns: &mut Columns| {
        columns.iter_mut().for_each(|(_, column)| *column = column.slice(0, 3));
        columns[2].1 = Arc::new(StringArray::from_iter_values(vec!["x".repeat(1 << 20); 3]));
    };
    assert_eq!(refused(text), ArgoverseError::Table(TableError::Text { column: "object_type" }));
    // More rows than any scene has: a page of run lengths is small.
    let rows = |columns: &mut Columns| {
        for (_, column) in columns.iter_mut() {
            let row = column.slice(0, 1);
            let indices = Int64Array::from(vec![0; 1_100_000]);
            *column = repeated(&row, &indices);
        }
    };
    assert_eq!(refused(rows), ArgoverseError::Table(TableError::OutOfBounds("it has more than 1,000,000 rows")));
    // A map with a lane of a hundred thousand kilometres.
    let scene = scene("following");
    let (columns, _) = packed(&scene);
    let mut map = scene.map().as_ref().clone();
    map.lanes[0].centerline = vec![Point3::default(), Point3::new(1e8, 0.0, 0.0)];
    let map = tabled::archive(&map, &[]).to_string();
    assert!(matches!(argoverse::read(&table(columns), map.as_bytes()), Err(ArgoverseError::TooLarge(_))));
}

/// A column of one value, repeated.
fn repeated(row: &arrow_array::ArrayRef, indices: &Int64Array) -> arrow_array::ArrayRef {
    use arrow_array::{Array, BooleanArray};
    let count = indices.len();
    if let Some(values) = row.as_any().downcast_ref::<Int64Array>() {
        Arc::new(Int64Array::from(vec![values.value(0); count]))
    } else if let Some(values) = row.as_any().downcast_ref::<Float64Array>() {
        Arc::new(Float64Array::from(vec![values.value(0); count]))
    } else if let Some(values) = row.as_any().downcast_ref::<BooleanArray>() {
        Arc::new(BooleanArray::from(vec![values.value(0); count]))
    } else {
        let values = row.as_any().downcast_ref::<StringArray>().unwrap();
        Arc::new(StringArray::from_iter_values(vec![values.value(0); count]))
    }
}

#[test]
fn times_may_be_floats_as_who_writes_what_was_read_has_them() {
    let (mut columns, map) = packed(&scene("following"));
    let whole = argoverse::read(&table(columns.clone()), &map).unwrap();
    for name in ["start_timestamp", "end_timestamp"] {
        let column = &mut columns.iter_mut().find(|(column, _)| *column == name).unwrap().1;
        let values = column.as_any().downcast_ref::<Int64Array>().unwrap().values();
        *column = Arc::new(Float64Array::from_iter_values(values.iter().map(|value| *value as f64)));
    }
    assert_eq!(argoverse::read(&table(columns), &map).unwrap(), whole);
}

#[test]
fn a_scene_of_ours_comes_back_by_tables() {
    for packing in tabled::packings() {
        let scene = scene("urban");
        let (columns, map) = packed(&scene);
        let (again, _) = argoverse::read(&tabled::table(columns, packing).unwrap(), &map).unwrap();
        assert_eq!(again.tracks().len(), scene.tracks().len());
        for track in scene.tracks() {
            let other = again.tracks().iter().find(|other| other.id == track.id || track.id == scene.av().id).unwrap();
            let other = if track.id == scene.av().id { again.av() } else { other };
            let places = |track: &world::scene::Track| -> Vec<Option<[f64; 4]>> {
                track.states.iter().map(|s| s.map(|s| [s.x, s.y, s.velocity_x, s.velocity_y])).collect()
            };
            assert_eq!(places(other), places(track));
        }
        let drivable = scene.map().lanes.iter().filter(|lane| lane.centerline.len() > 1).count();
        assert_eq!(again.map().lanes.len(), drivable);
    }
}
