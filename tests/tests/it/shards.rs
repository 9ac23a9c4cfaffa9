//! A run that several processes drive comes out as if one had, whatever happens to them.

use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

use crate::killed::Moments;
use crate::stage::{Ended, Stage, assert_same, program, wait_until};

const SETTINGS: &str = "--driver idm --scenarios small.toml --parallel 1";

/// `sim run` of a shard of the run in `run`.
fn shard(stage: &Stage, run: &str, which: &str) -> Ended {
    stage.sim(&format!("run {SETTINGS} --out {run} --shard {which}"))
}

fn ended(output: Output) -> Ended {
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    Ended { code: output.status.code(), out: text(output.stdout), err: text(output.stderr) }
}

#[test]
fn shards_in_any_order_merge_to_the_files_of_one_process() {
    let stage = Stage::new();
    stage.good_sim(&format!("run {SETTINGS} --out whole"));
    let second = shard(&stage, "run", "2/2");
    assert_eq!((second.code, second.out.trim()), (Some(0), "shard 2/2 of run is whole: 1 episodes, 0 failed"));

    let status = stage.sim("status run");
    assert_eq!(status.code, Some(1), "{status:?}");
    insta::assert_snapshot!(status.out, @"
    run: idm, strict: 1 of 3 episodes are done, 0 of them failed

       shard  episodes      done    failed
         1/2         2         0         0  nobody is at work
         2/2         1         1         0  whole

    2 missing: following-3-0, red-light-3-0

    this drives what is missing:
      sim run --driver idm --scenarios small.toml --parallel 1 --out run --shard 1/2
    or, all of it here, and then merged:
      sim run --driver idm --scenarios small.toml --parallel 1 --out run
    ");
    let early = stage.sim("merge run");
    assert_eq!(early.code, Some(2), "{early:?}");
    insta::assert_snapshot!(early.err, @"
    error: 2 of 3 episodes of the run in run are missing: following-3-0, red-light-3-0
    hint: `sim status run` says who drives them
    ");

    assert_eq!(shard(&stage, "run", "1/2").code, Some(0));
    let again = shard(&stage, "run", "1/2");
    assert!(again.code == Some(0) && again.err.contains("shard 1/2 of run: 2 of 2 episodes are done"), "{again:?}");
    assert!(stage.sim("status run").out.contains("this makes it a run:\n  sim merge run"));
    let merged = stage.good_sim("merge run");
    assert!(merged.out.contains("digest "), "{merged:?}");
    assert_same(&stage.files("whole"), &stage.files("run"));
    assert!(stage.good_sim("merge run").err.contains("run is merged already"));
    assert_eq!(stage.sim("status run").out, "run is finished: 3 episodes, none failed\n");
    let late = shard(&stage, "run", "1/2");
    assert!(late.code == Some(0) && late.err.contains("finished already: nothing was driven"), "{late:?}");
}

#[test]
fn what_a_lost_shard_left_is_driven_on_by_the_same_command_or_by_one_process() {
    let stage = Stage::new();
    stage.good_sim(&format!("run {SETTINGS} --out whole"));
    for heal in [" --shard 1/2", ""] {
        let command = format!("run {SETTINGS} --out run");
        let mut sim = stage.start(&format!("{command} --shard 1/2"));
        wait_until("an episode is done", || stage.parts("run") > 0);
        sim.kill().unwrap();
        sim.wait().unwrap();
        stage.wait_until_alone();
        let healed = stage.good_sim(&format!("{command}{heal}"));
        assert!(healed.err.contains(" episodes are done"), "{healed:?}");
        if !heal.is_empty() {
            assert_eq!(shard(&stage, "run", "2/2").code, Some(0));
            stage.good_sim("merge run");
        }
        assert_same(&stage.files("whole"), &stage.files("run"));
        fs::remove_dir_all(stage.path("run")).unwrap();
    }
}

#[test]
fn of_two_processes_on_one_shard_the_second_says_so_and_leaves() {
    let stage = Stage::new();
    // A planner that never comes: the first waits for it.
    let waiting = "run --scenarios small.toml --out run --planner-command";
    let begin = |which: &str| {
        let mut command = stage.command(waiting);
        command.arg("sleep 60 # ").args(["--shard", which]);
        command
    };
    let mut first = begin("1/2").spawn().unwrap();
    stage.wait_for("sleep");
    let second = ended(begin("1/2").output().unwrap());
    assert_eq!(second.code, Some(2), "{second:?}");
    assert!(second.err.contains("another sim drives shard 1/2 of run"), "{second:?}");
    let other = ended(begin("1/3").output().unwrap());
    assert!(other.err.contains("run is driven in 2 shards, not 3"), "{other:?}");
    let status = stage.sim_beside("status run");
    assert!(status.out.contains("1/2         2         0         0  at work"), "{status:?}");
    let merge = stage.sim_beside("merge run");
    assert!(merge.err.contains("another sim works in run"), "{merge:?}");
    first.kill().unwrap();
    first.wait().unwrap();
}

#[test]
fn a_shard_that_never_drove_leaves_no_folder_and_another_number_of_shards_is_taken_when_none_is_at_work() {
    let stage = Stage::new();
    let mut command = stage.command("run --scenarios small.toml --out run --shard 1/2 --planner-command");
    let broken = ended(command.arg("exit 3 # ").output().unwrap());
    assert_eq!(broken.code, Some(2), "{broken:?}");
    assert!(broken.err.contains("no episode of shard 1/2 was driven"), "{broken:?}");
    assert!(!stage.path("run").exists());

    assert_eq!(shard(&stage, "run", "1/2").code, Some(0));
    let third = shard(&stage, "run", "3/3");
    assert!(third.err.contains("shard 3/3 of run: 1 of 1 episodes are done"), "{third:?}");
    assert_eq!(shard(&stage, "run", "2/3").code, Some(0));
    assert_eq!(shard(&stage, "run", "1/3").code, Some(0));
    stage.good_sim("merge run");
}

#[test]
fn what_failed_is_told_and_driven_again() {
    let stage = Stage::new();
    let drive = |more: &str, lie: &str| {
        let mut command = stage.command(&format!("run --scenarios small.toml --parallel 1 {more}"));
        command.arg("--planner-command").arg(program("liar")).env("RELOOP_LIE", lie);
        ended(command.output().unwrap())
    };
    assert_eq!(drive("--out whole", "").code, Some(0));
    let failed = drive("--out run --shard 1/2", "following-3-0 20 error");
    assert_eq!((failed.code, failed.out.trim()), (Some(1), "shard 1/2 of run is whole: 2 episodes, 1 failed"));
    assert_eq!(drive("--out run --shard 2/2", "").code, Some(0));
    let status = stage.sim("status run");
    assert!(status.code == Some(1) && status.out.contains("failed: following-3-0: driver-failed"), "{status:?}");
    assert!(status.out.contains("--shard 1/2 --retry failed"), "{status:?}");
    assert_eq!(drive("--out run --shard 1/2 --retry failed", "").code, Some(0));
    stage.good_sim("merge run");
    assert_same(&stage.files("whole"), &stage.files("run"));
}

#[test]
fn a_matrix_is_driven_in_shards_that_the_scheduler_counts() {
    let stage = Stage::new();
    let matrix = "matrix small.toml --drivers idm,constant-velocity --in-process --parallel 1 --out";
    stage.good_sim(&format!("{matrix} whole"));
    for index in ["1", "0"] {
        let mut command = stage.command(&format!("{matrix} runs --shard auto/2"));
        let done = ended(command.env("JOB_COMPLETION_INDEX", index).output().unwrap());
        assert_eq!(done.code, Some(0), "{done:?}");
        assert_eq!(done.out.lines().count(), 2, "{done:?}");
    }
    stage.good_sim("merge runs/idm-strict runs/constant-velocity-strict");
    for run in ["idm-strict", "constant-velocity-strict"] {
        assert_same(&stage.files(&format!("whole/{run}")), &stage.files(&format!("runs/{run}")));
    }
    let nowhere = stage.sim(&format!("{matrix} more --shard auto"));
    assert!(nowhere.code == Some(2) && nowhere.err.contains("no scheduler says which shard this is"), "{nowhere:?}");
}

#[test]
fn shards_without_a_common_folder_are_gathered_and_what_does_not_belong_is_refused() {
    let stage = Stage::new();
    stage.good_sim(&format!("run {SETTINGS} --out whole"));
    assert_eq!(shard(&stage, "one", "1/2").code, Some(0));
    assert_eq!(shard(&stage, "two", "2/2").code, Some(0));
    assert_eq!(shard(&stage, "too", "1/2").code, Some(0));
    let overlap = stage.sim("merge one --from two too");
    assert_eq!(overlap.code, Some(2), "{overlap:?}");
    assert!(overlap.err.contains("is in one and in too, and they are not the same"), "{overlap:?}");
    assert_eq!(stage.parts("one"), 2, "nothing was copied");
    stage.good_sim("run --driver constant-velocity --scenarios small.toml --record none --out other --shard 2/2");
    let other = stage.sim("merge one --from other");
    assert!(other.err.contains("other holds another run than one:\n  settings.driver"), "{other:?}");
    // By hand, so that no run.toml tells.
    fs::copy(stage.path("other/parts/curve-3-0.part"), stage.path("one/parts/curve-3-0.part")).unwrap();
    let foreign = stage.sim("merge one");
    assert!(foreign.err.contains("1 episodes in one are of another run: curve-3-0"), "{foreign:?}");
    fs::remove_file(stage.path("one/parts/curve-3-0.part")).unwrap();

    let lost = stage.path("two/episodes/curve-3-0.mcap");
    fs::rename(&lost, stage.path("kept")).unwrap();
    let unrecorded = stage.sim("merge one --from two");
    assert!(unrecorded.err.contains("1 of 3 episodes of the run in one are missing: curve-3-0"), "{unrecorded:?}");
    fs::rename(stage.path("kept"), stage.path("one/episodes/curve-3-0.mcap")).unwrap();
    stage.good_sim("merge one --from two");
    assert_same(&stage.files("whole"), &stage.files("one"));
}

#[test]
fn a_plan_says_what_shards_take_and_leaves_nothing() {
    let stage = Stage::new();
    let planned = stage.good_sim("plan small.toml --driver idm --in-process --record none --sample 2 --shards 1,3");
    for said in ["3 episodes by idm", "from 2 of them", "memory of a shard", "room of the run", "shards  episodes each"]
    {
        assert!(planned.out.contains(said), "{said}: {planned:?}");
    }
    assert_eq!(fs::read_dir(stage.path("")).unwrap().count(), 1, "small.toml alone is there");
}

/// Numbers of the processes whose command line has both of these words, `first` as its program.
fn running(stage: &Stage, first: &str, word: &str) -> Vec<Pid> {
    let line = |pid: &Pid| fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default();
    let is_one = |pid: &Pid| {
        let line = String::from_utf8_lossy(&line(pid)).into_owned();
        let mut words = line.split('\0');
        words.next().is_some_and(|program| program.ends_with(first)) && words.any(|other| other == word)
    };
    stage.processes().into_iter().map(|(pid, _)| pid).filter(is_one).collect()
}

#[test]
#[ignore = "installs HyperQueue's package, and drives 400 episodes"]
fn hyperqueue_loses_two_shards_and_a_worker_and_the_digest_is_that_of_one_process() {
    let stage = Stage::new();
    let environment = stage.path("venv");
    let ran = |command: &mut Command| assert!(command.status().unwrap().success(), "{command:?}");
    ran(Command::new("python3").args(["-m", "venv"]).arg(&environment));
    ran(Command::new(environment.join("bin/pip")).args(["install", "--quiet", "hyperqueue==0.27.0"]));
    fs::write(stage.path("many.toml"), "[[generate]]\nfamily = \"all\"\ncount = 10\nseed = 5\n").unwrap();
    let settings = "many.toml --driver idm --in-process --record none --parallel 1";
    let whole = stage.good_sim(&format!("run {settings} --out whole"));

    let driver = Path::new(env!("CARGO_MANIFEST_DIR")).join("../deploy/hq_driver.py");
    let sim = stage.beside("sim");
    let mut begun = Command::new(environment.join("bin/python"));
    begun.arg(driver).args(["--shards", "8", "--workers", "3", "--pause", "0.5", "--sim"]).arg(sim.get_program());
    begun.arg("--").args(settings.split(' ')).args(["--out", "run"]).current_dir(stage.path(""));
    begun.envs(sim.get_envs().filter_map(|(name, value)| Some((name, value?))));
    let driven = begun.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();

    let mut moments = Moments(7);
    for victims in [["/sim", "run"], ["/sim", "run"], ["/python", "--as-worker"]] {
        let before = stage.parts("run");
        wait_until("more episodes are stored", || stage.parts("run") > before + 5);
        let mut alive = Vec::new();
        wait_until("there is somebody to be killed", || {
            alive = running(&stage, victims[0], victims[1]);
            !alive.is_empty()
        });
        let victim = (moments.next().unwrap() * alive.len() as f64) as usize;
        kill(alive[victim], Signal::SIGKILL).unwrap();
    }
    let driven = ended(driven.wait_with_output().unwrap());
    assert_eq!(driven.code, Some(0), "{driven:?}");
    assert!(driven.err.contains("was ended by signal 9"), "nothing was lost: {}", driven.err);
    let digest = |text: &str| text.lines().find_map(|line| line.strip_prefix("digest ")).unwrap().to_owned();
    assert_eq!(digest(&driven.out), digest(&whole.out));
    assert_same(&stage.files("whole"), &stage.files("run"));
    println!("{}\n{}", driven.err, driven.out);
}
