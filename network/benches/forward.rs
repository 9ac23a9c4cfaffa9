//! What features and an answer cost.
//!
//! `cargo bench -p network --bench forward` first prints, over the eight real frames of `../shared/dipp/feature-vectors` (or generated
//! ones where that is missing), the best of many for each: features, an answer at batch 1, and at batch 32; then times one of each.
//! One core.
//!
//! The floor. What remains of the network's multiply-adds for a frame, at the rate that the same machine reaches in a product of
//! 3,000 x 384 x 256, the largest of its own; measured in the same run. `checks/pytorch.py` times PyTorch on the same frames.
#![allow(clippy::unwrap_used, clippy::print_stdout, missing_docs, reason = "a bench")]

use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

use criterion::Criterion;
use network::features::{SceneFeatures, Settings, Window};
use network::inference::{Network, Workspace, bench_product};
use network::verify;
use network::weights::{Variant, Weights};
use network::{Frame, Prediction};
use scenarios::SceneSet;
use scenarios::generated::FAMILIES;
use world::scene::Scene;

struct Case {
    name: String,
    scene: Arc<Scene>,
    window: Window,
    frame: Frame,
}

fn cases() -> Vec<Case> {
    let real = vectors::shared("dipp/feature-vectors").zip(vectors::shared("data/womd-derived/20s"));
    let Some((folder, scenes)) = real else { return generated() };
    let set = SceneSet::open(&[scenes.display().to_string()]).unwrap();
    let case = |path: &std::path::PathBuf| {
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        let scene = name.split('_').next()?;
        let index = set.entries().iter().position(|entry| entry.id.as_str() == scene)?;
        let (scene, npz) = (set.load(index).unwrap().0, vectors::Npz::read(path).unwrap());
        let (window, frame) = (verify::window(&npz, &scene).unwrap(), verify::frame(&npz).unwrap());
        Some(Case { name, scene, window, frame })
    };
    vectors::npz_files(&folder).unwrap().iter().filter_map(case).collect()
}

fn generated() -> Vec<Case> {
    let case = |family: &scenarios::generated::Family| {
        let scene = scenarios::womd::read(&family.payload("bench", 1, 0, &Default::default()).unwrap()).unwrap().0;
        let window = Window::logged(&scene, 60).unwrap();
        let frame = SceneFeatures::new(scene.map(), Settings::Authors).at(&window).frame;
        Case { name: family.name.to_owned(), scene: Arc::new(scene), window, frame }
    };
    FAMILIES.iter().map(case).collect()
}

/// The best time of many (s): what else the machine does only adds to it.
fn best(mut run: impl FnMut()) -> f64 {
    let start = Instant::now();
    let mut best = f64::INFINITY;
    let mut times = 0;
    while times < 5 || start.elapsed().as_secs_f64() < 0.4 {
        let begin = Instant::now();
        run();
        best = best.min(begin.elapsed().as_secs_f64());
        times += 1;
    }
    best
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn main() {
    let network = Network::new(&Weights::formula(Variant::Joint)).unwrap();
    let (mut workspace, mut out) = (Workspace::new(1), [Prediction::empty()]);
    let rate = 3000.0 * 384.0 * 256.0 / best(bench_product(3000, 384, 256));
    println!("products: {:.0} GFLOP/s", 2e-9 * rate);
    let cases = cases();
    let (mut forwards, mut floors, mut features) = (Vec::new(), Vec::new(), Vec::new());
    for case in &cases {
        let forward = best(|| network.forward(&[&case.frame], &mut workspace, &mut out));
        let floor = network.multiply_adds(&workspace.work()) as f64 / rate;
        let own = [Settings::Authors, Settings::Mended].map(|settings| {
            let prepared = SceneFeatures::new(case.scene.map(), settings);
            best(|| drop(black_box(prepared.at(&case.window))))
        });
        let prepare = best(|| drop(black_box(SceneFeatures::new(case.scene.map(), Settings::Authors))));
        println!(
            "{:24} answer {:5.2} ms, floor {:5.2} ms ({:.2}x); features {:.2} ms (mended {:.2}), once a scene {:.0} ms",
            case.name,
            1e3 * forward,
            1e3 * floor,
            forward / floor,
            1e3 * own[0],
            1e3 * own[1],
            1e3 * prepare
        );
        forwards.push(forward);
        floors.push(floor);
        features.push(own[0]);
    }
    let batch: Vec<&Frame> = cases.iter().map(|case| &case.frame).cycle().take(32).collect();
    let mut answers = vec![Prediction::empty(); 32];
    let mut shared = Workspace::new(8);
    let together = best(|| network.forward(&batch, &mut shared, &mut answers)) / 32.0;
    println!(
        "median: answer {:.2} ms, floor {:.2} ms, features {:.2} ms; at batch 32 {:.2} ms a frame",
        1e3 * median(forwards),
        1e3 * median(floors),
        1e3 * median(features),
        1e3 * together
    );

    let mut criterion = Criterion::default().configure_from_args();
    let case = &cases[0];
    criterion.bench_function("forward", |b| b.iter(|| network.forward(&[&case.frame], &mut workspace, &mut out)));
    let prepared = SceneFeatures::new(case.scene.map(), Settings::Authors);
    criterion.bench_function("features", |b| b.iter(|| prepared.at(&case.window)));
    criterion.final_summary();
}
