//! Files under TensorFlow's compression types.

use std::fs;

use miniz_oxide::deflate::{compress_to_vec, compress_to_vec_zlib};
use scenarios::generated::Family;
use scenarios::tfrecord::{self, MAX_PAYLOAD_BYTES, PackedError, PackedProblem, Packing};
use scenarios::{Content, RecordError, RecordProblem, SceneSet, SetError, Source, womd};
use world::scene::SceneParts;

/// Seven scenes in a row, and where each record begins.
fn scenes() -> (Vec<u8>, Vec<usize>) {
    let (mut file, mut places) = (Vec::new(), Vec::new());
    for (index, family) in scenarios::generated::FAMILIES[..7].iter().enumerate() {
        places.push(file.len());
        tfrecord::append_record(&mut file, &family.payload(&format!("s{index}"), 1, 0, &Default::default()).unwrap());
    }
    (file, places)
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut file = vec![0x1f, 0x8b, 8, 0, 0, 0, 0, 0, 0, 255];
    file.extend(compress_to_vec(bytes, 6));
    file.extend(crc32fast::hash(bytes).to_le_bytes());
    file.extend((bytes.len() as u32).to_le_bytes());
    file
}

/// A member with all that its header may hold.
fn gzip_with_names(bytes: &[u8]) -> Vec<u8> {
    let plain = gzip(bytes);
    let mut file = vec![0x1f, 0x8b, 8, 4 + 8 + 16 + 2, 0, 0, 0, 0, 0, 255, 3, 0, 1, 2, 3];
    file.extend(b"name\0comment\0\x12\x34");
    file.extend(&plain[10..]);
    file
}

fn open_as(name: &str, bytes: &[u8]) -> (tempfile::TempDir, Result<SceneSet, SetError>) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    fs::write(&path, bytes).unwrap();
    let set = SceneSet::open(&[path.to_string_lossy().into_owned()]);
    (folder, set)
}

fn record_error(bytes: &[u8]) -> RecordError {
    match open_as("x.tfrecord.gz", bytes).1.unwrap_err() {
        SetError::Record(error) => error,
        error => panic!("{error}"),
    }
}

#[test]
fn packed_files_hold_the_scenes_of_the_plain_one() {
    let (plain, places) = scenes();
    let (_folder, set) = open_as("x.tfrecord", &plain);
    let set = set.unwrap();
    let (first, rest) = plain.split_at(places[3]);
    let members = [gzip_with_names(first), gzip(rest)].concat();
    let packed = [("a.tfrecord.gz", gzip(&plain)), ("b.bin", compress_to_vec_zlib(&plain, 9)), ("c.gz", members)];
    for (name, bytes) in packed {
        let (_folder, other) = open_as(name, &bytes);
        let other = other.unwrap();
        // The last ones first: each is reached by itself.
        for index in (0..places.len()).rev() {
            let (of_plain, of_packed) = (&set.entries()[index], &other.entries()[index]);
            assert_eq!(of_plain.id, of_packed.id);
            assert_eq!(set.sha256(index).unwrap(), other.sha256(index).unwrap());
            assert_eq!(set.load(index).unwrap(), other.load(index).unwrap());
            let (Source::File(plain), Source::File(packed)) = (&of_plain.source, &of_packed.source) else { panic!() };
            assert_eq!((plain.record, plain.offset), (packed.record, packed.offset));
        }
    }
}

#[test]
fn a_file_is_entered_where_the_scene_is_not_at_its_beginning() {
    let payload = Family::named("curve").unwrap().payload("x", 1, 0, &Default::default()).unwrap();
    let parts = womd::read(&payload).unwrap().0.into_parts();
    let mut plain = Vec::new();
    let number = (11 << 20) / payload.len() + 1;
    let ids: Vec<String> = (0..number).map(|index| format!("scene-{index}")).collect();
    for id in &ids {
        let (scene, _) = SceneParts { id: id.clone(), ..parts.clone() }.check().unwrap();
        tfrecord::append_record(&mut plain, &womd::write(&scene));
    }
    let (_folder, set) = open_as("x.tfrecord.gz", &gzip(&plain));
    let set = set.unwrap();
    let entered = |index: usize| match &set.entries()[index].source {
        Source::File(place) => (place.offset, place.file.packed.as_ref().unwrap().before(place.offset).unpacked()),
        _ => panic!(),
    };
    let far = (0..ids.len()).map(entered).map(|(offset, entered)| offset - entered).max().unwrap();
    assert!(plain.len() > 10 << 20 && far < (4 << 20) + 2 * payload.len() as u64, "{far} of {}", plain.len());
    for index in [number - 1, number / 2, 0] {
        assert_eq!(set.load(index).unwrap().0.id().as_str(), ids[index]);
    }
}

#[test]
fn a_cut_stream_says_which_record_and_which_byte() {
    let (plain, mut places) = scenes();
    let packed = gzip(&plain);
    // Where the stream's own checksum alone is cut, all records are whole, and what would follow them is named.
    places.push(plain.len());
    for cut in [packed.len() - 1, packed.len() / 2, 15, 4] {
        let error = record_error(&packed[..cut]);
        let RecordProblem::Packed(PackedError { packing: Packing::Gzip, byte, problem: PackedProblem::CutOff }) =
            error.problem
        else {
            panic!("{error}")
        };
        assert_eq!(byte, cut as u64);
        assert_eq!(error.offset, places[error.record as usize] as u64);
    }
    let text = record_error(&packed[..packed.len() / 2]).to_string();
    assert!(text.contains("unpacked: the gzip stream is cut off (byte "), "{text}");
}

#[test]
fn a_flipped_bit_is_found_by_one_checksum_or_another() {
    let (plain, _) = scenes();
    for packed in [gzip(&plain), compress_to_vec_zlib(&plain, 6)] {
        for at in (10..packed.len()).step_by(packed.len() / 40).chain(packed.len() - 8..packed.len()) {
            let mut packed = packed.clone();
            packed[at] ^= 1;
            assert!(open_as("x.tfrecord.gz", &packed).1.is_err(), "byte {at}");
        }
    }
}

#[test]
fn what_follows_a_stream_is_not_passed_over() {
    let (plain, _) = scenes();
    for packed in [gzip(&plain), compress_to_vec_zlib(&plain, 6)] {
        let error = record_error(&[packed, b"more".to_vec()].concat());
        let problem = PackedProblem::Damaged;
        assert!(matches!(error.problem, RecordProblem::Packed(packed) if packed.problem == problem), "{error}");
    }
}

#[test]
fn a_bomb_is_bounded_whatever_it_unpacks_to() {
    // Records that are sound, and as long as they may be: a packed megabyte of them would be a gigabyte.
    let mut plain = Vec::new();
    let mut payload = b"\x2a\x04bomb\x12".to_vec();
    let zeros = MAX_PAYLOAD_BYTES as usize - 16;
    let mut length = zeros;
    while length >= 0x80 {
        payload.push((length & 0x7f) as u8 | 0x80);
        length >>= 7;
    }
    payload.push(length as u8);
    payload.resize(payload.len() + zeros, 0);
    assert!(payload.len() as u64 <= MAX_PAYLOAD_BYTES);
    tfrecord::append_record(&mut plain, &payload);
    let one = plain.clone();
    plain.extend(one);
    let error = record_error(&gzip(&plain));
    let RecordProblem::Packed(PackedError { problem: PackedProblem::Bomb { unpacked }, .. }) = error.problem else {
        panic!("{error}")
    };
    assert!((MAX_PAYLOAD_BYTES..MAX_PAYLOAD_BYTES + (1 << 20)).contains(&unpacked), "{unpacked}");
    // And a stream of nothing but zeros is no file of records from its first bytes on.
    let error = record_error(&gzip(&vec![0; 100 << 20]));
    assert!(matches!(error.problem, RecordProblem::Foreign(Content::Packed(Packing::Gzip))), "{error}");
}

#[test]
fn an_archive_is_told_apart_from_packed_records() {
    let tar = gzip(&[b"data/scene.tfrecord\0".to_vec(), vec![0; 600]].concat());
    let error = record_error(&tar).to_string();
    assert!(error.ends_with("the file is something compressed with gzip, not a TFRecord"), "{error}");
    let other = open_as("scenes.tar.gz", &tar).1.unwrap_err();
    assert!(matches!(other, SetError::Foreign { content: Content::Packed(Packing::Gzip), .. }), "{other}");
}

#[test]
fn a_packed_file_that_changes_after_it_was_opened() {
    let (plain, _) = scenes();
    let (folder, set) = open_as("x.tfrecord.gz", &gzip(&plain));
    let set = set.unwrap();
    let mut other = plain.clone();
    other.truncate(100);
    fs::write(folder.path().join("x.tfrecord.gz"), gzip(&other)).unwrap();
    assert!(matches!(set.load(3).unwrap_err(), SetError::Record(_)));
}
