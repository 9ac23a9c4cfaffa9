//! Explanations of small recordings, whole and damaged.

use std::collections::BTreeMap;

use gauss_newton::constants::{HAND_TUNED, Term};
use mcap::{WriteOptions, Writer};
use wire::proto;
use world::observation::Observation;
use world::plan::{Control, UncheckedPlan, UncheckedPrediction};

use super::*;
use crate::gauss_newton_planner::Options;
use crate::gauss_newton_planner::tests::Road;

/// The bytes of a recording with the scene, and observation, prediction and plan of the steps 0 and 1.
fn recording(road: &Road, predicted: bool, plan: &UncheckedPlan) -> Vec<u8> {
    recording_with(WriteOptions::new().use_chunks(false), road, predicted, plan, None)
}

/// The same, so written, and with the run's settings if any.
fn recording_with(
    options: WriteOptions,
    road: &Road,
    predicted: bool,
    plan: &UncheckedPlan,
    run: Option<&str>,
) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let mut writer = Writer::with_options(&mut bytes, options).unwrap();
    if let Some(run) = run {
        let metadata = BTreeMap::from([("run.toml".to_owned(), run.to_owned())]);
        writer.write_metadata(&mcap::records::Metadata { name: "reloop".to_owned(), metadata }).unwrap();
    }
    let mut write = |topic: &str, data: Vec<u8>| {
        let channel = writer.add_channel(0, topic, "protobuf", &BTreeMap::new()).unwrap();
        let header = mcap::records::MessageHeader { channel_id: channel, sequence: 0, log_time: 0, publish_time: 0 };
        writer.write_to_known_channel(&header, &data).unwrap();
    };
    write("/reloop/scene", encoded::<proto::Scene>((&road.briefing).into()));
    for step in 0..2 {
        let observation = Observation { step, ..road.observation.clone() };
        write("/reloop/observation", encoded::<proto::Observation>((&observation).into()));
        if predicted {
            let prediction = UncheckedPrediction { step, ..road.prediction.clone() };
            write("/reloop/prediction", encoded::<proto::Prediction>((&prediction).into()));
        }
        let plan = UncheckedPlan { step, ..plan.clone() };
        write("/reloop/plan", encoded::<proto::Plan>((&plan).into()));
    }
    writer.finish().unwrap();
    drop(writer);
    bytes.into_inner()
}

fn encoded<M: prost::Message>(message: M) -> Vec<u8> {
    message.encode_to_vec()
}

fn explained(bytes: &[u8], step: u32) -> Result<Explanation, String> {
    explained_by(bytes, step, None)
}

fn explained_by(bytes: &[u8], step: u32, weights: Option<&Weights>) -> Result<Explanation, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("road.mcap");
    std::fs::write(&path, bytes).unwrap();
    let text = |e: ExplainError| e.to_string().replace(path.to_str().unwrap(), "road.mcap");
    explain(&path, step, weights).map_err(text)
}

/// What its controls cost.
fn costs(explanation: Explanation) -> Box<Costs> {
    let Explanation::Costs(costs) = explanation else { panic!("{explanation}") };
    costs
}

fn planned(road: &Road) -> UncheckedPlan {
    road.plan(Options::default()).unwrap()
}

#[test]
fn a_plan_is_costed_by_the_rules_of_its_protocol() {
    for protocol in ["paper", "strict"] {
        let road = Road::new(0.4, 8.0, protocol).with_standing_car(12.0);
        let plan = planned(&road);
        let explanation = costs(explained(&recording(&road, true, &plan), 1).unwrap());
        for ((term, _, whole), (name, objective)) in explanation.terms.iter().zip(&plan.diagnostics.objective) {
            assert_eq!(term.name(), name);
            // What is planned is within the limits here: nothing was cut before it was recorded.
            assert!((whole - objective).abs() <= 1e-9 * objective, "{protocol}, {name}: {whole} {objective}");
        }
        let text = explanation.to_string();
        assert!(text.starts_with(&format!("scene road under {protocol}, step 1: ")), "{text}");
        assert!(text.contains(" s track 7 is "), "{text}");
        assert!(!text.contains("nobody predicted"), "{text}");
    }
}

#[test]
fn a_plan_of_other_weights_is_not_explained_by_the_hand_tuned_ones() {
    let mut weights = HAND_TUNED;
    weights[Term::Speed as usize] = 0.3;
    let given = Weights::Given(weights);
    for protocol in ["paper", "strict"] {
        let road = Road::new(0.4, 8.0, protocol);
        let plan = road.plan(Options { weights: given.clone(), ..Options::default() }).unwrap();
        let bytes = recording(&road, true, &plan);
        let error = explained(&bytes, 0).unwrap_err();
        assert_eq!(
            error,
            "step 0: the plan was not made with the hand-tuned weights: speed 0.3000, not 0.1000\nhint: give the weights of its run by --weights FILE"
        );
        let explanation = costs(explained_by(&bytes, 0, Some(&given)).unwrap());
        assert_eq!((explanation.weights, explanation.doubt), (weights, None));
        let text = explained_by(&bytes, 0, Some(&Weights::HandTuned)).unwrap().to_string();
        let doubt = "\nthe plan was not made with the given weights: speed 0.3000, not 0.1000\n";
        assert!(text.contains(doubt), "{text}");
    }
}

#[test]
fn the_weights_that_the_run_names_are_taken() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("weights.toml");
    let mut weights = HAND_TUNED;
    weights[Term::Safety as usize] = 4.0;
    let text = Term::ALL.map(|term| format!("{} = {:?}\n", term.name(), weights[term as usize])).concat();
    std::fs::write(&file, text).unwrap();
    let road = Road::new(0.4, 8.0, "strict");
    let plan = road.plan(Options { weights: Weights::Given(weights), ..Options::default() }).unwrap();
    let command = format!("planner-node --planner gauss-newton --weights {} --init idm", file.display());
    let run = format!("[settings.planner]\ncommand = {command:?}\n");
    let bytes = recording_with(WriteOptions::new().use_chunks(false), &road, true, &plan, Some(&run));
    // Nobody is near: what the plan told shows nothing of this weight.
    assert_eq!(costs(explained(&bytes, 0).unwrap()).weights, weights);
    std::fs::remove_file(&file).unwrap();
    let error = explained(&bytes, 0).unwrap_err();
    let file = file.display();
    assert!(error.starts_with(&format!("step 0: its run has --weights {file}: cannot read the weights in")), "{error}");
    assert!(error.ends_with("\nhint: give the weights of its run by --weights FILE"), "{error}");
}

#[test]
fn the_weights_that_came_with_the_prediction_are_found() {
    let mut road = Road::new(0.4, 8.0, "strict");
    let mut weights = HAND_TUNED;
    weights[Term::Jerk as usize] = 0.05;
    road.prediction.cost_weights = weights.to_vec();
    for (whose, wanted) in [(Weights::Learned, weights), (Weights::HandTuned, HAND_TUNED)] {
        let plan = road.plan(Options { weights: whose, ..Options::default() }).unwrap();
        assert_eq!(costs(explained(&recording(&road, true, &plan), 0).unwrap()).weights, wanted);
    }
}

#[test]
fn a_plan_that_was_cut_after_it_was_costed_is_explained_with_a_word_of_warning() {
    let road = Road::new(0.4, 8.0, "strict");
    let mut plan = planned(&road);
    plan.controls[3].acceleration = 5.0;
    let text = explained(&recording(&road, true, &plan), 0).unwrap().to_string();
    assert!(text.contains("\nits controls were cut to what the vehicle can follow"), "{text}");
}

#[test]
fn the_stop_before_a_red_light_is_where_the_rules_have_it() {
    for (protocol, margin) in [("paper", "3"), ("strict", "6.5")] {
        let mut road = Road::new(0.4, 8.0, protocol);
        road.observation.av.length = 12.0;
        road.observation.window.red_stops = vec![280];
        let text = explained(&recording(&road, true, &planned(&road)), 0).unwrap().to_string();
        assert!(text.contains(&format!(" s it passes the stop {margin} m before the red light, by ")), "{text}");
    }
}

#[test]
fn without_a_prediction_everybody_is_expected_to_keep_their_velocity() {
    let road = Road::new(0.4, 8.0, "strict").with_standing_car(12.0);
    let text = explained(&recording(&road, false, &planned(&road)), 0).unwrap().to_string();
    assert!(text.contains("\nnobody predicted: everybody is expected to keep their velocity\n"), "{text}");
    // It stands, so it is expected where it was predicted.
    assert!(text.contains(" s track 7 is "), "{text}");
}

#[test]
fn a_recording_that_is_cut_off_is_explained_as_far_as_it_goes() {
    let road = Road::new(0.4, 8.0, "strict");
    let whole = recording(&road, true, &planned(&road));
    let without_the_last_plan = &whole[..whole.len() - 1500];
    explained(without_the_last_plan, 0).unwrap();
    let error = explained(without_the_last_plan, 1).unwrap_err();
    insta::assert_snapshot!(error, @r"
    road.mcap is cut off before step 1 is told; it tells steps 0 to 0
    hint: the command of its run, given again, drives what is missing
    ");
    // The magic bytes and the header record, and nothing after them; or the beginning of something.
    let header = 8 + 9 + usize::from(whole[9]);
    let error = explained(&whole[..header], 1).unwrap_err();
    assert_eq!(explained(&whole[..header + 20], 1).unwrap_err(), error);
    insta::assert_snapshot!(error, @r"
    road.mcap has no scene: it is empty, cut off before it, or no recording of reloop
    hint: `recorder info road.mcap` says what it holds
    ");
}

#[test]
fn a_damaged_recording_is_not_called_cut_off() {
    let road = Road::new(0.4, 8.0, "strict");
    let chunks = WriteOptions::new().chunk_size(Some(1)).compression(None);
    let mut bytes = recording_with(chunks, &road, true, &planned(&road), None);
    let observation = encoded::<proto::Observation>((&Observation { step: 1, ..road.observation.clone() }).into());
    let place = bytes.windows(observation.len()).rposition(|window| window == observation).unwrap();
    bytes[place + observation.len() / 2] ^= 1;
    let error = explained(&bytes, 1).unwrap_err();
    assert!(error.starts_with("road.mcap is damaged, and step 1 is not told (byte "), "{error}");
    explained(&bytes, 0).unwrap();
}

#[test]
fn a_step_that_was_not_driven_is_named_beside_those_that_were() {
    let road = Road::new(0.4, 8.0, "strict");
    let error = explained(&recording(&road, true, &planned(&road)), 2).unwrap_err();
    insta::assert_snapshot!(error, @r"
    road.mcap has no /reloop/observation of step 2; it tells steps 0 to 1
    hint: `recorder info road.mcap` says what it holds
    ");
}

#[test]
fn a_plan_without_controls_has_no_cost() {
    let road = Road::new(0.4, 8.0, "strict");
    let plan = UncheckedPlan { controls: Vec::<Control>::new(), ..planned(&road) };
    let error = explained(&recording(&road, true, &plan), 0).unwrap_err();
    insta::assert_snapshot!(error, @r"
    the plan of step 0 has no controls, and only controls have a cost
    hint: gauss-newton and idm plan controls
    ");
}

#[test]
fn a_step_after_the_damage_is_explained_and_no_damage_makes_a_panic() {
    let road = Road::new(0.4, 8.0, "strict");
    let chunks = WriteOptions::new().chunk_size(Some(1));
    let whole = recording_with(chunks, &road, true, &planned(&road), None);
    // The chunks are scene, observation, prediction and plan of step 0, then of step 1.
    let name = |nth: usize| whole.windows(4).enumerate().filter(|(_, window)| window == b"zstd").nth(nth).unwrap().0;
    let mut bytes = whole.clone();
    bytes[name(2) + 20] ^= 0x55;
    explained(&bytes, 1).unwrap();
    for seed in 0..400 {
        let bytes = ::recording::mutants::mutant(&whole, &mut ::recording::mutants::Dice(seed));
        let _ = step_of(&bytes, Path::new("road.mcap"), 1);
    }
}
