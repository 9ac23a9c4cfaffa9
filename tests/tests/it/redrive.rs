//! The plans of a recording give its drive again, to the bit: no bus, no node, no clock.

use episode::Episode;
use prost::Message;
use results::folder::read_run_file;
use scenarios::SceneSet;
use wire::proto::{EpisodeEnd, Event, Plan, StepRecord};
use world::plan::UncheckedPlan;

use crate::recording::{messages, of_channel};
use crate::stage::Stage;

/// Drives every episode of a run again from its recording.
fn drive_again(driver: &str) {
    let stage = Stage::new();
    stage.good_sim(&format!("run --driver {driver} --out run"));
    let protocol = read_run_file(&stage.path("run")).unwrap().unwrap().settings.protocol;
    let set = SceneSet::open(&[]).unwrap();
    for (index, entry) in set.entries().iter().enumerate() {
        let recording = messages(&stage.path("run/episodes").join(format!("{}.mcap", entry.id)));
        let (scene, _) = set.load(index).unwrap();
        let mut episode = Episode::new(scene, &protocol).unwrap();
        for (step, plan) in of_channel::<Plan>(&recording, "plan").into_iter().enumerate() {
            let plan = UncheckedPlan::try_from(plan).unwrap().check(step as u32).unwrap();
            episode.advance(&plan);
        }
        let outcome = episode.finish();
        // What is told for pictures beside the drive is the log's, and no part of it.
        let told = of_channel::<StepRecord>(&recording, "record").into_iter();
        let told: Vec<_> = told.map(|record| StepRecord { logged_av: None, ..record }).collect();
        let bytes = |records: &[StepRecord]| records.iter().map(Message::encode_to_vec).collect::<Vec<_>>();
        assert!(bytes(&outcome.records) == bytes(&told), "{}: other records", entry.id);
        let told = of_channel::<Event>(&recording, "event").into_iter();
        let mut events = [outcome.events, told.map(|event| Event { other: None, ..event }).collect()]
            .map(|events| events.iter().map(Message::encode_to_vec).collect::<Vec<_>>());
        events.iter_mut().for_each(|events| events.sort());
        assert!(events[0] == events[1], "{}: other events", entry.id);
        let end = of_channel::<EpisodeEnd>(&recording, "end").remove(0);
        assert_eq!((outcome.end.reason, outcome.end.metrics), (end.reason, end.metrics), "{}", entry.id);
    }
}

#[test]
fn a_recorded_drive_is_driven_again_to_the_bit() {
    drive_again("idm");
}

#[test]
fn a_drive_recorded_under_paper_is_driven_again_to_the_bit() {
    drive_again("idm --protocol paper");
}

#[test]
fn a_recorded_log_is_played_back_again_to_the_bit() {
    drive_again("human");
}
