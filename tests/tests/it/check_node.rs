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
fn nothing_is_wrong_with_our_own_traffic() {
    let (report, code) = check(&Stage::new(), "--traffic-command", "traffic-node --traffic idm", "--format json");
    assert_eq!((rules(&report, "skipped"), code), (vec!["golden"], Some(0)), "{report:#}");
    assert_eq!(rules(&report, "holds").len(), 16, "{report:#}");
    assert!(!report.to_string().contains("in-place"), "{report:#}");
    for (rule, most) in [("moves", 200), ("hand-over", 4)] {
        let first = seen(&report, rule).split(' ').next().unwrap();
        assert!(first.parse::<u32>().unwrap() > most, "{report:#}");
    }
}

#[test]
fn traffic_of_every_character_and_that_drives_straight_on_is_found_right() {
    let rogue = program("rogue_traffic");
    for command in ["traffic-node --traffic mixed --seed 5", rogue.to_str().unwrap()] {
        let (report, code) = check(&Stage::new(), "--traffic-command", command, &format!("{QUICK} small.toml"));
        assert_eq!(
            (rules(&report, "BROKEN"), rules(&report, "in doubt"), code),
            (vec![], vec![], Some(0)),
            "{report:#}"
        );
        assert!(seen(&report, "answers").ends_with("on 7 courses"), "{report:#}");
    }
}

#[test]
fn each_lie_of_traffic_is_found_by_its_rule() {
    for (lie, rule, what) in [
        ("die", "answers", "check-following: the traffic is gone; it "),
        ("error", "answers", "I would rather not"),
        ("step", "answers", "it answers step 6, but step 5 was asked for"),
        ("missing", "answers", "it does not say where track "),
        ("twice", "answers", "it says twice where track "),
        ("stranger", "answers", "it moves track 2147483647, which it was not given"),
        ("nan", "answers", "agents[0].state.y"),
        ("size", "moves", "has another size than before"),
        ("jump", "moves", "jumps by "),
        ("turn", "moves", "turns by 1.00 rad in a step"),
        ("speed", "moves", "changes its speed by "),
        ("rise", "moves", "rises or sinks by 3.50 m in a step"),
        ("silence", "in-time", "no answer within 1 s"),
        ("chance", "repeats", "in another process, check-following: the answers part at step 5, by up to "),
    ] {
        let stage = Stage::with_lie(&format!("check-following 5 {lie}"));
        let rogue = program("rogue_traffic");
        let quick = format!("{QUICK},odd-scenes,cut-short,noise,version --deadline 1s");
        let (report, code) = check(&stage, "--traffic-command", rogue.to_str().unwrap(), &quick);
        assert_eq!((rules(&report, "BROKEN"), code), (vec![rule], Some(1)), "{lie}: {report:#}");
        assert!(seen(&report, rule).contains(what), "{lie}: {report:#}");
    }
}

#[test]
fn traffic_of_which_some_jump_when_they_are_taken_over_is_in_doubt() {
    let stage = Stage::with_lie("check-following 0 hand-over");
    let rogue = program("rogue_traffic");
    let (report, code) = check(&stage, "--traffic-command", rogue.to_str().unwrap(), QUICK);
    assert_eq!((rules(&report, "BROKEN"), rules(&report, "in doubt"), code), (vec![], vec!["hand-over"], Some(0)));
    assert!(seen(&report, "hand-over").contains("agents jump when they are taken over, by 0.40 m"), "{report:#}");
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
