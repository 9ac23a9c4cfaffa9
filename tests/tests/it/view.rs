//! `sim run --view` shows a run in a viewer, and neither a viewer that takes nothing, nor one that dies, nor none at all changes or holds anything.

use std::fs;
use std::os::unix::fs::PermissionsExt as _;

use crate::stage::{Ended, Stage, assert_same};

/// A program `rerun` that is this script, first on the PATH. What it is told comes in the file `said`.
fn viewer(stage: &Stage, script: &str) -> String {
    let folder = stage.path("bin");
    fs::create_dir(&folder).unwrap();
    let program = folder.join("rerun");
    let said = stage.path("said");
    fs::write(&program, format!("#!/bin/sh\necho \"$@\" > '{}'\n{script}\n", said.display())).unwrap();
    fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
    format!("{}:{}", folder.display(), std::env::var("PATH").unwrap())
}

/// Drives with `--view`.
fn drive(stage: &Stage, path: &str, more: &str) -> Ended {
    let mut command = stage.command(&format!("run --scenarios small.toml --driver idm --view --out run {more}"));
    let output = command.env("PATH", path).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    Ended { code: output.status.code(), out: text(output.stdout), err: text(output.stderr) }
}

/// The same run without a viewer.
fn without_view(more: &str) -> Stage {
    let stage = Stage::new();
    let ended = stage.sim(&format!("run --scenarios small.toml --driver idm --out run {more}"));
    assert_eq!(ended.code, Some(0), "{ended:?}");
    stage
}

/// The words that are found in a stream of Rerun, whose messages are packed: of its headers and stores' names.
fn pieces(stream: &[u8]) -> usize {
    stream.windows(4).filter(|four| four == b"RRF2").count()
}

#[test]
fn a_viewer_is_told_every_episode_in_pieces_while_it_is_driven_and_results_are_the_same() {
    for more in ["--record none", "--record none --in-process", "--record all"] {
        let stage = Stage::new();
        let shown = stage.path("shown.rrd");
        let path = viewer(&stage, &format!("cat > '{}'", shown.display()));
        let ended = drive(&stage, &path, more);
        assert_eq!(ended.code, Some(0), "{ended:?}");
        assert!(!ended.err.contains("left out") && !ended.err.contains("note"), "{}", ended.err);
        stage.wait_until_alone();
        assert_same(&without_view(more).files("run"), &stage.files("run"));
        let said = fs::read_to_string(stage.path("said")).unwrap();
        assert_eq!(said.trim(), "--bind 127.0.0.1 --memory-limit 2GB -");
        let stream = fs::read(&shown).unwrap();
        assert!(stream.starts_with(b"RRF2"), "it is a stream of Rerun");
        assert!(pieces(&stream) > 9, "three episodes in {} pieces", pieces(&stream));
    }
}

#[test]
fn a_viewer_that_takes_nothing_holds_nothing_up() {
    let stage = Stage::new();
    let path = viewer(&stage, "exec sleep 600 2>&-");
    let ended = drive(&stage, &path, "--record none");
    assert_eq!(ended.code, Some(0), "{ended:?}");
    assert!(!stage.processes().is_empty(), "the viewer stays: nobody waited for its end");
    assert!(ended.err.contains("the viewer takes nothing any more, and is left alone"), "{}", ended.err);
    assert_same(&without_view("--record none").files("run"), &stage.files("run"));
}

#[test]
fn a_viewer_that_dies_costs_nothing() {
    let stage = Stage::new();
    let path = viewer(&stage, "exec true");
    let ended = drive(&stage, &path, "--record none");
    assert_eq!(ended.code, Some(0), "{ended:?}");
    assert!(ended.err.contains("the viewer is gone, and the run goes on without it"), "{}", ended.err);
    assert!(!ended.err.contains("left out"), "nobody was slow: {}", ended.err);
    assert_same(&without_view("--record none").files("run"), &stage.files("run"));
}

#[test]
fn without_a_viewer_the_run_says_where_one_is_to_be_had_and_drives() {
    let stage = Stage::new();
    let ended = drive(&stage, "/nowhere", "--record none --in-process");
    assert_eq!(ended.code, Some(0), "{ended:?}");
    assert!(ended.err.contains("pip install rerun-sdk"), "{}", ended.err);
    assert!(ended.err.contains("note: there is no live view: it exited with code 2; the run goes on"), "{}", ended.err);
}
