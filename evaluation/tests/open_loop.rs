//! The open-loop metrics of two simple plans and of CTRV predictions, frame by frame of real scenes, against the authors' functions.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may panic, and prints its table")]

use std::sync::Arc;

use episode::metrics::paper::Comfort;
use evaluation::open_loop::{LoggedNeighbor, OFF_ROUTE, OpenLoop, OpenLoopFrame};
use predictor_node::Ctrv;
use scenarios::SceneSet;
use vectors::{Npz, Quantity, Report, absolute, worst_deviation};
use wire::node::{History, PredictorFactory, StepInput};
use world::authors_frame;
use world::geometry::{Point, Pose};
use world::map_matching::LanePoints;
use world::observation::{Briefing, HistoryStep, Observation, ObservedAgent};
use world::plan::{Control, PLAN_STEPS, STEP_SECONDS};
use world::route::{Route, RouteStyle};
use world::scene::bridged::SeenSignal;
use world::scene::{Scene, TrackId};
use world::vehicle::{BicycleModel, VehicleState, WHEELBASE};

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
        let frames = npz.array("frame", &[None]).unwrap();
        let expected: Vec<f64> = (20..scene.steps() - 50).step_by(10).map(|frame| frame as f64).collect();
        assert_eq!(frames, expected);
        let road = Road::of(&scene);
        for (row, frame) in frames.iter().enumerate() {
            report.count_case();
            compare(&road, *frame as usize, &npz, row, &mut report);
        }
    }
    println!("{report}");
    assert!(report.holds(), "{report}");
}

/// What is made of a scene once.
struct Road<'a> {
    scene: &'a Arc<Scene>,
    route: Route,
    lanes: LanePoints,
}

impl<'a> Road<'a> {
    fn of(scene: &'a Arc<Scene>) -> Self {
        let route = Route::of_log(scene, RouteStyle::Paper).unwrap();
        Self { scene, route, lanes: LanePoints::new(scene.map(), |_| true) }
    }

    fn agents(&self, log_index: usize) -> Vec<ObservedAgent> {
        let others = self.scene.tracks().iter().enumerate().filter(|(track, _)| *track != self.scene.av_index());
        let seen = others.filter_map(|(_, track)| {
            Some(ObservedAgent { track: track.id, kind: track.kind, unseen: 0, state: track.states[log_index]? })
        });
        seen.collect()
    }

    /// What a driver would see at a frame of the log.
    fn observation(&self, frame: usize) -> (Briefing, Observation) {
        let scene = self.scene;
        let av = scene.av().states[frame].unwrap();
        let before = frame - 1;
        let history = HistoryStep {
            log_index: before as u32,
            av: scene.av().states[before].unwrap(),
            agents: self.agents(before),
        };
        let briefing = Briefing {
            scene: scene.id().clone(),
            protocol: "paper".to_owned(),
            start: frame as u32,
            horizon: PLAN_STEPS as u32,
            wheelbase: WHEELBASE,
            map: Arc::clone(scene.map()),
            route: vec![],
            reference_line: Arc::clone(&self.route.line),
            history: vec![history],
        };
        let (nearest, _) = self.route.nearest_sample(av.position());
        let mut window = self.route.window(nearest, scene.signals(frame));
        let lane = self.lanes.authors_match(av.pose()).unwrap().lane;
        window.speed_limit = Some(scene.map().lanes[lane].speed_limit().unwrap_or(0.0));
        let signals = scene.signals(frame).iter().map(|&signal| SeenSignal { signal, unseen: 0 }).collect();
        let control = Control::default();
        let agents = self.agents(frame);
        (briefing, Observation { step: 0, log_index: frame as u32, av, control, agents, signals, window })
    }
}

/// What is known of a neighbor.
struct Neighbor {
    /// Place in the scene.
    track: usize,
    agent: ObservedAgent,
    logged: [Option<Pose>; PLAN_STEPS],
    predicted: [Point; PLAN_STEPS],
}

fn compare(road: &Road<'_>, frame: usize, npz: &Npz, row: usize, report: &mut Report) {
    let place = format!("{} at {frame}", road.scene.id());
    let (briefing, observation) = road.observation(frame);
    let av = observation.av.pose();
    let neighbors = neighbors(road, frame, &briefing, &observation);

    let tracks = group::<NEIGHBORS>(npz, "neighbor_tracks", row);
    let ours: [f64; NEIGHBORS] = std::array::from_fn(|i| neighbors.get(i).map_or(-1.0, |n| n.track as f64));
    report.add(0, TRACKS, f64::from(u8::from(ours != tracks)), &place);
    let missing = group::<NEIGHBORS>(npz, "gt_missing_steps", row);
    let ours = neighbors.iter().map(|n| n.logged.iter().filter(|pose| pose.is_none()).count() as f64);
    report.add(0, MISSING, worst_deviation(ours, &missing[..neighbors.len()], absolute), &place);
    let states = npz.rows::<8>("current_state", &[None, Some(NEIGHBORS + 1), Some(8)]).unwrap();
    let states = &states[row * (NEIGHBORS + 1)..];
    for (neighbor, state) in neighbors.iter().zip(&states[1..]) {
        let logged = &neighbor.agent.state;
        let (pose, velocity) = (authors_frame::pose(logged, av), authors_frame::velocity(logged, av));
        let own = [pose.x, pose.y, pose.heading, velocity.x, velocity.y];
        report.add(0, STATES, worst_deviation(own, &state[..5], absolute), &place);
    }

    let human: [Pose; PLAN_STEPS] =
        std::array::from_fn(|k| authors_frame::pose(&road.scene.av().states[frame + 1 + k].unwrap(), av));
    let window = &observation.window;
    let line: Vec<Point> =
        (window.start..window.start + window.samples).map(|sample| stored(av, window.line.point(sample))).collect();
    let info = window.authors_info();
    let logged: Vec<LoggedNeighbor<'_>> = neighbors
        .iter()
        .map(|neighbor| LoggedNeighbor {
            length: neighbor.agent.state.length,
            width: neighbor.agent.state.width,
            logged: &neighbor.logged,
            predicted: &neighbor.predicted,
        })
        .collect();
    let speed = libm::hypot(states[0][3], states[0][4]);
    for (name, plan) in [("constant_velocity", straight_on(speed)), ("constant_control", bend(speed))] {
        let place = format!("{place}, {name}");
        let wanted = npz.rows::<3>(&format!("{name}_plan"), &[None, Some(4), Some(3)]).unwrap();
        for (at, wanted) in [0, 9, 24, 49].into_iter().zip(&wanted[row * 4..]) {
            let pose = plan[at];
            report.add(0, PLANS, worst_deviation([pose.x, pose.y, pose.heading], wanted, absolute), &place);
        }
        let found = OpenLoop::of(&OpenLoopFrame {
            plan: &plan,
            human: &human,
            length: observation.av.length,
            width: observation.av.width,
            neighbors: &logged,
            line: &line,
            info: &info,
        });
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
        add_comfort(
            report,
            [HUMAN_ACCELERATION, HUMAN_JERK],
            found.human_comfort,
            &group::<3>(npz, "human", row),
            &place,
        );
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

/// The nearest agents with what the log and the predictor say of them.
fn neighbors(road: &Road<'_>, frame: usize, briefing: &Briefing, observation: &Observation) -> Vec<Neighbor> {
    let mut history = History::new(briefing);
    history.push(observation);
    let input = StepInput { briefing, observation, history: &history, prediction: None };
    let prediction = Ctrv(None).start(briefing).unwrap().predict(&input).unwrap().check(0).unwrap();
    let av = observation.av.pose();
    let mut agents = observation.agents.clone();
    agents.sort_by(|a, b| {
        let distance = |agent: &ObservedAgent| agent.state.position().distance_squared(av.position());
        distance(a).total_cmp(&distance(b))
    });
    agents.truncate(NEIGHBORS);
    let neighbor = |agent: &ObservedAgent| {
        let track = road.scene.tracks().iter().position(|track| track.id == agent.track).unwrap();
        let states = &road.scene.tracks()[track].states;
        let trajectories = &prediction.most_likely().unwrap().trajectories;
        let predicted = trajectories.iter().find(|trajectory| trajectory.track == TrackId(agent.track.0)).unwrap();
        Neighbor {
            track,
            agent: *agent,
            logged: std::array::from_fn(|k| Some(authors_frame::pose(&states[frame + 1 + k]?, av))),
            predicted: std::array::from_fn(|k| av.to_body(predicted.poses[k].position())),
        }
    };
    agents.iter().map(neighbor).collect()
}

/// A place in the AV's frame as the authors store it: in single precision before and after.
fn stored(av: Pose, place: Point) -> Point {
    let single = |place: Point| Point::new(f64::from(place.x as f32), f64::from(place.y as f32));
    single(av.to_body(single(place)))
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
