//! How long an answer takes, beside what the core can do: the time of its multiply-adds at the rate of one large product.

#![allow(clippy::unwrap_used, clippy::print_stdout, missing_docs, reason = "a bench")]

use std::hint::black_box;
use std::time::Instant;

use criterion::{Criterion, criterion_group, criterion_main};
use network::frame::{Frame, Tensors};
use network::gemm::{Begin, Finish, Left, Multiplier, Right};
use network::inference::{Forecast, Memory, Network};
use network::weights::formula;
use vectors::Npz;

fn frames() -> Vec<(String, Frame)> {
    let Some(folder) = vectors::shared("dipp/feature-vectors") else { return Vec::new() };
    let read = |path: std::path::PathBuf| {
        let npz = Npz::read(&path).unwrap();
        let single = |name: &str, shape: &[usize]| -> Vec<f32> {
            let shape: Vec<Option<usize>> = shape.iter().copied().map(Some).collect();
            npz.array(name, &shape).unwrap().iter().map(|value| *value as f32).collect()
        };
        let tensors = Tensors {
            ego: single("ego", &[20, 8]),
            neighbors: single("neighbors", &[10, 20, 9]),
            map_lanes: single("map_lanes", &[11, 6, 100, 17]),
            map_crosswalks: single("map_crosswalks", &[11, 4, 100, 3]),
        };
        (path.file_stem().unwrap().to_string_lossy().into_owned(), Frame::of_tensors(&tensors).unwrap())
    };
    vectors::npz_files(&folder).unwrap().into_iter().map(read).collect()
}

fn forecast(criterion: &mut Criterion) {
    // The floor: a product that is large enough to run at the core's rate.
    let (rows, inner, columns) = (960, 384, 256);
    let (left, weight) = (vec![0.5_f32; rows * inner], vec![0.25_f32; columns * inner]);
    let right = Right::of_rows(&weight, inner);
    let (bias, mut result) = (vec![0.0; columns], vec![0.0; rows * columns]);
    let mut multiplier = Multiplier::default();
    let mut best = f64::INFINITY;
    for _ in 0..50 {
        let begin = Instant::now();
        let left = Left::dense(black_box(&left), inner);
        multiplier.multiply(left, &right, Begin::Bias(&bias), Finish::Plain, &mut result, columns);
        black_box(&result);
        best = best.min(begin.elapsed().as_secs_f64());
    }
    let rate = (rows * inner * columns) as f64 / best;
    println!("a large product: {:.1} G multiply-adds a second", rate / 1e9);

    let network = Network::of(&formula::weights());
    let mut memory = Memory::default();
    let mut answer = Forecast::default();
    for (name, frame) in frames() {
        criterion.bench_function(&format!("forecast/{name}"), |bencher| {
            bencher.iter(|| network.forecast(black_box(&frame), &mut memory, &mut answer));
        });
    }
}

criterion_group!(benches, forecast);
criterion_main!(benches);
