//! The open-loop metrics of two simple plans and of CTRV predictions, frame by frame of real scenes, against the authors' functions.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may panic, and prints its table")]

use std::sync::Arc;

use episode::Episode;
use episode::metrics::paper::Comfort;
use evaluation::open_loop::authors::OFF_ROUTE;
use evaluation::open_loop::{Definitions, Moment, frames};
use predictor_node::Ctrv;
use scenarios::SceneSet;
use vectors::{Npz, Quantity, Report, absolute, worst_deviation};
use wire::node::{History, PredictorFactory, StepInput};
use world::authors_frame;
use world::geometry::{Point, Pose};
use world::plan::{Control, PLAN_STEPS, Plan, PlanState, Prediction, STEP_SECONDS, UncheckedPlan};
use world::scene::Scene;
use world::vehicle::{BicycleModel, VehicleState};

const NEIGHBORS: usize = 10;

const TRACKS: Quantity = Quantity::exact("neighbors");
const MISSING: Quantity = Quantity::exact("missing steps of their futures");
const STATES: Quantity = Quantity::within("states in the AV's frame", 1e-3, "abs");
const PLANS: Quantity = Quantity::within("plans", 1e-6, "abs");
const FLAGS: Quantity = Quantity::exact("collision, red light, off route");
const ACCELERATION: Quantity = Quantity::within("accelerations of the plans", 1e-3, "m/s^2");
const JERK: Quantity = Quantity::within("jerk of the plans", 1.0, "of 1 % or 0.2 m/s^3");
const HUMAN_ACCELERATION: Quantity = Quantity::within("accelerations of the human", 1e-3, "m/s^2");
const HUMAN_JERK: Quantity = Quantity::within("jerk of the human", 1.0, "of 1 % or 0.2 m/s^3");
const ERRORS: Quantity = Quantity::within("position errors", 2e-3, "m");
const PREDICTION: Quantity = Quantity::within("prediction errors", 2e-3, "m");
const QUANTITIES: [Quantity; 11] =
    [TRACKS, MISSING, STATES, PLANS, FLAGS, ACCELERATION, JERK, HUMAN_ACCELERATION, HUMAN_JERK, ERRORS, PREDICTION];

#[test]
fn every_frame_is_measured_as_the_authors_functions_do() {
    let Some(folder) = vectors::shared("dipp/open-loop-vectors") else { return };
    let file = |scene: &str| folder.join(format!("{scene}.npz"));
    let Some(scenes) = scenes(|scene| file(scene).exists()) else { return };
    let mut report = Report::new(&["off by"], &QUANTITIES);
    for scene in scenes {
        let npz = Npz::read(&file(scene.id().as_str())).unwrap();
        let wanted = npz.array("frame", &[None]).unwrap();
        assert_eq!(wanted, frames(scene.steps()).map(f64::from).collect::<Vec<_>>());
        for (row, frame) in frames(scene.steps()).enumerate() {
            report.count_case();
            compare(&scene, frame, &npz, row, &mut report);
        }
    }
    println!("{report}");
    assert!(report.holds(), "{report}");
}

fn compare(scene: &Arc<Scene>, frame: u32, npz: &Npz, row: usize, report: &mut Report) {
    let place = format!("{} at {frame}", scene.id());
    let moment = Moment::new(scene, Definitions::Authors, frame).unwrap();
    let av = moment.observation().av.pose();
    let episode = Episode::of_frame(Arc::clone(scene), &Definitions::Authors.protocol(), frame).unwrap();
    let neighbors = &episode.paper_sight().unwrap().neighbors;

    let tracks = group::<NEIGHBORS>(npz, "neighbor_tracks", row);
    let ours: [f64; NEIGHBORS] = std::array::from_fn(|i| neighbors.get(i).map_or(-1.0, |track| *track as f64));
    report.add(0, TRACKS, f64::from(u8::from(ours != tracks)), &place);
    let missing = group::<NEIGHBORS>(npz, "gt_missing_steps", row);
    let future = frame as usize + 1..frame as usize + 1 + PLAN_STEPS;
    let states = |track: &usize| &scene.tracks()[*track].states;
    let ours =
        neighbors.iter().map(|n| states(n)[future.clone()].iter().filter(|state| state.is_none()).count() as f64);
    report.add(0, MISSING, worst_deviation(ours, &missing[..neighbors.len()], absolute), &place);
    let wanted = npz.rows::<8>("current_state", &[None, Some(NEIGHBORS + 1), Some(8)]).unwrap();
    let wanted = &wanted[row * (NEIGHBORS + 1)..];
    for (neighbor, wanted) in neighbors.iter().zip(&wanted[1..]) {
        let logged = states(neighbor)[frame as usize].unwrap();
        let (pose, velocity) = (authors_frame::pose(&logged, av), authors_frame::velocity(&logged, av));
        let own = [pose.x, pose.y, pose.heading, velocity.x, velocity.y];
        report.add(0, STATES, worst_deviation(own, &wanted[..5], absolute), &place);
    }

    let prediction = constant_turn_rate(&moment);
    let speed = libm::hypot(wanted[0][3], wanted[0][4]);
    for (name, poses) in [("constant_velocity", straight_on(speed)), ("constant_control", bend(speed))] {
        let place = format!("{place}, {name}");
        let wanted = npz.rows::<3>(&format!("{name}_plan"), &[None, Some(4), Some(3)]).unwrap();
        for (at, wanted) in [0, 9, 24, 49].into_iter().zip(&wanted[row * 4..]) {
            let pose = poses[at];
            report.add(0, PLANS, worst_deviation([pose.x, pose.y, pose.heading], wanted, absolute), &place);
        }
        let found = moment.judge_as_authors(&plan(av, &poses), Some(&prediction)).unwrap();
        let wanted = group::<9>(npz, name, row);
        for (ours, theirs, from_edge) in [
            (found.collision(), wanted[0], found.collision_margin),
            (found.red_light, wanted[1], f64::INFINITY),
            (found.off_route(), wanted[2], found.route_distance - OFF_ROUTE),
        ] {
            // Their numbers are in single precision: within 1 mm of the edge either is right.
            let differs = f64::from(u8::from(ours)) != theirs && from_edge.abs() > 1e-3;
            report.add(0, FLAGS, f64::from(u8::from(differs)), &place);
        }
        add_comfort(report, [ACCELERATION, JERK], found.comfort, &wanted[3..6], &place);
        report.add(0, ERRORS, worst_deviation(found.position_errors, &wanted[6..], absolute), &place);
        let human = [HUMAN_ACCELERATION, HUMAN_JERK];
        add_comfort(report, human, found.human_comfort, &group::<3>(npz, "human", row), &place);
        let wanted = group::<2>(npz, "prediction", row);
        let deviation = match found.prediction {
            Some(errors) => worst_deviation([errors.average, errors.last], &wanted, absolute),
            None => f64::from(u8::from(!wanted.iter().all(|value| value.is_nan()))),
        };
        report.add(0, PREDICTION, deviation, &place);
    }
}

fn add_comfort(
    report: &mut Report,
    [acceleration, jerk]: [Quantity; 2],
    comfort: Comfort,
    wanted: &[f64],
    place: &str,
) {
    let ours = [comfort.acceleration.unwrap(), comfort.lateral_acceleration.unwrap()];
    report.add(0, acceleration, worst_deviation(ours, &[wanted[0], wanted[2]], absolute), place);
    let scale = |wanted: f64| (0.01 * wanted).max(0.2);
    report.add(0, jerk, worst_deviation(comfort.jerk, &wanted[1..2], scale), place);
}

/// What the predictor `ctrv` says at a moment.
fn constant_turn_rate(moment: &Moment) -> Prediction {
    let (briefing, observation) = (moment.briefing(), moment.observation());
    let mut history = History::new(&briefing);
    history.push(&observation);
    let input = StepInput { briefing: &briefing, observation: &observation, history: &history, prediction: None };
    Ctrv(None).start(&briefing).unwrap().predict(&input).unwrap().check(0).unwrap()
}

/// A plan of these poses in the frame of an AV at `av`.
fn plan(av: Pose, poses: &[Pose; PLAN_STEPS]) -> Plan {
    let state = |pose: &Pose| {
        let place: Point = av.to_world(pose.position());
        PlanState { x: place.x, y: place.y, heading: av.heading + pose.heading, speed: 0.0 }
    };
    UncheckedPlan { states: poses.iter().map(state).collect(), ..UncheckedPlan::default() }.check(0).unwrap()
}

fn straight_on(speed: f64) -> [Pose; PLAN_STEPS] {
    std::array::from_fn(|k| Pose::new(STEP_SECONDS * speed * (k + 1) as f64, 0.0, 0.0))
}

/// Braking softly to the left, by the authors' test model.
fn bend(speed: f64) -> [Pose; PLAN_STEPS] {
    let control = Control { acceleration: -1.0, steering: 0.05 };
    let mut state = VehicleState { speed, ..VehicleState::default() };
    std::array::from_fn(|_| {
        state = BicycleModel::authors_test().step(state, control, STEP_SECONDS);
        Pose::new(state.x, state.y, state.heading)
    })
}

/// Row `row` of an array of rows of `N`.
fn group<const N: usize>(npz: &Npz, name: &str, row: usize) -> [f64; N] {
    npz.rows::<N>(name, &[None, Some(N)]).unwrap()[row]
}

/// The twenty-second scenes that `wanted` takes, by name; `None`, with a word on it, where the shared data are missing.
fn scenes(wanted: impl Fn(&str) -> bool) -> Option<Vec<Arc<Scene>>> {
    let folder = vectors::shared("data/womd-derived/20s")?;
    let set = SceneSet::open(&[folder.display().to_string()]).unwrap();
    let indices = (0..set.entries().len()).filter(|index| wanted(set.entries()[*index].id.as_str()));
    Some(indices.map(|index| set.load(index).unwrap().0).collect())
}
