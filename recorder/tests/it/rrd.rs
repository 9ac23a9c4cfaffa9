//! What a Rerun file holds, read back by Rerun's own decoder.

use std::collections::{BTreeMap, BTreeSet};

use re_log_encoding::DecoderApp;
use re_log_types::{LogMsg, StoreKind};

use crate::rrd_of;
use crate::synthetic::{self, SMALL};

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
    let expected = [("reloop", "test/s"), ("reloop", "test/s/blueprint")];
    assert_eq!(stores, expected.map(|(app, id)| (app.to_owned(), id.to_owned())).into());
    assert!(activated);
}

#[test]
fn two_drawings_are_the_same_bytes() {
    let episode = synthetic::episode("s", SMALL);
    assert_eq!(rrd_of(&episode), rrd_of(&episode));
}
