//! Planners on real scenes, and `idm` on the demo set, against a small closed loop of their own: the AV by the bicycle model,
//! everybody else as logged. The simulator's judges say more; here they must stay on their line and drive into nobody.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Arc;

use planner_node::{GaussNewton, GaussNewtonOptions, Idm, Init};
use scenarios::SceneSet;
use wire::node::{History, PlannerFactory, StepInput};
use world::geometry::{Point, Pose, boxes_overlap};
use world::observation::{Briefing, HistoryStep, Observation, ObservedAgent};
use world::plan::{Control, Future, PLAN_STEPS, PredictedTrajectory, Prediction, STEP_SECONDS, UncheckedPrediction};
use world::route::{Route, RouteStyle};
use world::scene::{AgentState, Scene, TrackId};
use world::vehicle::{BicycleModel, Limits, VehicleState, WHEELBASE};

const START: usize = 19;
const HORIZON: usize = 150;

/// The folder of test data beside the repository.
fn shared() -> Option<PathBuf> {
    let repository = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("..");
    let beside = [repository.join("../shared"), repository.join("../../shared")];
    std::env::var_os("RELOOP_SHARED").map(PathBuf::from).into_iter().chain(beside).find(|path| path.is_dir())
}

struct Drive {
    meters: f64,
    human_meters: f64,
    /// Furthest from the line (m).
    beside: f64,
    /// Hardest braking (m/s^2, negative).
    hardest: f64,
    /// Step and track of each contact in which the AV's front drove into it.
    hits: Vec<(usize, TrackId)>,
}

fn agents(scene: &Scene, index: usize) -> Vec<ObservedAgent> {
    let others = scene.tracks().iter().enumerate().filter(|(place, _)| *place != scene.av_index());
    others
        .filter_map(|(_, track)| {
            let state = (*track.states.get(index)?)?;
            Some(ObservedAgent { track: track.id, kind: track.kind, state })
        })
        .collect()
}

/// What the log says of everybody who is there, as a prediction; who leaves stays where they were last.
fn log_ahead(scene: &Scene, index: usize, step: u32) -> Prediction {
    let trajectory = |agent: &ObservedAgent| {
        let track = scene.tracks().iter().find(|track| track.id == agent.track).unwrap();
        let mut last = agent.state.pose();
        let poses = (1..=PLAN_STEPS).map(|k| {
            last = track.states.get(index + k).copied().flatten().map_or(last, |state| state.pose());
            last
        });
        PredictedTrajectory { track: agent.track, poses: poses.collect::<Vec<Pose>>() }
    };
    let trajectories: Vec<_> = agents(scene, index).iter().map(trajectory).collect();
    let futures = if trajectories.is_empty() { vec![] } else { vec![Future { probability: 1.0, trajectories }] };
    UncheckedPrediction { step, futures, ..Default::default() }.check(step).unwrap()
}

fn drive(factory: &dyn PlannerFactory, scene: &Scene, route: &Route) -> Option<Drive> {
    let logged = |index: usize| scene.av().states.get(index).copied().flatten();
    let step =
        |index: usize| Some(HistoryStep { log_index: index as u32, av: logged(index)?, agents: agents(scene, index) });
    let briefing = Briefing {
        scene: scene.id().clone(),
        protocol: "strict".to_owned(),
        start: START as u32,
        horizon: HORIZON as u32,
        wheelbase: WHEELBASE,
        map: Arc::clone(scene.map()),
        route: route.lanes.clone(),
        reference_line: Arc::clone(&route.line),
        history: (0..START).filter_map(step).collect(),
    };
    let mut planner = factory.start(&briefing).ok()?;
    let mut history = History::new(&briefing);
    let mut av = logged(START)?;
    let (mut control, mut meters, mut beside, mut hardest) = (Control::default(), 0.0, 0.0_f64, 0.0_f64);
    let (mut touched, mut hits) = (BTreeSet::new(), Vec::new());
    for k in 0..HORIZON.min(scene.steps() - 1 - START) {
        let index = START + k;
        let (nearest, distance) = route.nearest_sample(av.position());
        beside = beside.max(distance);
        let observation = Observation {
            step: k as u32,
            log_index: index as u32,
            av,
            control,
            agents: agents(scene, index),
            signals: scene.signals(index).to_vec(),
            window: route.window(nearest, scene.signals(index)),
        };
        history.push(&observation);
        let prediction = factory.needs_prediction().then(|| log_ahead(scene, index, k as u32));
        let input = StepInput {
            briefing: &briefing,
            observation: &observation,
            history: &history,
            prediction: prediction.as_ref(),
        };
        let plan = planner.plan(&input).unwrap().check(k as u32).unwrap();
        control = Limits::STRICT.apply(plan.controls().unwrap()[0], control.steering, STEP_SECONDS);
        let state = VehicleState { x: av.x, y: av.y, heading: av.heading, speed: av.speed() };
        let next = BicycleModel::new(WHEELBASE).step(state, control, STEP_SECONDS);
        let velocity = Point::unit(next.heading) * next.speed;
        meters += av.position().distance(Point::new(next.x, next.y));
        av = AgentState {
            x: next.x,
            y: next.y,
            heading: next.heading,
            velocity_x: velocity.x,
            velocity_y: velocity.y,
            ..av
        };
        hardest = hardest.min(control.acceleration);
        let body = av.oriented_box();
        for other in agents(scene, index + 1) {
            let logged =
                logged(index + 1).is_some_and(|l| boxes_overlap(&l.oriented_box(), &other.state.oriented_box()));
            if !boxes_overlap(&body, &other.state.oriented_box()) || !touched.insert(other.track) || logged {
                continue;
            }
            // The first touch tells who drove into whom: the AV into what is ahead and slower.
            let ahead = body.forward.dot(other.state.position() - av.position()) > 0.25 * av.length;
            if ahead && next.speed > body.forward.dot(other.state.velocity()).max(0.05) {
                hits.push((k, other.track));
            }
        }
    }
    let logged_path: Vec<Point> =
        (START..scene.steps().min(START + HORIZON + 1)).filter_map(|i| logged(i).map(|s| s.position())).collect();
    let human_meters = logged_path.windows(2).map(|pair| pair[0].distance(pair[1])).sum();
    Some(Drive { meters, human_meters, beside, hardest, hits })
}

/// The folders of real scenes; none, with a word on it, where there are none.
fn real_scenes() -> Vec<String> {
    let Some(shared) = shared() else {
        eprintln!("skipped: no folder of test data (set RELOOP_SHARED)");
        return vec![];
    };
    let folders = ["data/womd-derived/20s", "data/womd-derived/20s-partial"];
    folders.map(|folder| shared.join(folder).to_string_lossy().into_owned()).to_vec()
}

/// Each scene is driven within `furthest_beside` (m) of the line, and into nobody. An empty list is no scene here.
fn stays_on_its_line_and_drives_into_nobody(scenes: &[String], factory: &dyn PlannerFactory, furthest_beside: f64) {
    if scenes.is_empty() {
        return;
    }
    let set = SceneSet::open(scenes).unwrap();
    let mut hits = Vec::new();
    for (index, entry) in set.entries().iter().enumerate() {
        let (scene, _) = set.load(index).unwrap();
        let route = Route::of_log(&scene, RouteStyle::Strict).unwrap();
        let Some(drive) = drive(factory, &scene, &route) else { panic!("{} cannot be driven", entry.id) };
        eprintln!(
            "{} {:6.1} m (human {:6.1} m), at most {:4.2} m beside the line, braked {:5.2}, hits {:?}",
            entry.id, drive.meters, drive.human_meters, drive.beside, drive.hardest, drive.hits
        );
        assert!(drive.beside < furthest_beside, "{} leaves its line", entry.id);
        hits.extend(drive.hits.into_iter().map(|hit| (entry.id.clone(), hit)));
    }
    assert!(hits.is_empty(), "{hits:?}");
}

#[test]
fn idm_drives_the_demo_set() {
    stays_on_its_line_and_drives_into_nobody(&["demo".to_owned()], &Idm, 3.0);
}

#[test]
fn idm_stays_on_its_line_and_drives_into_nobody() {
    stays_on_its_line_and_drives_into_nobody(&real_scenes(), &Idm, 3.0);
}

#[test]
fn gauss_newton_that_knows_the_log_stays_near_its_line_and_drives_into_nobody() {
    for init in [Init::Zero, Init::Idm] {
        let options = GaussNewtonOptions { init, ..Default::default() };
        // By the weights tuned by hand, a lane's width off the line costs less than what stands in it.
        stays_on_its_line_and_drives_into_nobody(&real_scenes(), &GaussNewton(options), 5.5);
    }
}
