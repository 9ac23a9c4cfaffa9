//! Windows of generated scenes, and of real ones against those of the authors.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use network::verify;
use proptest::prelude::*;
use scenarios::SceneSet;
use vectors::{Npz, Quantity, Report, absolute, worst_deviation};
use world::scene::Scene;

use super::*;

const RECIPE: Recipe = Recipe { features: Whose::Mended, stride: 10, others: false };

/// A set of `count` generated scenes of each of two families.
fn set(folder: &Path, count: usize) -> SceneSet {
    let path = folder.join("set.toml");
    let generate = |family: &str| format!("[[generate]]\nfamily = \"{family}\"\nseed = 3\ncount = {count}\n");
    fs::write(&path, generate("following") + &generate("cut-in")).unwrap();
    SceneSet::open(&[path.display().to_string()]).unwrap()
}

fn make(set: &SceneSet, out: &Path, recipe: Recipe, jobs: usize) -> Prepared {
    let split = Split::Share(0.5);
    let order = Order { set, recipe: &recipe, split: &split, out, jobs };
    prepare(&order, &AtomicBool::new(false), &|_, _| {}).unwrap()
}

fn windows_of(set: &SceneSet, recipe: &Recipe) -> Vec<Window> {
    (0..set.entries().len()).flat_map(|index| cut(&set.load(index).unwrap().0, recipe).windows).collect()
}

#[test]
fn a_file_holds_what_was_cut() {
    let folder = tempfile::tempdir().unwrap();
    let (set, out) = (set(folder.path(), 2), folder.path().join("some.windows"));
    for features in [Whose::Authors, Whose::Mended] {
        let recipe = Recipe { features, stride: 35, others: true };
        let expected = windows_of(&set, &recipe);
        let prepared = make(&set, &out, recipe, 2);
        let windows = Windows::open(&out).unwrap();
        assert_eq!((windows.len(), *windows.recipe()), (expected.len(), recipe));
        assert_eq!(prepared.windows, [windows.training().len(), windows.validation().len()]);
        assert_eq!(prepared.bytes, fs::metadata(&out).unwrap().len());
        for (index, expected) in expected.iter().enumerate() {
            assert!(windows.get(index).unwrap() == *expected, "window {index}");
        }
        assert!(matches!(windows.get(expected.len()), Err(WindowsError::Index { .. })));
    }
    let left: Vec<PathBuf> = fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().path()).collect();
    assert_eq!(left.len(), 2, "the set and the file alone: {left:?}");
}

#[test]
fn a_sketch_is_the_whole_frame() {
    let folder = tempfile::tempdir().unwrap();
    let (scene, _) = set(folder.path(), 1).load(0).unwrap();
    let features = network::features::SceneFeatures::new(scene.map(), network::features::Settings::Authors);
    let frame = features.at(&network::features::Window::logged(&scene, 30).unwrap()).frame;
    assert!(Sketch::of(&frame).frame() == frame);
}

#[test]
fn a_window_knows_what_follows() {
    let folder = tempfile::tempdir().unwrap();
    let (scene, _) = set(folder.path(), 1).load(0).unwrap();
    let cut = cut(&scene, &RECIPE);
    let steps: Vec<u32> = cut.windows.iter().map(|window| window.step).collect();
    assert_eq!(steps, (20..scene.steps() as u32 - 50).step_by(10).collect::<Vec<u32>>());
    for window in &cut.windows {
        let now = scene.av().states[window.step as usize].unwrap().pose();
        for k in [0, 49] {
            let after = now.pose_to_body(scene.av().states[window.step as usize + 1 + k].unwrap().pose());
            let [x, y, heading, ..] = window.future[0][k].map(f64::from);
            let own = [x, y, heading];
            assert!(window.seen[0][k] && worst_deviation(own, &[after.x, after.y, after.heading], absolute) < 1e-4);
        }
        assert_eq!(window.line.len(), 1200);
        let at_av = f64::from(window.line[200][0]);
        assert!(at_av.abs() < 0.2, "{at_av}");
    }
}

#[test]
fn a_limit_that_is_not_known_is_no_wish_to_stand() {
    let folder = tempfile::tempdir().unwrap();
    let mut parts = Scene::clone(&set(folder.path(), 1).load(0).unwrap().0).into_parts();
    parts.map.lanes.iter_mut().for_each(|lane| lane.speed_limit_mph = 0.0);
    let scene = parts.check().unwrap().0;
    let fastest = |features| {
        let window = cut(&scene, &Recipe { features, ..RECIPE }).windows.remove(0);
        window.line.iter().map(|row| row[4]).fold(0.0, f32::max)
    };
    assert!(fastest(Whose::Authors) <= 1.0);
    assert!((10.0..12.0).contains(&fastest(Whose::Mended)));
}

#[test]
fn other_vehicles_drive_where_they_are_seen_and_move() {
    let folder = tempfile::tempdir().unwrap();
    let (scene, _) = set(folder.path(), 1).load(0).unwrap();
    let recipe = Recipe { others: true, ..RECIPE };
    let (alone, all) = (cut(&scene, &RECIPE).windows, cut(&scene, &recipe).windows);
    assert!(all[..alone.len()] == alone[..] && all.len() > alone.len());
    for window in &all[alone.len()..] {
        assert_ne!(window.av, scene.av().id.0);
        assert!(window.seen[0].iter().all(|seen| *seen));
        let [x, y, heading, ..] = window.sketch.ego[19];
        assert!(x == 0.0 && y == 0.0 && heading == 0.0, "who drives is where its frame begins");
    }
}

#[test]
fn another_vehicle_far_from_every_lane_does_not_drive() {
    let folder = tempfile::tempdir().unwrap();
    let (scene, _) = set(folder.path(), 1).load(0).unwrap();
    let recipe = Recipe { others: true, ..RECIPE };
    let before = cut(&scene, &recipe);
    let away = before.windows.last().unwrap().av;
    let mut parts = (*scene).clone().into_parts();
    let track = parts.tracks.iter_mut().find(|track| track.id.0 == away).unwrap();
    let heading = track.states.iter().flatten().next().unwrap().heading;
    let aside = world::geometry::Point::unit(heading + std::f64::consts::FRAC_PI_2) * 400.0;
    for state in track.states.iter_mut().flatten() {
        (state.x, state.y) = (state.x + aside.x, state.y + aside.y);
    }
    let after = cut(&parts.check().unwrap().0, &recipe);
    assert!(after.windows.iter().all(|window| window.av != away));
    let missing = before.windows.iter().filter(|window| window.av == away).count();
    let skipped = |cut: &Cut| cut.skipped.values().sum::<u32>() as usize;
    assert_eq!(skipped(&after) - skipped(&before), missing);
}

#[test]
fn the_bytes_are_the_same_for_any_number_of_threads_and_after_an_interruption() {
    let folder = tempfile::tempdir().unwrap();
    let (set, split) = (set(folder.path(), 4), Split::Share(0.5));
    let (one, four, resumed) = ("one", "four", "resumed");
    let path = |name: &str| folder.path().join(name);
    make(&set, &path(one), RECIPE, 1);
    make(&set, &path(four), RECIPE, 4);
    assert!(fs::read(path(one)).unwrap() == fs::read(path(four)).unwrap());

    let (stop, done) = (AtomicBool::new(false), AtomicUsize::new(0));
    let out = path(resumed);
    let order = Order { set: &set, recipe: &RECIPE, split: &split, out: &out, jobs: 1 };
    let after_three = |_: usize, _: bool| stop.store(done.fetch_add(1, Ordering::Relaxed) == 2, Ordering::Relaxed);
    assert!(matches!(prepare(&order, &stop, &after_three), Err(PrepareError::Interrupted)));
    assert!(!out.exists());
    // One of the parts is damaged meanwhile.
    let parts = path("resumed.parts");
    let mut names: Vec<PathBuf> = fs::read_dir(&parts).unwrap().map(|entry| entry.unwrap().path()).collect();
    names.retain(|path| path.extension().is_some_and(|extension| extension == "part"));
    assert_eq!(names.len(), 3);
    let mut bytes = fs::read(&names[0]).unwrap();
    *bytes.last_mut().unwrap() ^= 1;
    fs::write(&names[0], bytes).unwrap();
    assert_eq!(make(&set, &out, RECIPE, 2).resumed, 2);
    assert!(fs::read(path(one)).unwrap() == fs::read(&out).unwrap());
    assert!(!parts.exists());
}

#[test]
fn parts_of_other_settings_are_made_anew() {
    let folder = tempfile::tempdir().unwrap();
    let (set, out) = (set(folder.path(), 1), folder.path().join("some.windows"));
    let (stop, split) = (AtomicBool::new(false), Split::Share(0.5));
    let order = Order { set: &set, recipe: &RECIPE, split: &split, out: &out, jobs: 1 };
    assert!(prepare(&order, &stop, &|_, _| stop.store(true, Ordering::Relaxed)).is_err());
    assert_eq!(make(&set, &out, Recipe { stride: 20, ..RECIPE }, 1).resumed, 0);
}

#[test]
fn two_commands_do_not_work_on_one_file() {
    let folder = tempfile::tempdir().unwrap();
    let (set, out) = (set(folder.path(), 1), folder.path().join("some.windows"));
    let split = Split::Share(0.5);
    let order = Order { set: &set, recipe: &RECIPE, split: &split, out: &out, jobs: 1 };
    let again = |_: usize, _: bool| {
        let second = prepare(&order, &AtomicBool::new(false), &|_, _| {});
        assert!(matches!(second, Err(PrepareError::Busy(_))));
    };
    prepare(&order, &AtomicBool::new(false), &again).unwrap();
}

#[test]
fn scenes_that_a_list_does_not_name_are_left_out_and_no_window_is_no_file() {
    let folder = tempfile::tempdir().unwrap();
    let (set, out) = (set(folder.path(), 1), folder.path().join("some.windows"));
    let list = |ids: &[&str]| Split::List(ids.iter().map(|id| ((*id).to_owned(), Role::Validation)).collect());
    let split = list(&["cut-in-3-0"]);
    let order = Order { set: &set, recipe: &RECIPE, split: &split, out: &out, jobs: 1 };
    let prepared = prepare(&order, &AtomicBool::new(false), &|_, _| {}).unwrap();
    assert_eq!(prepared.left_out, ["following-3-0"]);
    assert_eq!(prepared.windows[0], 0);
    let windows = Windows::open(&out).unwrap();
    assert_eq!(windows.scenes().map(|scene| scene.role).collect::<Vec<Role>>(), [Role::Validation]);
    let split = list(&["nothing"]);
    let error = prepare(&Order { split: &split, ..order }, &AtomicBool::new(false), &|_, _| {}).unwrap_err();
    assert!(error.to_string().starts_with("no scene gives a window\nhint: "), "{error}");
}

#[test]
fn several_files_are_one_and_a_scene_has_one_role_in_all() {
    let folder = tempfile::tempdir().unwrap();
    let set = set(folder.path(), 1);
    let file = |name: &str, recipe: Recipe, ids: &[(&str, Role)]| {
        let out = folder.path().join(name);
        let split = Split::List(ids.iter().map(|(id, role)| ((*id).to_owned(), *role)).collect());
        let order = Order { set: &set, recipe: &recipe, split: &split, out: &out, jobs: 1 };
        prepare(&order, &AtomicBool::new(false), &|_, _| {}).unwrap();
        out
    };
    let (training, validation) = (Role::Training, Role::Validation);
    let a = file("a", RECIPE, &[("cut-in-3-0", training)]);
    let b = file("b", Recipe { stride: 20, ..RECIPE }, &[("following-3-0", validation)]);
    let both = Windows::open_all(&[a.clone(), b.clone()]).unwrap();
    let (first, second) = (Windows::open(&a).unwrap(), Windows::open(&b).unwrap());
    assert_eq!(both.training(), (0..first.len()).collect::<Vec<usize>>());
    assert_eq!(both.validation(), (first.len()..both.len()).collect::<Vec<usize>>());
    assert!(both.get(first.len() + 1).unwrap() == second.get(1).unwrap());
    assert_eq!(both.entry(first.len()).unwrap(), second.entry(0).unwrap());
    let c = file("c", RECIPE, &[("cut-in-3-0", validation)]);
    assert!(matches!(Windows::open_all(&[a.clone(), c]), Err(WindowsError::BothRoles { .. })));
    let d = file("d", Recipe { features: Whose::Authors, ..RECIPE }, &[("cut-in-3-0", training)]);
    assert!(matches!(Windows::open_all(&[a, d]), Err(WindowsError::OtherFeatures { .. })));
}

#[test]
fn a_scene_that_cannot_be_read_is_listed_and_a_short_one_gives_no_window() {
    let folder = tempfile::tempdir().unwrap();
    let whole = set(folder.path(), 1);
    let (scene, _) = whole.load(1).unwrap();
    let mut parts = std::sync::Arc::unwrap_or_clone(scene).into_parts();
    parts.timestamps.truncate(70);
    parts.signals.truncate(70);
    parts.tracks.iter_mut().for_each(|track| track.states.truncate(70));
    let short = scenarios::womd::write(&parts.check().unwrap().0);
    // The scenario's id, and nothing else.
    let empty = [&[0x2a, 5], &b"empty"[..]].concat();
    let mut file = Vec::new();
    for payload in [&whole.payload(0).unwrap(), &empty, &short] {
        scenarios::tfrecord::append_record(&mut file, payload);
    }
    let path = folder.path().join("three.tfrecord");
    fs::write(&path, file).unwrap();
    let set = SceneSet::open(&[path.display().to_string()]).unwrap();
    let prepared = make(&set, &folder.path().join("some.windows"), RECIPE, 2);
    let [broken] = &prepared.broken[..] else { panic!("{:?}", prepared.broken) };
    assert!(broken.scene == "empty" && broken.reason.contains("no timestamps"), "{}", broken.reason);
    let [first, second] = &prepared.scenes[..] else { panic!("{:?}", prepared.scenes) };
    assert!(first.skipped.is_empty() && second.skipped[0].reason.contains("shorter than 7.1 s"));
}

/// A small file, made once.
fn small() -> &'static [u8] {
    static BYTES: std::sync::OnceLock<Vec<u8>> = std::sync::OnceLock::new();
    BYTES.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("small.windows");
        make(&set(folder.path(), 1), &out, Recipe { stride: 100, ..RECIPE }, 1);
        fs::read(out).unwrap()
    })
}

proptest! {
    #[test]
    fn no_damage_goes_unseen((at, change) in (any::<prop::sample::Index>(), 1_u8..)) {
        let mut bytes = small().to_vec();
        let at = at.index(bytes.len());
        bytes[at] ^= change;
        crate::fuzzing::windows(&bytes);
        let windows = Windows::of_bytes(bytes);
        let whole = windows.is_ok_and(|windows| (0..windows.len()).all(|index| windows.get(index).is_ok()));
        prop_assert!(!whole, "byte {at}");
    }

    #[test]
    fn no_file_that_is_cut_short_is_opened(length in any::<prop::sample::Index>()) {
        let bytes = &small()[..length.index(small().len())];
        crate::fuzzing::windows(bytes);
        prop_assert!(Windows::of_bytes(bytes.to_vec()).is_err());
    }

    #[test]
    fn nothing_panics_where_the_checksums_are_right(
        (changes, cut) in (prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..5), 0_usize..9),
    ) {
        let mut bytes = small().to_vec();
        for (at, value) in changes {
            // The head is where most can go wrong.
            let at = at.index(2000).min(bytes.len() - 1);
            bytes[at] = value;
        }
        bytes.truncate(bytes.len() - cut);
        crate::fuzzing::windows(&bytes);
    }
}

const FRAME: Quantity = Quantity::within("frames", 1e-4, "abs");
const LINE: Quantity = Quantity::within("positions of the line", 1e-3, "m");
const DIRECTIONS: Quantity = Quantity::within("headings of the line", 1e-5, "rad");
const CURVATURE: Quantity = Quantity::within("curvature of the line", 1e-4, "1/m");
const INFORMATION: Quantity = Quantity::within("information of the line", 1e-5, "abs");
const FUTURE: Quantity = Quantity::within("futures", 1e-4, "abs");

#[test]
fn windows_of_real_scenes_are_those_of_the_authors() {
    let (Some(folder), Some(data)) = (vectors::shared("dipp/training-vectors"), vectors::shared("data/womd-derived"))
    else {
        return;
    };
    let set = SceneSet::open(&[data.display().to_string()]).unwrap();
    let batch = Npz::read(&folder.join("batch.npz")).unwrap();
    let steps = batch.array("timestep", &[None]).unwrap().to_vec();
    let mut report = Report::new(&["authors"], &[FRAME, LINE, DIRECTIONS, CURVATURE, INFORMATION, FUTURE]);
    for (case, step) in steps.iter().enumerate() {
        let npz = batch.case(case, steps.len());
        let id = npz.array("window", &[None]).unwrap().iter().filter(|byte| **byte != 0.0);
        let id: String = id.map(|byte| char::from(*byte as u8)).collect();
        let index = set.entries().iter().position(|entry| entry.id.as_str() == id).unwrap();
        let recipe = Recipe { features: Whose::Authors, stride: 10, others: false };
        let windows = cut(&set.load(index).unwrap().0, &recipe).windows;
        let window = windows.iter().find(|window| f64::from(window.step) == *step).unwrap();
        report.count_case();
        let place = format!("{id} step {step}");
        let mut add = |quantity, own: &[f32], wanted: &[f64]| {
            let own = own.iter().map(|value| f64::from(*value));
            report.add(0, quantity, worst_deviation(own, wanted, absolute), &place);
        };
        let (own, wanted) = (window.sketch.frame(), verify::frame(&npz).unwrap());
        for (own, wanted) in [
            (own.ego.as_flattened(), wanted.ego.as_flattened()),
            (own.neighbors.as_flattened().as_flattened(), wanted.neighbors.as_flattened().as_flattened()),
            (own.lanes.as_flattened().as_flattened(), wanted.lanes.as_flattened().as_flattened()),
            (own.crosswalks.as_flattened().as_flattened(), wanted.crosswalks.as_flattened().as_flattened()),
        ] {
            let wanted: Vec<f64> = wanted.iter().map(|value| f64::from(*value)).collect();
            add(FRAME, own, &wanted);
        }
        assert_eq!(own.presence, wanted.presence, "{place}");
        let line = npz.rows::<5>("ref_line", &[Some(1200), Some(5)]).unwrap();
        for (own, wanted) in window.line.iter().zip(line) {
            add(LINE, &own[..2], &wanted[..2]);
            add(DIRECTIONS, &own[2..3], &wanted[2..3]);
            add(CURVATURE, &own[3..4], &wanted[3..4]);
            add(INFORMATION, &own[4..], &wanted[4..]);
        }
        let shape = [Some(11), Some(50), Some(5)];
        let future = npz.array("gt_future_states", &shape).unwrap();
        add(FUTURE, window.future.as_flattened().as_flattened(), future);
    }
    println!("{report}");
    assert!(report.holds(), "{report}");
}

#[test]
fn transitions_are_the_steps_of_the_log() {
    let folder = tempfile::tempdir().unwrap();
    let (set, out) = (set(folder.path(), 1), folder.path().join("some.transitions"));
    let split = Split::Share(0.0);
    let drawn = Drawn::default();
    let order = Order { set: &set, recipe: &drawn, split: &split, out: &out, jobs: 2 };
    prepare(&order, &AtomicBool::new(false), &|_, _| {}).unwrap();
    let transitions = Transitions::open(std::slice::from_ref(&out)).unwrap();
    let scenes: Vec<_> = (0..2).map(|index| set.load(index).unwrap().0).collect();
    let counts: Vec<usize> = scenes.iter().map(|scene| scene.steps() - 20).collect();
    assert_eq!((transitions.training().len(), transitions.validation().len()), (counts.iter().sum(), 0));
    let of = |index: usize| transitions.get(transitions.training()[index]).unwrap();
    let log = &scenes[1].av().states;
    let (one, after, last) = (of(counts[0]), of(counts[0] + 1), of(counts[0] + counts[1] - 1));
    assert!(one.next == after.state && one.state != one.next);
    assert_eq!((one.goal, last.goal), (false, true));
    let way = log[20].unwrap().position().distance(log[19].unwrap().position());
    assert!((f64::from(one.distance) - way).abs() < 1e-5);
    let done: [f32; 3] = one.action.clone().try_into().unwrap();
    let there = network::cql::next_pose(log[19].unwrap().pose(), done);
    assert!(there.position().distance(log[20].unwrap().position()) < 1e-4);
    let between_scenes = transitions.get(transitions.training()[counts[0] - 1] + 1).unwrap();
    assert!(between_scenes.action == network::cql::action_of(Default::default(), Default::default()));
    assert!(matches!(Windows::open(&out), Err(WindowsError::File { problem: FileProblem::Settings(_), .. })));
}
