//! How fast WOMD files are read: bytes in memory to checked scenes, both checksums of every record verified, on one core.
//!
//! Beside it, in the same run, what it consists of: the frames alone, and the floor of all reading: a CRC32C and a copy of the
//! bytes. Real 20 s scenes where they are present (`RELOOP_SHARED`, or `../shared` beside the repository), else the generated ones.
//!
//! `cargo bench -p scenarios --bench read`
#![allow(missing_docs, clippy::unwrap_used, reason = "a bench may fail by panic")]

use std::hint::black_box;
use std::path::PathBuf;
use std::time::Duration;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use scenarios::tfrecord::{Records, append_record};
use scenarios::{SceneSet, womd};

/// One file of all scenes.
fn file() -> (&'static str, Vec<u8>) {
    let repository = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("..");
    let places = [
        std::env::var_os("RELOOP_SHARED").map(PathBuf::from),
        Some(repository.join("../shared")),
        Some(repository.join("../../shared")),
    ];
    let real = places.into_iter().flatten().map(|place| place.join("data/womd-derived/20s")).find(|data| data.is_dir());
    let (name, inputs) = match real {
        Some(folder) => ("real 20 s scenes", vec![folder.to_string_lossy().into_owned()]),
        None => ("generated scenes", vec![]),
    };
    let set = SceneSet::open(&inputs).unwrap();
    let mut file = Vec::new();
    for index in 0..set.entries().len() {
        append_record(&mut file, &set.payload(index).unwrap());
    }
    (name, file)
}

fn read(criterion: &mut Criterion) {
    let (name, file) = file();
    eprintln!("{name}: {:.1} MB", file.len() as f64 / 1e6);
    let mut group = criterion.benchmark_group("read");
    group.throughput(Throughput::BytesDecimal(file.len() as u64));
    group.sample_size(10).warm_up_time(Duration::from_millis(500)).measurement_time(Duration::from_secs(4));
    group.bench_function("scenes", |bencher| {
        bencher.iter(|| {
            let mut records = Records::new(&file[..]);
            while let Some(record) = records.next_record().unwrap() {
                black_box(womd::read(record.payload).unwrap());
            }
        });
    });
    group.bench_function("frames and checksums alone", |bencher| {
        bencher.iter(|| {
            let mut records = Records::new(&file[..]);
            while let Some(record) = records.next_record().unwrap() {
                black_box(record.payload);
            }
        });
    });
    group.bench_function("floor: CRC32C and a copy", |bencher| {
        let mut copy = vec![0; file.len()];
        bencher.iter(|| {
            copy.copy_from_slice(black_box(&file));
            black_box(crc32c::crc32c(&copy))
        });
    });
    group.finish();
}

criterion_group!(benches, read);
criterion_main!(benches);
