//! The built binary, driven from outside: what it prints. These texts are part of the product.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test says what failed by failing")]

use std::process::Command;

/// Exit code, standard output and standard error of a call.
fn call(arguments: &[&str]) -> String {
    let mut command = Command::new(env!("CARGO_BIN_EXE_predictor-node"));
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
fn a_predictor_that_does_not_exist() {
    insta::assert_snapshot!(call(&["--predictor", "crystal-ball", "--endpoint", "tcp/127.0.0.1:1", "--run", "demo"]));
}
