//! What holds for every generated scene, whatever its seed.

use std::sync::Arc;

use proptest::prelude::*;
use world::geometry::{angle_difference, boxes_overlap};
use world::plan::STEP_SECONDS;
use world::route::{Route, RouteStyle};
use world::scene::Scene;

use super::{FAMILIES, STEPS};
use crate::lint::{Lint, Severity, lint};
use crate::womd;

fn scenes(seed: u64, index: u32) -> Vec<Scene> {
    let scene = |family: &super::Family| {
        let (scene, findings) =
            womd::read(&family.payload(family.name, seed, index, &Default::default()).unwrap()).unwrap();
        assert_eq!(findings, [], "{} {seed} {index}", family.name);
        scene
    };
    FAMILIES.iter().map(scene).collect()
}

fn nothing_to_say(scene: &Scene) {
    let grave: Vec<String> = lint(&Arc::new(scene.clone()), &[])
        .iter()
        .filter(|l| l.severity() > Severity::Note)
        .map(Lint::to_string)
        .collect();
    assert!(grave.is_empty(), "{}: {grave:?}", scene.id());
}

fn nobody_hits_anybody(scene: &Scene) {
    for step in 0..STEPS {
        let boxes: Vec<_> =
            scene.tracks().iter().filter_map(|track| Some((track.id, track.states[step]?.oriented_box()))).collect();
        for (index, (id, one)) in boxes.iter().enumerate() {
            for (other_id, other) in &boxes[index + 1..] {
                assert!(!boxes_overlap(one, other), "{}: {id} and {other_id} at step {step}", scene.id());
            }
        }
    }
}

/// The kinematic bicycle of the AV's size could have driven it, and nobody would have spilled coffee.
fn the_av_drives_feasibly(scene: &Scene) {
    let states: Vec<_> = scene.av().states.iter().map(|state| state.unwrap()).collect();
    assert_eq!(states.len(), STEPS);
    let speeds: Vec<f64> = states.iter().map(|state| state.speed()).collect();
    let mut path = 0.0;
    for step in 2..STEPS {
        let (before, now) = (&states[step - 1], &states[step]);
        let moved = before.position().distance(now.position());
        path += moved;
        let acceleration = (speeds[step] - speeds[step - 1]) / STEP_SECONDS;
        assert!(acceleration.abs() < 3.6, "{}: {acceleration} m/s^2 at step {step}", scene.id());
        let turned = angle_difference(before.heading, now.heading);
        if moved > 0.02 {
            let steering = (3.089 * turned / moved).abs();
            assert!(steering < 0.45, "{}: steering {steering} at step {step}", scene.id());
            assert!((turned / STEP_SECONDS * speeds[step]).abs() < 2.5, "{}: sideways at step {step}", scene.id());
            let along = (now.position() - before.position()).heading();
            assert!(angle_difference(along, now.heading).abs() < 0.1, "{}: slips at step {step}", scene.id());
        }
    }
    assert!(path > 60.0, "{}: {path} m", scene.id());
}

/// The AV's route is found, and lies where the AV drives.
fn the_route_is_the_way_driven(scene: &Scene) {
    let route = Route::of_log(scene, RouteStyle::Strict).unwrap();
    for state in scene.av().states.iter().flatten() {
        let (_, distance) = route.nearest_sample(state.position());
        assert!(distance < 0.7, "{}: {distance} m from its route", scene.id());
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn any_seed_gives_clean_feasible_scenes(seed in any::<u64>(), index in 0_u32..100) {
        for scene in scenes(seed, index) {
            nothing_to_say(&scene);
            nobody_hits_anybody(&scene);
            the_av_drives_feasibly(&scene);
            the_route_is_the_way_driven(&scene);
        }
    }
}

#[test]
fn the_demo_scenes_are_clean_and_feasible() {
    for scene in scenes(0, 0) {
        nothing_to_say(&scene);
        nobody_hits_anybody(&scene);
        the_av_drives_feasibly(&scene);
        the_route_is_the_way_driven(&scene);
    }
}

#[test]
fn one_seed_gives_one_scene_and_another_gives_another() {
    for family in FAMILIES {
        let payload = |seed, index| family.payload("x", seed, index, &Default::default()).unwrap();
        assert_eq!(payload(7, 1), payload(7, 1));
        assert_ne!(payload(7, 1), payload(7, 2));
        assert_ne!(payload(7, 1), payload(8, 1));
    }
}
