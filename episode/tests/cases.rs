//! Scenes on which data is missing, routes come back to where they were, or the logged driver breaks rules himself. They are
//! skipped where they are not there.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may panic, and prints what it drove")]

mod straight_road;

use std::path::PathBuf;
use std::sync::Arc;

use episode::driver::{Driver, drive};
use episode::protocol::{Motion, Protocol, StrictSettings};
use episode::{Episode, Outcome};
use scenarios::SceneSet;
use straight_road::{LogReplay, straight_on};
use world::observation::Observation;
use world::plan::{PLAN_STEPS, Plan, PlanState, UncheckedPlan};
use world::scene::Scene;

fn scenes(name: &str) -> Vec<Arc<Scene>> {
    let crate_folder = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    let places = ["../../shared", "../../../shared"].map(|place| crate_folder.join(place));
    let shared = std::env::var_os("RELOOP_SHARED").map(PathBuf::from).into_iter().chain(places);
    let file = shared.map(|shared| shared.join("cases/scenes").join(name)).find(|file| file.exists());
    let Some(file) = file else {
        eprintln!("skipped: no ../shared/cases/scenes/{name}, and RELOOP_SHARED is not set");
        return Vec::new();
    };
    let set = SceneSet::open(&[file.display().to_string()]).unwrap();
    (0..set.entries().len()).map(|index| set.load(index).unwrap().0).collect()
}

fn drive_with(scene: &Arc<Scene>, motion: Motion, driver: &mut impl Driver) -> Outcome {
    let protocol = Protocol::Strict(StrictSettings { motion, ..StrictSettings::default() });
    let outcome = drive(Episode::new(Arc::clone(scene), &protocol).unwrap(), driver);
    println!("{} {:?} after {}", scene.id(), outcome.end.reason(), outcome.end.steps);
    for metric in &outcome.end.metrics {
        if metric.name.starts_with("nuplan_") || metric.name.contains("progress") {
            println!("    {} {:?}", metric.name, metric.value);
        }
    }
    for event in &outcome.events {
        println!("    step {}: {}", event.step, event.text);
    }
    outcome
}

fn human(scene: &Arc<Scene>) -> Outcome {
    drive_with(scene, Motion::Playback, &mut LogReplay(Arc::clone(scene)))
}

fn metric(outcome: &Outcome, name: &str) -> Option<f64> {
    outcome.end.metrics.iter().find(|metric| metric.name == name).unwrap().value
}

/// Drives what the logged AV drives `sooner` steps later: the same way, at another time.
struct Sooner {
    scene: Arc<Scene>,
    sooner: usize,
}

impl Driver for Sooner {
    fn plan(&mut self, observation: &Observation) -> Result<Plan, String> {
        let states = &self.scene.av().states;
        let state = |step: usize| {
            let at = (observation.log_index as usize + step + self.sooner).min(states.len() - 1);
            let logged = states[at].ok_or("the AV is not in the log")?;
            Ok(PlanState { x: logged.x, y: logged.y, heading: logged.heading, speed: logged.speed() })
        };
        let states = (1..=PLAN_STEPS).map(state).collect::<Result<_, String>>()?;
        let plan = UncheckedPlan { step: observation.step, states, ..UncheckedPlan::default() };
        plan.check(observation.step).map_err(|error| error.to_string())
    }
}

#[test]
fn who_crosses_the_curb_where_the_human_does_is_not_charged_whenever_it_is() {
    for scene in scenes("01-driveway-curb.tfrecord") {
        let own = human(&scene);
        assert_eq!((metric(&own, "off_road"), metric(&own, "nuplan_drivable_area")), (Some(0.0), Some(1.0)));
        let sooner = &mut Sooner { scene: Arc::clone(&scene), sooner: 32 };
        let early = drive_with(&scene, Motion::Playback, sooner);
        assert_eq!((metric(&early, "off_road"), metric(&early, "nuplan_drivable_area")), (Some(0.0), Some(1.0)));
    }
}

#[test]
fn a_leader_that_drops_out_is_there_and_nobody_is_to_blame_for_one_that_appears() {
    for scene in scenes("03-track-gaps.tfrecord") {
        let own = human(&scene);
        assert_eq!(metric(&own, "collision"), Some(0.0), "{}", scene.id());
        let straight = drive_with(&scene, Motion::Bicycle, &mut straight_on());
        println!("    straight on: at fault {:?}", metric(&straight, "at_fault_collision"));
    }
}

#[test]
fn loops_are_driven_once() {
    for scene in scenes("04b-loops.tfrecord") {
        let own = human(&scene);
        assert_eq!(own.events, vec![], "{}", scene.id());
        let (driven, counted) = (metric(&own, "progress_m").unwrap(), metric(&own, "route_progress_m").unwrap());
        assert!((counted / driven - 1.0).abs() < 0.05, "{}: {driven} m driven, {counted} m counted", scene.id());
        assert_eq!((metric(&own, "off_route"), metric(&own, "nuplan_progress")), (Some(0.0), Some(1.0)));
    }
}

#[test]
fn cars_without_a_size_are_there() {
    for scene in scenes("05-sizes.tfrecord") {
        let straight = drive_with(&scene, Motion::Bicycle, &mut straight_on());
        let own = human(&scene);
        println!("    human {:?}, straight on {:?}", metric(&own, "collision"), metric(&straight, "collision"));
        assert_ne!(metric(&own, "collision"), Some(1.0), "{}", scene.id());
    }
}

#[test]
fn without_edges_limits_or_with_flipped_edges_the_terms_are_missing() {
    for scene in scenes("07-no-edge-no-limit.tfrecord").into_iter().chain(scenes("08-edges-flipped.tfrecord")) {
        let own = human(&scene);
        let missing: Vec<&str> = ["off_road", "nuplan_drivable_area", "speeding", "nuplan_speed_limit"]
            .into_iter()
            .filter(|name| metric(&own, name).is_none())
            .collect();
        println!("    missing {missing:?}");
        // One scene of the file is whole, to compare with.
        let is_whole = scene.id().as_str().ends_with("normal");
        assert_eq!(missing.is_empty(), is_whole, "{}", scene.id());
        assert_eq!(metric(&own, "nuplan_terms") == Some(8.0), is_whole, "{}", scene.id());
    }
}

#[test]
fn the_human_is_the_upper_mark() {
    for name in ["09-two-way", "10-reversing", "11-curb-lip", "12-lane-gaps", "13-rim"] {
        for scene in scenes(&format!("{name}.tfrecord")) {
            let own = human(&scene);
            for rule in ["collision", "off_route", "off_road", "red_light", "wrong_way", "speeding"] {
                assert_ne!(metric(&own, rule), Some(1.0), "{}: {rule}", scene.id());
            }
            assert_ne!(metric(&own, "nuplan_score"), Some(0.0), "{}", scene.id());
            println!("    score {:?} of {:?} terms", metric(&own, "nuplan_score"), metric(&own, "nuplan_terms"));
        }
    }
}
