//! `sim compare` over run folders that were written, not driven.

use std::fs;
use std::path::Path;

use results::folder::{Folder, Opened};
use results::part::{LoggedState, Part};
use results::settings::{Build, Machine, Node, Planner, Record, RunFile, SceneLine, Settings};
use wire::proto::{AgentState, EndReason, EpisodeEnd, Event, Metric, StepRecord};

use crate::sim;

/// A drive straight on at so many metres a second, which makes that much progress; `end` may make it another.
pub fn drive(scene: &str, speed: f64, end: impl FnOnce(&mut Part)) -> (String, Part) {
    let record = |step: u32| StepRecord {
        step,
        log_index: 20 + step,
        av: Some(AgentState { x: speed * 0.1 * f64::from(step + 1), ..AgentState::default() }),
        ..StepRecord::default()
    };
    let records: Vec<_> = (0..100).map(record).collect();
    let metric = |name: &str, value| Metric { name: name.to_owned(), value: Some(value) };
    let mut metrics = vec![metric("progress_m", 10.0 * speed), metric("nuplan_score", 1.0)];
    metrics
        .extend(["at_fault_collision", "off_route", "off_road", "red_light", "speeding"].map(|name| metric(name, 0.0)));
    let mut part = Part {
        end: Some(EpisodeEnd {
            scene: scene.to_owned(),
            reason: EndReason::Horizon.into(),
            detail: "all 100 steps were driven".to_owned(),
            metrics,
            ..EpisodeEnd::default()
        }),
        logged: records.iter().map(|_| LoggedState::default()).collect(),
        records,
        ..Part::default()
    };
    end(&mut part);
    (scene.to_owned(), part)
}

fn set(part: &mut Part, name: &str, value: f64) {
    let metrics = part.end.iter_mut().flat_map(|end| &mut end.metrics);
    metrics.filter(|metric| metric.name == name).for_each(|metric| metric.value = Some(value));
}

pub fn strikes(part: &mut Part) {
    let end = part.end.as_mut().unwrap();
    (end.reason, end.detail) =
        (EndReason::Collision.into(), "step 99: the AV's front struck vehicle 7 at 3.0 m/s, at fault".to_owned());
    set(part, "at_fault_collision", 1.0);
    set(part, "nuplan_score", 0.0);
}

fn runs_a_red_light(part: &mut Part) {
    part.records[30].red_light = true;
    part.events.push(Event {
        step: 30,
        text: "crossed the stop point of lane 4 at red".to_owned(),
        ..Event::default()
    });
    set(part, "red_light", 1.0);
}

fn driver_fails(part: &mut Part) {
    let end = part.end.as_mut().unwrap();
    (end.reason, end.detail) = (EndReason::DriverFailed.into(), "step 12: the planner is gone".to_owned());
    part.records.truncate(12);
    part.logged.truncate(12);
}

/// A finished run of these drives in `root`/`name`.
pub fn finished(root: &Path, name: &str, drives: &[(String, Part)], change: impl FnOnce(&mut RunFile)) {
    let line = |(scene, _): &(String, Part)| SceneLine {
        id: scene.clone(),
        sha256: format!("content of {scene}"),
        fingerprint: None,
    };
    let mut file = RunFile {
        settings: Settings {
            driver: name.to_owned(),
            deadline_s: 5.0,
            record: Record::None,
            planner: Planner::Node(Node::named("idm", false)),
            predictor: None,
            protocol: toml::from_str("name = \"strict\"").unwrap(),
            latency: None,
            fork: None,
            traffic: None,
        },
        build: Build { version: "0.1.0".to_owned(), git_revision: "0123456789ab".to_owned(), wire_version: 2 },
        machine: Machine {
            parallel: 1,
            in_process: false,
            pin: false,
            start_timeout_s: 20.0,
            endpoint: None,
            weights: None,
            latency_trace: None,
            scenarios: Vec::new(),
            planner_certificates: Vec::new(),
            zenoh_config: None,
            shards: None,
        },
        scenes: drives.iter().map(line).collect(),
    };
    change(&mut file);
    let Ok(Opened::New(folder)) = Folder::open(&root.join(name), &file) else { panic!("it is new") };
    drives.iter().for_each(|(scene, part)| folder.store(scene, part).unwrap());
    results::merge(&folder, &file, None, |_, _| {}).unwrap();
}

/// Baseline and candidate over 24 scenes: one mended, two that fail newly, one without a partner on either side.
pub fn two_runs(root: &Path) {
    let speed = |at: u32| f64::from(at % 5 + 8);
    let scene = |at: u32| format!("scene-{at:02}");
    let a = (0..24).map(|at| match at {
        3 => drive(&scene(at), speed(at), strikes),
        _ => drive(&scene(at), speed(at), |_| {}),
    });
    let b = (1..25).map(|at| match at {
        5 => drive(&scene(at), speed(at) + 2.0, runs_a_red_light),
        6 => drive(&scene(at), speed(at), driver_fails),
        at if at < 12 => drive(&scene(at), speed(at) + 1.0, |_| {}),
        _ => drive(&scene(at), speed(at), |_| {}),
    });
    finished(root, "main", &a.collect::<Vec<_>>(), |_| {});
    finished(root, "change", &b.collect::<Vec<_>>(), |file| file.build.git_revision = "ba9876543210".to_owned());
}

#[test]
fn flips_stand_first_and_every_figure_says_whether_it_may_be_chance() {
    let root = tempfile::tempdir().unwrap();
    two_runs(root.path());
    insta::assert_snapshot!(sim(root.path(), &["compare", "main", "change"]));
    insta::assert_snapshot!(sim(root.path(), &["compare", "main", "change", "--format", "markdown"]));
    insta::assert_snapshot!(sim(root.path(), &["compare", "main", "main"]));
}

#[test]
fn a_broken_rule_makes_the_exit_code_and_the_report_of_tests() {
    let root = tempfile::tempdir().unwrap();
    two_runs(root.path());
    let said = sim(
        root.path(),
        &[
            "compare",
            "main",
            "change",
            "--fail-on",
            "new-failures",
            "--fail-on",
            "progress_m<-5%",
            "--junit",
            "out.xml",
        ],
    );
    assert!(said.starts_with("code 1\n"), "{said}");
    assert!(said.contains("FAIL: new-failures: 2 scenes passed in A and failed in B\n"), "{said}");
    insta::assert_snapshot!(fs::read_to_string(root.path().join("out.xml")).unwrap());
    let said = sim(root.path(), &["compare", "main", "change", "--fail-on", "progress_m<-5%", "--format", "json"]);
    assert!(said.starts_with("code 0\n"), "{said}");
    let told: serde_json::Value =
        serde_json::from_str(said.split_once("stdout\n").unwrap().1.split_once("--- stderr").unwrap().0).unwrap();
    assert_eq!(told["new_failures"][0]["scene"], "scene-05");
    assert_eq!(told["new_failures"][0]["part_at_step"], 2, "0.2 m a step, more than half a metre after the third");
    assert_eq!(told["gates"][0]["hit"], false);
}

#[test]
fn one_planted_regression_among_two_hundred_is_the_only_thing_that_is_told() {
    let root = tempfile::tempdir().unwrap();
    let drives = |planted: u32| -> Vec<(String, Part)> {
        let one = |at: u32| {
            if at == planted { drive(&format!("s{at}"), 9.0, strikes) } else { drive(&format!("s{at}"), 9.0, |_| {}) }
        };
        (0..200).map(one).collect()
    };
    finished(root.path(), "main", &drives(999), |_| {});
    finished(root.path(), "change", &drives(137), |_| {});
    let said = sim(root.path(), &["compare", "main", "change", "--fail-on", "new-failures"]);
    assert!(said.starts_with("code 1\n"), "{said}");
    assert!(said.contains("\n1 new failure, 0 mended in 200 scenes\n"), "{said}");
    assert!(said.contains("\ns137        collision: step 99: the AV's front struck vehicle 7"), "{said}");
    assert!(said.contains("200 paired scenes, 199 driven alike"), "{said}");
    assert!(!said.contains("better or worse "), "{said}");
}

#[test]
fn what_cannot_be_compared_is_refused_with_code_2() {
    let root = tempfile::tempdir().unwrap();
    two_runs(root.path());
    let few = [drive("scene-01", 9.0, |_| {})];
    finished(root.path(), "short", &few, |file| {
        file.settings.protocol = toml::from_str("name = \"strict\"\nhorizon = 100").unwrap();
    });
    finished(root.path(), "paper", &few, |file| file.settings.protocol = toml::from_str("name = \"paper\"").unwrap());
    finished(root.path(), "elsewhere", &[drive("other", 9.0, |_| {})], |_| {});
    let refused = |arguments: &[&str]| sim(root.path(), &[&["compare"], arguments].concat());
    let said = [
        refused(&["main", "short"]),
        refused(&["main", "paper"]),
        refused(&["main", "elsewhere"]),
        refused(&["main", "nowhere"]),
        refused(&["main", "change", "--fail-on", "progess_m>1"]),
        refused(&["main", "change", "--fail-on", "min_time_to_collision_s<0"]),
    ];
    insta::assert_snapshot!(said.join("\n"));
}
