//! Runs scored from their folders: the same for any number of cores, and what cannot be scored.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::fs;
use std::path::{Path, PathBuf};

use evaluation::drives::Run;
use evaluation::score::{Format, Score, render, score, write, write_steps};
use results::folder::{Folder, Opened};
use results::parquet::Table;
use results::part::Part;
use results::settings::{Build, Machine, Node, Planner, Record, RunFile, SceneLine, Settings};
use scenarios::SceneSet;
use wire::proto::{AgentState, EndReason, EpisodeEnd, StepRecord};
use world::scene::Scene;

/// A drive in which the AV is where it was logged, so many steps.
fn drive(scene: &Scene, steps: u32) -> Part {
    let state = |log_index: u32| AgentState::from(&scene.av().states[log_index as usize].unwrap());
    let record =
        |step: u32| StepRecord { step, log_index: 20 + step, av: Some(state(20 + step)), ..StepRecord::default() };
    Part {
        end: Some(EpisodeEnd {
            scene: scene.id().to_string(),
            reason: EndReason::Horizon.into(),
            steps,
            ..EpisodeEnd::default()
        }),
        records: (0..steps).map(record).collect(),
        logged: (0..steps).map(|_| Default::default()).collect(),
        start: Some(state(19)),
        start_log_index: 19,
        ..Part::default()
    }
}

/// A run over these scenes, or the demo set; the driver of its last scene failed. Unfinished if nobody merges it.
fn run_over(inputs: &[String], root: &Path, protocol: &str, finish: bool) -> PathBuf {
    let scenes = SceneSet::open(inputs).unwrap();
    let entries = scenes.entries();
    let line = |(at, entry): (usize, &scenarios::SceneEntry)| SceneLine {
        id: entry.id.to_string(),
        sha256: scenes.sha256(at).unwrap(),
        fingerprint: None,
    };
    let file = RunFile {
        settings: Settings {
            driver: "replayed".to_owned(),
            deadline_s: 5.0,
            record: Record::None,
            planner: Planner::Node(Node::named("human", true)),
            predictor: None,
            latency: None,
            fork: None,
            traffic: None,
            protocol: toml::from_str(&format!("name = \"{protocol}\"")).unwrap(),
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
            scenarios: inputs.to_vec(),
            planner_certificates: Vec::new(),
            zenoh_config: None,
            shards: None,
        },
        scenes: entries.iter().enumerate().map(line).collect(),
    };
    let path = root.join(protocol);
    let Ok(Opened::New(folder)) = Folder::open(&path, &file) else { panic!("it is new") };
    for index in 0..entries.len() {
        let (scene, _) = scenes.load(index).unwrap();
        let mut part = drive(&scene, 60);
        if index + 1 == entries.len() {
            let end = part.end.as_mut().unwrap();
            (end.reason, end.detail) = (EndReason::DriverFailed.into(), "step 60: it is gone".to_owned());
        }
        folder.store(scene.id().as_str(), &part).unwrap();
    }
    if finish {
        results::merge(&folder, &file, None, |_, _| true).unwrap();
    }
    path
}

fn run(root: &Path, protocol: &str, finish: bool) -> PathBuf {
    run_over(&[], root, protocol, finish)
}

/// Writes a run of the log's own drives through the scenes in `SCORE_SCENES` into the folder `SCORE_RUN`, to measure `sim score` on.
#[test]
#[ignore = "writes what its variables say"]
fn write_a_run_to_measure() {
    let [scenes, out] = ["SCORE_SCENES", "SCORE_RUN"].map(|name| std::env::var(name).unwrap());
    run_over(&[scenes], Path::new(&out), "strict", true);
}

#[test]
fn a_run_that_does_not_say_where_its_agents_were_that_reacted_is_refused() {
    let root = tempfile::tempdir().unwrap();
    let folder = run(root.path(), "strict", true);
    let path = folder.join("run.toml");
    let text = fs::read_to_string(&path).unwrap();
    let reacting = text.replacen(
        "[build]",
        "[settings.traffic.node]\nname = \"idm\"\nreads-log = false\n\n[settings.traffic.hand-over]\n\n[build]",
        1,
    );
    fs::write(&path, reacting).unwrap();
    let refused = Run::open(&folder, &[]).unwrap().each(&[], |index, _| index).unwrap_err().to_string();
    assert!(refused.contains("has no column reactive") && refused.contains("hint: "), "{refused}");
}

#[test]
fn a_run_is_scored_the_same_on_any_number_of_cores() {
    let root = tempfile::tempdir().unwrap();
    let folders = [run(root.path(), "strict", true), run(root.path(), "paper", true)];
    let told = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let runs: Vec<_> = folders
                .iter()
                .map(|folder| score(&Run::open(folder, &[]).unwrap(), &Score::ALL, true).unwrap())
                .collect();
            let paths = ["rows", "steps"].map(|name| root.path().join(format!("{name}-{threads}.parquet")));
            write(&paths[0], &runs).unwrap();
            write_steps(&paths[1], &runs).unwrap();
            let formats = [Format::Text, Format::Csv, Format::Markdown, Format::Json];
            let texts = formats.map(|format| [false, true].map(|scenes| render(&runs, scenes, format, 100)));
            (texts, paths.map(|path| fs::read(path).unwrap()), runs)
        })
    };
    let (one, many) = (told(1), told(3));
    assert!(one.0 == many.0 && one.1 == many.1);
    // The log's own drive, of which one failed.
    let scenes = SceneSet::open(&[]).unwrap().entries().len();
    for run in &one.2 {
        assert_eq!(run.episodes.len(), scenes);
        for group in run.groups.iter().filter(|group| [Score::Waymax, Score::Alpasim].contains(&group.score)) {
            assert_eq!(run.judged(group), scenes - 1);
        }
        let told = |name: &str| {
            let group = run.groups.iter().find(|group| group.figures.iter().any(|figure| figure.name == name)).unwrap();
            run.of_run(group, group.figures.iter().position(|figure| figure.name == name).unwrap()).unwrap().0
        };
        assert_eq!((told("waymax_log_divergence_ade_m"), told("waymax_overlap")), (0.0, 0.0));
        assert!((told("navsim_progress_by_human") - 1.0).abs() < 1e-9);
    }
    assert!(
        one.0[0][0].contains("waymax, ") && one.0[0][0].contains("driver-failed: step 60: it is gone"),
        "{}",
        one.0[0][0]
    );
    let rows = Table::read(&root.path().join("rows-1.parquet")).unwrap();
    assert_eq!(rows.text("scene").unwrap().len(), 2 * scenes);
    let steps = Table::read(&root.path().join("steps-1.parquet")).unwrap();
    assert_eq!(steps.counts("log_index").unwrap()[..2], [20, 21]);
    assert_eq!(steps.text("scene").unwrap().len(), 2 * 60 * (scenes - 1));
}

#[test]
fn what_is_no_finished_run_or_has_no_scenes_is_refused_with_the_reason() {
    let root = tempfile::tempdir().unwrap();
    let refused = |folder: &Path, scenarios: &[String]| Run::open(folder, scenarios).unwrap_err().to_string();
    assert!(refused(&root.path().join("nowhere"), &[]).contains("nowhere is not there"));
    fs::create_dir(root.path().join("empty")).unwrap();
    assert!(refused(&root.path().join("empty"), &[]).contains("holds no run"));
    assert!(refused(&run(root.path(), "paper", false), &[]).contains("is not finished"));
    let finished = run(root.path(), "strict", true);
    let moved = refused(&finished, &[root.path().join("gone").display().to_string()]);
    assert!(moved.contains("gone"), "{moved}");
}
