//! Small recordings, whole and damaged in every way that has a name.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use std::collections::BTreeMap;
use std::io::Cursor;

use mcap::records::{MessageHeader, Metadata};
use mcap::{Compression, WriteOptions, Writer};
use proptest::prelude::*;

use crate::records::{Chunk, Frame, HEADER_BYTES, MAGIC, op};
use crate::{Event, Fault, NotMcap, Reader};

/// Messages of a file; each closes a chunk, where there are chunks.
const MESSAGES: usize = 12;

/// What the message of a number says.
fn said(number: usize) -> Vec<u8> {
    format!("message {number} ").repeat(20).into_bytes()
}

fn file(options: WriteOptions) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let mut writer = Writer::with_options(&mut bytes, options.library("")).unwrap();
    let metadata = BTreeMap::from([("run".to_owned(), "test".to_owned())]);
    writer.write_metadata(&Metadata { name: "reloop".to_owned(), metadata }).unwrap();
    let schema = writer.add_schema("a.Message", "protobuf", b"its description").unwrap();
    let channels = ["/a", "/b"].map(|topic| writer.add_channel(schema, topic, "protobuf", &BTreeMap::new()).unwrap());
    for number in 0..MESSAGES {
        let log_time = number as u64;
        let channel_id = channels[number % 2];
        let header = MessageHeader { channel_id, sequence: number as u32, log_time, publish_time: log_time };
        writer.write_to_known_channel(&header, &said(number)).unwrap();
        writer.flush().unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    bytes.into_inner()
}

fn zstd() -> Vec<u8> {
    file(WriteOptions::new().compression(Some(Compression::Zstd)))
}

fn stored() -> Vec<u8> {
    file(WriteOptions::new().compression(None))
}

fn without_chunks() -> Vec<u8> {
    file(WriteOptions::new().use_chunks(false))
}

/// What reading came to.
#[derive(Debug, Default, PartialEq)]
struct Read {
    run: Option<String>,
    channels: Vec<String>,
    /// The numbers of the messages.
    messages: Vec<usize>,
    faults: Vec<Fault>,
    places: Vec<u64>,
}

fn read(bytes: &[u8]) -> Result<Read, NotMcap> {
    let mut read = Read::default();
    let mut reader = Reader::new(bytes)?;
    while let Some(event) = reader.next() {
        match event {
            Event::Metadata { name, entries } => {
                assert_eq!((name, entries[0].0), ("reloop", "run"));
                read.run = Some(entries[0].1.to_owned());
            }
            Event::Channel(channel) => read.channels.push(format!("{} {}", channel.topic, channel.schema)),
            Event::Message(message) => {
                let number = message.log_time as usize;
                assert_eq!(message.data, said(number));
                assert_eq!(message.channel.topic, ["/a", "/b"][number % 2]);
                read.messages.push(number);
            }
            Event::Damage(damage) => {
                read.faults.push(damage.fault);
                read.places.push(damage.at);
            }
        }
    }
    Ok(read)
}

/// Where the records of a kind begin among those of the file.
fn records(bytes: &[u8], opcode: u8) -> Vec<usize> {
    let (mut at, mut found) = (MAGIC.len(), Vec::new());
    while let Some(frame) = Frame::at(bytes, at) {
        if frame.opcode == opcode {
            found.push(at);
        }
        at = frame.end(at);
    }
    found
}

/// All messages but these.
fn all_but(lost: &[usize]) -> Vec<usize> {
    (0..MESSAGES).filter(|number| !lost.contains(number)).collect()
}

#[test]
fn a_whole_file_is_read_whole_however_it_is_packed() {
    for bytes in [zstd(), stored(), without_chunks()] {
        let read = read(&bytes).unwrap();
        assert_eq!((read.faults, read.messages), (vec![], all_but(&[])));
        assert_eq!(read.run.unwrap(), "test");
        assert_eq!(read.channels, ["/a a.Message", "/b a.Message"]);
    }
}

#[test]
fn a_flipped_bit_in_a_chunk_costs_that_chunk() {
    for whole in [zstd(), stored()] {
        let chunks = records(&whole, op::CHUNK);
        assert_eq!(chunks.len(), MESSAGES);
        for lost in [1, 5, MESSAGES - 1] {
            let mut bytes = whole.clone();
            let end = Frame::at(&whole, chunks[lost]).unwrap().end(chunks[lost]);
            bytes[end - 20] ^= 0x10;
            let read = read(&bytes).unwrap();
            assert_eq!((read.messages, read.places), (all_but(&[lost]), vec![chunks[lost] as u64]));
            assert!(matches!(&read.faults[..], [Fault::Chunk { .. } | Fault::Unpacking(_)]), "{:?}", read.faults);
        }
    }
}

#[test]
fn the_channels_of_a_lost_first_chunk_come_from_the_summary() {
    let mut bytes = zstd();
    let first = records(&bytes, op::CHUNK)[0];
    let end = Frame::at(&bytes, first).unwrap().end(first);
    bytes[end - 20] ^= 0x10;
    let whole = read(&bytes).unwrap();
    assert_eq!((whole.messages, whole.faults.len()), (all_but(&[0]), 1));
    // Without a summary nothing tells what the messages are; each channel is named once.
    let end = records(&bytes, op::DATA_END)[0];
    let cut = read(&bytes[..end]).unwrap();
    assert_eq!(cut.messages, [] as [usize; 0]);
    assert_eq!(cut.faults[1..], [Fault::NoChannel(2), Fault::NoChannel(1), Fault::CutOff]);
}

#[test]
fn after_a_wrong_length_it_goes_on_at_the_next_chunk() {
    let whole = zstd();
    let chunk = records(&whole, op::CHUNK)[4];
    for length in [0, 3, 31, 1 << 20, 1 << 40, u64::MAX] {
        let mut bytes = whole.clone();
        bytes[chunk + 1..chunk + 9].copy_from_slice(&u64::to_le_bytes(length));
        let read = read(&bytes).unwrap();
        assert_eq!(read.messages, all_but(&[4]), "{length}");
        assert_eq!(read.places[0], chunk as u64, "{length}");
        assert!(!read.faults.contains(&Fault::CutOff), "{length}: {:?}", read.faults);
    }
}

#[test]
fn a_chunk_without_bounds_is_passed_over() {
    let whole = zstd();
    let chunk = records(&whole, op::CHUNK)[4];
    for size in [0, 17, 1 << 25, 1 << 40, u64::MAX] {
        let mut bytes = whole.clone();
        let place = chunk + HEADER_BYTES + 16;
        bytes[place..place + 8].copy_from_slice(&u64::to_le_bytes(size));
        let read = read(&bytes).unwrap();
        assert_eq!((read.messages, read.places), (all_but(&[4]), vec![chunk as u64]), "{size}");
    }
}

#[test]
fn chunks_of_unknown_packing_are_named() {
    let mut bytes = zstd();
    let name = bytes.windows(4).position(|window| window == b"zstd").unwrap();
    bytes[name..name + 4].copy_from_slice(b"zzzz");
    assert_eq!(read(&bytes).unwrap().faults, [Fault::Compression("zzzz".to_owned())]);
}

#[test]
fn the_rest_of_the_file_is_checked_too() {
    let whole = zstd();
    let end = records(&whole, op::DATA_END)[0];
    let footer = records(&whole, op::FOOTER)[0];
    let flipped = |place: usize| {
        let mut bytes = whole.clone();
        bytes[place] ^= 1;
        let read = read(&bytes).unwrap();
        assert_eq!(read.messages, all_but(&[]), "{place}");
        read.faults
    };
    assert!(matches!(&flipped(records(&whole, 0x07)[3] + 12)[..], [Fault::Data { .. }]));
    assert!(matches!(&flipped(end + 9)[..], [Fault::Data { .. }]));
    assert!(matches!(&flipped(end)[..], [Fault::Stray { opcode: 0x0e }] | []), "what the summary has may come early");
    assert!(matches!(&flipped(end + 40)[..], [Fault::Summary { .. }]));
    assert!(matches!(&flipped(footer + 9)[..], [Fault::Summary { .. }]));
    assert!(matches!(&flipped(whole.len() - 1)[..], [Fault::End]));
    assert!(matches!(&flipped(0)[..], [Fault::Beginning]));
    assert_eq!(flipped(footer), [Fault::End]);
}

#[test]
fn what_does_not_belong_here_is_named_and_passed_over() {
    let whole = zstd();
    let chunk = records(&whole, op::CHUNK)[7];
    for (record, fault) in [
        (&[0_u8, 0, 0, 0, 0, 0, 0, 0, 0][..], Some(Fault::Stray { opcode: 0 })),
        (&[0x42, 1, 0, 0, 0, 0, 0, 0, 0, 9], Some(Fault::Stray { opcode: 0x42 })),
        (&[op::METADATA, 2, 0, 0, 0, 0, 0, 0, 0, 9, 9], Some(Fault::Fields { opcode: op::METADATA })),
        (&[op::MESSAGE, 1, 0, 0, 0, 0, 0, 0, 0, 9], Some(Fault::Fields { opcode: op::MESSAGE })),
        (&[op::HEADER, 0, 0, 0, 0, 0, 0, 0, 0], Some(Fault::Stray { opcode: op::HEADER })),
    ] {
        let bytes = [&whole[..chunk], record, &whole[chunk..]].concat();
        let read = read(&bytes).unwrap();
        assert_eq!((read.messages, read.faults.first()), (all_but(&[]), fault.as_ref()).clone(), "{record:?}");
    }
}

#[test]
fn a_cut_file_is_cut_off_wherever_it_is_cut() {
    for whole in [zstd(), stored(), without_chunks()] {
        for end in MAGIC.len()..whole.len() {
            let read = read(&whole[..end]).unwrap();
            assert_eq!(read.faults, [Fault::CutOff], "{end}");
            assert_eq!(read.messages, all_but(&[])[..read.messages.len()]);
        }
    }
    assert_eq!(read(&MAGIC[..7]), Err(NotMcap));
    assert_eq!(read(b""), Err(NotMcap));
    assert_eq!(read(b"not an mcap"), Err(NotMcap));
}

#[test]
fn the_largest_of_all_is_bounded() {
    // Somebody's own record of 32 MiB of zeros, thousands of times, in a kilobyte each; or millions of empty records.
    let mut large = vec![0; 32 << 20];
    assert_eq!(last_fault_of_many(&large), Fault::TooMuch("records"));
    large[0] = op::PRIVATE;
    large[1..9].copy_from_slice(&((32_u64 << 20) - 9).to_le_bytes());
    assert_eq!(last_fault_of_many(&large), Fault::TooMuch("data"));
}

/// What is wrong at last with a file of a chunk's records so many times that nobody can want them all.
fn last_fault_of_many(records: &[u8]) -> Fault {
    let zeros = zstd::bulk::compress(records, 1).unwrap();
    let mut body = [0_u8; 16].to_vec();
    body.extend((32_u64 << 20).to_le_bytes());
    body.extend([0, 0, 0, 0, 4, 0, 0, 0]);
    body.extend(b"zstd");
    body.extend((zeros.len() as u64).to_le_bytes());
    body.extend(zeros);
    assert!(Chunk::of(&body).is_some());
    let mut bytes = MAGIC.to_vec();
    for _ in 0..4096 {
        bytes.push(op::CHUNK);
        bytes.extend((body.len() as u64).to_le_bytes());
        bytes.extend(&body);
    }
    let mut reader = Reader::new(&bytes).unwrap();
    let mut last = None;
    while let Some(event) = reader.next() {
        last = Some(event).map(|event| if let Event::Damage(damage) = event { damage.fault } else { Fault::CutOff });
    }
    last.unwrap()
}

#[test]
fn bytes_that_look_like_chunks_cost_no_more_than_others() {
    // Chunks by their opcode, each with a length that fits and a name that is half of the file; and chunks of no fields at all.
    let mut look_alike = MAGIC.to_vec();
    let length = 4_u64 << 20;
    while (look_alike.len() as u64) < 2 * length {
        look_alike.push(op::CHUNK);
        look_alike.extend(length.to_le_bytes());
        look_alike.extend([b'a'; 28]);
        look_alike.extend(((length / 2) as u32).to_le_bytes());
    }
    let mut empty = MAGIC.to_vec();
    (0..1 << 19).for_each(|_| empty.extend([op::CHUNK, 2, 0, 0, 0, 0, 0, 0, 0, 9, 9]));
    let start = std::time::Instant::now();
    for bytes in [look_alike, empty] {
        let mut reader = Reader::new(&bytes).unwrap();
        while reader.next().is_some() {}
    }
    assert!(start.elapsed() < std::time::Duration::from_secs(20), "{:?}", start.elapsed());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, ..ProptestConfig::default() })]

    #[test]
    fn whatever_the_bytes_are_reading_ends(
        kind in 0..3,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..6),
        end in any::<prop::sample::Index>(),
    ) {
        let mut bytes = [zstd, stored, without_chunks][kind as usize]();
        for (place, byte) in changes {
            let place = place.index(bytes.len());
            bytes[place] = byte;
        }
        for bytes in [&bytes[..], &bytes[..end.index(bytes.len())]] {
            let Ok(mut reader) = Reader::new(bytes) else { continue };
            let mut events = 0;
            while reader.next().is_some() {
                events += 1;
            }
            prop_assert!(events < 200, "{}", events);
        }
    }
}
