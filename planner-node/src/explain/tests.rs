//! Explanations of small recordings, whole and damaged.

use std::collections::BTreeMap;

use mcap::{WriteOptions, Writer};
use wire::proto;
use world::observation::Observation;
use world::plan::{Control, UncheckedPlan};

use super::*;
use crate::gauss_newton_planner::Options;
use crate::gauss_newton_planner::tests::Road;

/// The bytes of a recording with the scene, and observation, prediction and plan of the steps 0 and 1.
fn recording(road: &Road, predicted: bool, plan: &UncheckedPlan) -> Vec<u8> {
    recording_with(WriteOptions::new().use_chunks(false), road, predicted, plan)
}

fn recording_with(options: WriteOptions, road: &Road, predicted: bool, plan: &UncheckedPlan) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let mut writer = Writer::with_options(&mut bytes, options).unwrap();
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
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("road.mcap");
    std::fs::write(&path, bytes).unwrap();
    let text = |e: ExplainError| e.to_string().replace(path.to_str().unwrap(), "road.mcap");
    explain(&path, step, &Weights::HandTuned).map_err(text)
}

fn planned(road: &Road) -> UncheckedPlan {
    road.plan(Options::default()).unwrap()
}

#[test]
fn a_plan_is_costed_by_the_rules_of_its_protocol() {
    for protocol in ["paper", "strict"] {
        let road = Road::new(0.4, 8.0, protocol).with_standing_car(12.0);
        let plan = planned(&road);
        let explanation = explained(&recording(&road, true, &plan), 1).unwrap();
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
    let mut bytes = recording_with(chunks, &road, true, &planned(&road));
    let observation = encoded::<proto::Observation>((&Observation { step: 1, ..road.observation.clone() }).into());
    let place = bytes.windows(observation.len()).rposition(|window| window == observation).unwrap();
    bytes[place + observation.len() / 2] ^= 1;
    let error = explained(&bytes, 1).unwrap_err();
    assert!(error.starts_with("road.mcap is damaged before step 1 is told (Chunk CRC failed"), "{error}");
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
