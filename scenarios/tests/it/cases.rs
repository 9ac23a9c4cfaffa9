//! Small scenes on which readers once went wrong, where they are at hand. What they hold is in the tests of each kind too.

use std::path::PathBuf;
use std::sync::Arc;

use scenarios::lint::{self, Lint, Severity};
use scenarios::{SceneSet, SetError};
use world::scene::bridged::Bridged;
use world::scene::{Judgement, Scene};

use crate::shared;

fn case(name: &str) -> Option<PathBuf> {
    shared(&format!("cases/scenes/{name}"))
}

/// Each scene of a case, by name, with what is found in it.
fn scenes(name: &str) -> Vec<(String, Arc<Scene>, Vec<Lint>)> {
    let Some(path) = case(name) else { return Vec::new() };
    let set = SceneSet::open(&[path.to_string_lossy().into_owned()]).unwrap();
    let scene = |(index, entry): (usize, &scenarios::SceneEntry)| {
        let (scene, findings) = set.load(index).unwrap();
        let lints = lint::lint(&scene, &findings);
        (entry.id.to_string(), scene, lints)
    };
    set.entries().iter().enumerate().map(scene).collect()
}

fn codes(lints: &[Lint]) -> Vec<&'static str> {
    lint::Summary::of(lints).codes
}

#[test]
fn a_leader_who_drops_out_is_filled_in_and_told() {
    for (id, scene, lints) in scenes("03-track-gaps.tfrecord") {
        let bridged = Bridged::of(&scene);
        let leader = scene.tracks().iter().position(|track| track.id.0 == 5).unwrap();
        let judged = |step: usize| bridged.judged().tracks()[leader].states[step].is_some();
        let seen = |step: usize| bridged.observed(leader, step).is_some();
        let (told, gap) = match id.as_str() {
            "c04-gap15" => ("track-drops-out", Some(75..90)),
            "c04-gap30" => ("track-drops-out", Some(70..100)),
            "c04-gone" => ("track-vanishes", None),
            "c04-late" => ("track-appears", None),
            _ => continue,
        };
        assert_eq!(codes(&lints), [told], "{id}");
        match gap {
            Some(mut gap) => assert!(gap.all(|step| judged(step) && seen(step)), "{id}"),
            None if id == "c04-gone" => assert!(!judged(75) && seen(104) && !seen(105), "{id}"),
            None => assert!(!judged(89) && bridged.visible_for(leader, 95) == Some(6), "{id}"),
        }
    }
}

#[test]
fn a_car_is_as_long_as_cars_are_whatever_one_frame_says() {
    for (id, scene, lints) in scenes("05-sizes.tfrecord") {
        let bridged = Bridged::of(&scene);
        let car = scene.tracks().iter().position(|track| track.id.0 == 5).unwrap();
        for step in 0..scene.steps() {
            let judged = bridged.judged().tracks()[car].states[step].unwrap();
            let seen = bridged.observed(car, step).unwrap().state;
            for state in [judged, seen] {
                assert!((4.0..5.0).contains(&state.length) && (1.5..2.5).contains(&state.width), "{id} at {step}");
                assert!((1.0..2.0).contains(&state.height), "{id} at {step}");
            }
        }
        let sizes = lints.iter().filter(|lint| matches!(lint, Lint::Size(_))).count();
        assert_eq!(sizes, usize::from(id != "c07-full"), "{id}: {lints:?}");
    }
}

#[test]
fn what_a_map_does_not_hold_or_holds_the_wrong_way_round_is_not_judged() {
    let unjudged = |name: &str| {
        let of = |(id, _, lints): (String, _, Vec<Lint>)| (id, lint::Summary::of(&lints).unjudged);
        scenes(name).into_iter().map(of).collect::<Vec<_>>()
    };
    for (id, unjudged) in [unjudged("07-no-edge-no-limit.tfrecord"), unjudged("08-edges-flipped.tfrecord")].concat() {
        let expected: &[Judgement] = match id.as_str() {
            "c16-noedge" | "c23-flipped" => &[Judgement::OffRoad],
            "c16-nolimit" => &[Judgement::Speeding],
            _ => &[],
        };
        assert_eq!(unjudged, expected, "{id}");
    }
}

#[test]
fn a_driveway_is_to_be_driven_on() {
    let first_off_road = |wanted: &str| {
        let mut all = scenes("01-driveway-curb.tfrecord").into_iter();
        let (_, _, lints) = all.find(|(id, ..)| id == wanted)?;
        lints.into_iter().find_map(|lint| match lint {
            Lint::AvOffRoad { steps, .. } => steps.first(),
            _ => None,
        })
    };
    if let (Some(without), Some(with)) = (first_off_road("c13-no-driveway"), first_off_road("c13-driveway")) {
        assert!(with > without + 20, "off road from step {with} with a driveway, from {without} without");
    }
}

#[test]
fn side_files_alone_are_no_scenes_and_beside_a_shard_they_are_passed_over() {
    let Some(folder) = case("14-sidecars") else { return };
    let error = SceneSet::open(&[folder.to_string_lossy().into_owned()]).unwrap_err();
    assert!(matches!(&error, SetError::EmptyFolder { passed_over, .. } if passed_over.len() == 3), "{error}");
    let copy = tempfile::tempdir().unwrap();
    for file in std::fs::read_dir(&folder).unwrap() {
        let file = file.unwrap();
        std::fs::copy(file.path(), copy.path().join(file.file_name())).unwrap();
    }
    let shard = case("09-two-way.tfrecord").unwrap();
    std::fs::copy(shard, copy.path().join("training_20s.tfrecord-00000-of-01000")).unwrap();
    let set = SceneSet::open(&[copy.path().to_string_lossy().into_owned()]).unwrap();
    assert_eq!((set.entries().len(), set.notes().len()), (2, 1));
}

#[test]
fn records_that_give_no_scene_are_named_and_the_others_read() {
    let survey = |name: &str| {
        let path = case(name)?;
        let (set, bad) = SceneSet::survey(&[path.to_string_lossy().into_owned()]).unwrap();
        let loads = (0..set.entries().len()).map(|index| set.load(index).is_ok()).collect::<Vec<_>>();
        Some((loads, bad.iter().map(ToString::to_string).collect::<Vec<_>>()))
    };
    if let Some((loads, bad)) = survey("15-lidar-only.tfrecord") {
        assert!(loads.is_empty() && bad[0].contains("the laser data of scene eb4b91b10ca94ff2 alone"), "{bad:?}");
    }
    if let Some((loads, bad)) = survey("16-times-and-states-differ.tfrecord") {
        assert_eq!((loads, bad), (vec![true, false, false, true], vec![]));
    }
}

#[test]
fn two_points_make_as_good_a_lane_as_four_hundred() {
    let all = scenes("17-sparse-lanes.tfrecord");
    let routes: Vec<f64> = all
        .iter()
        .map(|(id, scene, lints)| {
            assert_eq!(codes(lints), if id == "c22-sparse" { vec!["sparse-lanes"] } else { vec![] });
            let bridged = Bridged::of(scene);
            let style = world::route::RouteStyle::Strict;
            world::route::Route::of_log(bridged.judged(), style).unwrap().line.len() as f64
        })
        .collect();
    if let [dense, sparse] = routes[..] {
        assert!((dense - sparse).abs() < 20.0, "{dense} and {sparse} samples of 0.1 m");
    }
}

#[test]
fn real_scenes_have_few_warnings_and_no_errors() {
    let Some(data) = shared("data") else { return };
    let inputs = ["womd/9s", "womd-derived", "train-9s"].map(|name| data.join(name).to_string_lossy().into_owned());
    let set = SceneSet::open(&inputs).unwrap();
    let (mut warned, mut unjudged) = (0, 0);
    for index in 0..set.entries().len() {
        let (scene, findings) = set.load(index).unwrap();
        let lints = lint::lint(&scene, &findings);
        assert!(lints.iter().all(|lint| lint.severity() < Severity::Error), "{}: {lints:?}", scene.id());
        let summary = lint::Summary::of(&lints);
        warned += usize::from(summary.warnings > 0);
        unjudged += usize::from(!summary.unjudged.is_empty());
    }
    // The three without speed limits are those whose converter lost them.
    assert_eq!((set.entries().len(), unjudged), (471, 3));
    assert!(warned < 471 / 3, "{warned} of 471 have warnings");
}
