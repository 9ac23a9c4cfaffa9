//! `scenarios render`: what it prints, how it ends, and that pictures are there. What they show is tested beside the drawing.

use std::path::Path;

use insta::assert_snapshot;
use scenarios::picture::{Extent, Look, Moment, Picture};
use scenarios::{SceneSet, tfrecord, womd};
use world::geometry::Point3;
use world::map::{Lane, Map, MapId};
use world::scene::{AgentKind, AgentState, SceneParts, Track, TrackId};

use crate::cli::run_in;
use crate::shared;

/// Writes scenes `scene-0`, `scene-1` ... of a lane and an AV, 30 steps each, as `scenes.tfrecord`.
fn write_scenes(folder: &Path, number: usize) {
    let mut file = Vec::new();
    for index in 0..number {
        let state = |step: u32| {
            let x = f64::from(step);
            AgentState { x, length: 4.6, width: 2.0, height: 1.5, velocity_x: 10.0, ..AgentState::default() }
        };
        let states = (0..30).map(|step| Some(state(step))).collect();
        let centerline = (0..100).map(|x| Point3::new(f64::from(x), 0.0, 0.0)).collect();
        let parts = SceneParts {
            id: format!("scene-{index}"),
            timestamps: (0..30).map(|step| f64::from(step) * 0.1).collect(),
            tracks: vec![Track { id: TrackId(1), kind: AgentKind::Vehicle, states }],
            map: Map { lanes: vec![Lane { id: MapId(1), centerline, ..Lane::default() }], ..Map::default() },
            ..SceneParts::default()
        };
        let (scene, _) = parts.check().unwrap();
        tfrecord::append_record(&mut file, &womd::write(&scene));
    }
    std::fs::write(folder.join("scenes.tfrecord"), file).unwrap();
}

fn render(folder: &Path, arguments: &str) -> String {
    let arguments: Vec<&str> = ["render", "scenes.tfrecord"].into_iter().chain(arguments.split_whitespace()).collect();
    run_in(folder, &arguments)
}

#[test]
fn one_scene_many_scenes_and_both_formats() {
    let folder = tempfile::tempdir().unwrap();
    write_scenes(folder.path(), 105);
    let texts = [
        "--scene scene-3 --out one.png",
        "--scene scene-3 --out one.png --step 29 --radius 20 --av-up --trail 0 --width 300",
        "--scene scene-3 --scene scene-7 --scene scene-9 --columns 3 --out sheet.SVG",
        "--width 100 --whole --out all.png",
    ]
    .map(|arguments| render(folder.path(), arguments));
    assert_snapshot!(texts.concat());
    let mut files: Vec<String> = std::fs::read_dir(folder.path())
        .unwrap()
        .map(|file| file.unwrap().file_name().into_string().unwrap())
        .collect();
    files.sort();
    assert_eq!(files, ["all.png", "one.png", "scenes.tfrecord", "sheet.SVG"], "nothing else is left there");
    let svg = std::fs::read_to_string(folder.path().join("sheet.SVG")).unwrap();
    assert_eq!(svg.matches("class=\"tile\"").count(), 3);
    let png = std::fs::read(folder.path().join("one.png")).unwrap();
    assert_eq!(&png[..8], b"\x89PNG\r\n\x1a\n");
    assert_eq!(&png[16..20], 300_u32.to_be_bytes(), "the second picture replaced the first");
}

#[test]
fn errors_of_pictures_say_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    write_scenes(folder.path(), 20);
    let too_many = "--scene scene-1 ".repeat(101);
    let texts = [
        "--out scene.jpg",
        "--out scene",
        "--out gone/scene.png",
        "--scene scene-20 --out scene.png",
        "--step 30 --out scene.png",
        &format!("{too_many} --out scene.png"),
        "--width 10000 --out scene.png",
        "--radius 0 --out scene.png",
        "--radius wide --out scene.png",
        "--radius 20 --whole --out scene.png",
        "--width 7 --out scene.png",
        "",
    ]
    .map(|arguments| render(folder.path(), arguments));
    assert_snapshot!(texts.concat());
    assert!(!folder.path().join("scene.png").exists());
}

#[test]
fn every_real_scene_is_drawn() {
    let Some(folder) = shared("data/womd-derived/20s") else { return };
    let set = SceneSet::open(&[folder.to_string_lossy().into_owned()]).unwrap();
    for index in 0..set.entries().len() {
        let (scene, _) = set.load(index).unwrap();
        for extent in [Extent::Radius(60.0), Extent::Whole] {
            let look = Look { width: 480, extent, av_up: false, trail: 2.0 };
            let picture = Picture::of(Moment::usual(&scene), &look);
            assert!(picture.svg().len() < 1_000_000, "{}: {} bytes", scene.id(), picture.svg().len());
            assert!(picture.png().is_ok(), "{}", scene.id());
        }
    }
}
