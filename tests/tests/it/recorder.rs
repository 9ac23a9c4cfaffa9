//! A recorder that dies costs recordings and no result.

use nix::sys::signal::{Signal, kill};
use results::parquet::Table;

use crate::stage::{Stage, wait_until};

#[test]
fn a_recorder_killed_in_the_middle_is_started_again_and_the_run_says_so() {
    let stage = Stage::new();
    stage.good_sim("run --scenarios small.toml --parallel 1 --out whole");
    let sim = stage.start("run --scenarios small.toml --parallel 1 --out run");
    wait_until("an episode is done", || stage.parts("run") > 0);
    kill(stage.wait_for("recorder"), Signal::SIGKILL).unwrap();
    let output = sim.wait_with_output().unwrap();
    let (code, said) = (output.status.code(), String::from_utf8_lossy(&output.stderr));
    stage.wait_until_alone();

    let read =
        |run: &str, column: &str| Table::read(&stage.path(run).join("results.parquet")).unwrap().text(column).unwrap();
    assert_eq!(read("run", "episode_sha256"), read("whole", "episode_sha256"), "results do not depend on the recorder");
    let (scenes, errors) = (read("run", "scene"), read("run", "recording_error"));
    let broken = errors.iter().filter(|error| !error.is_empty()).count();
    assert!(broken <= 1, "{errors:?}");
    assert_eq!(code, Some(broken as i32));
    let (whole, run) = (stage.files("whole"), stage.files("run"));
    for (scene, error) in scenes.iter().zip(&errors) {
        let name = format!("episodes/{scene}.mcap");
        if error.is_empty() {
            assert!(whole[&name] == run[&name], "{name} differs\n{said}");
        }
    }
    if broken == 1 {
        assert!(stage.sim("table run").out.contains("is not recorded whole"));
    }
}
