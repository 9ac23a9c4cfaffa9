//! Routes of real scenes: the authors' construction against vectors of their code, ours against the human's drive.
//!
//! Needs the scenes and vectors that are no part of the repository (`RELOOP_SHARED`, or `shared` beside it); skips without.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test")]

use std::sync::Arc;

use vectors::{Npz, npz_files, shared};
use world::geometry::{Point, angle_difference};
use world::plan::{Control, STEP_SECONDS};
use world::reference_line::SAMPLE_SPACING;
use world::route::{Route, RouteError, RouteStyle};
use world::scene::Scene;
use world::vehicle::{BicycleModel, VehicleState};

fn scenes(folder: &str) -> Vec<Arc<Scene>> {
    let Some(folder) = shared(folder) else { return Vec::new() };
    let set = scenarios::SceneSet::open(&[folder.to_str().unwrap().to_owned()]).unwrap();
    (0..set.entries().len()).map(|index| set.load(index).unwrap().0).collect()
}

#[test]
fn the_paper_route_is_the_authors_route() {
    let Some(vectors) = shared("dipp/closed-loop-vectors") else { return };
    let mut compared = 0;
    for scene in scenes("data/womd-derived/20s") {
        let file = vectors.join(format!("{}__route.npz", scene.id()));
        if !file.exists() {
            continue;
        }
        let route = Route::of_log(&scene, RouteStyle::Paper).unwrap();
        let npz = Npz::read(&file).unwrap();
        let waypoints = npz.rows::<2>("waypoints", &[None, Some(2)]).unwrap();
        assert_eq!(route.waypoints().len(), waypoints.len(), "{}", scene.id());
        for (ours, theirs) in route.waypoints().iter().zip(waypoints) {
            assert!(ours.distance(Point::new(theirs[0], theirs[1])) < 1e-6, "{} {ours:?} {theirs:?}", scene.id());
        }
        let rows = npz.rows::<4>("route", &[None, Some(4)]).unwrap();
        assert_eq!(route.line.len(), rows.len(), "{}", scene.id());
        let mut worst = [0.0_f64; 3];
        for (index, row) in rows.iter().enumerate() {
            let off = [
                route.line.point(index).distance(Point::new(row[0], row[1])),
                angle_difference(row[2], route.line.heading[index]).abs(),
                (route.line.curvature[index] - row[3]).abs(),
            ];
            worst = std::array::from_fn(|i| worst[i].max(off[i]));
        }
        println!("{}: off by at most {:.1e} m, {:.1e} rad, {:.1e} 1/m", scene.id(), worst[0], worst[1], worst[2]);
        assert!(worst[0] < 1e-6 && worst[1] < 1e-6 && worst[2] < 1e-5, "{} {worst:?}", scene.id());
        compared += 1;
    }
    assert!(compared >= 6, "only {compared} scenes compared");
}

#[test]
fn the_authors_plans_move_as_their_test_vehicle_does() {
    let Some(vectors) = shared("dipp/closed-loop-vectors") else { return };
    let mut compared = 0;
    for file in npz_files(&vectors).unwrap() {
        if !file.to_str().unwrap().ends_with("__planner.npz") {
            continue;
        }
        let npz = Npz::read(&file).unwrap();
        let states = npz.rows::<8>("av_state", &[None, Some(8)]).unwrap();
        let controls = npz.rows::<2>("control_first", &[None, Some(2)]).unwrap();
        let plans = npz.rows::<3>("plan_first", &[None, Some(3)]).unwrap();
        for ((state, control), plan) in states.iter().zip(controls).zip(plans) {
            let before = VehicleState { speed: Point::new(state[3], state[4]).norm(), ..VehicleState::default() };
            let control = Control { acceleration: control[0], steering: control[1] };
            let after = BicycleModel::authors_test().step(before, control, STEP_SECONDS);
            let off = [after.x - plan[0], after.y - plan[1], after.heading - plan[2]];
            assert!(off.iter().all(|off| off.abs() < 1e-6), "{file:?} {compared} {off:?}");
            compared += 1;
        }
    }
    assert!(compared > 500, "only {compared} steps compared");
}

/// Largest distance of the logged AV to the line (m), and what else tells a good line from a bad one.
fn report(scene: &Scene, route: &Route) -> f64 {
    let line = &route.line;
    let (mut distance, mut turned, mut back) = (0.0_f64, 0.0_f64, 0_usize);
    let mut farthest = 0;
    for state in scene.av().states.iter().flatten() {
        let (nearest, off) = route.nearest_sample(state.position());
        distance = distance.max(off);
        turned = turned.max(angle_difference(state.heading, line.heading[nearest]).abs());
        back = back.max(farthest.max(nearest) - nearest);
        farthest = farthest.max(nearest);
    }
    let bend = line.curvature.iter().fold(0.0_f64, |bend, curvature| bend.max(curvature.abs()));
    println!(
        "{:17} {:?}: human within {distance:.2} m and {turned:.2} rad, back by {back}, line {} samples, curvature up to {bend:.3}/m, {} lanes, {} stops, limits {:?}",
        scene.id().as_str(),
        route.style(),
        line.len(),
        route.lanes.len(),
        route.stops().all().len(),
        line.speed_limit.iter().fold((f64::INFINITY, 0.0_f64), |(low, high), v| (low.min(*v), high.max(*v))),
    );
    distance
}

#[test]
fn the_human_drives_near_the_strict_line() {
    // What is left are turns cut short and lane changes: the line keeps to the lanes.
    let folders = [
        ("data/womd-derived/20s", 2.5),
        ("data/womd-derived/20s-partial", 1.0),
        ("data/womd-derived/9s", 3.6),
        ("data/womd/9s", 1.0),
    ];
    for (folder, within) in folders {
        for scene in scenes(folder) {
            let route = Route::of_log(&scene, RouteStyle::Strict).unwrap();
            let distance = report(&scene, &route);
            assert!(distance < within, "{}: {distance} m", scene.id());
            let line = &route.line;
            for index in 1..line.len() {
                let step = line.point(index).distance(line.point(index - 1));
                assert!((step - SAMPLE_SPACING).abs() < 1e-3, "{} {index}: {step} m", scene.id());
            }
            let bend = line.curvature.iter().fold(0.0_f64, |bend, curvature| bend.max(curvature.abs()));
            assert!(bend < 0.5, "{}: {bend}/m", scene.id());
        }
    }
}

#[test]
fn the_paper_gives_a_route_or_says_why_not() {
    let folders = ["data/womd-derived/20s-partial", "data/womd-derived/9s", "data/womd/9s"];
    for scene in folders.iter().flat_map(|folder| scenes(folder)) {
        match Route::of_log(&scene, RouteStyle::Paper) {
            Ok(route) => drop(report(&scene, &route)),
            Err(error @ (RouteError::NothingBehind | RouteError::NoLane { .. })) => println!("{}: {error}", scene.id()),
            Err(error) => panic!("{}: {error}", scene.id()),
        }
    }
}
