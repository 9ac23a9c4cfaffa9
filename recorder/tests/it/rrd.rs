//! What a Rerun file holds, read back by Rerun's own decoder.

use std::collections::{BTreeMap, BTreeSet};

use re_log_encoding::DecoderApp;
use re_log_types::{LogMsg, StoreKind};
use recorder::message::{Body, Message};
use recorder::rrd::Drawing;
use wire::proto;

use crate::rrd_of;
use crate::synthetic::{self, SMALL, Size};

fn decode(bytes: &[u8]) -> Vec<LogMsg> {
    DecoderApp::decode_lazy(std::io::Cursor::new(bytes)).map(Result::unwrap).collect()
}

#[test]
fn the_entities_and_their_rows() {
    let mut entities = BTreeMap::new();
    for message in decode(&rrd_of(&synthetic::episode("s", SMALL))) {
        let LogMsg::ArrowMsg(store, chunk) = message else { continue };
        if store.kind() == StoreKind::Recording {
            let chunk = re_chunk::Chunk::from_arrow_msg(&chunk).unwrap();
            let timelines: BTreeSet<String> = chunk.timelines().keys().map(ToString::to_string).collect();
            let rows = entities.entry(chunk.entity_path().to_string()).or_insert_with(Vec::new);
            rows.push(format!("{} rows {}", chunk.num_rows(), timelines.into_iter().collect::<Vec<_>>().join(" ")));
        }
    }
    let lines = entities.into_iter().map(|(path, rows)| format!("{path}: {}", rows.join("; ")));
    insta::assert_snapshot!(lines.collect::<Vec<_>>().join("\n"));
}

#[test]
fn the_recording_is_named_and_brings_its_layout() {
    let mut stores = BTreeSet::new();
    let mut activated = false;
    for message in decode(&rrd_of(&synthetic::episode("s", SMALL))) {
        stores.insert((message.store_id().application_id().to_string(), message.store_id().recording_id().to_string()));
        activated |= matches!(message, LogMsg::BlueprintActivationCommand(_));
    }
    let id = format!("test.s.{:08x}", crc32fast::hash(synthetic::SETTINGS.as_bytes()));
    let expected = [("reloop", id.clone()), ("reloop", id + ".blueprint")];
    assert_eq!(stores, expected.map(|(app, id)| (app.to_owned(), id)).into());
    assert!(activated);
}

#[test]
fn runs_of_other_settings_are_other_recordings_and_those_of_the_same_are_one() {
    let id = |run: &str, scene: &str, settings: &str| {
        let mut drawing = Drawing::default();
        synthetic::episode(scene, SMALL).iter().for_each(|message| drawing.push(message));
        let messages = decode(&drawing.finish(run, settings).unwrap());
        let recording = messages.iter().find(|message| message.store_id().kind() == StoreKind::Recording).unwrap();
        recording.store_id().recording_id().to_string()
    };
    let ids = [
        id("a", "s", ""),
        id("b", "s", ""),
        id("a", "t", ""),
        id("a", "s", "deadline = 5"),
        id("a", "s", "deadline = 6"),
    ];
    assert_eq!(BTreeSet::from(ids.clone()).len(), ids.len(), "{ids:?}");
    assert_eq!(id("a", "s", "deadline = 5"), ids[3]);
    assert!(ids.iter().all(|id| !id.contains('/')), "{ids:?}");
}

#[test]
fn who_reacts_is_labelled_from_the_step_after_on() {
    let mut episode = synthetic::episode("s", Size { agents: 2, steps: 3, futures: 0 });
    let labels = |episode: &[Message]| -> String {
        let vehicles = decode(&rrd_of(episode)).into_iter().filter_map(|message| {
            let LogMsg::ArrowMsg(_, chunk) = message else { return None };
            let path = re_chunk::Chunk::from_arrow_msg(&chunk).unwrap().entity_path().to_string();
            (path == "/world/agents/vehicles").then(|| format!("{:?}", chunk.batch))
        });
        vehicles.collect()
    };
    assert!(labels(&episode).contains("vehicle 100") && !labels(&episode).contains("reacts"));
    let record = episode.iter().position(|message| matches!(message.body, Body::Record(_))).unwrap();
    let agents = vec![proto::Agent { track: 100, ..Default::default() }];
    let moves = proto::TrafficMoves { step: 0, agents, ..Default::default() };
    episode.insert(record, Message::encode(Body::Moves(moves)));
    let labels = labels(&episode);
    assert!(labels.contains("vehicle 100, reacts") && !labels.contains("vehicle 101, reacts"), "{labels}");
}

#[test]
fn two_drawings_are_the_same_bytes() {
    let episode = synthetic::episode("s", SMALL);
    assert_eq!(rrd_of(&episode), rrd_of(&episode));
}
