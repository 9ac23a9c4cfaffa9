//! A recorder that dies or freezes costs recordings and no result.

use std::time::{Duration, Instant};

use nix::sys::signal::{Signal, kill};
use results::parquet::Table;

use crate::stage::{Stage, wait_until};

#[test]
fn a_recorder_killed_in_the_middle_is_started_again_and_the_run_says_so() {
    let stage = Stage::new();
    stage.good_sim("run --driver idm --scenarios small.toml --parallel 1 --out whole");
    let sim = stage.start("run --driver idm --scenarios small.toml --parallel 1 --out run");
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

#[test]
fn a_frozen_recorder_is_cut_off_once_and_another_takes_its_place() {
    let stage = Stage::new();
    let begin = Instant::now();
    stage.good_sim("run --driver idm --scenarios small.toml --parallel 1 --out whole");
    let whole = begin.elapsed();
    let begin = Instant::now();
    let sim = stage.start("run --driver idm --scenarios small.toml --parallel 1 --out run");
    wait_until("an episode is done", || stage.parts("run") > 0);
    let frozen = stage.wait_for("recorder");
    kill(frozen, Signal::SIGSTOP).unwrap();
    let output = sim.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    // 5 s until it is noticed, once; the rest is a busy machine's.
    let (took, most) = (begin.elapsed(), 3 * whole + Duration::from_secs(8));
    assert!(took < most, "it took {took:?}, a run without it {whole:?}\n{said}");
    stage.wait_until_alone();
    let read =
        |run: &str| Table::read(&stage.path(run).join("results.parquet")).unwrap().text("episode_sha256").unwrap();
    assert_eq!(read("run"), read("whole"), "results do not depend on the recorder");
}
