//! `sim compare --open`: two drives of a scene in one file for the viewer.

use std::fs;

use crate::stage::Stage;

/// The exit code and standard error, without a viewer on the path: nobody wants a window of a test.
fn open(stage: &Stage, arguments: &str) -> (Option<i32>, String) {
    let output = stage.command(arguments).env("PATH", "/usr/bin:/bin").output().unwrap();
    (output.status.code(), String::from_utf8(output.stderr).unwrap())
}

/// A scene that is recorded in `run`.
fn recorded(stage: &Stage, run: &str) -> String {
    let file = fs::read_dir(stage.path(&format!("{run}/episodes"))).unwrap().next().unwrap().unwrap().path();
    file.file_stem().unwrap().to_str().unwrap().to_owned()
}

#[test]
fn both_drives_of_a_scene_are_in_one_file_whose_bytes_are_the_same() {
    let stage = Stage::new();
    for driver in ["idm", "gn-ctrv"] {
        stage.good_sim(&format!("run --scenarios small.toml --driver {driver} --out {driver}"));
    }
    let scene = recorded(&stage, "idm");
    let told = open(&stage, &format!("compare idm gn-ctrv --open {scene} --rrd one.rrd"));
    assert!(told.0 == Some(0) && told.1.contains("one.rrd") && told.1.contains(" part"), "{told:?}");
    assert_eq!(open(&stage, &format!("compare idm gn-ctrv --open {scene} --rrd two.rrd")).0, Some(0));
    let [one, two] = ["one.rrd", "two.rrd"].map(|name| fs::read(stage.path(name)).unwrap());
    assert!(one == two && one.starts_with(b"RRF"), "{} and {} bytes", one.len(), two.len());
    let alone = fs::metadata(stage.path(&format!("idm/episodes/{scene}.rrd"))).unwrap().len();
    assert!(one.len() as u64 > alone, "{} bytes for both, {alone} for one", one.len());
}

#[test]
fn what_cannot_be_shown_is_said() {
    let stage = Stage::new();
    stage.good_sim("run --scenarios small.toml --driver idm --out idm");
    stage.good_sim("run --scenarios small.toml --driver idm --record none --out same");
    let nothing = open(&stage, "compare idm same --open");
    assert!(nothing.0 == Some(2) && nothing.1.contains("--open SCENE shows any"), "{nothing:?}");
    let nobody = open(&stage, "compare idm same --open nowhere");
    assert!(nobody.0 == Some(2) && nobody.1.contains("nowhere is not among"), "{nobody:?}");
    let scene = recorded(&stage, "idm");
    let unrecorded = open(&stage, &format!("compare idm same --open {scene}"));
    assert!(unrecorded.0 == Some(2) && unrecorded.1.contains("--record all"), "{unrecorded:?}");
}
