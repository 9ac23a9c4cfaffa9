//! Planners on real scenes, and `idm` on the demo set, against a small closed loop of their own: the AV by the bicycle model,
//! everybody else as logged. The simulator's judges say more; here they must stay on their line and drive into nobody.

use std::collections::BTreeSet;
use std::sync::Arc;

use planner_node::{GaussNewton, GaussNewtonOptions, Idm, Init};
use scenarios::SceneSet;
use wire::node::{PlannerFactory, StepInput};
use world::geometry::{Point, boxes_overlap};
use world::observation::Observation;
use world::plan::{Control, Plan, STEP_SECONDS};
use world::scene::{AgentState, Scene, TrackId};
use world::vehicle::{BicycleModel, Limits, VehicleState, WHEELBASE};

use crate::log::{Foresight, HORIZON, Log, START, real_scenes};

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

/// Drives the scene, and looks at every plan on the way.
fn drive(
    factory: &dyn PlannerFactory,
    foresight: Foresight,
    scene: &Arc<Scene>,
    look: &mut dyn FnMut(&Observation, &Plan),
) -> Drive {
    let mut log = Log::new(Arc::clone(scene), "strict");
    let mut planner = factory.start(&log.briefing).unwrap();
    let mut av = log.av(START).unwrap();
    let (mut control, mut meters, mut beside, mut hardest) = (Control::default(), 0.0, 0.0_f64, 0.0_f64);
    let (mut touched, mut hits) = (BTreeSet::new(), Vec::new());
    for k in 0..log.steps() {
        let index = START + k;
        beside = beside.max(log.route.nearest_sample(av.position()).1);
        let observation = log.observe(k, av, control);
        let prediction = factory.needs_prediction().then(|| log.predict(&observation, foresight));
        let input = StepInput {
            briefing: &log.briefing,
            observation: &observation,
            history: &log.history,
            prediction: prediction.as_ref(),
        };
        let plan = planner.plan(&input).unwrap().check(k as u32).unwrap();
        look(&observation, &plan);
        control = Limits::STRICT.apply(plan.controls().unwrap()[0], control.steering, STEP_SECONDS);
        let next = BicycleModel::new(WHEELBASE).step(vehicle(&av), control, STEP_SECONDS);
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
        for other in log.agents(index + 1) {
            let logged =
                log.av(index + 1).is_some_and(|l| boxes_overlap(&l.oriented_box(), &other.state.oriented_box()));
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
        (START..scene.steps().min(START + HORIZON + 1)).filter_map(|i| log.av(i).map(|s| s.position())).collect();
    let human_meters = logged_path.windows(2).map(|pair| pair[0].distance(pair[1])).sum();
    Drive { meters, human_meters, beside, hardest, hits }
}

fn vehicle(av: &AgentState) -> VehicleState {
    VehicleState { x: av.x, y: av.y, heading: av.heading, speed: av.speed() }
}

/// Each scene is driven within `furthest_beside` (m) of the line, by plans that can be driven as they are; gives back whom the AV drove into.
fn hits_on_its_line(
    set: &SceneSet,
    factory: &dyn PlannerFactory,
    foresight: Foresight,
    furthest_beside: f64,
) -> Vec<(String, Vec<(usize, TrackId)>)> {
    let mut all = Vec::new();
    for (index, entry) in set.entries().iter().enumerate() {
        let (scene, _) = set.load(index).unwrap();
        let drive = drive(factory, foresight, &scene, &mut can_be_driven);
        eprintln!(
            "{} {:6.1} m (human {:6.1} m), at most {:4.2} m beside the line, braked {:5.2}, hits {:?}",
            entry.id, drive.meters, drive.human_meters, drive.beside, drive.hardest, drive.hits
        );
        assert!(drive.beside < furthest_beside, "{} leaves its line", entry.id);
        if !drive.hits.is_empty() {
            all.push((entry.id.to_string(), drive.hits));
        }
    }
    all
}

/// Each scene is driven into nobody, too.
fn stays_on_its_line_and_drives_into_nobody(
    scenes: &[String],
    factory: &dyn PlannerFactory,
    foresight: Foresight,
    furthest_beside: f64,
) {
    // An empty list is no scene here.
    if scenes.is_empty() {
        return;
    }
    let hits = hits_on_its_line(&SceneSet::open(scenes).unwrap(), factory, foresight, furthest_beside);
    assert!(hits.is_empty(), "{hits:?}");
}

/// Every control of the plan is within the vehicle's limits, from what it does now on, and leads to the plan's states. (That
/// all numbers are finite is checked of every plan that comes in.)
fn can_be_driven(observation: &Observation, plan: &Plan) {
    let mut state = vehicle(&observation.av);
    let mut before = observation.control;
    for (t, (control, planned)) in plan.controls().unwrap().iter().zip(plan.states()).enumerate() {
        let limited = Limits::STRICT.apply(*control, before.steering, STEP_SECONDS);
        assert_eq!(*control, limited, "step {} plans what the vehicle cannot do after {t} steps", observation.step);
        state = BicycleModel::new(WHEELBASE).step(state, *control, STEP_SECONDS);
        let driven = (state.x, state.y, state.heading, state.speed);
        assert_eq!(driven, (planned.x, planned.y, planned.heading, planned.speed), "step {}", observation.step);
        before = *control;
    }
}

#[test]
fn idm_drives_the_demo_set() {
    // Some of the demo set ask for more than it can do: to wait for a gap, and for those who do not wait for it.
    let set = SceneSet::open(&[]).unwrap();
    let hits = hits_on_its_line(&set, &Idm, Foresight::Ctrv, 3.0);
    assert!(hits.len() * 5 <= set.entries().len(), "{hits:?}");
}

#[test]
fn idm_stays_on_its_line_and_drives_into_nobody() {
    stays_on_its_line_and_drives_into_nobody(&real_scenes(), &Idm, Foresight::Ctrv, 3.0);
}

#[test]
fn gauss_newton_stays_on_its_line_and_drives_into_nobody() {
    for init in [Init::Zero, Init::Idm] {
        for foresight in [Foresight::Ctrv, Foresight::Oracle] {
            let options = GaussNewtonOptions { init, ..Default::default() };
            stays_on_its_line_and_drives_into_nobody(&real_scenes(), &GaussNewton(options), foresight, 3.0);
        }
    }
}
