//! What it costs to merge a run's parts into its files: 500 and 10,000 episodes of 150 steps.
//!
//! `cargo bench -p results --bench merge`. The floor, measured beside, is to read and check the parts, and to compress their bytes
//! once at the level of the files.

#![allow(clippy::unwrap_used, missing_docs, reason = "a bench")]

#[path = "../tests/synthetic/mod.rs"]
mod synthetic;

use criterion::{Criterion, criterion_group, criterion_main};

const EPISODES: [usize; 2] = [500, 10_000];

fn merge(criterion: &mut Criterion) {
    EPISODES.iter().for_each(|episodes| merge_of(*episodes, criterion));
}

fn merge_of(episodes: usize, criterion: &mut Criterion) {
    let root = tempfile::tempdir().unwrap();
    let file = synthetic::run_file(episodes);
    let folder = synthetic::driven(root.path(), &file, 150);
    let mut group = criterion.benchmark_group(format!("{episodes} episodes of 150 steps"));
    group.sample_size(10);
    group.bench_function("merge", |bencher| {
        bencher.iter(|| results::merge(&folder, &file, None, |_, _| true).unwrap());
    });
    group.bench_function("floor: parts read, and compressed once", |bencher| {
        bencher.iter(|| {
            let parts = (0..episodes).map(|place| folder.part(&synthetic::scene(place)).unwrap().unwrap());
            parts.map(|part| zstd::bulk::compress(&part.to_bytes(), 1).unwrap().len()).sum::<usize>()
        });
    });
    group.finish();
}

criterion_group!(benches, merge);
criterion_main!(benches);
