//! How fast scenes are generated, on one core: composed from a seed, checked, encoded. Each round makes another scene.
//!
//! Beside it, in the same run, the floor: the same scenes, ready, encoded alone.
//!
//! `cargo bench -p scenarios --bench generate`
#![allow(missing_docs, clippy::unwrap_used, reason = "a bench may fail by panic")]

use std::hint::black_box;
use std::time::Duration;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use scenarios::generated::{FAMILIES, Family, Parameters};
use scenarios::womd;

/// Scenes of each family that the floor is measured with, and rounds go through.
const SCENES: u32 = 16;

fn generate(criterion: &mut Criterion) {
    let parameters = Parameters::default();
    let payload = |family: &Family, index: u32| family.payload("bench", 1, index % SCENES, &parameters).unwrap();
    let mut group = criterion.benchmark_group("generate");
    group.sample_size(10).warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(2));
    for family in FAMILIES {
        group.throughput(Throughput::Elements(1));
        let mut index = 0;
        group.bench_function(family.name, |bencher| {
            bencher.iter(|| {
                index += 1;
                black_box(payload(family, index))
            });
        });
    }
    group.throughput(Throughput::Elements(FAMILIES.len() as u64));
    let mut index = 0;
    group.bench_function("one of each", |bencher| {
        bencher.iter(|| {
            index += 1;
            FAMILIES.iter().for_each(|family| drop(black_box(payload(family, index))));
        });
    });
    let payloads: Vec<Vec<u8>> =
        FAMILIES.iter().flat_map(|family| (0..SCENES).map(|index| payload(family, index))).collect();
    let scenes: Vec<_> = payloads.iter().map(|payload| womd::read(payload).unwrap().0).collect();
    let bytes: usize = payloads.iter().map(Vec::len).sum();
    eprintln!("a scene has {:.2} MB in the mean", bytes as f64 / 1e6 / scenes.len() as f64);
    group.throughput(Throughput::Elements(scenes.len() as u64));
    group.bench_function("floor: ready scenes encoded", |bencher| {
        bencher.iter(|| scenes.iter().for_each(|scene| drop(black_box(womd::write(scene)))));
    });
    group.finish();
}

criterion_group!(benches, generate);
criterion_main!(benches);
