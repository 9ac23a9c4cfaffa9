//! What it costs to open a set before its first scene is loaded: a plain file of 350 MB, its index, a thousand generated scenes.
//!
//! Beside it, in the same run, what finding all damage at once would cost: the file read whole, checksums verified and hashes taken; and the
//! floor: the frames of the file alone, two small reads a record.
//!
//! Scenes are real ones where they are present (`RELOOP_SHARED`, or `../shared` beside the repository), else generated, each with a name of
//! its own.
//!
//! `cargo bench -p scenarios --bench open`
#![allow(missing_docs, clippy::unwrap_used, reason = "a bench may fail by panic")]

use std::fs::{self, File};
use std::hint::black_box;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use criterion::{Criterion, criterion_group, criterion_main};
use scenarios::tfrecord::{Frames, append_record};
use scenarios::{SceneSet, womd};
use world::scene::{Scene, SceneParts};

const BYTES: usize = 350_000_000;

fn open(input: &Path) -> SceneSet {
    SceneSet::open(&[input.to_string_lossy().into_owned()]).unwrap()
}

/// Writes scenes one after the other, again and again, until there are enough bytes; how many there are then.
fn write(path: &Path) -> usize {
    let repository = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("..");
    let places = [
        std::env::var_os("RELOOP_SHARED").map(PathBuf::from),
        Some(repository.join("../shared")),
        Some(repository.join("../../shared")),
    ];
    let real = places.into_iter().flatten().map(|place| place.join("data/womd-derived")).find(|data| data.is_dir());
    let set = real.map_or_else(|| SceneSet::open(&[]).unwrap(), |folder| open(&folder));
    let mut file = BufWriter::new(File::create(path).unwrap());
    let (mut scenes, mut bytes) = (0, 0);
    while bytes < BYTES {
        let (scene, _) = set.load(scenes % set.entries().len()).unwrap();
        let parts = SceneParts { id: format!("scene-{scenes}"), ..Scene::clone(&scene).into_parts() };
        let mut record = Vec::new();
        append_record(&mut record, &womd::write(&parts.check().unwrap().0));
        file.write_all(&record).unwrap();
        (scenes, bytes) = (scenes + 1, bytes + record.len());
    }
    scenes
}

fn bench(criterion: &mut Criterion) {
    let folder = tempfile::tempdir().unwrap();
    let [plain, index, one, made] =
        ["plain.tfrecord", "plain.index", "one.toml", "made.toml"].map(|name| folder.path().join(name));
    let scenes = write(&plain);
    eprintln!("{:.0} MB in {scenes} scenes", fs::metadata(&plain).unwrap().len() as f64 / 1e6);
    fs::write(&index, open(&plain).index(folder.path())).unwrap();
    fs::write(&one, format!("files = ['plain.tfrecord']\nscenes = ['scene-{}']", scenes / 2)).unwrap();
    fs::write(&made, "[[generate]]\nfamily = 'all'\ncount = 50").unwrap();
    let mut group = criterion.benchmark_group("open");
    group.sample_size(10).warm_up_time(Duration::from_millis(500)).measurement_time(Duration::from_secs(3));
    group.bench_function("a plain file", |bencher| bencher.iter(|| black_box(open(&plain))));
    group.bench_function("a plain file, one scene kept and loaded", |bencher| {
        bencher.iter(|| black_box(open(&one).load(0).unwrap()));
    });
    group.bench_function("its index", |bencher| bencher.iter(|| black_box(open(&index))));
    group.bench_function("a thousand generated scenes", |bencher| bencher.iter(|| black_box(open(&made))));
    group.bench_function("a plain file, and all verified on all cores", |bencher| {
        bencher.iter(|| open(&plain).verify().unwrap());
    });
    group.bench_function("floor: frames alone", |bencher| {
        bencher.iter(|| {
            let file = File::open(&plain).unwrap();
            let length = file.metadata().unwrap().len();
            let mut frames = Frames::new(file, length);
            while let Some(frame) = frames.next_frame().unwrap() {
                black_box(frame);
            }
        });
    });
    group.finish();
}

criterion_group!(benches, bench);
criterion_main!(benches);
