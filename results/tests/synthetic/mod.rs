//! A made-up run of any size.

use std::path::Path;

use episode::metrics::METRICS;
use episode::protocol::Protocol;
use results::folder::{Folder, Opened};
use results::part::{LoggedState, Part};
use results::settings::{Build, Machine, Node, Planner, Record, RunFile, SceneLine, Settings};
use wire::proto::{AgentState, Control, EndReason, EpisodeEnd, Metric, StepRecord};

/// The run's file, with so many scenes.
pub fn run_file(scenes: usize) -> RunFile {
    let settings = Settings {
        driver: "idm".to_owned(),
        deadline_s: 5.0,
        record: Record::None,
        planner: Planner::Node(Node::named("idm", false)),
        predictor: None,
        protocol: Protocol::default(),
        latency: None,
        fork: None,
        traffic: None,
    };
    let machine = Machine {
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
    };
    let line = |place| SceneLine { id: scene(place), sha256: format!("{place:064x}"), fingerprint: None };
    RunFile { settings, build: Build::this(), machine, scenes: (0..scenes).map(line).collect() }
}

/// The name of the scene at a place.
pub fn scene(place: usize) -> String {
    format!("{place:016x}")
}

/// The episode of the scene at a place. Hardly a number is twice there, as in a drive.
pub fn part(place: usize, steps: u32) -> Part {
    let number = |step: u32, column: u32| (1e6 * place as f64 + 1e3 * f64::from(column) + f64::from(step)).sqrt();
    let state = |step, column| AgentState {
        x: number(step, column),
        y: number(step, column + 1),
        z: 30.0,
        heading: number(step, column + 2),
        velocity_x: number(step, column + 3),
        velocity_y: number(step, column + 4),
        length: 4.9,
        width: 2.0,
        height: 1.6,
    };
    let record = |step| StepRecord {
        step,
        log_index: step + 11,
        av: Some(state(step, 0)),
        control: Some(Control { acceleration: number(step, 10), steering: number(step, 11) }),
        yaw_rate: number(step, 12),
        station: number(step, 13),
        lateral_offset: number(step, 14),
        speed_limit: 11.176,
        route_distance: number(step, 15),
        time_to_collision: (step % 7 > 3).then(|| number(step, 16)),
        position_error: Some(number(step, 17)),
        road_edge_distance: Some(number(step, 18)),
        in_one_lane: true,
        ..StepRecord::default()
    };
    let metric = |(column, name)| Metric { name, value: Some(number(0, 30 + column)) };
    let metrics = METRICS.iter().map(|metric| metric.name.to_owned());
    let end = EpisodeEnd {
        scene: scene(place),
        reason: EndReason::Horizon.into(),
        metrics: (0_u32..).zip(metrics).map(metric).collect(),
        ..EpisodeEnd::default()
    };
    Part {
        end: Some(end),
        records: (0..steps).map(record).collect(),
        logged: (0..steps).map(|step| LoggedState { state: Some(state(step, 20)) }).collect(),
        ..Part::default()
    }
}

/// The folder of a run whose episodes are all driven.
pub fn driven(root: &Path, file: &RunFile, steps: u32) -> Folder {
    let Ok(Opened::New(folder)) = Folder::open(root, file) else { panic!("it is new") };
    (0..file.scenes.len()).for_each(|place| folder.store(&scene(place), &part(place, steps)).unwrap());
    folder
}
