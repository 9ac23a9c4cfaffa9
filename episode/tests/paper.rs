//! The protocol `paper` on a straight road: quirk by quirk what the authors' simulator does.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod straight_road;

use std::sync::Arc;

use episode::driver::{Driver, drive};
use episode::metrics::authors;
use episode::protocol::Protocol;
use episode::{Episode, Outcome, Undrivable};
use straight_road::{LIMIT_MPH, LogReplay, Mover, StraightRoad, car};
use wire::proto::EndReason;
use wire::proto::event::Kind;
use world::geometry::Pose;
use world::observation::Observation;
use world::plan::{PLAN_STEPS, Plan, PlanState, UncheckedPlan};
use world::route::RouteError;

/// Plans to be at the pose that a function of the observation says.
struct To<F: FnMut(&Observation) -> Pose>(F);

impl<F: FnMut(&Observation) -> Pose> Driver for To<F> {
    fn plan(&mut self, observation: &Observation) -> Result<Plan, String> {
        let Pose { x, y, heading } = (self.0)(observation);
        let states = vec![PlanState { x, y, heading, speed: 0.0 }; PLAN_STEPS];
        let step = observation.step;
        UncheckedPlan { step, states, ..UncheckedPlan::default() }.check(step).map_err(|error| error.to_string())
    }
}

/// Straight on, and so many metres to the left in every step.
fn drifting(left: f64) -> To<impl FnMut(&Observation) -> Pose> {
    To(move |o: &Observation| Pose::new(o.av.x + 1.0, o.av.y + left, o.av.heading))
}

fn episode(road: &StraightRoad) -> Episode {
    Episode::new(road.scene(), &Protocol::Paper).unwrap()
}

fn run(road: &StraightRoad, driver: &mut impl Driver) -> Outcome {
    drive(episode(road), driver)
}

fn metric(outcome: &Outcome, name: &str) -> Option<f64> {
    outcome.end.metrics.iter().find(|metric| metric.name == name).unwrap().value
}

/// A car that is only there while `is_there` says so of the time (s).
fn sometimes(car: Mover, is_there: impl Fn(f64) -> bool + 'static) -> Mover {
    let motion = car.motion;
    Mover { motion: Box::new(move |time| motion(time).filter(|_| is_there(time))), ..car }
}

#[test]
fn a_full_drive_has_151_steps_and_the_papers_metrics_alone() {
    let road = StraightRoad::new();
    let outcome = run(&road, &mut LogReplay(road.scene()));
    assert_eq!((outcome.end.reason(), outcome.end.steps), (EndReason::Horizon, 151));
    assert_eq!(outcome.end.protocol, "paper");
    assert_eq!(outcome.events, vec![]);
    for seconds in ["3s", "5s", "10s"] {
        assert_eq!(metric(&outcome, &format!("position_error_{seconds}_m")), Some(0.0));
    }
    assert!((metric(&outcome, "progress_m").unwrap() - 150.0).abs() < 1e-9);
    for metric in &outcome.end.metrics {
        assert_eq!(metric.value.is_some(), authors::is_measured(&metric.name), "{}", metric.name);
    }
}

#[test]
fn a_short_log_ends_the_drive_at_its_last_state() {
    let road = StraightRoad { steps: 119, ..StraightRoad::new() };
    let outcome = run(&road, &mut drifting(0.0));
    assert_eq!((outcome.end.reason(), outcome.end.steps), (EndReason::LogEnd, 99));
    assert_eq!(metric(&outcome, "position_error_3s_m"), None, "their code needs 120 states");
    let too_short = StraightRoad { steps: 20, ..StraightRoad::new() }.scene();
    let refused = Episode::new(too_short, &Protocol::Paper).unwrap_err();
    assert!(matches!(refused, Undrivable::TooShort { steps: 20, needed: 20 }), "{refused}");
}

#[test]
fn the_av_takes_the_plans_first_pose_but_turns_by_a_tenth_at_most() {
    let mut episode = episode(&StraightRoad::new());
    let plan = To(|_: &Observation| Pose::new(3.0, 0.5, 1.0)).plan(&episode.observe()).unwrap();
    let record = episode.advance(&plan).record;
    let av = record.av.unwrap();
    assert_eq!((av.x, av.y, av.heading), (3.0, 0.5, 0.1));
    assert!((av.velocity_x - 30.0).abs() < 1e-9 && (av.velocity_y - 5.0).abs() < 1e-9, "{av:?}");
    assert_eq!(episode.observe().av.heading, 0.1);
}

#[test]
fn a_heading_is_never_wrapped() {
    // Nearly a full turn away, which is a small turn back.
    let mut episode = episode(&StraightRoad::new());
    let plan = To(|o: &Observation| Pose::new(o.av.x + 1.0, 0.0, 6.25)).plan(&episode.observe()).unwrap();
    let heading = episode.advance(&plan).record.av.unwrap().heading;
    assert!((heading - (6.25 - std::f64::consts::TAU)).abs() < 1e-12, "{heading}");
}

#[test]
fn the_whole_line_has_the_limit_of_the_lane_under_the_av() {
    let episode = episode(&StraightRoad::new());
    let window = episode.observe().window;
    assert_eq!(window.speed_limit, Some(LIMIT_MPH / 2.237));
    assert_ne!(window.line.speed_limit[window.start], LIMIT_MPH / 2.237, "a mile has 0.44704 m/s an hour");
}

#[test]
fn who_appears_beside_the_av_is_seen_a_step_late() {
    // Both go side by side, too near; the other is in the log from 1 s on.
    let other = || car(0.0, 1.5, 0.0, 10.0);
    let late = StraightRoad::new().with(sometimes(other(), |time| time > 0.95));
    let outcome = run(&late, &mut LogReplay(late.scene()));
    assert_eq!((outcome.end.reason(), outcome.end.steps), (EndReason::Collision, 11));
    let event = &outcome.events[0];
    assert_eq!((event.kind(), event.track, event.step), (Kind::Collision, Some(2), 10));
    assert_eq!((metric(&outcome, "collision"), metric(&outcome, "off_route")), (Some(1.0), Some(0.0)));
    let always = StraightRoad::new().with(other());
    assert_eq!(run(&always, &mut LogReplay(always.scene())).end.steps, 1);
}

#[test]
fn beyond_the_ten_nearest_nobody_is_hit() {
    // Ten parked cars stay nearer than the one behind them that comes at 100 m/s in a single step.
    let mut road = StraightRoad::new();
    for index in 0..10 {
        road = road.with(car(10.0 * f64::from(index), 4.4, 0.0, 0.0));
    }
    let sudden = |time: f64| {
        let x = if time < 0.05 { 400.0 } else { 10.0 * time };
        Some((x, 0.0, 0.0, 10.0))
    };
    let road = road.with(Mover { motion: Box::new(sudden), ..car(0.0, 0.0, 0.0, 0.0) });
    let outcome = run(&road, &mut LogReplay(road.scene()));
    // Step 1 was judged against those seen before it; in the step after, it is the nearest.
    assert_eq!((outcome.end.reason(), outcome.end.steps), (EndReason::Collision, 2));
}

#[test]
fn who_leaves_the_log_stands_at_the_origin_of_the_map() {
    // The AV is at the origin of the map when its neighbor, far away, is seen no more.
    let origin = Pose::new(-10.0, 0.0, 0.0);
    let leaving = sometimes(car(60.0, 3.5, 0.0, 0.0), |time| time < 0.95);
    let road = StraightRoad { origin, ..StraightRoad::new() }.with(leaving);
    let outcome = run(&road, &mut LogReplay(road.scene()));
    assert_eq!((outcome.end.reason(), outcome.end.steps), (EndReason::Collision, 10));
}

#[test]
fn more_than_five_metres_from_the_line_is_off_route() {
    let outcome = run(&StraightRoad::new(), &mut drifting(-0.3));
    assert_eq!((outcome.end.reason(), outcome.end.steps), (EndReason::OffRoute, 17));
    assert_eq!((metric(&outcome, "collision"), metric(&outcome, "off_route")), (Some(0.0), Some(1.0)));
    assert_eq!(outcome.events[0].text, "5.1 m from the line");
}

#[test]
fn a_pose_at_the_end_of_the_world_is_off_route_and_one_beyond_it_no_plan() {
    for x in [1.1e7, -1e200, f64::MAX] {
        let outcome = run(&StraightRoad::new(), &mut To(|_: &Observation| Pose::new(x, 0.0, 0.0)));
        assert_eq!((outcome.end.reason(), outcome.end.steps), (EndReason::DriverFailed, 0), "{x}");
    }
    for x in [1e7, -1e7] {
        let outcome = run(&StraightRoad::new(), &mut To(|_: &Observation| Pose::new(x, 0.0, x)));
        assert_eq!((outcome.end.reason(), outcome.end.steps), (EndReason::OffRoute, 1), "{x}");
        let record = outcome.records[0];
        assert!(!record.station.is_nan() && !record.lateral_offset.is_nan(), "{x}: {record:?}");
        assert!(outcome.end.metrics.iter().filter_map(|metric| metric.value).all(|value| !value.is_nan()), "{x}");
    }
}

#[test]
fn where_no_lane_has_the_avs_heading_the_route_is_lost() {
    let mut turning = To(|o: &Observation| Pose::new(o.av.x + 1.0, o.av.y, o.av.heading + 0.1));
    let outcome = run(&StraightRoad::new(), &mut turning);
    // Ten degrees are passed in the second step.
    assert_eq!((outcome.end.reason(), outcome.end.steps), (EndReason::RouteLost, 2));
    assert!(outcome.end.detail.contains("log index 21"), "{}", outcome.end.detail);
    assert_eq!((metric(&outcome, "collision"), metric(&outcome, "off_route")), (Some(0.0), Some(0.0)));
}

#[test]
fn an_av_that_starts_across_the_road_has_no_route() {
    let mut road = StraightRoad::new();
    let straight = road.av.motion;
    // Only at the start: the route goes by whole seconds of the log, and this is none.
    road.av.motion = Box::new(move |time| {
        straight(time).map(|(x, y, heading, speed)| (x, y, if time.abs() < 0.01 { 1.0 } else { heading }, speed))
    });
    let refused = Episode::new(road.scene(), &Protocol::Paper).unwrap_err();
    assert!(matches!(refused, Undrivable::Route(RouteError::NoLane { log_index: 19 })), "{refused}");
}

#[test]
fn no_observation_knows_more_than_its_step() {
    let road = StraightRoad::new().with(car(50.0, 3.5, std::f64::consts::PI, 8.0));
    let scene = road.scene();
    let episode = Episode::new(Arc::clone(&scene), &Protocol::Paper).unwrap();
    assert!(episode.briefing().history.iter().all(|step| step.log_index < 19));
    let seen = episode.observe();
    assert_eq!((seen.log_index, seen.agents.len()), (19, 1));
    assert_eq!(Some(seen.agents[0].state), scene.tracks()[1].states[19]);
}
