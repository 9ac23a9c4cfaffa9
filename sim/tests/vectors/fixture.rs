//! `sim verify` on vectors of our own making, see `tests/fixtures/paper/README.md`.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use sim::verify::verify;
use vectors::{Npz, npz_files};

fn fixture() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/paper")
}

fn scenes() -> [String; 1] {
    [fixture().join("scenes.toml").display().to_string()]
}

#[test]
fn generated_scenes_are_driven_as_an_implementation_of_its_own_drives_them() {
    let report = verify(&scenes(), &fixture()).unwrap();
    println!("{report}");
    assert!(report.holds(), "{report}");
}

/// Scenes change; what the vectors are there for has to be in them all the same.
#[test]
fn the_vectors_hold_red_rows_crosswalks_and_every_end() {
    let mut ends = BTreeSet::new();
    let (mut red, mut crosswalks) = (0.0, 0.0);
    for file in npz_files(&fixture()).unwrap() {
        let Ok(text) = std::fs::read(file.with_extension("json")) else { continue };
        let words: serde_json::Value = serde_json::from_slice(&text).unwrap();
        ends.insert(words["end_reason"].as_str().unwrap().to_owned());
        let npz = Npz::read(&file).unwrap();
        let sum = |name: &str| npz.array(name, &[None]).unwrap().iter().sum::<f64>();
        red += sum("red_count");
        crosswalks += sum("crosswalk_count");
    }
    assert_eq!(ends.iter().map(String::as_str).collect::<Vec<_>>(), ["collision", "horizon", "off_route"]);
    assert!(red > 0.0 && crosswalks > 0.0, "{red} red rows, {crosswalks} on crosswalks");
}

#[test]
fn the_drive_of_another_policy_does_not_hold() {
    let folder = tempfile::tempdir().unwrap();
    for extension in ["npz", "json"] {
        let file = |policy: &str| format!("curve-2-0__{policy}.{extension}");
        std::fs::copy(fixture().join(file("human")), folder.path().join(file("constant-velocity"))).unwrap();
    }
    assert!(!verify(&scenes(), folder.path()).unwrap().holds());
}
