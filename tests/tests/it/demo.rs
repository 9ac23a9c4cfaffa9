//! One command, a table, a folder.

use std::fs;

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use results::drivers;
use results::folder::read_run_file;
use results::parquet::Table;
use scenarios::generated::FAMILIES;

use crate::stage::{Stage, wait_until};

/// The names of the files in a folder of the run.
fn names(stage: &Stage, folder: &str) -> Vec<String> {
    let entries = fs::read_dir(stage.path(folder)).unwrap();
    let mut names: Vec<String> =
        entries.map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

/// The names of the recordings of these scenes.
fn recordings(scenes: Vec<String>) -> Vec<String> {
    let mut names: Vec<_> =
        scenes.iter().flat_map(|scene| ["mcap", "rrd"].map(|kind| format!("{scene}.{kind}"))).collect();
    names.sort();
    names
}

/// Lines without what lines up their columns, whose widths are those of the figures.
fn words(lines: &[&str]) -> String {
    let words = |line: &&str| line.split_whitespace().collect::<Vec<_>>().join(" ");
    lines.iter().map(words).collect::<Vec<_>>().join("\n")
}

#[test]
fn one_command_drives_the_demo_set_and_prints_its_table() {
    let stage = Stage::new();
    let ended = stage.good_sim("run --driver idm --timing");
    let lines: Vec<&str> = ended.out.lines().collect();
    let scenes = FAMILIES.len();
    assert_eq!(lines[0], format!("driver idm, protocol strict, motion bicycle, {scenes} scenes"));
    // Not the driver's figures: they change with every improvement of it.
    insta::assert_snapshot!(words(&lines[2..5]), @"
    driver epi- colli- at off off red pro- acc. jerk lat. error
    sodes failed sion fault route road light gress acc. @3 s
    % % % % % m m/s² m/s³ m/s² m
    ");
    assert!(words(&lines[6..7]).starts_with(&format!("idm {scenes} 0 ")), "{}", ended.out);
    let last = &lines[lines.len() - 2..];
    assert_eq!(last[0], "folder runs/idm-strict-1");
    let digest = results::digest(&stage.path("runs/idm-strict-1")).unwrap();
    assert_eq!(last[1], format!("digest {digest}"));
    assert!(ended.err.contains("times real time"), "{}", ended.err);
    assert_eq!(names(&stage, "runs"), ["idm-strict-1"]);
    let run = "runs/idm-strict-1";
    assert_eq!(
        names(&stage, run),
        [".lock", "digest", "episodes", "results.parquet", "run.toml", "steps.parquet", "timing.parquet"]
    );
    let driven = Table::read(&stage.path(run).join("results.parquet")).unwrap();
    assert_eq!(names(&stage, &format!("{run}/episodes")), recordings(driven.text("scene").unwrap()));

    let table = stage.good_sim(&format!("table {run}"));
    assert!(ended.out.starts_with(&table.out), "{}", table.out);
    let again = stage.good_sim(&format!("run --driver idm --out {run}"));
    assert_eq!(again.out, ended.out);
    assert!(again.err.contains("is finished already: nothing was driven"), "{}", again.err);
}

#[test]
fn without_arguments_the_default_driver_drives_the_demo_set_from_any_folder() {
    let stage = Stage::new();
    let sim = stage.start("run");
    let run = &format!("runs/{}-strict-1", drivers::DEFAULT);
    wait_until("an episode is done", || stage.parts(run) > 0);
    // The others would take half a minute, and tell nothing more.
    kill(Pid::from_raw(sim.id() as i32), Signal::SIGINT).unwrap();
    let ended = sim.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&ended.stderr);
    assert_eq!(ended.status.code(), Some(130), "{said}");
    let file = read_run_file(&stage.path(run)).unwrap().unwrap();
    assert_eq!((&*file.settings.driver, file.scenes.len()), (drivers::DEFAULT, FAMILIES.len()));
}

#[test]
fn every_driver_drives_and_their_runs_stand_side_by_side() {
    let stage = Stage::new();
    let mut folders = Vec::new();
    for (driver, predictor) in [("human", "oracle"), ("constant-velocity", "none"), ("idm", "ctrv")] {
        stage.good_sim(&format!("run --scenarios small.toml --record none --driver {driver} --predictor {predictor}"));
        folders.push(if predictor == "none" {
            format!("runs/{driver}-strict-1")
        } else {
            format!("runs/{driver}-{predictor}-strict-1")
        });
    }
    let wide = |folders: &str| {
        let output = stage.command(&format!("table {folders}")).env("COLUMNS", "200").output().unwrap();
        String::from_utf8(output.stdout).unwrap()
    };
    let table = wide(&folders[..2].join(" "));
    let lines: Vec<&str> = table.lines().collect();
    insta::assert_snapshot!(words(&lines[..5]), @"
    protocol strict, 3 scenes

    driver epi- colli- at off off red pro- acc. jerk lat. error error error nuPlan
    sodes failed sion fault route road light gress acc. @3 s @5 s @10 s score
    % % % % % m m/s² m/s³ m/s² m m m
    ");
    // The one whose figures are no matter of what the scenes are like: no faults, no errors.
    let human: Vec<&str> = lines[6].split_whitespace().collect();
    assert_eq!(human[..8], ["human-oracle", "3", "0", "0.0", "0.0", "0.0", "0.0", "0.0"], "{table}");
    assert_eq!(human[12..15], ["0.00", "0.00", "0.00"], "{table}");
    assert!(words(&lines[7..8]).starts_with("constant-velocity 3 0 "), "{table}");
    let folders = folders.join(" ");
    let csv = stage.good_sim(&format!("table --format csv {folders}")).out;
    assert_eq!(csv.lines().count(), 4);
}

#[test]
fn a_matrix_drives_each_driver_under_each_protocol_once() {
    let stage = Stage::new();
    let matrix = "matrix --scenarios small.toml --drivers idm,second:idm,human --protocols strict,paper --out m";
    let first = stage.good_sim(matrix);
    let protocols: Vec<&str> = first.out.lines().filter(|line| line.starts_with("protocol")).collect();
    assert_eq!(
        protocols,
        ["protocol strict, 3 scenes", "protocol paper, motion first-pose, 3 scenes"],
        "{}",
        first.out
    );
    assert_eq!(
        names(&stage, "m"),
        ["human-paper", "human-strict", "idm-paper", "idm-strict", "second-paper", "second-strict"]
    );
    // The second of the same driver is the first by another name.
    let results = |run: &str| Table::read(&stage.path(run).join("results.parquet")).unwrap().numbers().unwrap();
    assert_eq!(results("m/idm-strict"), results("m/second-strict"));
    // What is there stays, and what is missing is driven.
    fs::remove_dir_all(stage.path("m/second-strict")).unwrap();
    let again = stage.good_sim(matrix);
    assert_eq!(again.out, first.out);
    assert_eq!(again.err.matches("is finished already").count(), 5, "{}", again.err);
    let csv = stage.good_sim(&format!("{matrix} --format csv")).out;
    assert_eq!(csv.lines().filter(|line| !line.is_empty()).count(), 8);
    let twice = stage.sim("matrix --drivers idm,idm --out m");
    assert!(twice.code == Some(2) && twice.err.contains("two drivers are called idm"), "{}", twice.err);
    let alone = stage.sim("matrix --drivers sep --out m");
    assert!(alone.code == Some(2) && alone.err.contains("sep: the driver sep needs weights"), "{}", alone.err);
}

#[test]
fn a_folder_of_another_run_is_refused_and_every_difference_named() {
    let stage = Stage::new();
    stage.good_sim("run --driver idm --scenarios small.toml --record none --out run");
    let before = stage.files("run");
    let ended =
        stage.sim("run --scenarios small.toml --record none --out run --driver constant-velocity --deadline 2s");
    assert_eq!(ended.code, Some(2));
    insta::assert_snapshot!(ended.err, @r#"
    error: run holds another run:
      settings.deadline-s: 5.0 there, 2.0 here
      settings.driver: "idm" there, "constant-velocity" here
      settings.planner.name: "idm" there, "constant-velocity" here
    hint: repeat the command it was begun with, or give another folder with --out
    "#);
    let ended = stage.sim("run --driver idm --record none --out run");
    assert_eq!(ended.code, Some(2));
    assert!(ended.err.contains("scenes: 3 there, "), "{}", ended.err);
    assert!(before == stage.files("run"));
}

#[test]
fn only_failures_are_kept_when_only_failures_are_asked_for() {
    let stage = Stage::new();
    // Straight on, come what may: some of these end in a collision or off the route.
    let ended = stage.good_sim("run --driver constant-velocity --record failures --out run");
    let results = Table::read(&stage.path("run/results.parquet")).unwrap();
    let (scenes, reasons) = (results.text("scene").unwrap(), results.text("end_reason").unwrap());
    let bad = |reason: &str| ["collision", "off-route", "driver-failed"].contains(&reason);
    let kept: Vec<_> =
        scenes.into_iter().zip(reasons).filter(|(_, reason)| bad(reason)).map(|(scene, _)| scene).collect();
    assert_eq!(names(&stage, "run/episodes"), recordings(kept.clone()));
    assert!(!kept.is_empty(), "{}", ended.out);
}
