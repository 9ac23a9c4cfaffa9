//! Plans that are followed later than they were asked for.

#![allow(clippy::unwrap_used, missing_docs, reason = "a test may panic")]

use std::sync::Arc;

use episode::guidance::{Aged, Guidance, STEP_US};
use episode::latency::pipeline::Pipeline;
use episode::protocol::{EndingCollision, Protocol, StrictSettings};
use episode::{Episode, Outcome};
use proptest::prelude::*;
use scenarios::generated::{Family, Parameters};
use wire::proto::StepRecord;
use world::observation::Observation;
use world::plan::{Control, PLAN_STEPS, Plan, PlanState, STEP_SECONDS, UncheckedPlan};
use world::scene::Scene;

fn scene() -> Arc<Scene> {
    let payload = Family::named("curve").unwrap().payload("curve", 1, 0, &Parameters::default()).unwrap();
    Arc::new(scenarios::womd::read(&payload).unwrap().0)
}

fn episode(scene: &Arc<Scene>) -> Episode {
    let settings = StrictSettings {
        horizon: 60,
        ending_collision: EndingCollision::None,
        off_route_distance: 1e6,
        ..StrictSettings::default()
    };
    Episode::new(Arc::clone(scene), &Protocol::Strict(settings)).unwrap()
}

/// Drives by `plan` of each observation, which takes `delay_us`.
fn drive(
    scene: &Arc<Scene>,
    mut plan: impl FnMut(&Observation) -> UncheckedPlan,
    mut delay_us: impl FnMut(u32) -> Option<u32>,
) -> Outcome {
    let (mut episode, mut pipeline) = (episode(scene), Pipeline::default());
    while episode.ended().is_none() {
        let observation = episode.observe();
        let step = observation.step;
        let plan = UncheckedPlan { step, ..plan(&observation) }.check(step).unwrap();
        episode.follow(&pipeline.step(plan, delay_us(step)));
    }
    episode.finish()
}

/// As if there were no latency.
fn drive_at_once(scene: &Arc<Scene>, mut plan: impl FnMut(&Observation) -> UncheckedPlan) -> Outcome {
    let mut episode = episode(scene);
    while episode.ended().is_none() {
        let observation = episode.observe();
        let step = observation.step;
        episode.advance(&UncheckedPlan { step, ..plan(&observation) }.check(step).unwrap());
    }
    episode.finish()
}

/// From where the AV is along an arc at its speed, with the controls of that or without; `turn` in rad/m.
fn arc(observation: &Observation, turn: f64, controls: bool) -> UncheckedPlan {
    let av = &observation.av;
    let speed = av.speed().max(3.0);
    let state = |step: usize| {
        let way = speed * STEP_SECONDS * (step + 1) as f64;
        let heading = av.heading + turn * way;
        PlanState { x: av.x + way * libm::cos(heading), y: av.y + way * libm::sin(heading), heading, speed }
    };
    let control = |step: usize| Control { acceleration: 0.02 * step as f64, steering: 3.0 * turn };
    UncheckedPlan {
        states: (0..PLAN_STEPS).map(state).collect(),
        controls: (0..PLAN_STEPS).filter(|_| controls).map(control).collect(),
        ..UncheckedPlan::default()
    }
}

/// The record of a drive without latency.
fn without_ages(outcome: Outcome) -> Outcome {
    let records = outcome.records.into_iter();
    let without = |record: StepRecord| StepRecord { plan_age: None, plan_taken_up_us: 0, ..record };
    Outcome { records: records.map(without).collect(), ..outcome }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn without_delay_all_is_as_without_latency_to_the_bit(turn in -0.02..0.02_f64, controls in any::<bool>()) {
        let scene = scene();
        let late = drive(&scene, |seen| arc(seen, turn, controls), |_| Some(0));
        prop_assert!(late.records.iter().all(|record| record.plan_age == Some(0)));
        prop_assert_eq!(without_ages(late), drive_at_once(&scene, |seen| arc(seen, turn, controls)));
    }

    #[test]
    fn a_record_tells_all_that_is_needed_to_drive_again(
        turn in -0.02..0.02_f64,
        controls in any::<bool>(),
        delays in prop::collection::vec(prop::option::weighted(0.9, 0..900_000_u32), 60),
    ) {
        let scene = scene();
        let mut plans: Vec<Plan> = Vec::new();
        let keep = |seen: &Observation| {
            let plan = arc(seen, turn, controls);
            plans.push(UncheckedPlan { step: seen.step, ..plan.clone() }.check(seen.step).unwrap());
            plan
        };
        let then = drive(&scene, keep, |step| delays[step as usize]);
        let mut again = episode(&scene);
        for (step, record) in then.records.iter().enumerate() {
            let aged = |age: i32| Some(Aged { plan: &plans[step - usize::try_from(age).ok()?], age: age as u32 });
            let since_us = record.plan_taken_up_us;
            let before = if since_us > 0 && step > 0 { then.records[step - 1].plan_age } else { None };
            let before = before.filter(|age| *age >= 0).and_then(|age| aged(age + 1));
            again.follow(&Guidance { before, now: record.plan_age.and_then(aged), since_us });
        }
        prop_assert_eq!(again.finish(), then);
    }
}

/// A trajectory of the scene's own: from where the AV begins along an arc. Whoever plans by it says the same at any time.
fn foreseen(scene: &Arc<Scene>) -> impl Fn(&Observation) -> UncheckedPlan {
    let (begin, turn) = (episode(scene).observe().av, 0.01);
    let speed = begin.speed();
    move |seen: &Observation| {
        let state = |step: usize| {
            let way = speed * STEP_SECONDS * f64::from(seen.step + 1 + step as u32);
            let turned = turn * way;
            let (along, across) = (libm::sin(turned) / turn, (1.0 - libm::cos(turned)) / turn);
            let (cos, sin) = (libm::cos(begin.heading), libm::sin(begin.heading));
            PlanState {
                x: begin.x + along * cos - across * sin,
                y: begin.y + along * sin + across * cos,
                heading: begin.heading + turned,
                speed,
            }
        };
        UncheckedPlan { states: (0..PLAN_STEPS).map(state).collect(), ..UncheckedPlan::default() }
    }
}

#[test]
fn plans_that_foresee_all_are_followed_alike_however_late_they_are() {
    let scene = scene();
    let plan = foreseen(&scene);
    let place = |outcome: &Outcome, at: usize| outcome.records[at].av.unwrap();
    // The first plan is there at once; from then on all say the same.
    let first_then = |delay: u32| move |step: u32| Some(if step == 0 { 0 } else { delay });
    let at_once = drive(&scene, &plan, |_| Some(0));
    for delay in [30_000, 50_000, 100_000, 270_000, 1_000_000] {
        let late = drive(&scene, &plan, first_then(delay));
        assert_eq!(late.records.len(), at_once.records.len());
        for at in 0..late.records.len() {
            let (one, other) = (place(&at_once, at), place(&late, at));
            let apart = libm::hypot(one.x - other.x, one.y - other.y);
            // The tracker begins anew within a step: that is not nothing.
            assert!(apart < 0.15, "{delay} us, step {at}: {apart} m apart");
        }
    }
}

#[test]
fn until_the_first_plan_is_there_the_av_keeps_its_speed_and_its_wheels() {
    let scene = scene();
    let begin = episode(&scene).observe();
    let outcome = drive(&scene, |seen| arc(seen, 0.02, true), |_| Some(450_000));
    let speed = |record: &StepRecord| record.av.map(|av| libm::hypot(av.velocity_x, av.velocity_y)).unwrap();
    for record in &outcome.records[..4] {
        assert_eq!((record.plan_age, record.plan_taken_up_us), (Some(-1), 0));
        assert!((speed(record) - begin.av.speed()).abs() < 0.05);
        assert_eq!(record.control.unwrap().steering, begin.control.steering);
    }
    assert_eq!((outcome.records[4].plan_age, outcome.records[4].plan_taken_up_us), (Some(4), 50_000));
}

#[test]
fn a_plan_that_has_run_out_goes_on_as_it_ended() {
    let scene = scene();
    for controls in [true, false] {
        // One plan, and never another; its end is at step 50 of 60.
        let outcome = drive(&scene, |seen| arc(seen, 0.0, controls), |step| (step == 0).then_some(0));
        let ages: Vec<i32> = outcome.records.iter().filter_map(|record| record.plan_age).collect();
        assert_eq!(ages, (0..60).collect::<Vec<_>>());
        let last = outcome.records[PLAN_STEPS..].iter().map(|record| record.control.unwrap().acceleration);
        assert!(last.into_iter().all(|acceleration| acceleration.abs() < 0.05), "controls: {controls}");
    }
    assert_eq!(f64::from(STEP_US) / 1e6, STEP_SECONDS, "a whole step is driven as ever, to the bit");
}
