//! A planner's command is one for a shell, and what it says is logged.

use std::fs;

use results::parquet::Table;

use crate::stage::{Ended, Stage, program};

/// Runs `sim` over the small set with this planner; `LIAR` in it is the program of that name.
fn drive(stage: &Stage, planner: &str) -> Ended {
    let mut command = stage.command("run --scenarios small.toml --record none --parallel 1 --out run");
    command.env("LIAR", program("liar")).args(["--planner-command", planner]);
    let output = command.output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    stage.wait_until_alone();
    Ended { code: output.status.code(), out: text(output.stdout), err: text(output.stderr) }
}

#[test]
fn everything_that_a_shell_understands_drives() {
    for planner in [
        "cd / && \"$LIAR\"",
        "PLANNER=\"$LIAR\" && $PLANNER 2>&1",
        "\"$LIAR\" | cat",
        "\"$LIAR\" \"$@\" | cat; true",
        "# a comment\n$LIAR",
    ] {
        let stage = Stage::new();
        let ended = drive(&stage, planner);
        assert_eq!(ended.code, Some(0), "{planner}: {ended:?}");
    }
}

#[test]
fn what_a_planner_says_is_shown_and_logged_without_commands_to_the_terminal() {
    let stage = Stage::new();
    let ended = drive(&stage, "echo 'to \u{1b}[31mstandard output'; echo to standard error >&2; printf unended; $LIAR");
    assert_eq!(ended.code, Some(0), "{ended:?}");
    let log = fs::read_to_string(stage.path("run/logs/w0.log")).unwrap();
    for line in ["planner w0: to \\u{1b}[31mstandard output", "planner w0: to standard error", "planner w0: unended"] {
        assert!(log.lines().any(|logged| logged == line), "{log}");
        assert!(ended.err.lines().any(|said| said == line), "{}", ended.err);
    }
}

#[test]
fn how_a_planner_ended_is_part_of_the_reason() {
    let whole = Stage::new();
    assert_eq!(drive(&whole, "$LIAR").code, Some(0));
    let scene = Table::read(&whole.path("run/results.parquet")).unwrap().text("scene").unwrap().remove(0);
    let stage = Stage::with_lie(&format!("{scene} 20 die"));
    let ended = drive(&stage, "$LIAR || exit 3");
    assert_eq!(ended.code, Some(1), "{ended:?}");
    let reason =
        format!("{scene} failed (driver-failed): step 20: the planner is gone: the planner exited with code 3");
    assert!(ended.out.contains(&reason), "{}", ended.out);
    let log = fs::read_to_string(stage.path("run/logs/w0.log")).unwrap();
    assert!(log.contains("planner w0 exited with code 3"), "{log}");
}

#[test]
fn a_planner_that_does_not_come_is_given_up_with_a_hint() {
    let stage = Stage::new();
    let mut command = stage.command("run --scenarios small.toml --record none --parallel 1 --start-timeout 300ms");
    let output = command.args(["--planner-command", "sleep 60; true", "--out", "run"]).output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(said.contains("after 0.3 s still missing: ") && said.contains("hint: give it more time"), "{said}");
    stage.wait_until_alone();
}
