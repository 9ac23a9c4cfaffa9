//! What the route costs: building it once an episode, and looking up its window at each step.
//!
//! Floors, measured in the same run: of building, one `atan2` a sample (its heading); of a step, the distances to as many
//! samples as one cell of the grid holds (what an exact search must look at). Goals: 20 ms and 100 microseconds.
//!
//! The scene is the one with the most lanes of those beside the repository (481), else of the demo set.
#![allow(clippy::unwrap_used, missing_docs, reason = "a bench; criterion's macros write no docs")]

use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use criterion::{Criterion, criterion_group, criterion_main};
use world::geometry::Point;
use world::map_matching::LanePoints;
use world::route::{Route, RouteStyle};
use world::scene::Scene;

fn scene() -> Arc<Scene> {
    let repository = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let places = [
        std::env::var_os("RELOOP_SHARED").map(PathBuf::from),
        Some(repository.join("../shared")),
        Some(repository.join("../../shared")),
    ];
    let real = places.into_iter().flatten().map(|place| place.join("data/womd-derived/20s")).find(|p| p.is_dir());
    let inputs: Vec<String> = real.iter().map(|folder| folder.to_str().unwrap().to_owned()).collect();
    let set = scenarios::SceneSet::open(&inputs).unwrap();
    let scenes = (0..set.entries().len()).map(|index| set.load(index).unwrap().0);
    scenes.max_by_key(|scene| scene.map().lanes.len()).unwrap()
}

fn bench(criterion: &mut Criterion) {
    let scene = scene();
    let route = Route::of_log(&scene, RouteStyle::Strict).unwrap();
    eprintln!("scene {}: {} lanes, {} samples", scene.id(), scene.map().lanes.len(), route.line.len());

    let mut building = criterion.benchmark_group("build");
    for style in [RouteStyle::Strict, RouteStyle::Paper] {
        building.bench_function(format!("{style:?}"), |bencher| {
            bencher.iter(|| Route::of_log(black_box(&scene), style));
        });
    }
    building.bench_function("Paper, with what matches lanes", |bencher| {
        bencher.iter(|| {
            (Route::of_log(black_box(&scene), RouteStyle::Paper), LanePoints::new(black_box(scene.map()), |_| true))
        });
    });
    building.bench_function("floor: a heading a sample", |bencher| {
        bencher.iter(|| (0..route.line.len()).map(|i| route.line.point(i).heading()).sum::<f64>());
    });
    building.finish();

    // The logged drive, step by step: nearest sample from the step before, then the window with the red rows.
    let drive: Vec<(Point, usize)> =
        (0..scene.steps()).filter_map(|step| Some((scene.av().states[step]?.position(), step))).collect();
    let mut steps = criterion.benchmark_group("step");
    let mut window = route.window(0, &[]);
    let (mut at, mut hint) = (0, 0);
    steps.bench_function("nearest sample and window", |bencher| {
        bencher.iter(|| {
            let (point, step) = drive[at];
            at = (at + 1) % drive.len();
            hint = route.nearest_sample_from(point, hint).0;
            route.move_window(&mut window, hint, scene.signals(step));
            window.samples + window.red_stops.len()
        });
    });
    let paper = Route::of_log(&scene, RouteStyle::Paper).unwrap();
    let lanes = LanePoints::new(scene.map(), |_| true);
    let mut paper_window = paper.window(0, &[]);
    steps.bench_function("Paper: nearest sample, window, lane of the limit, distance to the window", |bencher| {
        bencher.iter(|| {
            let (point, step) = drive[at];
            at = (at + 1) % drive.len();
            hint = paper.nearest_sample_from(point, hint).0;
            paper.move_window(&mut paper_window, hint, scene.signals(step));
            let lane = lanes.authors_match(scene.av().states[step].unwrap_or_default().pose());
            let rows = paper_window.start..paper_window.start + paper_window.samples;
            let distance = rows.map(|row| point.distance_squared(paper.line.point(row))).fold(f64::INFINITY, f64::min);
            (lane, distance, paper_window.red_stops.len())
        });
    });
    steps.bench_function("nearest sample without a hint", |bencher| {
        bencher.iter(|| {
            at = (at + 1) % drive.len();
            route.nearest_sample(drive[at].0)
        });
    });
    steps.bench_function("station and lateral offset", |bencher| {
        bencher.iter(|| {
            at = (at + 1) % drive.len();
            hint = route.nearest_sample_from(drive[at].0, hint).0;
            route.to_frenet(drive[at].0, hint)
        });
    });
    steps.bench_function("floor: distances to 20 samples", |bencher| {
        bencher.iter(|| {
            at = (at + 1) % drive.len();
            let point = drive[at].0;
            (0..20)
                .map(|i| point.distance_squared(route.line.point(i)))
                .fold(f64::INFINITY, |best, d| if d < best { d } else { best })
        });
    });
    steps.finish();
}

criterion_group!(benches, bench);
criterion_main!(benches);
