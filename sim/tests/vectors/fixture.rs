//! `sim verify` on vectors of our own making, see `tests/fixtures/paper/README.md`.

use std::path::{Path, PathBuf};

use sim::verify::verify;

fn fixture() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/paper")
}

fn demo() -> [String; 1] {
    ["demo".to_owned()]
}

#[test]
fn the_demo_scenes_are_driven_as_an_implementation_of_its_own_drives_them() {
    let report = verify(&demo(), &fixture()).unwrap();
    println!("{report}");
    assert!(report.holds(), "{report}");
}

#[test]
fn the_drive_of_another_policy_does_not_hold() {
    let folder = tempfile::tempdir().unwrap();
    for extension in ["npz", "json"] {
        let file = |policy: &str| format!("demo-curve__{policy}.{extension}");
        std::fs::copy(fixture().join(file("human")), folder.path().join(file("constant-velocity"))).unwrap();
    }
    assert!(!verify(&demo(), folder.path()).unwrap().holds());
}
