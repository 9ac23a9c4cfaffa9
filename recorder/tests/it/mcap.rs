//! What an MCAP file holds, and that its bytes depend on nothing else.

use recorder::mcap::EpisodeWriter;
use recorder::message::{Body, Message};
use wire::proto;

use crate::synthetic::{self, SMALL, Size};
use crate::{mcap_of, read_all, rrd_of};

#[test]
fn two_writes_are_the_same_bytes() {
    let episode = synthetic::episode("s", SMALL);
    // Two writers in one process have different hash seeds already.
    assert!((0..5).all(|_| mcap_of(&episode) == mcap_of(&episode)));
}

#[test]
fn what_is_read_is_what_was_written() {
    let episode = synthetic::episode("s", SMALL);
    let (contents, messages) = read_all(&mcap_of(&episode)).unwrap();
    assert!(messages == episode);
    assert_eq!((&*contents.run, &*contents.settings), ("test", synthetic::SETTINGS));
    assert_eq!(contents.trouble(), None);
    assert_eq!(contents.last_step, 5);
}

#[test]
fn the_summary_agrees_with_the_data_and_its_checksum_holds() {
    let bytes = mcap_of(&synthetic::episode("s", SMALL));
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let stats = summary.stats.unwrap();
    assert_eq!(stats.message_count, mcap::MessageStream::new(&bytes).unwrap().count() as u64);
    assert_eq!(stats.channel_count, 16);
    assert_eq!(summary.channels.len(), 16);
    for (id, channel) in summary.channels.iter().collect::<std::collections::BTreeMap<_, _>>() {
        assert_eq!(*id, channel.id);
        assert_eq!(channel.message_encoding, "protobuf");
    }
}

/// Readers that share a decoder factory among files go by these numbers alone. A line may be added; none may change.
#[test]
fn schemas_and_channels_keep_their_numbers_for_ever() {
    let of_size = |size| mcap::Summary::read(&mcap_of(&synthetic::episode("s", size))).unwrap().unwrap();
    let numbered = |summary: &mcap::Summary| {
        let schemas = summary.schemas.iter().map(|(id, schema)| format!("schema {id:>2} {}", schema.name));
        let channels = summary.channels.iter().map(|(id, channel)| format!("channel {id:>2} {}", channel.topic));
        let mut lines: Vec<String> = schemas.chain(channels).collect();
        lines.sort();
        lines
    };
    let lines = numbered(&of_size(SMALL));
    // Whether or not there are predictions and agents.
    assert_eq!(numbered(&of_size(Size { agents: 0, steps: 1, futures: 0 })), lines);
    insta::assert_snapshot!(lines.join("\n"));
}

#[test]
fn the_channels_and_their_counts() {
    let (contents, _) = read_all(&mcap_of(&synthetic::episode("s", SMALL))).unwrap();
    let rows = contents
        .channels
        .iter()
        .map(|(topic, channel)| format!("{topic:<20} {:<26} {}", channel.schema, channel.messages));
    insta::assert_snapshot!(rows.collect::<Vec<_>>().join("\n"));
}

#[test]
fn boxes_are_drawn_near_the_frame_s_origin() {
    use foxglove::messages::{FrameTransforms, SceneUpdate};
    use prost::Message as _;
    let bytes = mcap_of(&synthetic::episode("s", SMALL));
    for message in mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap) {
        match message.channel.topic.as_str() {
            "/view/agents" | "/view/av" => {
                let update = SceneUpdate::decode(&*message.data).unwrap();
                assert!(!update.entities.is_empty());
                for cube in update.entities.iter().flat_map(|entity| &entity.cubes) {
                    let position = cube.pose.unwrap().position.unwrap();
                    assert!(
                        position.x.abs() < 300.0 && position.y.abs() < 300.0 && position.z.abs() < 5.0,
                        "{position:?}"
                    );
                }
            }
            "/tf" => {
                let frames = FrameTransforms::decode(&*message.data).unwrap().transforms;
                let shift = frames[0].translation.unwrap();
                assert_eq!((frames[0].parent_frame_id.as_str(), frames[0].child_frame_id.as_str()), ("map", "scene"));
                assert_eq!((shift.x, shift.y, shift.z), (8_341.0, -9_379.0, 31.0));
            }
            _ => {}
        }
    }
}

#[test]
fn one_decoded_step() {
    use foxglove::messages::{FrameTransforms, Log, SceneUpdate};
    use prost::Message as _;
    let bytes = mcap_of(&synthetic::episode("s", Size { agents: 1, steps: 1, futures: 1 }));
    let mut text = String::new();
    for message in mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap) {
        let shown = match message.channel.topic.as_str() {
            "/view/agents" | "/view/av" | "/view/signals" => {
                format!("{:#?}", SceneUpdate::decode(&*message.data).unwrap())
            }
            "/tf" => format!("{:#?}", FrameTransforms::decode(&*message.data).unwrap()),
            "/log" => format!("{:#?}", Log::decode(&*message.data).unwrap()),
            _ => format!("{} bytes", message.data.len()),
        };
        text += &format!("{} at {} ns\n{shown}\n", message.channel.topic, message.log_time);
    }
    insta::assert_snapshot!(text);
}

#[test]
fn a_cut_file_is_read_up_to_its_last_chunk() {
    let size = Size { agents: 40, steps: 60, futures: 1 };
    let episode = synthetic::episode("s", size);
    let mut writer = EpisodeWriter::new("test", synthetic::SETTINGS).unwrap();
    let mut on_disk = Vec::new();
    // Killed here: chunks that were open are gone.
    for message in &episode[..200] {
        writer.write(message).unwrap();
        on_disk.extend(writer.take());
    }
    let (contents, messages) = read_all(&on_disk).unwrap();
    assert_eq!(contents.trouble().unwrap(), "cut off");
    assert!(messages.len() > 100, "{}", messages.len());
    assert!(messages == episode[..messages.len()]);
    // And at any byte: never a panic, never a message that was not written.
    let whole = mcap_of(&episode);
    for end in (0..whole.len()).step_by(9_973) {
        if let Ok((contents, messages)) = read_all(&whole[..end]) {
            assert_eq!(contents.trouble().unwrap(), "cut off", "{end}");
            assert!(messages == episode[..messages.len()]);
        }
    }
}

#[test]
fn a_flipped_bit_is_noticed() {
    let episode = synthetic::episode("s", SMALL);
    let whole = mcap_of(&episode);
    for place in (60..whole.len()).step_by(503) {
        let mut bytes = whole.clone();
        bytes[place] ^= 0x10;
        let (contents, messages) = read_all(&bytes).unwrap();
        assert!(contents.trouble().is_some(), "byte {place}");
        assert!(messages.iter().all(|message| episode.contains(message)), "byte {place}");
    }
}

#[test]
fn one_damaged_chunk_costs_its_own_messages_and_no_others() {
    let episode = synthetic::episode("s", Size { agents: 40, steps: 150, futures: 2 });
    let mut bytes = mcap_of(&episode);
    let place = bytes.len() / 2;
    bytes[place] ^= 0x10;
    let (contents, messages) = read_all(&bytes).unwrap();
    assert_eq!((contents.damage.len(), contents.more_damage, contents.is_cut_off), (1, 0, false));
    assert!(messages.len() > episode.len() / 2 && messages.len() < episode.len(), "{}", messages.len());
    assert!(messages.last() == episode.last());
    let after = episode.iter().position(|message| !messages.contains(message)).unwrap();
    assert_eq!(contents.damage[0].0, u64::from(messages[after - 1].step()), "the step before the damage is named");
}

#[test]
fn foreign_files_are_refused() {
    for bytes in [&b""[..], b"not an mcap", &rrd_of(&synthetic::episode("s", SMALL))] {
        assert!(read_all(bytes).is_err());
    }
}

#[test]
fn the_end_shows_the_av_after_the_last_step() {
    let episode = synthetic::episode("s", SMALL);
    let (contents, messages) = read_all(&mcap_of(&episode)).unwrap();
    assert_eq!(contents.channels["/view/av"].messages, u64::from(SMALL.steps) + 1);
    assert!(matches!(messages.last().unwrap().body, Body::End(_)));
}

#[test]
fn the_logged_av_is_drawn_beside_the_driven_one_at_every_step() {
    use foxglove::messages::SceneUpdate;
    use prost::Message as _;
    let bytes = mcap_of(&synthetic::episode("s", SMALL));
    let mut x: [Vec<f64>; 2] = [Vec::new(), Vec::new()];
    for message in mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap) {
        let Some(which) = ["/view/av", "/view/logged_av"].iter().position(|topic| *topic == message.channel.topic)
        else {
            continue;
        };
        let update = SceneUpdate::decode(&*message.data).unwrap();
        assert_eq!(message.log_time, x[which].len() as u64 * 100_000_000);
        x[which].push(update.entities[0].cubes[0].pose.unwrap().position.unwrap().x);
    }
    let [driven, logged] = x;
    assert_eq!((driven.len(), logged.len()), (6, 6));
    for (step, (driven, logged)) in driven.iter().zip(&logged).enumerate() {
        assert!((logged - driven - 0.016 * step as f64).abs() < 1e-3, "{step}: {logged} {driven}");
    }
}

#[test]
fn whom_the_av_touched_is_marked_from_then_on_and_at_the_end_lies_where_it_was_touched() {
    use foxglove::messages::SceneUpdate;
    use prost::Message as _;
    let mut episode = synthetic::episode("s", Size { agents: 2, steps: 4, futures: 0 });
    let contact = |step, track, at_fault, x: f64| {
        let place = synthetic::CENTER;
        let other = proto::AgentState { x: place.0 + x, y: place.1, z: place.2, length: 4.0, ..Default::default() };
        let (kind, contact) = (proto::event::Kind::Collision, proto::event::Contact::Front);
        let event = proto::Event { step, track: Some(track), at_fault, other: Some(other), ..Default::default() };
        Message::encode(Body::Event(proto::Event { kind: kind.into(), contact: contact.into(), ..event }))
    };
    let end = episode.pop().unwrap();
    let second = episode.iter().position(|message| message.step() == 2).unwrap();
    episode.insert(second, contact(1, 101, false, 0.0));
    episode.extend([contact(3, 100, true, 7.0), end]);
    let bytes = mcap_of(&episode);
    let mut shown = Vec::new();
    for message in mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap) {
        if message.channel.topic == "/view/agents" {
            let update = SceneUpdate::decode(&*message.data).unwrap();
            let texts = update.entities.iter().flat_map(|entity| entity.texts.iter().map(|text| text.text.clone()));
            shown.push(texts.collect::<Vec<_>>().join(" | "));
        }
    }
    let (touched, both) = ("vehicle 101, touched", "vehicle 100, struck | vehicle 101, touched");
    assert_eq!(shown, ["", "", touched, touched, both]);
    // A drawing for Rerun has the same.
    let (contents, messages) = read_all(&bytes).unwrap();
    assert_eq!((contents.trouble(), messages.len()), (None, episode.len()));
    assert!(!rrd_of(&messages).is_empty());
}
