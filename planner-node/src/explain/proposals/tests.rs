//! Explanations of plans that were chosen among proposals.

use wire::node::Planner;
use world::plan::UncheckedPlan;
use world::vehicle::{BicycleModel, VehicleState};

use super::*;
use crate::Weights;
use crate::explain::{Explanation, PlannerOfRun, explain_step};
use crate::gauss_newton_planner::tests::Road;

const RUN: &str = "[settings.planner]\nfrom = \"node\"\nname = \"proposals\"\n";

/// So many steps driven towards a standing car, as they are recorded.
fn driven(steps: u32) -> Vec<RecordedStep> {
    let mut road = Road::new(0.4, 9.0, "strict").with_standing_car(60.0);
    let mut planner = Drive::new(ProposalsOptions::default(), &road.briefing);
    let model = BicycleModel::new(road.briefing.wheelbase);
    let mut recorded: Vec<RecordedStep> = Vec::new();
    for step in 0..steps {
        road.observation.step = step;
        let plan = road.step(|input| planner.plan(input)).unwrap().check(step).unwrap();
        let control = plan.controls().unwrap()[0];
        let before = recorded.iter().rev().take(BEFORE as usize).rev().map(|step| step.observation.clone()).collect();
        recorded.push(RecordedStep {
            briefing: road.briefing.clone(),
            observation: road.observation.clone(),
            prediction: Some(road.prediction.clone().check(0).unwrap()),
            plan,
            before,
            last: recorded.last().map(|step| step.plan.clone()),
            planner: PlannerOfRun::of(RUN),
        });
        let av = &mut road.observation.av;
        let now = VehicleState { x: av.x, y: av.y, heading: av.heading, speed: av.speed() };
        let next = model.step(now, control, STEP_SECONDS);
        (av.x, av.y, av.heading) = (next.x, next.y, next.heading);
        av.velocity_x = next.speed * libm::cos(next.heading);
        av.velocity_y = next.speed * libm::sin(next.heading);
        road.observation.control = control;
    }
    recorded
}

fn trials(step: u32, recorded: &RecordedStep) -> Trials {
    match explain_step(step, recorded, None).unwrap() {
        Explanation::Trials(trials) => trials,
        other @ Explanation::Costs(_) => panic!("{other}"),
    }
}

#[test]
fn every_step_of_a_drive_is_found_again_to_the_bit() {
    for (step, recorded) in (0..).zip(&driven(40)) {
        let trials = trials(step, recorded);
        let told = recorded.plan.diagnostics();
        assert_eq!(trials.best(), Some((&*told.status, told.objective[0].1)), "step {step}");
        assert_eq!(trials.tried.len(), told.iterations as usize);
        assert!(trials.notes.is_empty(), "step {step}: {:?}", trials.notes);
        assert!(trials.tried.iter().all(|tried| is_name(tried.name)), "{trials}");
    }
}

#[test]
fn what_is_not_recorded_is_told_and_what_comes_of_it() {
    let mut recorded = driven(31).pop().unwrap();
    recorded.before.drain(..20);
    recorded.last = None;
    recorded.prediction = None;
    recorded.planner = PlannerOfRun::default();
    let notes = trials(30, &recorded).notes;
    let texts = [
        "of the 24 steps before it the recording tells 4: its comfort may be judged otherwise",
        "its last plan is not recorded, and not among the proposals",
        "nobody predicted: everybody is expected to keep their velocity",
        "its run does not tell the planner's options: --contingency branches and --refine 2 are taken",
    ];
    assert_eq!(notes[..4], texts);
    assert!(notes.iter().any(|note| note == "it chose among 29 proposals, not 28"), "{notes:?}");
}

#[test]
fn other_options_of_its_run_are_taken() {
    let mut recorded = driven(1).pop().unwrap();
    recorded.planner = PlannerOfRun::of(&format!("{RUN}options = [\"--refine\", \"0\"]\n"));
    let trials = trials(0, &recorded);
    assert_eq!(trials.tried.len(), 26);
    let last = trials.notes.last().unwrap();
    assert!(
        last.starts_with("it chose among 28 ") || last.starts_with("it may have been planned by another"),
        "{last}"
    );
}

#[test]
fn before_a_fork_and_at_its_first_step_something_is_missing() {
    let mut recorded = driven(6);
    for step in &mut recorded {
        step.planner = PlannerOfRun::of(&format!("[settings.fork]\nstep = 4\n{RUN}"));
    }
    let notes = |step: u32| trials(step, &recorded[step as usize]).notes;
    assert!(notes(3)[0].starts_with("up to step 4 another run's plans were driven"), "{:?}", notes(3));
    assert_eq!(notes(4)[0], "its last plan is not recorded, and not among the proposals");
    assert_eq!(notes(5), [""; 0]);
}

#[test]
fn driving_on_into_a_standing_car_is_farther_and_loses_by_it() {
    let driven = driven(41);
    let trials = trials(40, &driven[40]);
    let binding = trials.binding.clone().unwrap();
    assert!(binding.farther > FARTHER && binding.score < trials.tried[0].score, "{trials}");
    let (objection, without) = binding.loss.unwrap();
    let track = match objection {
        Objection::Contact(met) | Objection::Close(met) => met.track,
        Objection::Unsaved(track) => track,
        _ => panic!("{trials}"),
    };
    assert_eq!(track, TrackId(7));
    assert!(without > binding.score, "{trials}");
    let through = trials.tried.iter().find(|tried| tried.name == "through").unwrap();
    assert!(through.against.iter().any(|against| matches!(against, Objection::Contact(_))), "{trials}");
}

#[test]
fn weights_are_of_no_use_to_a_score() {
    let recorded = driven(1).pop().unwrap();
    let error = explain_step(0, &recorded, Some(&Weights::HandTuned)).unwrap_err();
    insta::assert_snapshot!(error, @r"
    the plan of step 0 was chosen among proposals, and their score has no weights to be given
    hint: leave --weights out
    ");
}

#[test]
fn a_plan_of_another_planner_is_none_of_these() {
    let recorded = driven(1).pop().unwrap();
    let UncheckedPlan { diagnostics, .. } = recorded.plan.into_unchecked();
    assert!(is_chosen(&diagnostics));
    let score = ("score".to_owned(), 1.0);
    for other in [
        Diagnostics { status: "converged".to_owned(), ..diagnostics.clone() },
        Diagnostics { objective: vec![("speed".to_owned(), 1.0)], ..diagnostics.clone() },
        Diagnostics { objective: vec![score.clone(), score], ..diagnostics },
    ] {
        assert!(!is_chosen(&other), "{other:?}");
    }
}

/// Among three futures.
fn among(chosen: [bool; FUTURES]) -> Among {
    Among { chosen, count: FUTURES }
}

#[test]
fn all_that_can_be_said() {
    let met = |track, seconds, chosen| Encounter { track: TrackId(track), seconds, futures: among(chosen) };
    let tried = |name, score, against| Tried {
        name,
        score,
        progress: 30.0 + score,
        comfort: 0.9,
        against,
        given_up: Among::none(FUTURES),
    };
    let contact = Objection::Contact(met(7, 2.4, [false, true, false]));
    let trials = Trials {
        scene: "road".to_owned(),
        protocol: "strict".to_owned(),
        step: 40,
        notes: vec!["nobody predicted: everybody is expected to keep their velocity".to_owned()],
        tried: vec![
            Tried { given_up: among([false, true, true]), ..tried("brisk", 0.98, vec![]) },
            tried("go", 0.61, vec![contact, Objection::Close(met(8, 1.2, [true, false, true]))]),
            tried("left 0.5", 0.43, vec![Objection::Unsaved(TrackId(9)), Objection::Aside(0.46)]),
            tried("right 1.5", 0.15, vec![Objection::OffRoad, Objection::Oncoming]),
            tried("through", 0.0, vec![Objection::OverTheEdge, Objection::Red]),
        ],
        futures: vec![
            InFuture { probability: 0.6, worth: 1.0, given_up: false },
            InFuture { probability: 0.3, worth: 0.9, given_up: true },
            InFuture { probability: 0.1, worth: 0.8, given_up: true },
        ],
        binding: Some(Binding { name: "go", score: 0.61, farther: 4.2, loss: Some((contact, 0.99)) }),
    };
    insta::assert_snapshot!(trials);
    let binding = |binding: Option<Binding>| {
        let text = Trials { binding, ..trials.clone() }.to_string();
        text.split_once("what binds\n").unwrap().1.to_owned()
    };
    assert_eq!(binding(None), "no proposal comes farther\n");
    let go = |loss| Some(Binding { name: "go", score: 0.61, farther: 4.2, loss });
    insta::assert_snapshot!(binding(go(Some((Objection::Discomfort(0.31), 0.7)))), @r"
    go would come 4.2 m farther, with a score of 0.6100
    it loses most by: a comfort of 0.310; without that 0.7000, still not more than brisk
    ");
    insta::assert_snapshot!(binding(go(None)), @r"
    go would come 4.2 m farther, with a score of 0.6100
    nothing is against it
    ");
}
