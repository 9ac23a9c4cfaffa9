//! A run that is healed comes out as if nothing had happened, and a finished one that was changed is noticed.

use std::fs;
use std::process::Command;

use crate::stage::{Ended, Stage, assert_same, program};

/// Runs `sim` with the liar as planner, who tells `lie`, or nothing but the truth.
fn drive(stage: &Stage, lie: Option<&str>, arguments: &str) -> Ended {
    let mut command = stage.command(&format!("run --scenarios small.toml --parallel 2 {arguments}"));
    command.arg("--planner-command").arg(program("liar"));
    match lie {
        Some(lie) => command.env("RELOOP_LIE", lie),
        None => command.env_remove("RELOOP_LIE"),
    };
    ended(command)
}

fn ended(mut command: Command) -> Ended {
    let output = command.output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    Ended { code: output.status.code(), out: text(output.stdout), err: text(output.stderr) }
}

/// The name of the second scene of the small set.
fn second_scene(stage: &Stage) -> String {
    let results = results::parquet::Table::read(&stage.path("whole/results.parquet")).unwrap();
    results.text("scene").unwrap().remove(1)
}

#[test]
fn failed_episodes_are_driven_again_and_the_run_is_as_if_they_had_not_failed() {
    let stage = Stage::new();
    assert_eq!(drive(&stage, None, "--out whole").code, Some(0));
    let lie = format!("{} 20 error", second_scene(&stage));
    let failed = drive(&stage, Some(&lie), "--out run");
    assert_eq!(failed.code, Some(1), "{failed:?}");

    let unchanged = drive(&stage, None, "--out run");
    assert_eq!(unchanged.code, Some(1), "the same command drives nothing: {unchanged:?}");
    let nothing = drive(&stage, None, "--out run --retry unrecorded");
    assert!(nothing.err.contains("is finished already: nothing was driven"), "{nothing:?}");

    let healed = drive(&stage, None, "--out run --retry failed");
    assert_eq!(healed.code, Some(0), "{healed:?}");
    assert!(healed.err.contains("run: 2 of 3 episodes are done, the others follow"), "{healed:?}");
    assert_same(&stage.files("whole"), &stage.files("run"));
}

#[test]
fn a_run_whose_disk_was_full_is_continued_by_the_same_command() {
    let stage = Stage::new();
    stage.good_sim("run --driver idm --scenarios small.toml --parallel 1 --out whole");
    let largest = stage.files("whole").into_iter().filter(|(name, _)| name.ends_with(".mcap"));
    let largest = largest.map(|(_, bytes)| bytes.len()).max().unwrap();
    // No room for more than a part of the largest recording, in units of 512 bytes; SIGXFSZ would end the programs.
    let script = format!("trap '' XFSZ; ulimit -f {}; exec \"$@\"", largest / 2 / 512);
    let mut full = Command::new("sh");
    full.args(["-c", &script, "sh"]).arg(program("sim"));
    full.args("run --driver idm --scenarios small.toml --parallel 1 --out run".split(' ')).current_dir(stage.path(""));
    let full = ended(full);
    assert_eq!(full.code, Some(2), "{full:?}");
    assert!(full.err.contains("os error 27"), "{full:?}");
    stage.wait_until_alone();

    stage.good_sim("run --driver idm --scenarios small.toml --parallel 1 --out run");
    assert_same(&stage.files("whole"), &stage.files("run"));
}

#[test]
fn a_finished_run_that_was_changed_is_named_by_every_reader() {
    let stage = Stage::new();
    stage.good_sim("run --driver idm --scenarios small.toml --record none --out run");
    let path = stage.path("run/results.parquet");
    let mut bytes = fs::read(&path).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(&path, bytes).unwrap();
    for arguments in [
        "table run",
        "table run --scenes",
        "run --driver idm --scenarios small.toml --record none --out run",
        "run --driver idm --scenarios small.toml --record none --out run --retry failed",
    ] {
        let refused = stage.sim(arguments);
        assert_eq!(refused.code, Some(2), "{arguments}: {refused:?}");
        insta::allow_duplicates! {
            insta::assert_snapshot!(refused.err, @"
            error: run/results.parquet was changed since the run was finished: its digest is another
            hint: take it from a copy, or drive the run again into another folder with --out
            ");
        }
    }
}

#[test]
fn a_damaged_part_is_named_and_driven_again() {
    let stage = Stage::new();
    stage.good_sim("run --driver idm --scenarios small.toml --record none --parallel 1 --out whole");
    let mut sim = stage.start("run --driver idm --scenarios small.toml --record none --parallel 1 --out run");
    crate::stage::wait_until("an episode is done", || stage.parts("run") > 0);
    sim.kill().unwrap();
    sim.wait().unwrap();
    stage.wait_until_alone();
    let Some(part) = fs::read_dir(stage.path("run/parts")).into_iter().flatten().flatten().next() else {
        return; // It was finished before it was killed.
    };
    let mut bytes = fs::read(part.path()).unwrap();
    bytes[9] ^= 1;
    fs::write(part.path(), bytes).unwrap();
    let ended = stage.good_sim("run --driver idm --scenarios small.toml --record none --parallel 1 --out run");
    assert!(ended.err.contains("is damaged or of another run, and is driven again"), "{ended:?}");
    assert_same(&stage.files("whole"), &stage.files("run"));
}

#[test]
fn a_run_without_an_episode_leaves_no_folder_and_unfinished_ones_are_passed_over() {
    let stage = Stage::new();
    let mut command = stage.command("run --scenarios small.toml --parallel 1");
    let failed = ended({
        command.args(["--planner-command", "exit 7"]);
        command
    });
    assert_eq!(failed.code, Some(2), "{failed:?}");
    assert!(failed.err.contains("exited with code 7 before it was on the bus"), "{failed:?}");
    assert!(failed.err.contains("no episode was driven, and no folder is left"), "{failed:?}");
    assert!(!stage.path("runs/command-strict-1").exists());

    stage.good_sim("run --driver idm --scenarios small.toml --record none --out runs/done");
    fs::create_dir_all(stage.path("runs/begun/parts")).unwrap();
    fs::copy(stage.path("runs/done/run.toml"), stage.path("runs/begun/run.toml")).unwrap();
    let table = stage.good_sim("table runs/begun runs/done");
    insta::assert_snapshot!(table.err, @"note: passed over, because there is no finished run: runs/begun");
    assert!(table.out.starts_with("driver idm, "), "{table:?}");
    let missing = stage.sim("table runs/done runs/dune");
    assert_eq!(missing.code, Some(2));
    insta::assert_snapshot!(missing.err, @"
    error: runs/dune is not there
    hint: runs are in the folder `runs`, unless --out named another
    ");
    let device = stage.sim("run --scenarios small.toml --out /dev/null");
    assert_eq!(device.code, Some(2));
    insta::assert_snapshot!(device.err, @"
    error: /dev/null is there and no folder, but a run is one
    hint: give another name with --out
    ");
}
