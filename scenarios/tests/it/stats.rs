//! Figures of sets: of real scenes as they were measured before, and the files that `scenarios stats` writes.

use std::fs::File;
use std::path::Path;
use std::process::{Command, Output};

use arrow_array::cast::AsArray;
use arrow_array::types::Float64Type;
use arrow_array::{Array, RecordBatch};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use scenarios::SceneSet;
use scenarios::stats::{self, COLUMNS, Quantity, Share};

use crate::real_data;

#[test]
fn medians_of_real_scenes_are_those_of_another_implementation() {
    let Some(data) = real_data() else { return };
    let shard = data.join("train-9s/womd9s-00000-of-00009.tfrecord.gz");
    if !shard.exists() {
        eprintln!("skipped: no packed scenes here");
        return;
    }
    let set = SceneSet::open(&[shard.to_string_lossy().into_owned()]).unwrap();
    let load = |index: usize| set.load(index).map(|(scene, _)| scene);
    let (samples, _) = stats::measure(set.entries().len(), load).unwrap();
    // Of 502 scenes, which these 50 are among; hence the room.
    for (quantity, percent, expected) in [
        (Quantity::VehicleLength, 50.0, 4.63),
        (Quantity::VehicleWidth, 50.0, 2.07),
        (Quantity::PedestrianHeight, 50.0, 1.73),
        (Quantity::MovingToLane, 50.0, 0.30),
        (Quantity::VehicleSpeed, 50.0, 8.96),
        (Quantity::VehicleAcceleration, 50.0, 0.25),
        (Quantity::PedestrianSpeed, 50.0, 1.12),
        (Quantity::GapBothMoving, 50.0, 18.85),
        (Quantity::HeadwayBothMoving, 50.0, 1.98),
        (Quantity::AvAbsAcceleration, 50.0, 0.66),
        (Quantity::LaneLength, 50.0, 16.4),
        (Quantity::LargestCurvature, 75.0, 0.154),
        (Quantity::Turn, 75.0, 85.3),
        (Quantity::LaneWidth, 50.0, 3.48),
        (Quantity::ControlledLength, 50.0, 34.5),
        (Quantity::CrosswalkShort, 50.0, 3.23),
    ] {
        let value = samples.percentile(quantity, percent).unwrap();
        assert!((value / expected - 1.0).abs() < 0.08, "{quantity:?} at {percent} %: {value}, not {expected}");
    }
    let on_lane = samples.count(Share::OnLane).share().unwrap();
    assert!((0.34..0.48).contains(&on_lane), "{on_lane}");
}

fn stats(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_scenarios"));
    command.arg("stats").args(arguments).current_dir(folder).env_remove("RUST_LOG").env("COLUMNS", "200");
    command.output().unwrap()
}

fn read(path: &Path) -> RecordBatch {
    let reader = ParquetRecordBatchReaderBuilder::try_new(File::open(path).unwrap()).unwrap().build().unwrap();
    let batches: Vec<RecordBatch> = reader.map(Result::unwrap).collect();
    assert_eq!(batches.len(), 1);
    batches[0].clone()
}

#[test]
fn the_table_has_all_sections_and_the_files_all_rows() {
    let folder = tempfile::tempdir().unwrap();
    let output = stats(folder.path(), &["demo", "--parquet", "all.parquet", "--per-scene", "each.parquet"]);
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success(), "{text}");
    for section in stats::Section::ALL {
        assert!(text.contains(&format!("\n{section}\n")), "{section}: {text}");
    }
    let all = read(&folder.path().join("all.parquet"));
    assert_eq!(all.num_rows(), Quantity::ALL.len() + Share::ALL.len());
    let names: Vec<String> = all.schema().fields().iter().map(|field| field.name().clone()).collect();
    assert_eq!(names, ["section", "quantity", "unit", "p5", "p25", "p50", "p75", "p95", "mean", "n"]);
    let each = read(&folder.path().join("each.parquet"));
    let scenes = SceneSet::open(&["demo".to_owned()]).unwrap().entries().len();
    assert_eq!((each.num_rows(), each.num_columns()), (scenes, COLUMNS.len() + 1));
    let numbers = |name: &str| each.column_by_name(name).unwrap().as_primitive::<Float64Type>().clone();
    assert!(numbers("vehicles").iter().all(|vehicles| vehicles.is_some_and(|vehicles| vehicles >= 1.0)));
    assert!(numbers("cyclist_speed_median_mps").iter().flatten().all(f64::is_finite));
    assert_eq!(numbers("steps").null_count(), 0);
}

#[test]
fn the_same_scenes_are_the_same_bytes_and_markdown_is_markdown() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    let first = stats(folder.path(), &["demo", "--markdown", "--parquet", "1", "--per-scene", "2"]);
    let again = stats(folder.path(), &["demo", "--markdown", "--parquet", "3", "--per-scene", "4"]);
    assert_eq!((first.stdout.clone(), bytes("1"), bytes("2")), (again.stdout, bytes("3"), bytes("4")));
    let text = String::from_utf8(first.stdout).unwrap();
    assert!(text.contains("## Lanes\n\n| quantity ") && text.contains("\n|----"), "{text}");
}

#[test]
fn a_file_that_cannot_be_written_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let output = stats(folder.path(), &["demo", "--parquet", "nowhere/all.parquet"]);
    let text = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{text}");
    assert!(text.contains("error: nowhere/all.parquet: ") && text.contains("hint: "), "{text}");
}
