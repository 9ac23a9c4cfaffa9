//! The planner at hand-made steps and in a closed loop: what is planned is driven, and the others do what is expected of them.

use std::sync::Arc;

use proptest::prelude::*;
use wire::node::StepInput;
use world::geometry::{Point, Point3, Pose, boxes_overlap};
use world::map::{Map, MapId, RoadEdge, RoadEdgeKind};
use world::observation::ObservedAgent;
use world::plan::{Future, PredictedTrajectory, STEP_SECONDS, UncheckedPrediction};
use world::scene::{AgentKind, AgentState, TrackId};
use world::vehicle::{BicycleModel, Limits, VehicleState};

use super::*;
use crate::gauss_newton_planner::tests::Road;

/// Nobody is refined.
const AS_PROPOSED: Options = Options { contingency: Contingency::Branches, refine: 0 };

/// A vehicle so far ahead of the AV and to its left (m), at a speed (m/s) in a direction (rad) from the AV's own.
fn car(road: &Road, track: i32, (ahead, left): (f64, f64), speed: f64, turned: f64) -> ObservedAgent {
    let place = road.observation.av.pose().to_world(Point::new(ahead, left));
    let heading = road.observation.av.heading + turned;
    let velocity = Point::unit(heading) * speed;
    let state = AgentState {
        x: place.x,
        y: place.y,
        heading,
        velocity_x: velocity.x,
        velocity_y: velocity.y,
        ..road.observation.av
    };
    ObservedAgent { track: TrackId(track), kind: AgentKind::Vehicle, state, unseen: 0 }
}

/// It drives on like this for so many seconds, and stands from then on.
fn until(agent: &ObservedAgent, seconds: f64) -> PredictedTrajectory {
    let state = &agent.state;
    let pose = |k: usize| {
        let place = state.position() + state.velocity() * (k as f64 * STEP_SECONDS).min(seconds);
        Pose::new(place.x, place.y, state.heading)
    };
    PredictedTrajectory { track: agent.track, poses: (1..=PLAN_STEPS).map(pose).collect() }
}

fn future(probability: f64, trajectories: Vec<PredictedTrajectory>) -> Future {
    Future { probability, trajectories, controls: vec![] }
}

/// Everybody keeps their velocity.
fn as_now(agents: &[ObservedAgent]) -> UncheckedPrediction {
    let trajectories = agents.iter().map(|agent| until(agent, f64::INFINITY)).collect();
    UncheckedPrediction { futures: vec![future(1.0, trajectories)], ..UncheckedPrediction::default() }
}

fn with_cars(mut road: Road, agents: Vec<ObservedAgent>) -> Road {
    road.prediction = as_now(&agents);
    road.observation.agents = agents;
    road
}

/// The AV so far to the left of the line (m).
fn beside(left: f64, speed: f64) -> Road {
    let mut road = Road::new(1.0, speed, "strict");
    let place = road.observation.av.pose().to_world(Point::new(0.0, left));
    (road.observation.av.x, road.observation.av.y) = (place.x, place.y);
    road
}

fn try_all(options: Options, road: &Road) -> Drive {
    let mut drive = Drive::new(options, &road.briefing);
    road.step(|step| drive.try_all(step)).unwrap();
    drive
}

fn plan(options: Options, road: &Road) -> UncheckedPlan {
    road.step(|step| Drive::new(options, &road.briefing).plan(step)).unwrap()
}

/// Drives what is planned, so many steps, on a line whose end is out of sight; the AV after each.
fn drive(road: &mut Road, steps: u32) -> Vec<AgentState> {
    road.observation.window.samples = 1900;
    drive_on(road, steps)
}

fn drive_on(road: &mut Road, steps: u32) -> Vec<AgentState> {
    let mut planner = Drive::new(Options::default(), &road.briefing);
    let model = BicycleModel::new(road.briefing.wheelbase);
    let step = |_| {
        let plan = road.step(|step| planner.plan(step)).unwrap();
        let observation = &mut road.observation;
        let av = &mut observation.av;
        let now = VehicleState { x: av.x, y: av.y, heading: av.heading, speed: av.speed() };
        let next = model.step(now, plan.controls[0], STEP_SECONDS);
        let velocity = Point::unit(next.heading) * next.speed;
        (av.x, av.y, av.heading) = (next.x, next.y, next.heading);
        (av.velocity_x, av.velocity_y) = (velocity.x, velocity.y);
        observation.control = plan.controls[0];
        (observation.step, observation.log_index) = (observation.step + 1, observation.log_index + 1);
        for agent in &mut observation.agents {
            let moved = agent.state.velocity() * STEP_SECONDS;
            (agent.state.x, agent.state.y) = (agent.state.x + moved.x, agent.state.y + moved.y);
        }
        road.prediction = as_now(&road.observation.agents);
        road.observation.av
    };
    (0..steps).map(step).collect()
}

/// Along the line from the AV's first place, and to the left of it (m).
fn on_line(line: Pose, av: &AgentState) -> (f64, f64) {
    let place = line.to_body(av.position());
    (place.x, place.y)
}

#[test]
fn on_a_free_road_it_drives_to_the_limit_and_stays_on_the_line() {
    let mut road = Road::new(2.0, 8.0, "strict");
    let line = road.observation.av.pose();
    let driven = drive(&mut road, 80);
    for av in &driven {
        assert!(on_line(line, av).1.abs() < 0.05 && av.speed() < 12.1, "{av:?}");
    }
    assert!(driven[79].speed() > 11.0, "{}", driven[79].speed());
}

/// Edges of the road, so far to either side of the line (m).
fn between_edges(mut road: Road, away: f64) -> Road {
    let frame = road.observation.av.pose();
    let edge = |id: i64, ends: [f64; 2], left: f64| {
        let point = |along: f64| {
            let place = frame.to_world(Point::new(along, left));
            Point3::new(place.x, place.y, 0.0)
        };
        RoadEdge { id: MapId(id), kind: RoadEdgeKind::Boundary, polyline: ends.map(point).to_vec() }
    };
    // The road is to the left of each.
    let road_edges = vec![edge(1, [-50.0, 250.0], -away), edge(2, [250.0, -50.0], away)];
    road.briefing.map = Arc::new(Map { road_edges, ..Map::default() });
    road
}

#[test]
fn it_passes_a_car_that_stands_half_in_its_way() {
    let mut road = Road::new(-2.5, 8.0, "strict").with_standing_car(45.0);
    let line = road.observation.av.pose();
    let left = Point::unit(line.heading + std::f64::consts::FRAC_PI_2) * 1.6;
    let state = &mut road.observation.agents[0].state;
    (state.x, state.y) = (state.x + left.x, state.y + left.y);
    let (pose, other) = (state.pose(), state.oriented_box());
    road.prediction.futures[0].trajectories[0].poses.fill(pose);
    let driven = drive(&mut road, 120);
    assert!(driven.iter().all(|av| !boxes_overlap(&av.oriented_box(), &other)));
    let (along, aside) = on_line(line, &driven[119]);
    assert!(along > 55.0 && aside.abs() < 2.0, "{along} {aside}");
}

#[test]
fn it_stops_behind_a_standing_car_and_never_touches_it() {
    let mut road = between_edges(Road::new(-2.5, 8.0, "strict").with_standing_car(45.0), 2.0);
    let line = road.observation.av.pose();
    let other = road.observation.agents[0].state.oriented_box();
    let driven = drive(&mut road, 150);
    assert!(driven.iter().all(|av| !boxes_overlap(&av.oriented_box(), &other)));
    let (along, _) = on_line(line, &driven[149]);
    let gap = 45.0 - 5.0 - along;
    assert!(driven[149].speed() < 0.1 && gap > 0.5 && gap < 6.0, "{gap} {}", driven[149].speed());
}

#[test]
fn from_a_standstill_it_drives_off_wherever_it_stands() {
    for left in [0.0, 1.5, -1.5, 2.5] {
        let mut road = beside(left, 0.0);
        let line = Road::new(1.0, 0.0, "strict").observation.av.pose();
        let driven = drive(&mut road, 80);
        let (along, aside) = on_line(line, &driven[79]);
        assert!(along > 25.0 && aside.abs() <= left.abs() + 0.1, "{left}: {along} {aside}");
    }
}

#[test]
fn it_stops_at_a_red_light() {
    let mut road = Road::new(0.7, 8.0, "strict");
    let line = road.observation.av.pose();
    road.observation.window.red_stops = vec![550, 551];
    let driven = drive(&mut road, 150);
    let fronts = driven.iter().map(|av| on_line(line, av).0 + 2.5);
    let farthest = fronts.fold(0.0, f64::max);
    assert!(farthest < 35.0 && farthest > 29.0, "{farthest}");
    assert!(driven[149].speed() < 0.1);
}

#[test]
fn it_stops_before_the_end_of_the_line() {
    let mut road = Road::new(0.7, 12.0, "strict");
    let line = road.observation.av.pose();
    let window = &mut road.observation.window;
    window.samples = window.line.len() - window.start;
    // The AV starts at sample 200 of a line of 0.1 m.
    let end = 0.1 * (window.line.len() - 201) as f64;
    let driven = drive_on(&mut road, 300);
    let places: Vec<f64> = driven.iter().map(|av| on_line(line, av).0).collect();
    assert!(places[299] > 50.0 && driven[299].speed() < 0.1, "{} {}", places[299], driven[299].speed());
    assert!(places.iter().all(|along| *along + 2.5 < end), "{} {end}", places[299]);
}

/// Someone crosses from the right, or stops before the line.
fn crossing(speed: f64, crosses: f64) -> Road {
    let mut road = Road::new(0.4, speed, "strict");
    let other = car(&road, 3, (28.0, -14.0), 6.0, std::f64::consts::FRAC_PI_2);
    let futures =
        vec![future(crosses, vec![until(&other, f64::INFINITY)]), future(1.0 - crosses, vec![until(&other, 1.0)])];
    road.prediction = UncheckedPrediction { futures, ..UncheckedPrediction::default() };
    road.observation.agents = vec![other];
    road
}

fn score(contingency: Contingency, refine: u8, road: &Road) -> f64 {
    try_all(Options { contingency, refine }, road).candidates[0].score
}

#[test]
fn where_it_may_think_twice_a_plan_is_worth_at_least_as_much() {
    let mut more = 0;
    for crosses in [0.2, 0.5, 0.8] {
        for speed in [0.0, 4.0, 8.0, 11.0] {
            let road = crossing(speed, crosses);
            let once = score(Contingency::Expected, 0, &road);
            let twice = score(Contingency::Branches, 0, &road);
            assert!(twice >= once, "{crosses} {speed}: {twice} {once}");
            more += u32::from(twice > once);
        }
    }
    assert!(more > 0);
}

#[test]
fn one_who_looks_at_the_likeliest_future_sees_no_other() {
    let road = crossing(9.0, 0.4);
    let mut alone = crossing(9.0, 0.4);
    alone.prediction.futures.remove(0);
    alone.prediction.futures[0].probability = 1.0;
    let off = Options { contingency: Contingency::Off, ..Options::default() };
    assert_eq!(plan(off, &road), plan(off, &alone));
    assert_ne!(plan(Options::default(), &road), plan(Options::default(), &alone));
}

#[test]
fn a_window_of_less_than_two_samples_is_refused() {
    for samples in [0, 1] {
        let mut road = Road::new(0.0, 5.0, "strict");
        road.observation.window.samples = samples;
        let error = road.step(|step| Drive::new(Options::default(), &road.briefing).plan(step)).unwrap_err();
        assert_eq!(error, "the window of the reference line has less than two samples");
    }
}

/// A plan that its door lets in.
fn is_whole(road: &Road) {
    for contingency in [Contingency::Off, Contingency::Expected, Contingency::Branches] {
        let plan = plan(Options { contingency, ..Options::default() }, road);
        assert!(plan.diagnostics.objective[0].1.is_finite(), "{:?}", plan.diagnostics);
        plan.check(0).unwrap();
    }
}

#[test]
fn nobody_and_nothing_expected_is_no_trouble() {
    let road = Road::new(0.0, 5.0, "strict");
    is_whole(&road);
    let seen = with_cars(Road::new(0.0, 5.0, "strict"), vec![car(&road, 1, (20.0, 0.0), 3.0, 0.0)]);
    is_whole(&Road { prediction: UncheckedPrediction::default(), ..seen });
    let mut drive = Drive::new(Options::default(), &road.briefing);
    road.step(|step| drive.plan(&StepInput { prediction: None, ..*step }).unwrap().check(0).unwrap());
}

#[test]
fn boxes_without_a_size_and_cars_on_top_of_the_av_are_no_trouble() {
    let mut road = Road::new(0.0, 0.0, "strict");
    let agents = (0..30).map(|k| {
        let mut agent = car(&road, k, (f64::from(k % 3), 0.0), f64::from(k % 2) * 40.0, f64::from(k));
        (agent.state.length, agent.state.width, agent.state.height) = (0.0, 0.0, 0.0);
        agent
    });
    let agents = agents.collect();
    road = with_cars(road, agents);
    is_whole(&road);
    (road.observation.av.length, road.observation.av.width) = (0.0, 0.0);
    is_whole(&road);
}

#[test]
fn futures_that_are_many_or_impossible_or_forget_somebody_are_no_trouble() {
    let mut road = Road::new(0.0, 10.0, "strict");
    let agents = vec![car(&road, 1, (20.0, 0.0), 3.0, 0.0), car(&road, 2, (9e6, -9e6), 100.0, 1.0)];
    let all = |seconds: f64| agents.iter().map(|agent| until(agent, seconds)).collect::<Vec<_>>();
    let mut futures = vec![future(0.0, all(1.0)); 30];
    futures[0].trajectories.remove(0);
    futures[29].probability = 1.0;
    futures[29].controls = vec![Control { acceleration: -9e6, steering: 9e6 }; PLAN_STEPS];
    futures[29].trajectories[0].poses[7] = Pose::new(9e6, 9e6, 9e6);
    road.prediction = UncheckedPrediction { futures, ..UncheckedPrediction::default() };
    road.observation.agents = agents;
    is_whole(&road);
}

/// Where others may be: ahead and left (m), speed (m/s), turned (rad).
fn others() -> impl Strategy<Value = Vec<(f64, f64, f64, f64)>> {
    prop::collection::vec((-30.0..60.0, -8.0..8.0, 0.0..14.0, -3.2..3.2), 0..6)
}

fn any_road() -> impl Strategy<Value = Road> {
    let futures = prop::collection::vec((0.0..5.0, 0.01..1.0), 1..4);
    (-3.1..3.1, 0.0..14.0, -2.0..2.0, others(), futures, prop::option::of(150_u32..900)).prop_map(
        |(heading, speed, left, others, futures, red)| {
            let mut road = Road::new(heading, speed, "strict");
            let of = |(track, (ahead, left, speed, turned)): (usize, (f64, f64, f64, f64))| {
                car(&road, track as i32, (ahead, left), speed, turned)
            };
            let agents: Vec<_> = others.into_iter().enumerate().map(of).collect();
            let sum: f64 = futures.iter().map(|(_, probability)| probability).sum();
            let told = futures.iter().map(|(seconds, probability)| {
                future(probability / sum, agents.iter().map(|agent| until(agent, *seconds)).collect())
            });
            road.prediction = UncheckedPrediction { futures: told.collect(), ..UncheckedPrediction::default() };
            road.observation.agents = agents;
            let place = road.observation.av.pose().to_world(Point::new(0.0, left));
            (road.observation.av.x, road.observation.av.y) = (place.x, place.y);
            road.observation.window.red_stops = red.into_iter().collect();
            road
        },
    )
}

impl std::fmt::Debug for Road {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:?} among {:?}", self.observation.av, self.observation.agents)
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn no_policy_is_worth_more_than_the_plan(road in any_road()) {
        let drive = try_all(Options::default(), &road);
        let best = drive.candidates[0].score;
        for policy in POLICIES {
            let tried = drive.candidates.iter().find(|candidate| candidate.name == policy.name).unwrap();
            prop_assert!(best >= tried.score, "{} {best} {}", policy.name, tried.score);
        }
        let planned = plan(Options::default(), &road);
        prop_assert_eq!(&planned.diagnostics.objective[0].1, &best);
        prop_assert_eq!(planned.diagnostics.status, drive.candidates[0].name);
    }

    #[test]
    fn a_plan_is_within_limits_and_drives_where_it_says(road in any_road()) {
        let plan = plan(Options::default(), &road);
        let model = BicycleModel::new(road.briefing.wheelbase);
        let av = &road.observation.av;
        let mut state = VehicleState { x: av.x, y: av.y, heading: av.heading, speed: av.speed() };
        let mut wheel = road.observation.control.steering;
        for (control, planned) in plan.controls.iter().zip(&plan.states) {
            prop_assert_eq!(Limits::STRICT.apply(*control, wheel, STEP_SECONDS), *control);
            wheel = control.steering;
            state = model.step(state, *control, STEP_SECONDS);
            let off = [state.x - planned.x, state.y - planned.y, state.speed - planned.speed];
            prop_assert!(off.iter().all(|by| by.abs() < 1e-9) && planned.speed >= 0.0, "{state:?} {planned:?}");
        }
    }

    #[test]
    fn the_same_situation_is_answered_to_the_bit(road in any_road()) {
        let bits = |plan: &UncheckedPlan| -> Vec<u64> {
            let states = plan.states.iter().flat_map(|s| [s.x, s.y, s.heading, s.speed]);
            states.chain(plan.controls.iter().flat_map(|c| [c.acceleration, c.steering])).map(f64::to_bits).collect()
        };
        let (once, again) = (plan(Options::default(), &road), plan(Options::default(), &road));
        prop_assert_eq!(bits(&once), bits(&again));
    }

    #[test]
    fn thinking_twice_costs_nothing(road in any_road()) {
        let once = score(Contingency::Expected, 0, &road);
        prop_assert!(score(Contingency::Branches, 0, &road) >= once);
    }
}

#[test]
fn once_set_up_a_step_allocates_nothing() {
    for options in [Options::default(), AS_PROPOSED, Options { contingency: Contingency::Expected, refine: 8 }] {
        let mut road = crossing(9.0, 0.6);
        road.observation.window.samples = 1900;
        road.prediction.futures[0].controls = vec![Control::default(); PLAN_STEPS];
        let mut drive = Drive::new(options, &road.briefing);
        let counted: Vec<u64> = (0..30)
            .map(|number| {
                road.observation.step = number;
                road.observation.av.x += 0.1;
                let count =
                    |step: &StepInput<'_>| allocation_counter::measure(|| drive.try_all(step).unwrap()).count_total;
                let counted = road.step(count);
                drive.last = Some(drive.candidates[0].rollout.controls);
                counted
            })
            .collect();
        assert!(counted[3..].iter().all(|count| *count == 0), "{options:?}: {counted:?}");
    }
}
