//! What it prints. These texts are part of the product.

use std::process::Command;

/// Exit code, standard output and standard error of a call.
fn call(arguments: &[&str]) -> String {
    let mut command = Command::new(env!("CARGO_BIN_EXE_planner-node"));
    for variable in ["RELOOP_ENDPOINT", "RELOOP_RUN", "RELOOP_WORKER", "RUST_LOG"] {
        command.env_remove(variable);
    }
    let output = command.args(arguments).env("COLUMNS", "100").output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    format!("exit {}\n{}{}", output.status.code().unwrap(), text(&output.stdout), text(&output.stderr))
}

#[test]
fn help() {
    insta::assert_snapshot!(call(&["--help"]));
}

#[test]
fn a_run_that_is_not_there() {
    insta::assert_snapshot!(call(&["--planner", "idm", "--endpoint", "tcp/127.0.0.1:1", "--run", "demo"]));
}

#[test]
fn a_name_that_cannot_be() {
    insta::assert_snapshot!(call(&["--planner", "idm", "--endpoint", "tcp/127.0.0.1:1", "--run", "a/b"]));
}

#[test]
fn scenes_that_are_not_there() {
    let output =
        call(&["--planner", "human", "--scenarios", "/nowhere", "--endpoint", "tcp/127.0.0.1:1", "--run", "demo"]);
    assert!(output.starts_with("exit 2\nerror: cannot open the scenes"), "{output}");
}

#[test]
fn vectors_that_are_not_there() {
    let output = call(&["verify", "/nowhere"]);
    assert!(output.starts_with("exit 2\nerror: cannot list /nowhere"), "{output}");
}

#[test]
fn a_recording_that_is_none() {
    let output = call(&["explain", env!("CARGO_BIN_EXE_planner-node"), "--step", "3"]);
    assert!(output.starts_with("exit 2\nerror: ") && output.contains("no readable MCAP file"), "{output}");
}

#[test]
fn vectors_are_built_in() {
    let output = call(&["verify"]);
    assert!(output.starts_with("exit 0\n7 cases") && output.ends_with("all within tolerance\n"), "{output}");
}
