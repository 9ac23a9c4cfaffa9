//! A single plan at a frame of the log: what is seen there, and how it is played out.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod straight_road;

use std::sync::Arc;

use episode::protocol::{Protocol, StrictSettings};
use episode::{Episode, Outcome};
use straight_road::{Mover, StraightRoad, car};
use world::plan::{PLAN_STEPS, PlanState};

/// Two seconds and a half after the usual start.
const FRAME: u32 = 44;

fn protocols() -> [Protocol; 2] {
    [Protocol::default(), Protocol::Paper]
}

/// A car that stands there and is seen while `is_there` says so of the time (s) since the usual start.
fn seen(x: f64, is_there: impl Fn(f64) -> bool + 'static) -> Mover {
    let stands = car(x, 3.5, 0.0, 0.0);
    Mover { motion: Box::new(move |time| (stands.motion)(time).filter(|_| is_there(time))), ..stands }
}

fn at(road: &StraightRoad, protocol: &Protocol, frame: u32) -> Episode {
    Episode::of_frame(road.scene(), protocol, frame).unwrap()
}

#[test]
fn at_the_usual_start_all_is_seen_as_in_a_drive() {
    let road = StraightRoad { red_at: Some(60.0), ..StraightRoad::new() }.with(car(20.0, 0.0, 0.0, 8.0));
    for protocol in protocols() {
        let (frame, drive) = (at(&road, &protocol, 19), Episode::new(road.scene(), &protocol).unwrap());
        assert_eq!(frame.observe(), drive.observe());
        assert_eq!(frame.briefing().history, drive.briefing().history);
        assert_eq!(frame.paper_sight(), drive.paper_sight());
    }
}

#[test]
fn what_is_seen_is_what_is_there_at_the_frame() {
    // One has left long before, one has come since the usual start.
    let road = StraightRoad::new().with(seen(10.0, |time| time < -1.0)).with(seen(50.0, |time| time > 1.0));
    for protocol in protocols() {
        let episode = at(&road, &protocol, FRAME);
        let observation = episode.observe();
        assert_eq!((observation.step, observation.log_index), (0, FRAME));
        assert_eq!(observation.av, road.scene().av().states[FRAME as usize].unwrap());
        assert_eq!(observation.agents.iter().map(|agent| agent.track.0).collect::<Vec<_>>(), [3]);
        let told: Vec<u32> = episode.briefing().history.iter().map(|step| step.log_index).collect();
        assert_eq!(told, (FRAME - 19..FRAME).collect::<Vec<_>>());
    }
    let sight = at(&road, &Protocol::Paper, FRAME);
    assert_eq!(sight.paper_sight().unwrap().neighbors, [2]);
    // 25 m on, 20 m of the line are behind.
    let window = sight.paper_sight().unwrap().window.clone();
    assert!((window.line.x[window.start] - 5.0).abs() < 0.2, "{}", window.line.x[window.start]);
}

fn flag(outcome: &Outcome, name: &str) -> bool {
    outcome.end.metrics.iter().find(|metric| metric.name == name).unwrap().value == Some(1.0)
}

/// Straight on from where the AV is at the frame, a step at a time; `aside` says how far to the left (m) after so many steps.
fn plan(aside: impl Fn(usize) -> f64) -> Vec<PlanState> {
    let state = |k: usize| PlanState { x: 25.0 + k as f64, y: aside(k), heading: 0.0, speed: 10.0 };
    (1..=PLAN_STEPS).map(state).collect()
}

#[test]
fn a_plan_is_played_out_to_its_end_whatever_happens() {
    // Into the ditch after a second, and back; then into a car that stands by the road, which the log has driven by.
    let protocol = Protocol::Strict(StrictSettings::default());
    let road = StraightRoad::new().with(seen(60.0, |_| true));
    let mut episode = at(&road, &protocol, FRAME);
    let astray = plan(|k| {
        if (10..20).contains(&k) {
            -8.0
        } else if k > 30 {
            3.5
        } else {
            0.0
        }
    });
    let outcome = episode.play_out(&astray);
    assert_eq!(outcome.records.len(), PLAN_STEPS);
    assert!(["off_route", "off_road", "collision", "at_fault_collision"].iter().all(|name| flag(&outcome, name)));
    let clean = at(&road, &protocol, FRAME).play_out(&plan(|_| 0.0));
    assert!(!["off_route", "off_road", "collision", "red_light"].iter().any(|name| flag(&clean, name)));
}

#[test]
fn a_red_light_is_run_from_before_the_stop_point_alone() {
    let red = |x: f64| {
        let mut road = StraightRoad { red_at: Some(x), ..StraightRoad::new() };
        // The log itself stops at 30 m, so that nothing is netted.
        road.av.motion = Box::new(|time| Some((10.0 * time.min(3.0), 0.0, 0.0, if time < 3.0 { 10.0 } else { 0.0 })));
        let mut episode = Episode::of_frame(Arc::clone(&road.scene()), &Protocol::default(), FRAME).unwrap();
        flag(&episode.play_out(&plan(|_| 0.0)), "red_light")
    };
    // The front is 2.5 m ahead of the centre, which starts at 25 m and comes to 75 m.
    assert_eq!([20.0, 27.0, 50.0, 90.0].map(red), [false, false, true, false]);
}
