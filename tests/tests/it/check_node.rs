//! `sim check-node` finds nothing wrong with nodes that are right, and what is wrong with those that are not.

use serde_json::Value;

use crate::stage::{Stage, program};

/// Rules that take long, or are others' to test here.
const QUICK: &str = "--format json --skip unknown,leaves,second,late,all-workers";

/// What came of the check, and its exit code.
fn check(stage: &Stage, which: &str, command: &str, more: &str) -> (Value, Option<i32>) {
    let output = stage.command(&format!("check-node {more}")).args([which, command]).output().unwrap();
    stage.wait_until_alone();
    let text = String::from_utf8(output.stdout).unwrap();
    let report = serde_json::from_str(&text);
    let report = report.unwrap_or_else(|_| panic!("{text}{}", String::from_utf8_lossy(&output.stderr)));
    (report, output.status.code())
}

/// The rules that came out so.
fn rules<'a>(report: &'a Value, verdict: &str) -> Vec<&'a str> {
    let rules = report["rules"].as_array().unwrap();
    rules.iter().filter(|rule| rule["verdict"] == verdict).map(|rule| rule["rule"].as_str().unwrap()).collect()
}

fn seen<'a>(report: &'a Value, rule: &str) -> &'a str {
    let rules = report["rules"].as_array().unwrap();
    rules.iter().find(|row| row["rule"] == rule).unwrap()["seen"].as_str().unwrap()
}

#[test]
fn nothing_is_wrong_with_our_own_planner() {
    let (report, code) = check(&Stage::new(), "--planner-command", "planner-node --planner idm", "--format json");
    assert_eq!((rules(&report, "skipped"), code), (vec!["golden"], Some(0)), "{report:#}");
    assert_eq!(rules(&report, "holds").len(), 15, "{report:#}");
}

#[test]
fn nothing_is_wrong_with_the_example_nor_with_a_predictor_and_who_needs_one() {
    let stage = Stage::new();
    let example = program("follow_the_line");
    for (which, command, more) in [
        ("--planner-command", example.to_str().unwrap(), ""),
        ("--planner-command", "planner-node --planner gauss-newton", "--predictor ctrv"),
        ("--predictor-command", "predictor-node --predictor ctrv", "small.toml"),
    ] {
        let (report, code) = check(&stage, which, command, &format!("{QUICK} {more}"));
        assert_eq!(
            (rules(&report, "BROKEN"), rules(&report, "in doubt"), code),
            (vec![], vec![], Some(0)),
            "{report:#}"
        );
        let courses = if more == "small.toml" { "on 7 courses" } else { "on 4 courses" };
        assert!(seen(&report, "answers").ends_with(courses), "{report:#}");
    }
}

/// The liar tells `lie` on one course.
fn finds(lie: &str, more: &str, broken: &[&str], rule: &str, what: &str) {
    let stage = Stage::with_lie(&format!("check-curve 5 {lie}"));
    let liar = program("liar");
    let (report, code) = check(&stage, "--planner-command", liar.to_str().unwrap(), &format!("{QUICK} {more}"));
    assert_eq!((rules(&report, "BROKEN"), code), (broken.to_vec(), Some(1)), "{report:#}");
    assert!(seen(&report, rule).contains(what), "{report:#}");
}

#[test]
fn answers_that_are_none_are_found() {
    finds("nan", "", &["answers"], "answers", "check-curve: step 5: state 7 is not finite");
    finds("length", "", &["answers"], "answers", "49 states, but 50 are needed");
    finds("step", "", &["answers"], "answers", "it answers step 6, but step 5 was asked for");
    finds("error", "", &["answers"], "answers", "I would rather not");
}

#[test]
fn a_node_that_dies_or_falls_silent_is_found_and_the_other_courses_are_driven() {
    finds("die", "", &["answers"], "answers", "check-curve: the planner is gone; it ");
    finds("silence", "--deadline 1s", &["in-time"], "in-time", "no answer within 1 s");
}

#[test]
fn chance_is_found() {
    finds(
        "chance",
        "",
        &["repeats"],
        "repeats",
        "in another process, check-curve: the answers part at step 5, by up to ",
    );
}

#[test]
fn a_program_that_is_no_node_is_named_so() {
    let (report, code) = check(&Stage::new(), "--planner-command", "true", "--format json");
    assert_eq!(code, Some(1), "{report:#}");
    assert_eq!(seen(&report, "joins"), "it exited with code 0 before it was on the bus");
    assert_eq!(rules(&report, "BROKEN"), ["joins", "second", "unknown", "leaves"], "{report:#}");
    assert_eq!(rules(&report, "skipped").len(), 12, "{report:#}");
}

#[test]
fn golden_answers_are_written_once_and_held_to() {
    let stage = Stage::new();
    let golden = |planner: &str, more: &str| {
        let command = format!("planner-node --planner {planner}");
        check(&stage, "--planner-command", &command, &format!("{QUICK} --golden golden.json {more}"))
    };
    let (written, _) = golden("idm", "");
    assert!(seen(&written, "golden").starts_with("20 answers are written to golden.json"), "{written:#}");
    let (same, code) = golden("idm", "");
    assert_eq!((seen(&same, "golden"), code), ("20 answers as before", Some(0)));
    let (other, code) = golden("constant-velocity", "");
    assert_eq!((rules(&other, "BROKEN"), code), (vec!["golden"], Some(1)), "{other:#}");
    let (blessed, code) = golden("constant-velocity", "--bless");
    assert_eq!((rules(&blessed, "BROKEN"), code), (vec![], Some(0)), "{blessed:#}");

    std::fs::write(stage.path("golden.json"), "[1]").unwrap();
    let ended = stage.sim("check-node --planner-command true --golden golden.json");
    assert_eq!(ended.code, Some(2));
    assert!(
        ended.err.contains("golden.json holds no answers of a node") && ended.err.contains("--bless"),
        "{}",
        ended.err
    );
}
