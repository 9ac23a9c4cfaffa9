//! The planner `idm` on real scenes and on the demo set, against a small closed loop of its own: the AV by the bicycle model, everybody else
//! as logged. The simulator's judges say more; here it must stay on its line and drive into nobody.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Arc;

use planner_node::Idm;
use scenarios::SceneSet;
use wire::node::{History, PlannerFactory, StepInput};
use world::geometry::{Point, boxes_overlap};
use world::observation::{Briefing, HistoryStep, Observation, ObservedAgent};
use world::plan::{Control, STEP_SECONDS};
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

fn drive(scene: &Scene, route: &Route) -> Option<Drive> {
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
    let mut planner = Idm.start(&briefing).ok()?;
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
        let input = StepInput { briefing: &briefing, observation: &observation, history: &history, prediction: None };
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

#[test]
fn idm_stays_on_its_line_and_drives_into_nobody() {
    let Some(shared) = shared() else {
        eprintln!("skipped: no folder of test data (set RELOOP_SHARED)");
        return;
    };
    let folders = ["data/womd-derived/20s", "data/womd-derived/20s-partial"];
    check(&folders.map(|folder| shared.join(folder).to_string_lossy().into_owned()));
}

#[test]
fn idm_drives_the_demo_set() {
    check(&["demo".to_owned()]);
}

fn check(scenes: &[String]) {
    let set = SceneSet::open(scenes).unwrap();
    let mut hits = Vec::new();
    for (index, entry) in set.entries().iter().enumerate() {
        let (scene, _) = set.load(index).unwrap();
        let route = Route::of_log(&scene, RouteStyle::Strict).unwrap();
        let Some(drive) = drive(&scene, &route) else { panic!("{} cannot be driven", entry.id) };
        eprintln!(
            "{} {:6.1} m (human {:6.1} m), at most {:4.2} m beside the line, braked {:5.2}, hits {:?}",
            entry.id, drive.meters, drive.human_meters, drive.beside, drive.hardest, drive.hits
        );
        assert!(drive.beside < 3.0, "{} leaves its line", entry.id);
        hits.extend(drive.hits.into_iter().map(|hit| (entry.id.clone(), hit)));
    }
    assert!(hits.is_empty(), "{hits:?}");
}
