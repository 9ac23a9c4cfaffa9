//! How fast an episode steps, without nodes and recorder: 128 agents around the AV; collision, time to collision, route,
//! lanes, road and signals judged. `cargo bench -p episode --bench step`.
//!
//! Each line of `step` is a whole drive of 150 steps; the throughput is steps per second. The floor is what no judge of 128 agents can
//! be faster than: reading three numbers of each and comparing.
//!
//! The groups `prepare` are of a generated scene, and of a real scene of 9 s where one is at hand (`RELOOP_SHARED`, or `../shared` beside
//! the repository): what it costs to read, to lint and to prepare it, and its whole drive by the logged AV, all of that included. Their
//! floor is one pass over the points of the map, each compared with one place.

#![allow(missing_docs, clippy::unwrap_used, reason = "a bench")]

use std::hint::black_box;
use std::path::PathBuf;
use std::sync::Arc;

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use episode::Episode;
use episode::driver::{Driver, drive};
use episode::protocol::{EndingCollision, Protocol, StrictSettings};
use episode::strict::traffic::Traffic;
use scenarios::generated::{FAMILIES, Parameters};
use scenarios::lint::lint;
use scenarios::{SceneSet, womd};
use world::geometry::Point;
use world::plan::Plan;
use world::scene::Scene;
use world::scene::bridged::Bridged;

#[path = "../tests/straight_road/mod.rs"]
mod straight_road;
use straight_road::{LogReplay, StraightRoad, car, straight_on};

const AGENTS: usize = 128;

/// Both lanes full, and parked cars on both sides of the road.
fn crowded() -> Arc<Scene> {
    let mut road = StraightRoad::new();
    for index in 0..AGENTS / 4 {
        let x = 12.0 * index as f64;
        road = road
            .with(car(x + 9.0, 0.0, 0.0, 10.0))
            .with(car(x + 3.0, 3.5, std::f64::consts::PI, 9.0))
            .with(car(x, -4.0, 0.0, 0.0))
            .with(car(x, 7.5, std::f64::consts::PI, 0.0));
    }
    road.scene()
}

fn plans(episode: &Episode, driver: &mut impl Driver) -> Vec<Plan> {
    let mut episode = episode.clone();
    let mut plans = Vec::new();
    while episode.ended().is_none() {
        let plan = driver.plan(&episode.observe()).unwrap();
        episode.advance(&plan);
        plans.push(plan);
    }
    plans
}

fn step(criterion: &mut Criterion) {
    let scene = crowded();
    let settings = StrictSettings { ending_collision: EndingCollision::None, ..StrictSettings::default() };
    let episode = Episode::new(Arc::clone(&scene), &Protocol::Strict(settings.clone())).unwrap();
    let by_controls = plans(&episode, &mut straight_on());
    let by_states = plans(&episode, &mut LogReplay(Arc::clone(&scene)));
    let steps = by_controls.len();
    assert_eq!(steps, 150);

    let mut group = criterion.benchmark_group("step");
    group.sample_size(30);
    group.throughput(Throughput::Elements(steps as u64));
    let advance = |plans: &[Plan], mut episode: Episode| {
        for plan in plans {
            black_box(episode.advance(plan));
        }
        episode
    };
    group.bench_function("advance_by_controls", |bencher| {
        bencher.iter_batched(|| episode.clone(), |episode| advance(&by_controls, episode), BatchSize::SmallInput);
    });
    group.bench_function("advance_by_tracker", |bencher| {
        bencher.iter_batched(|| episode.clone(), |episode| advance(&by_states, episode), BatchSize::SmallInput);
    });
    group.bench_function("observe_and_advance", |bencher| {
        let drive = |mut episode: Episode| {
            for plan in &by_states {
                black_box(episode.observe());
                black_box(episode.advance(plan));
            }
            episode
        };
        bencher.iter_batched(|| episode.clone(), drive, BatchSize::SmallInput);
    });
    group.bench_function("observe", |bencher| {
        bencher.iter(|| (0..steps).for_each(|_| drop(black_box(episode.observe()))));
    });
    let traffic = Traffic::of(&Bridged::of(&scene));
    group.bench_function("floor_one_pass_over_the_agents", |bencher| {
        let nowhere = Point::new(1e9, 0.0);
        bencher.iter(|| {
            for step in 0..steps {
                traffic.for_each_near(step, black_box(nowhere), 10.0, |agent| {
                    black_box(agent);
                });
            }
        });
    });
    group.finish();

    let mut group = criterion.benchmark_group("episode");
    group.sample_size(20);
    group.bench_function("new", |bencher| {
        bencher.iter(|| Episode::new(Arc::clone(&scene), &Protocol::Strict(settings.clone())).unwrap());
    });
    let driven = advance(&by_states, episode.clone());
    group.bench_function("finish", |bencher| {
        bencher.iter_batched(|| driven.clone(), |episode| episode.finish(), BatchSize::SmallInput);
    });
    group.finish();
}

/// What a scene is read from.
fn payloads() -> Vec<(&'static str, Vec<u8>)> {
    let urban = FAMILIES.iter().find(|family| family.name == "urban").unwrap();
    let mut payloads = vec![("urban", urban.payload("bench", 1, 0, &Parameters::default()).unwrap())];
    let repository = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("..");
    let shared = std::env::var_os("RELOOP_SHARED").map(PathBuf::from);
    let places = shared.into_iter().chain(["../shared", "../../shared"].map(|place| repository.join(place)));
    if let Some(folder) = places.map(|place| place.join("data/womd-derived/9s")).find(|folder| folder.is_dir()) {
        let set = SceneSet::open(&[folder.display().to_string()]).unwrap();
        payloads.push(("real", set.payload(0).unwrap().to_vec()));
    }
    payloads
}

fn prepare(criterion: &mut Criterion) {
    for (name, payload) in payloads() {
        let mut group = criterion.benchmark_group(format!("prepare/{name}"));
        group.sample_size(20);
        let read = || {
            let (scene, findings) = womd::read(&payload).unwrap();
            (Arc::new(scene), findings)
        };
        let (scene, findings) = read();
        let new = |scene: &Arc<Scene>| Episode::new(Arc::clone(scene), &Protocol::default()).unwrap();
        group.bench_function("read", |bencher| bencher.iter(read));
        group.bench_function("lint", |bencher| bencher.iter(|| lint(&scene, &findings)));
        group.bench_function("new", |bencher| bencher.iter(|| new(&scene)));
        group.bench_function("read_lint_and_drive", |bencher| {
            bencher.iter(|| {
                let (scene, findings) = read();
                (lint(&scene, &findings), drive(new(&scene), &mut LogReplay(scene)))
            });
        });
        let map = scene.map();
        let lanes = map.lanes.iter().map(|lane| &lane.centerline);
        let lines = map.road_lines.iter().map(|line| &line.polyline);
        let edges = map.road_edges.iter().map(|edge| &edge.polyline);
        let points: Vec<Point> = lanes.chain(lines).chain(edges).flatten().map(|point| point.xy()).collect();
        group.bench_function("floor_one_pass_over_the_map", |bencher| {
            let near = |place: Point| points.iter().filter(|point| point.distance_squared(place) < 100.0).count();
            bencher.iter(|| near(black_box(points[0])));
        });
        group.finish();
    }
}

criterion_group!(benches, step, prepare);
criterion_main!(benches);
