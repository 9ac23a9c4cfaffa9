//! A run that stands still for a while (Ctrl-Z, `docker pause`, a laptop that sleeps) comes out as if it had not.

use std::thread::sleep;
use std::time::Duration;

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

use crate::stage::{Stage, assert_same, wait_until};

/// Who is stopped.
#[derive(Clone, Copy, Debug)]
enum Who {
    Sim,
    All,
}

fn run(stage: &Stage, name: &str, more: &str) -> std::process::Child {
    stage.start(&format!("run --driver idm --parallel 1 {more} --out {name}"))
}

/// Stops `who` in the middle of a run, for so long; the run's files are those of a run that was left alone.
fn costs_nothing(who: Who, seconds: u64, more: &str) {
    let stage = Stage::new();
    let whole = run(&stage, "whole", more).wait_with_output().unwrap();
    assert_eq!(whole.status.code(), Some(0), "{}", String::from_utf8_lossy(&whole.stderr));
    let sim = run(&stage, "run", more);
    wait_until("an episode is done", || stage.parts("run") > 0);
    let everybody = stage.processes();
    let stopped: Vec<Pid> = match who {
        Who::Sim => vec![Pid::from_raw(sim.id() as i32)],
        Who::All => everybody.into_iter().map(|(pid, _)| pid).collect(),
    };
    let signal = |signal| stopped.iter().for_each(|pid| kill(*pid, signal).unwrap());
    signal(Signal::SIGSTOP);
    assert!(stage.parts("run") < 16, "the run was over before it was stopped");
    sleep(Duration::from_secs(seconds));
    signal(Signal::SIGCONT);
    let output = sim.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{who:?} for {seconds} s: {said}");
    stage.wait_until_alone();
    assert_same(&stage.files("whole"), &stage.files("run"));
}

#[test]
fn a_pause_of_the_sim_beyond_the_deadline() {
    costs_nothing(Who::Sim, 3, "--deadline 1s");
}

#[test]
fn a_pause_of_all_of_it_beyond_the_deadline() {
    costs_nothing(Who::All, 3, "--deadline 1s");
}

/// As a long pause may cost it its connection. The one in its place is told of those episodes alone that begin with it.
#[test]
fn a_recorder_that_is_lost_in_a_pause() {
    let stage = Stage::new();
    let whole = run(&stage, "whole", "").wait_with_output().unwrap();
    assert_eq!(whole.status.code(), Some(0), "{}", String::from_utf8_lossy(&whole.stderr));
    for late in 0..4 {
        let name = format!("run-{late}");
        let sim = run(&stage, &name, "");
        wait_until("an episode is done", || stage.parts(&name) > 0);
        sleep(Duration::from_millis(60 * late));
        let pid = Pid::from_raw(sim.id() as i32);
        kill(pid, Signal::SIGSTOP).unwrap();
        kill(stage.wait_for("recorder"), Signal::SIGKILL).unwrap();
        sleep(Duration::from_secs(1));
        kill(pid, Signal::SIGCONT).unwrap();
        let output = sim.wait_with_output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{late}: {said}");
        assert_same(&stage.files("whole"), &stage.files(&name));
    }
}

#[test]
#[ignore = "takes five minutes"]
fn pauses_of_8_20_and_70_seconds() {
    for seconds in [8, 20, 70] {
        costs_nothing(Who::Sim, seconds, "");
        costs_nothing(Who::All, seconds, "");
    }
}
