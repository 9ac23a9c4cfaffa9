//! The strict protocol on a straight road: what is judged, what ends a drive, what is netted.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod straight_road;

use std::sync::Arc;

use episode::driver::{Driver, drive};
use episode::protocol::{EndingCollision, Motion, Protocol, StrictSettings};
use episode::{Episode, Outcome, Undrivable};
use proptest::prelude::*;
use straight_road::{Controls, LIMIT, LogReplay, StraightRoad, car, straight_on, to_lateral};
use wire::proto::event::{Contact, Kind};
use wire::proto::{EndReason, Event};
use world::geometry::Pose;
use world::observation::Observation;
use world::plan::{Control, Plan};
use world::scene::{AgentKind, Scene};

fn run_with(scene: &Arc<Scene>, settings: StrictSettings, driver: &mut impl Driver) -> Outcome {
    drive(Episode::new(Arc::clone(scene), &Protocol::Strict(settings)).unwrap(), driver)
}

fn run(road: &StraightRoad, driver: &mut impl Driver) -> Outcome {
    run_with(&road.scene(), StrictSettings::default(), driver)
}

fn replay(road: &StraightRoad) -> Outcome {
    let settings = StrictSettings { motion: Motion::Playback, ..StrictSettings::default() };
    run_with(&road.scene(), settings, &mut LogReplay(road.scene()))
}

/// A log that is at 10 m/s where the drive starts, at 4 m/s after, and stands from `most` metres on: its AV meets nobody that
/// ours does, at any time.
fn slow_log_to(most: f64) -> StraightRoad {
    let mut av = car(0.0, 0.0, 0.0, 10.0);
    av.motion = Box::new(move |time| {
        let speed = if time < 0.05 { 10.0 } else { 4.0 };
        if speed * time < most { Some((speed * time, 0.0, 0.0, speed)) } else { Some((most, 0.0, 0.0, 0.0)) }
    });
    StraightRoad { av, ..StraightRoad::new() }
}

fn slow_log() -> StraightRoad {
    slow_log_to(40.0)
}

fn metric(outcome: &Outcome, name: &str) -> Option<f64> {
    outcome.end.metrics.iter().find(|metric| metric.name == name).unwrap().value
}

fn collisions(outcome: &Outcome) -> Vec<&Event> {
    outcome.events.iter().filter(|event| event.kind() == Kind::Collision).collect()
}

#[test]
fn the_log_replayed_has_no_fault_no_error_and_the_full_score() {
    let outcome = replay(&StraightRoad::new());
    assert_eq!((outcome.end.reason(), outcome.end.steps), (EndReason::Horizon, 150));
    assert_eq!(outcome.events, vec![]);
    for seconds in ["3s", "5s", "10s"] {
        assert_eq!(metric(&outcome, &format!("position_error_{seconds}_m")), Some(0.0));
    }
    assert!((metric(&outcome, "progress_m").unwrap() - 149.0).abs() < 1e-9);
    assert!((metric(&outcome, "route_progress_m").unwrap() - 150.0).abs() < 1e-6);
    assert_eq!(metric(&outcome, "nuplan_score"), Some(1.0));
}

#[test]
fn driving_into_a_standing_car_is_at_fault_and_ends_the_drive() {
    // 45 m between bumpers at 10 m/s: boxes touch after step 45, and overlap after the 46th.
    let outcome = run(&slow_log().with(car(50.0, 0.0, 0.0, 0.0)), &mut straight_on());
    assert_eq!((outcome.end.reason(), outcome.end.steps), (EndReason::Collision, 46));
    let collision = collisions(&outcome)[0];
    assert_eq!((collision.contact(), collision.at_fault, collision.track), (Contact::StoppedTrack, true, Some(2)));
    assert!((collision.relative_speed - 10.0).abs() < 1e-9);
    assert_eq!(metric(&outcome, "nuplan_no_at_fault_collision"), Some(0.0));
    assert_eq!(metric(&outcome, "nuplan_score"), Some(0.0));
    assert_eq!(metric(&outcome, "min_time_to_collision_s"), Some(0.0));
    assert_eq!(metric(&outcome, "position_error_5s_m"), None, "it never got there");
}

#[test]
fn a_contact_that_is_not_at_fault_counts_once_and_the_drive_goes_on() {
    let faster = StraightRoad::new().with(car(-30.0, 0.0, 0.0, 15.0));
    let outcome = run(&faster, &mut straight_on());
    assert_eq!(outcome.end.reason(), EndReason::Horizon);
    assert_eq!(collisions(&outcome).len(), 1);
    assert_eq!((collisions(&outcome)[0].contact(), collisions(&outcome)[0].at_fault), (Contact::Rear, false));
    assert_eq!(metric(&outcome, "collision"), Some(0.0), "the logged AV is hit at the same step: netted");

    // A logged AV that is elsewhere is no excuse.
    let settings = StrictSettings::default();
    let alone = StraightRoad { av: car(0.0, 0.0, 0.0, 10.0), ..faster };
    let slow =
        &mut Controls(|o: &Observation| Control { acceleration: if o.step < 20 { -1.0 } else { 0.0 }, steering: 0.0 });
    let outcome = run_with(&alone.scene(), settings, slow);
    assert_eq!(metric(&outcome, "collision"), Some(1.0));
    assert_eq!(metric(&outcome, "at_fault_collision"), Some(0.0));
    assert_eq!(metric(&outcome, "nuplan_no_at_fault_collision"), Some(1.0));
    let settings = StrictSettings { ending_collision: EndingCollision::Any, ..StrictSettings::default() };
    assert_eq!(run_with(&alone.scene(), settings, slow).end.reason(), EndReason::Collision);
}

#[test]
fn an_av_that_stands_is_never_at_fault() {
    let road = StraightRoad::new().with(car(100.0, 0.0, std::f64::consts::PI, 12.0));
    let outcome = run(&road, &mut Controls(|_| Control { acceleration: -5.0, steering: 0.0 }));
    assert_eq!((collisions(&outcome)[0].contact(), outcome.end.reason()), (Contact::Standing, EndReason::Horizon));
    assert_eq!(metric(&outcome, "at_fault_collision"), Some(0.0));
    // It braked, and did not reverse.
    assert_eq!(outcome.records.last().unwrap().av.unwrap().velocity_x, 0.0);
}

#[test]
fn what_the_logged_av_hits_too_is_shown_and_does_not_count() {
    let outcome = replay(&StraightRoad::new().with(car(3.0, 1.9, 0.0, 10.0)));
    assert!(collisions(&outcome).iter().all(|event| event.netted));
    assert_eq!(collisions(&outcome).len(), 1, "one long contact is said once");
    assert_eq!((metric(&outcome, "contacts"), metric(&outcome, "contacts_netted")), (Some(0.0), Some(1.0)));
    assert_eq!(metric(&outcome, "nuplan_score"), Some(1.0));
}

#[test]
fn traffic_on_the_bridge_above_is_not_hit() {
    let mut above = car(50.0, 0.0, 0.0, 0.0);
    above.z = 6.5;
    assert_eq!(collisions(&run(&StraightRoad::new().with(above), &mut straight_on())), Vec::<&Event>::new());
}

#[test]
fn one_object_costs_half_of_the_score() {
    let mut cone = car(50.0, 0.0, 0.0, 0.0);
    cone.kind = AgentKind::Other;
    let road = slow_log().with(cone);
    let settings = StrictSettings { ending_collision: EndingCollision::None, ..StrictSettings::default() };
    let outcome = run_with(&road.scene(), settings, &mut straight_on());
    assert_eq!(metric(&outcome, "nuplan_no_at_fault_collision"), Some(0.5));
    // TTC is lost too: 0.5 * (5 + 4 + 2) / 16.
    assert_eq!(metric(&outcome, "nuplan_score"), Some(0.5 * 11.0 / 16.0));
}

#[test]
fn crossing_at_red_is_seen_and_netted_if_the_human_did_it() {
    let slow_log = StraightRoad { red_at: Some(100.0), av: car(0.0, 0.0, 0.0, 5.0), ..StraightRoad::new() };
    let outcome = run(&slow_log, &mut Controls(|_| Control { acceleration: 1.0, steering: 0.0 }));
    assert_eq!(metric(&outcome, "red_light"), Some(1.0));
    let both = StraightRoad { red_at: Some(100.0), ..StraightRoad::new() };
    let outcome = run(&both, &mut straight_on());
    assert_eq!(metric(&outcome, "red_light"), Some(0.0));
    assert!(outcome.events.iter().any(|event| event.kind() == Kind::RedLight && event.netted));
}

#[test]
fn a_crossing_that_nobody_saw_is_no_excuse() {
    let mut av = car(0.0, 0.0, 0.0, 10.0);
    av.motion = Box::new(|time| (!(3.0..4.5).contains(&time)).then_some((10.0 * time, 0.0, 0.0, 10.0)));
    let outcome = run(&StraightRoad { red_at: Some(40.0), av, ..StraightRoad::new() }, &mut straight_on());
    assert_eq!(metric(&outcome, "red_light"), Some(1.0));
}

#[test]
fn who_leaves_the_route_has_no_score_to_keep() {
    // Within the lane and the road all the time, so that no term of the score is lost.
    let settings = StrictSettings { off_route_distance: 1.2, ..StrictSettings::default() };
    let outcome = run_with(&StraightRoad::new().scene(), settings, &mut to_lateral(-1.4));
    assert_eq!(outcome.end.reason(), EndReason::OffRoute);
    assert_eq!(metric(&outcome, "nuplan_drivable_area"), Some(1.0));
    assert_eq!(metric(&outcome, "nuplan_score"), Some(0.0));
}

#[test]
fn a_drive_too_short_to_be_felt_has_no_score_unless_it_is_lost_already() {
    let short = |steps| run(&StraightRoad { steps, ..StraightRoad::new() }, &mut straight_on());
    for steps in 21..=23 {
        let outcome = short(steps);
        assert_eq!((metric(&outcome, "nuplan_comfort"), metric(&outcome, "nuplan_score")), (None, None), "{steps}");
    }
    assert_eq!(metric(&short(24), "nuplan_score"), Some(1.0));
    let blocked = slow_log_to(0.1).with(car(5.5, 0.0, 0.0, 0.0));
    let outcome = run(&blocked, &mut straight_on());
    assert_eq!((outcome.end.reason(), outcome.end.steps), (EndReason::Collision, 1));
    assert_eq!(metric(&outcome, "nuplan_score"), Some(0.0));
}

#[test]
fn progress_is_compared_as_long_as_the_human_is_there() {
    // The human is seen for 10 s at 10 m/s; ours brakes to 5 m/s within 5 s and has 62.5 m by then, 87.5 m at the end.
    let mut av = car(0.0, 0.0, 0.0, 10.0);
    av.motion = Box::new(|time| (time < 10.05).then_some((10.0 * time, 0.0, 0.0, 10.0)));
    let braking =
        &mut Controls(|o: &Observation| Control { acceleration: if o.step < 50 { -1.0 } else { 0.0 }, steering: 0.0 });
    let outcome = run(&StraightRoad { av, ..StraightRoad::new() }, braking);
    assert_eq!(outcome.end.reason(), EndReason::Horizon);
    assert!((metric(&outcome, "route_progress_m").unwrap() - 87.5).abs() < 0.5);
    assert!((metric(&outcome, "nuplan_progress").unwrap() - 0.625).abs() < 5e-3);
    assert!((metric(&outcome, "progress_ratio").unwrap() - 0.625).abs() < 5e-3);
}

#[test]
fn leaving_the_road_is_seen_before_leaving_the_route_ends_the_drive() {
    let outcome = run(&StraightRoad::new(), &mut to_lateral(-9.0));
    assert_eq!(outcome.end.reason(), EndReason::OffRoute);
    let first = |kind| outcome.events.iter().find(|event| event.kind() == kind).unwrap().step;
    assert!(first(Kind::OffRoad) < first(Kind::OffRoute));
    assert_eq!(metric(&outcome, "nuplan_drivable_area"), Some(0.0));
    let last = outcome.records.last().unwrap();
    assert!(last.off_route && last.route_distance > 5.0 && last.lateral_offset < -5.0);
    assert!(outcome.records[outcome.records.len() - 2].route_distance <= 5.0);
}

#[test]
fn driving_in_the_oncoming_lane_is_the_wrong_way() {
    let outcome = run(&StraightRoad::new(), &mut to_lateral(3.5));
    assert_eq!(metric(&outcome, "wrong_way"), Some(1.0));
    assert_eq!(metric(&outcome, "nuplan_driving_direction"), Some(0.0), "10 m back in a second");
    assert!((outcome.records[149].backward_travel - 11.0).abs() < 0.1, "11 samples of 1 m, as nuPlan sums them");
}

#[test]
fn speeding_costs_what_the_integral_says_unless_the_human_speeds_there_too() {
    // The log drives at 15 m/s where 11.176 m/s are allowed; so does the AV.
    let fast = StraightRoad { av: car(0.0, 0.0, 0.0, 15.0), ..StraightRoad::new() };
    let outcome = run(&fast, &mut straight_on());
    assert_eq!(metric(&outcome, "speeding"), Some(0.0), "netted: the human speeds too");
    assert_eq!(metric(&outcome, "speed_limit_compliance"), Some(0.0), "what is netted is told");
    assert_eq!(metric(&outcome, "nuplan_speed_limit"), Some(1.0));
    // A log that slows down at once is no excuse for who keeps its speed.
    let mut av = car(0.0, 0.0, 0.0, 12.0);
    av.motion = Box::new(|time| Some((12.0 * time, 0.0, 0.0, 12.0)));
    let speeds_up =
        &mut Controls(|o: &Observation| Control { acceleration: if o.step < 10 { 2.0 } else { 0.0 }, steering: 0.0 });
    let outcome = run(&StraightRoad { av, ..StraightRoad::new() }, speeds_up);
    assert_eq!(metric(&outcome, "speeding"), Some(1.0));
    let speeds: Vec<f64> = outcome.records.iter().map(|record| record.av.unwrap().velocity_x).collect();
    let over: f64 = speeds.iter().map(|speed| speed - LIMIT).sum();
    let expected = (1.0 - over / (2.23 * speeds.len() as f64)).max(0.0);
    assert!((metric(&outcome, "nuplan_speed_limit").unwrap() - expected).abs() < 1e-9);
}

#[test]
fn who_is_no_faster_than_the_human_above_the_limit_keeps_it() {
    // Too little to count as speeding, enough to cost.
    let above = StraightRoad { av: car(0.0, 0.0, 0.0, LIMIT + 1.0), ..StraightRoad::new() };
    let limit = |outcome: &Outcome| metric(outcome, "nuplan_speed_limit").unwrap();
    assert_eq!(limit(&replay(&above)), 1.0);
    assert_eq!(limit(&run(&above, &mut straight_on())), 1.0);
    let faster = |o: &Observation| Control { acceleration: if o.step < 5 { 1.0 } else { 0.0 }, steering: 0.0 };
    let outcome = run(&above, &mut Controls(faster));
    assert!(limit(&outcome) < 0.5 && metric(&outcome, "speeding") == Some(0.0), "{}", limit(&outcome));
}

#[test]
fn a_plan_without_controls_is_tracked() {
    let road = StraightRoad::new();
    let outcome = run(&road, &mut LogReplay(road.scene()));
    assert!(metric(&outcome, "position_error_10s_m").unwrap() < 0.1);
    assert_eq!(metric(&outcome, "nuplan_score"), Some(1.0));
}

#[test]
fn a_driver_that_fails_ends_the_drive_with_its_reason() {
    struct Failing;
    impl Driver for Failing {
        fn plan(&mut self, observation: &Observation) -> Result<Plan, String> {
            if observation.step == 3 { Err("out of ideas".to_owned()) } else { straight_on().plan(observation) }
        }
    }
    let outcome = run(&StraightRoad::new(), &mut Failing);
    assert_eq!((outcome.end.reason(), outcome.end.steps), (EndReason::DriverFailed, 3));
    assert_eq!(outcome.end.detail, "out of ideas");
    assert_eq!(outcome.events.last().unwrap().kind(), Kind::DriverFailed);
}

#[test]
fn a_log_that_is_short_ends_the_drive_early_and_one_too_short_is_refused() {
    let outcome = run(&StraightRoad { steps: 60, ..StraightRoad::new() }, &mut straight_on());
    assert_eq!((outcome.end.reason(), outcome.end.steps), (EndReason::LogEnd, 40));
    let refused = |road: StraightRoad| Episode::new(road.scene(), &Protocol::default()).unwrap_err();
    assert!(matches!(refused(StraightRoad { steps: 20, ..StraightRoad::new() }), Undrivable::TooShort { .. }));
    let mut late = car(0.0, 0.0, 0.0, 10.0);
    let motion = late.motion;
    late.motion = Box::new(move |time| motion(time).filter(|_| time > 1.0));
    assert!(matches!(refused(StraightRoad { av: late, ..StraightRoad::new() }), Undrivable::AvMissing { start: 19 }));
}

#[test]
fn no_observation_knows_more_than_its_step() {
    let road = StraightRoad::new().with(car(50.0, 3.5, std::f64::consts::PI, 8.0));
    let scene = road.scene();
    let episode = Episode::new(Arc::clone(&scene), &Protocol::default()).unwrap();
    assert!(episode.briefing().history.iter().all(|step| step.log_index < 19));
    let seen = episode.observe();
    assert_eq!((seen.log_index, seen.agents.len()), (19, 1));
    assert_eq!(Some(seen.agents[0].state), scene.tracks()[1].states[19]);
}

#[test]
fn an_observation_says_whom_it_does_not_see_but_supposes() {
    let road = StraightRoad { red_at: Some(40.0), ..StraightRoad::new() }.with(car(50.0, 3.5, 0.0, 8.0));
    let mut parts = road.scene().as_ref().clone().into_parts();
    parts.tracks[1].states[15..40].fill(None);
    parts.signals[17..40].iter_mut().for_each(Vec::clear);
    let scene = Arc::new(parts.check().unwrap().0);
    let unseen = |protocol: &Protocol| {
        let seen = Episode::new(Arc::clone(&scene), protocol).unwrap().observe();
        let agents: Vec<u32> = seen.agents.iter().map(|agent| agent.unseen).collect();
        (agents, seen.signals.iter().map(|signal| signal.unseen).collect::<Vec<_>>())
    };
    assert_eq!(unseen(&Protocol::default()), (vec![5], vec![3]));
    // The authors' simulator knows what is listed, no more.
    assert_eq!(unseen(&Protocol::Paper), (vec![], vec![]));
}

/// A drive with something of everything.
fn eventful(origin: Pose) -> Outcome {
    let road = StraightRoad { origin, red_at: Some(40.0), av: car(0.0, 0.0, 0.0, 9.0), ..StraightRoad::new() };
    let road = road.with(car(60.0, -0.5, 0.1, 4.0)).with(car(90.0, 3.5, 3.2, 9.0)).with(car(-25.0, 0.2, 0.0, 12.0));
    let settings = StrictSettings { ending_collision: EndingCollision::None, ..StrictSettings::default() };
    let mut driver = Controls(|o: &Observation| Control {
        acceleration: libm::sin(f64::from(o.step) * 0.13),
        steering: 0.02 * libm::cos(f64::from(o.step) * 0.21),
    });
    run_with(&road.scene(), settings, &mut driver)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    #[test]
    fn where_the_road_lies_changes_no_metric(x in -5e3..5e3, y in -5e3..5e3, heading in -3.1..3.1) {
        let (here, there) = (eventful(Pose::default()), eventful(Pose::new(x, y, heading)));
        prop_assert_eq!(here.events.len(), there.events.len());
        for (a, b) in here.end.metrics.iter().zip(&there.end.metrics) {
            let near = match (a.value, b.value) {
                (Some(a), Some(b)) => (a - b).abs() < 1e-7,
                (a, b) => a == b,
            };
            prop_assert!(near, "{}: {:?} {:?}", a.name, a.value, b.value);
        }
    }
}

/// A logged AV at 8 m/s on the lane, and a driver at 12 m/s: it passes every place earlier.
fn passed_earlier(other: straight_road::Mover) -> Outcome {
    let road = StraightRoad { av: car(0.0, 0.0, 0.0, 8.0), ..StraightRoad::new() }.with(other);
    let faster = |o: &Observation| Control { acceleration: if o.step < 20 { 2.0 } else { 0.0 }, steering: 0.0 };
    run(&road, &mut Controls(faster))
}

#[test]
fn a_parked_car_that_the_human_grazes_is_netted_by_place_and_so_is_what_leads_to_it() {
    // Boxes of 2 m: the parked one reaches 5 and 15 cm into the way.
    for overlap in [0.05, 0.15] {
        let parked = || car(60.0, 2.0 - overlap, 0.0, 0.0);
        let outcome = passed_earlier(parked());
        assert!(collisions(&outcome).iter().all(|event| event.netted) && !collisions(&outcome).is_empty());
        assert_eq!(
            (metric(&outcome, "collision"), metric(&outcome, "nuplan_time_to_collision")),
            (Some(0.0), Some(1.0))
        );
        let own = replay(&StraightRoad { av: car(0.0, 0.0, 0.0, 8.0), ..StraightRoad::new() }.with(parked()));
        assert_eq!(metric(&own, "nuplan_score"), Some(1.0));
        assert!(metric(&own, "min_time_to_collision_s").is_none_or(|time| time >= 0.95));
    }
    // Another track at the same place, which the logged AV never meets, is no excuse.
    let mut passing = car(60.0, 1.9, 0.0, 0.0);
    passing.motion = Box::new(|time| (time < 6.5).then_some((60.0, 1.9, 0.0, 0.0)));
    assert_eq!(metric(&passed_earlier(passing), "at_fault_collision"), Some(1.0));
}

#[test]
fn nobody_is_at_fault_for_a_car_that_was_not_there_a_second_ago() {
    let appearing = |at: f64| {
        let mut parked = car(50.0, 0.0, 0.0, 0.0);
        parked.motion = Box::new(move |time| (time > at).then_some((50.0, 0.0, 0.0, 0.0)));
        run(&slow_log().with(parked), &mut straight_on())
    };
    // They touch after 4.5 s.
    let late = appearing(4.0);
    assert_eq!((metric(&late, "collision"), metric(&late, "at_fault_collision")), (Some(1.0), Some(0.0)));
    assert_eq!((metric(&late, "nuplan_time_to_collision"), late.end.reason()), (Some(1.0), EndReason::Horizon));
    assert_eq!(metric(&appearing(3.0), "at_fault_collision"), Some(1.0));
}

#[test]
fn a_track_that_ends_is_gone_from_the_next_step_on_and_what_led_to_it_is_judged() {
    let vanishing = |at: f64| {
        let mut parked = car(50.0, 0.0, 0.0, 0.0);
        parked.motion = Box::new(move |time| (time < at).then_some((50.0, 0.0, 0.0, 0.0)));
        run(&slow_log().with(parked), &mut straight_on())
    };
    let terms = |at: f64| {
        let outcome = vanishing(at);
        ["collision", "nuplan_no_at_fault_collision", "nuplan_time_to_collision"].map(|name| metric(&outcome, name))
    };
    // They touch after 4.5 s.
    assert_eq!(terms(99.0), [Some(1.0), Some(0.0), Some(0.0)]);
    assert_eq!(terms(4.35), [Some(0.0), Some(1.0), Some(0.0)], "a tenth of a second before: it was too near");
    assert_eq!(terms(3.0), [Some(0.0), Some(1.0), Some(1.0)], "nobody knows whether it is there still");
}

#[test]
fn what_the_map_does_not_tell_is_missing_and_not_kept() {
    let mut parts = StraightRoad::new().scene().as_ref().clone().into_parts();
    parts.map.road_edges.clear();
    parts.map.lanes.iter_mut().for_each(|lane| lane.speed_limit_mph = 0.0);
    let scene = Arc::new(parts.check().unwrap().0);
    let outcome = run_with(&scene, StrictSettings::default(), &mut straight_on());
    for missing in ["off_road", "speeding", "nuplan_drivable_area", "nuplan_speed_limit", "speed_limit_compliance"] {
        assert_eq!(metric(&outcome, missing), None, "{missing}");
    }
    assert_eq!((metric(&outcome, "nuplan_score"), metric(&outcome, "nuplan_terms")), (Some(1.0), Some(6.0)));
}

#[test]
fn without_lanes_nobody_drives_the_wrong_way_or_the_right_one() {
    let mut parts = StraightRoad::new().scene().as_ref().clone().into_parts();
    parts.map.lanes.clear();
    let outcome = run_with(&Arc::new(parts.check().unwrap().0), StrictSettings::default(), &mut straight_on());
    for missing in ["wrong_way", "nuplan_driving_direction", "speeding"] {
        assert_eq!(metric(&outcome, missing), None, "{missing}");
    }
    assert_eq!(metric(&outcome, "nuplan_terms"), Some(6.0));
}

#[test]
fn a_red_light_that_was_unlisted_for_longer_than_it_holds_is_no_trap() {
    let lit = |unlisted: std::ops::Range<usize>| {
        let road = StraightRoad { red_at: Some(45.0), av: car(0.0, 0.0, 0.0, 4.0), ..StraightRoad::new() };
        let mut parts = road.scene().as_ref().clone().into_parts();
        parts.tracks[0].states.iter_mut().skip(60).for_each(|state| *state = None);
        parts.signals[unlisted].iter_mut().for_each(Vec::clear);
        let scene = Arc::new(parts.check().unwrap().0);
        let faster = |o: &Observation| Control { acceleration: if o.step < 20 { 3.0 } else { 0.0 }, steering: 0.0 };
        run_with(&scene, StrictSettings::default(), &mut Controls(faster))
    };
    let crossing = |outcome: &Outcome| {
        let red = outcome.events.iter().find(|event| event.kind() == Kind::RedLight);
        red.map(|event| (event.step as usize + 20, event.netted))
    };
    let (at, netted) = crossing(&lit(0..0)).unwrap();
    assert!(!netted);
    // Known again half a second before it is crossed, after four seconds of silence; after two nobody forgets.
    assert_eq!(crossing(&lit(at - 45..at - 5)), Some((at, true)));
    assert_eq!(crossing(&lit(at - 25..at - 5)), Some((at, false)));
}
