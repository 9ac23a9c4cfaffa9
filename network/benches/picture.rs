//! What a picture of `cql` costs.
//!
//! `cargo bench -p network --bench picture` first prints, over generated scenes and the real ones of 20 s in `../shared/data/womd-derived/20s` where they
//! are, what it takes to draw the pictures along the logged drive, each step in its turn, and what a painter takes once a scene; then times one. Of each
//! step the least of three drives counts: what else the machine does only adds to it. One core.
//!
//! The floor. A picture of one brightness: as many bytes, written.
#![allow(clippy::unwrap_used, clippy::print_stdout, missing_docs, reason = "a bench")]

use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

use criterion::Criterion;
use network::cql::{AGES, PICTURE, Painter};
use scenarios::SceneSet;
use scenarios::generated::FAMILIES;
use world::observation::{HistoryStep, ObservedAgent};
use world::route::{Route, RouteStyle};
use world::scene::Scene;

/// What a picture may take (ms).
const BOUND: f64 = 2.0;
/// Where episodes begin.
const FIRST: usize = 19;

/// Who was where at a step, with others as the log has them.
fn history(scene: &Scene, step: usize) -> Option<HistoryStep> {
    let av = scene.av().states[step]?;
    let others = scene.tracks().iter().enumerate().filter(|(index, _)| *index != scene.av_index());
    let agents = others.filter_map(|(_, track)| {
        Some(ObservedAgent { track: track.id, kind: track.kind, state: track.states[step]?, unseen: 0 })
    });
    Some(HistoryStep { log_index: step as u32, av, agents: agents.collect() })
}

/// What can be seen at each step.
fn steps(scene: &Scene) -> Vec<(usize, Vec<HistoryStep>)> {
    let seen = (FIRST..scene.steps()).filter(|step| scene.av().states[*step].is_some());
    seen.map(|step| (step, AGES.iter().filter_map(|age| history(scene, step.checked_sub(*age as usize)?)).collect()))
        .collect()
}

fn painter(scene: &Scene) -> Painter {
    let line = Route::of_log(scene, RouteStyle::Strict).map(|route| route.line).unwrap_or_default();
    Painter::new(scene.map(), &line)
}

/// The least time of three (ms).
fn least(mut run: impl FnMut()) -> f64 {
    let mut least = f64::INFINITY;
    for _ in 0..3 {
        let begin = Instant::now();
        run();
        least = least.min(1e3 * begin.elapsed().as_secs_f64());
    }
    least
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn worst(values: &[f64]) -> f64 {
    values.iter().copied().fold(0.0, f64::max)
}

fn pace(name: &str, scenes: impl Iterator<Item = Arc<Scene>>) {
    let (mut all, mut scenes_own, mut once) = (Vec::new(), Vec::new(), Vec::new());
    for scene in scenes {
        let steps = steps(&scene);
        once.push(least(|| drop(black_box(painter(&scene)))));
        let mut least = vec![f64::INFINITY; steps.len()];
        for _ in 0..3 {
            let mut painter = painter(&scene);
            for ((step, seen), least) in steps.iter().zip(&mut least) {
                let begin = Instant::now();
                black_box(painter.paint(seen.iter(), scene.signals(*step).iter().copied()));
                *least = least.min(1e3 * begin.elapsed().as_secs_f64());
            }
        }
        scenes_own.push(mean(&least));
        all.extend(least);
    }
    println!(
        "{name}: {:.3} ms a picture (bound {BOUND} ms), {:.3} in the slowest of {} scenes, {:.3} the slowest of {} pictures; once a scene {:.2} ms, at most {:.2}",
        mean(&all),
        worst(&scenes_own),
        scenes_own.len(),
        worst(&all),
        all.len(),
        mean(&once),
        worst(&once)
    );
}

fn generated() -> impl Iterator<Item = Arc<Scene>> {
    let payload = |family: &scenarios::generated::Family| family.payload("bench", 1, 0, &Default::default()).unwrap();
    FAMILIES.iter().map(move |family| Arc::new(scenarios::womd::read(&payload(family)).unwrap().0))
}

fn main() {
    let mut bytes = vec![0_u8; PICTURE];
    let fill = least(|| (1..=100).for_each(|shade| black_box(&mut bytes).fill(shade)));
    println!("floor: {:.4} ms", fill / 100.0);
    pace("generated", generated());
    if let Some(folder) = vectors::shared("data/womd-derived/20s") {
        let set = SceneSet::open(&[folder.display().to_string()]).unwrap();
        pace("real, 20 s", (0..set.entries().len()).map(|index| set.load(index).unwrap().0));
    }

    let mut criterion = Criterion::default().configure_from_args();
    let scene = generated().next().unwrap();
    let (steps, mut painter) = (steps(&scene), painter(&scene));
    let (step, seen) = &steps[steps.len() / 2];
    criterion.bench_function("picture", |b| {
        b.iter(|| black_box(painter.paint(seen.iter(), scene.signals(*step).iter().copied()).len()));
    });
    criterion.final_summary();
}
