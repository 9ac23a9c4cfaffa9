//! The logged drivers of real scenes and of the demo set, judged by the rules for planners. Real scenes are skipped where they
//! are not there.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may panic, and prints its table")]

mod straight_road;

use std::path::PathBuf;
use std::sync::Arc;

use episode::driver::drive;
use episode::protocol::{Motion, Protocol, StrictSettings};
use episode::{Episode, Outcome};
use scenarios::SceneSet;
use straight_road::LogReplay;
use wire::proto::EndReason;
use world::scene::Scene;

/// The folder of shared data, if there is one.
fn shared() -> Option<PathBuf> {
    let crate_folder = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    let places = ["../../shared", "../../../shared"].map(|place| crate_folder.join(place));
    std::env::var_os("RELOOP_SHARED").map(PathBuf::from).into_iter().chain(places).find(|place| place.is_dir())
}

fn scenes(folders: &[&str]) -> Vec<Arc<Scene>> {
    let Some(shared) = shared() else {
        eprintln!("skipped: no ../shared with real scenes, and RELOOP_SHARED is not set");
        return Vec::new();
    };
    let folders: Vec<String> = folders.iter().map(|folder| shared.join(folder).display().to_string()).collect();
    let set = SceneSet::open(&folders).unwrap();
    (0..set.entries().len()).map(|index| set.load(index).unwrap().0).collect()
}

fn replay(scene: &Arc<Scene>, motion: Motion) -> Outcome {
    let protocol = Protocol::Strict(StrictSettings { motion, ..StrictSettings::default() });
    drive(Episode::new(Arc::clone(scene), &protocol).unwrap(), &mut LogReplay(Arc::clone(scene)))
}

fn metric(outcome: &Outcome, name: &str) -> Option<f64> {
    outcome.end.metrics.iter().find(|metric| metric.name == name).unwrap().value
}

fn describe(scene: &Scene, outcome: &Outcome) {
    let shown =
        ["progress_m", "min_time_to_collision_s", "speed_limit_compliance", "position_error_10s_m", "nuplan_score"];
    let shown = shown.map(|name| format!("{name} {:.3}", metric(outcome, name).unwrap_or(f64::NAN)));
    println!("{} {:?} after {}: {}", scene.id(), outcome.end.reason(), outcome.end.steps, shown.join(", "));
    for event in &outcome.events {
        println!("    step {} {:?}: {}", event.step, event.kind(), event.text);
    }
}

const ALL: [&str; 4] =
    ["data/womd-derived/20s", "data/womd-derived/20s-partial", "data/womd-derived/9s", "data/womd/9s"];

#[test]
fn the_human_has_no_fault_that_counts_and_no_position_error() {
    // What it does is netted against itself, so what the judges see of it says whether they see straight.
    let mut events = Vec::new();
    let scenes = scenes(&ALL);
    for scene in &scenes {
        let scene = Arc::clone(scene);
        let outcome = replay(&scene, Motion::Playback);
        describe(&scene, &outcome);
        let ended = outcome.end.reason();
        assert!(matches!(ended, EndReason::Horizon | EndReason::LogEnd), "{}: {ended:?}", scene.id());
        for rule in ["collision", "off_route", "off_road", "red_light", "wrong_way", "speeding"] {
            match metric(&outcome, rule) {
                None => events.push(format!("{}: {rule} cannot be judged", scene.id())),
                value => assert_eq!(value, Some(0.0), "{}: {rule}", scene.id()),
            }
        }
        let error = metric(&outcome, "position_error_5s_m").unwrap();
        assert!(error == 0.0, "{}: {error} m", scene.id());
        let seen = outcome.events.iter().map(|event| format!("{} step {}: {}", scene.id(), event.step, event.text));
        events.extend(seen);
    }
    if !scenes.is_empty() {
        insta::assert_debug_snapshot!(events, @r#"
        [
            "1446dc44bd6fd420: speeding cannot be judged",
            "2831b6fde0420b0d: speeding cannot be judged",
            "8d3d061e518531d0: speeding cannot be judged",
            "8e7a57ef92cc5da5 step 27: crossed the stop point of lane 144 at red (the logged AV too: not counted)",
        ]
        "#);
    }
}

#[test]
fn the_human_of_419_scenes_loses_by_its_own_comfort_alone() {
    let Some(folder) = shared().map(|shared| shared.join("data/train-9s")).filter(|folder| folder.is_dir()) else {
        eprintln!("skipped: no train-9s in ../shared or RELOOP_SHARED");
        return;
    };
    let set = SceneSet::open(&[folder.display().to_string()]).unwrap();
    let step = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let drive_from = |first: usize| {
        for index in (first..set.entries().len()).step_by(step) {
            let outcome = replay(&set.load(index).unwrap().0, Motion::Playback);
            for metric in &outcome.end.metrics {
                let is_term = metric.name.starts_with("nuplan_")
                    && !["max_", "min_", "comfort", "score", "terms"].iter().any(|other| metric.name.contains(other));
                let is_kept = !is_term || metric.value.is_none_or(|value| value == 1.0);
                assert!(is_kept, "{}: {} {:?}", set.entries()[index].id, metric.name, metric.value);
            }
        }
    };
    std::thread::scope(|threads| (0..step).for_each(|first| drop(threads.spawn(move || drive_from(first)))));
}

#[test]
fn the_drivers_of_the_demo_set_have_no_fault_at_all() {
    let set = SceneSet::open(&[]).unwrap();
    for index in 0..set.entries().len() {
        let scene = set.load(index).unwrap().0;
        let outcome = replay(&scene, Motion::Playback);
        describe(&scene, &outcome);
        assert_eq!(outcome.events, vec![], "{}", scene.id());
        assert_eq!(metric(&outcome, "position_error_5s_m"), Some(0.0), "{}", scene.id());
    }
}

#[test]
fn the_human_stays_on_the_road() {
    // Also without netting: so the left of WOMD's road edges is road, and the tolerance is not the log's.
    let (mut off, mut known) = (0, 0);
    for scene in scenes(&ALL) {
        let outcome = replay(&scene, Motion::Playback);
        let distances = outcome.records.iter().filter_map(|record| record.road_edge_distance);
        known += distances.clone().count();
        off += distances.filter(|distance| *distance > 0.0).count();
    }
    println!("{off} of {known} states are beyond a road edge");
    assert!(off * 1000 <= known * 5, "{off} of {known}");
}

#[test]
fn the_bicycle_follows_the_human_within_a_metre_or_two() {
    for scene in scenes(&ALL[..2]) {
        let outcome = replay(&scene, Motion::Bicycle);
        describe(&scene, &outcome);
        // The tracker holds speed, not place: some metres along the road are its share, not across it.
        let across = outcome.records.iter().map(|record| record.lateral_offset.abs()).fold(0.0, f64::max);
        let own = replay(&scene, Motion::Playback);
        let human = own.records.iter().map(|record| record.lateral_offset.abs()).fold(0.0, f64::max);
        println!("    {across:.2} m across, the human {human:.2} m");
        assert!(across <= human + 1.0, "{}: {across} m", scene.id());
    }
}
