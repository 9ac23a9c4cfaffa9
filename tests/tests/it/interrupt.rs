//! Ctrl-C leaves nothing running, whenever it comes.

use std::thread::sleep;
use std::time::{Duration, Instant};

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

use crate::stage::{Stage, assert_same, wait_until};

/// Sends `signal` to a run after `wait`: how it ended, and what it said.
fn interrupted(stage: &Stage, signal: Signal, wait: impl FnOnce()) -> (Option<i32>, String) {
    let sim = stage.start("run --driver idm --scenarios small.toml --parallel 2 --out run");
    wait();
    let begin = Instant::now();
    let _ = kill(Pid::from_raw(sim.id() as i32), signal);
    let output = sim.wait_with_output().unwrap();
    assert!(begin.elapsed() < Duration::from_secs(10), "it took {:?} to stop", begin.elapsed());
    stage.wait_until_alone();
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

#[test]
fn ctrl_c_while_driving_stops_cleanly_and_the_run_can_be_continued() {
    let stage = Stage::new();
    stage.good_sim("run --driver idm --scenarios small.toml --parallel 2 --out whole");
    let (code, said) =
        interrupted(&stage, Signal::SIGINT, || wait_until("an episode is done", || stage.parts("run") > 0));
    assert_eq!(code, Some(130), "{said}");
    assert!(said.contains("interrupted: ") && said.contains("the same command continues the run in run"), "{said}");
    stage.good_sim("run --driver idm --scenarios small.toml --parallel 2 --out run");
    assert_same(&stage.files("whole"), &stage.files("run"));
}

#[test]
fn ctrl_c_at_any_moment_of_the_start_leaves_nothing_running() {
    for milliseconds in [0, 30, 80, 150, 300] {
        let stage = Stage::new();
        let (code, said) = interrupted(&stage, Signal::SIGTERM, || sleep(Duration::from_millis(milliseconds)));
        // Before the handler stands, the signal itself ends the program; nothing is begun then.
        let not_begun = code.is_none() && !stage.path("run").exists();
        // A quick machine is done with these few scenes before it is interrupted.
        let over = code == Some(0);
        stage.wait_until_alone();
        assert!(code == Some(130) || not_begun || over, "after {milliseconds} ms: {code:?} {said}");
    }
}

#[test]
fn ctrl_c_while_waiting_for_a_planner_that_never_comes_stops_at_once() {
    let stage = Stage::new();
    let sim = stage.start("run --scenarios small.toml --planner external --out run");
    stage.wait_for("recorder");
    kill(Pid::from_raw(sim.id() as i32), Signal::SIGINT).unwrap();
    let output = sim.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130));
    assert!(String::from_utf8_lossy(&output.stderr).contains("--endpoint unixsock-stream/"));
    stage.wait_until_alone();
}

#[test]
fn a_killed_sim_leaves_no_process_behind() {
    let stage = Stage::new();
    let mut sim = stage.start("run --driver idm --scenarios small.toml --parallel 2 --out run");
    stage.wait_for("planner-node");
    sleep(Duration::from_millis(300));
    sim.kill().unwrap();
    sim.wait().unwrap();
    stage.wait_until_alone();
}
