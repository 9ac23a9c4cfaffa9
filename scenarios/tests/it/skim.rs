//! Opening a plain file skims it: the same scenes as by reading it, and damage named when a scene is loaded.

use std::fs;
use std::path::Path;

use proptest::collection::vec;
use proptest::prelude::*;
use scenarios::generated::{FAMILIES, Family};
use scenarios::tfrecord::{self, FrameProblem, Records};
use scenarios::womd;
use scenarios::{Place, RecordError, RecordProblem, SceneSet, SetError, Source};

use crate::real_data;

fn payload(id: &str) -> Vec<u8> {
    Family::named("curve").unwrap().payload(id, 1, 0, &Default::default()).unwrap()
}

fn survey(path: &Path) -> (SceneSet, Vec<RecordError>) {
    SceneSet::survey(&[path.to_string_lossy().into_owned()]).unwrap()
}

fn place(set: &SceneSet, index: usize) -> &Place {
    match &set.entries()[index].source {
        Source::File(place) => place,
        _ => panic!("it lies in no TFRecord file"),
    }
}

/// Holds what a set finds in a file of sound frames to what reading it finds: places, lengths, checksums, payloads; ids and errors, where
/// those do not lie behind an id.
fn hold(path: &Path) {
    let (set, bad) = survey(path);
    let bytes = fs::read(path).unwrap();
    let mut records = Records::new(&bytes[..]);
    let (mut at, mut bad) = (0, bad.iter().peekable());
    while let Some(record) = records.next_record().unwrap() {
        let read = womd::scene_id(record.payload);
        if let Some(error) = bad.next_if(|error| error.record == record.index) {
            assert_eq!(error.offset, record.offset);
            assert!(matches!(&error.problem, RecordProblem::Womd(problem) if read.as_ref() == Err(problem)), "{error}");
            continue;
        }
        let place = place(&set, at);
        let found = (place.record, place.offset, place.bytes, place.checksum);
        assert_eq!(found, (record.index, record.offset, record.payload.len() as u64, record.checksum));
        assert_eq!(set.payload(at).unwrap(), record.payload);
        match read {
            Ok(id) => assert_eq!(set.entries()[at].id, id),
            Err(error) => assert!(set.load(at).is_err(), "{error}"),
        }
        at += 1;
    }
    assert_eq!((at, bad.next().map(ToString::to_string)), (set.entries().len(), None));
}

#[test]
fn generated_and_real_files_are_skimmed_as_they_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.tfrecord");
    let mut file = Vec::new();
    for family in FAMILIES {
        tfrecord::append_record(&mut file, &family.payload(family.name, 3, 0, &Default::default()).unwrap());
    }
    fs::write(&path, file).unwrap();
    hold(&path);
    let Some(data) = real_data() else { return };
    for entry in fs::read_dir(data.join("womd-derived/20s")).unwrap() {
        hold(&entry.unwrap().path());
    }
}

fn varint(mut number: usize, bytes: &mut Vec<u8>) {
    while number >= 0x80 {
        bytes.push(number as u8 | 0x80);
        number >>= 7;
    }
    bytes.push(number as u8);
}

/// What a field of this number and wire type begins with.
fn key(number: usize, kind: usize) -> Vec<u8> {
    let mut bytes = Vec::new();
    varint(number << 3 | kind, &mut bytes);
    bytes
}

fn text(number: usize, content: Vec<u8>) -> Vec<u8> {
    let mut bytes = key(number, 2);
    varint(content.len(), &mut bytes);
    [bytes, content].concat()
}

/// A field of a message: of numbers that scenes have, and others; of every wire type, short and long.
fn field() -> impl Strategy<Value = Vec<u8>> {
    let number = || prop_oneof![1_usize..13, 900_usize..9000];
    prop_oneof![
        4 => Just([key(1, 1), vec![0; 8]].concat()),
        3 => (0_usize..3000).prop_map(|length| text(2, vec![8; length])),
        3 => "[a-z]{1,3}|[a-z]{128}|[a-z]{129}|/".prop_map(|id| text(5, id.into_bytes())),
        1 => (number(), 0_usize..2000).prop_map(|(number, length)| text(number, vec![0; length])),
        1 => (number(), 0_usize..1 << 40).prop_map(|(number, value)| {
            let mut bytes = key(number, 0);
            varint(value, &mut bytes);
            bytes
        }),
        1 => number().prop_map(|number| [key(number, 5), vec![1; 4]].concat()),
        1 => number().prop_map(|number| [key(number, 3), key(1, 0), vec![1], key(number, 4)].concat()),
        1 => vec(any::<u8>(), 1..4),
    ]
}

proptest! {
    #[test]
    fn whatever_a_message_holds_it_is_skimmed_as_it_is_read(messages in vec(vec(field(), 0..9), 1..5)) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.tfrecord");
        let mut file = Vec::new();
        messages.iter().for_each(|message| tfrecord::append_record(&mut file, &message.concat()));
        scenarios::fuzzing::skim(&file);
        fs::write(&path, &file).unwrap();
        // Two of one name are another test's.
        if SceneSet::survey(&[path.to_string_lossy().into_owned()]).is_ok() {
            hold(&path);
        }
    }

    #[test]
    fn a_damaged_file_gives_sound_scenes_or_errors(flips in vec((0.0..1.0, 0_u8..8), 0..3), cut in 0.0..1.2) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.tfrecord");
        let mut file = Vec::new();
        ["one", "two", "three"].iter().for_each(|id| tfrecord::append_record(&mut file, &payload(id)));
        let (length, sound) = (file.len() as f64, file.clone());
        for (at, bit) in flips {
            file[(length * at) as usize] ^= 1 << bit;
        }
        file.truncate((length * cut) as usize);
        fs::write(&path, &file).unwrap();
        scenarios::fuzzing::skim(&file);
        let Ok((set, bad)) = SceneSet::survey(&[path.to_string_lossy().into_owned()]) else { return Ok(()) };
        for index in 0..set.entries().len() {
            let begin = place(&set, index).offset as usize;
            let end = begin + place(&set, index).bytes as usize + 16;
            let is_sound = file[begin..end] == sound[begin..end];
            prop_assert_eq!(set.load(index).is_ok(), is_sound);
        }
        prop_assert!(set.entries().len() + bad.len() > 0 || file.is_empty());
    }
}

#[test]
fn a_damaged_payload_is_named_when_it_is_loaded_and_the_others_are_whole() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.tfrecord");
    let mut file = Vec::new();
    tfrecord::append_record(&mut file, &payload("one"));
    let second = file.len();
    tfrecord::append_record(&mut file, &payload("two"));
    let third = file.len();
    tfrecord::append_record(&mut file, &payload("three"));
    file[third - 100] ^= 1;
    fs::write(&path, file).unwrap();
    let (set, bad) = survey(&path);
    assert!(bad.is_empty());
    let ids: Vec<&str> = set.entries().iter().map(|entry| entry.id.as_str()).collect();
    assert_eq!(ids, ["one", "two", "three"]);
    let is_named = |error: SetError| match error {
        SetError::Record(error) => {
            let is_damage = matches!(error.problem, RecordProblem::Frame(FrameProblem::PayloadChecksum { .. }));
            assert!(is_damage && (error.record, error.offset) == (1, second as u64), "{error}");
        }
        error => panic!("{error}"),
    };
    is_named(set.load(1).unwrap_err());
    is_named(set.load_hashed(1).unwrap_err());
    is_named(set.payload(1).unwrap_err());
    is_named(set.sha256(1).unwrap_err());
    is_named(set.verify().unwrap_err());
    assert_eq!(set.known_sha256(1), None);
    assert!(set.load(0).is_ok() && set.load(2).is_ok());
    // Its id cannot be come to: it is read, and found.
    let mut file = fs::read(&path).unwrap();
    file[second + 12] ^= 7;
    fs::write(&path, file).unwrap();
    let (set, bad) = survey(&path);
    assert_eq!((set.entries().len(), bad.len()), (2, 1));
    is_named(SetError::Record(bad.into_iter().next().unwrap()));
}

#[test]
fn a_record_of_two_ids_is_refused_when_it_is_loaded() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.tfrecord");
    let twice = [payload("one"), b"\x2a\x05other".to_vec()].concat();
    let again = [payload("two"), b"\x2a\x03two".to_vec()].concat();
    let mut file = Vec::new();
    [&twice, &again].iter().for_each(|payload| tfrecord::append_record(&mut file, payload));
    fs::write(&path, &file).unwrap();
    let (set, bad) = survey(&path);
    assert!(bad.is_empty());
    let error = set.load(0).unwrap_err();
    assert!(error.to_string().ends_with("the record calls itself one first, and other further on"), "{error}");
    assert_eq!(set.load(1).unwrap().0.id().as_str(), "two");
    // Where the whole file is read, it is refused at once.
    let mut packed = vec![0x1f, 0x8b, 8, 0, 0, 0, 0, 0, 0, 255];
    packed.extend(miniz_oxide::deflate::compress_to_vec(&file, 6));
    packed.extend(crc32fast::hash(&file).to_le_bytes());
    packed.extend((file.len() as u32).to_le_bytes());
    fs::write(&path, packed).unwrap();
    let (set, bad) = survey(&path);
    assert_eq!((set.entries().len(), bad.len()), (1, 1));
    assert!(bad[0].to_string().ends_with("the record calls itself one first, and other further on"), "{}", bad[0]);
}

#[test]
fn hashes_are_those_of_the_payloads_however_they_are_come_by() {
    use sha2::{Digest, Sha256};
    let hash = |bytes: &[u8]| Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect::<String>();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.tfrecord");
    let mut file = Vec::new();
    ["one", "two"].iter().for_each(|id| tfrecord::append_record(&mut file, &payload(id)));
    fs::write(&path, &file).unwrap();
    let inputs = [path.to_string_lossy().into_owned(), "demo".to_owned()];
    let opened = || SceneSet::open(&inputs).unwrap();
    let set = opened();
    let expected: Vec<String> = (0..set.entries().len()).map(|at| hash(&set.payload(at).unwrap())).collect();
    assert_eq!(set.known_sha256(0), None, "nothing was hashed for that");
    let loaded = opened();
    for (at, expected) in expected.iter().enumerate() {
        assert_eq!(set.load(at).unwrap(), loaded.load_hashed(at).unwrap());
        assert_eq!(loaded.known_sha256(at).as_ref(), Some(expected));
        assert_eq!(set.sha256(at).as_ref().ok(), Some(expected));
    }
    let verified = opened();
    verified.verify().unwrap();
    let known = |set: &SceneSet| (0..set.entries().len()).map(|at| set.known_sha256(at).unwrap()).collect::<Vec<_>>();
    assert_eq!(known(&verified), expected);
    let one = verified.only(&[2, 1]);
    assert_eq!(known(&one), [expected[2].clone(), expected[1].clone()]);
}

#[test]
fn fingerprints_tell_scenes_of_one_name_apart() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.tfrecord");
    let of_file = |seed: u64| {
        let mut file = Vec::new();
        let payload = Family::named("curve").unwrap().payload("one", seed, 0, &Default::default()).unwrap();
        tfrecord::append_record(&mut file, &payload);
        fs::write(&path, file).unwrap();
        survey(&path).0.entries()[0].fingerprint()
    };
    assert_eq!(of_file(1), of_file(1));
    assert_ne!(of_file(1), of_file(2));
    let set = folder.path().join("set.toml");
    let of_making = |text: &str| {
        fs::write(&set, format!("[[generate]]\nname = 'one'\n{text}")).unwrap();
        survey(&set).0.entries()[0].fingerprint()
    };
    let made = ["family = 'curve'", "family = 'merge'", "family = 'curve'\nparameters = { traffic = 0.1 }"];
    let [curve, merge, sparse] = made.map(of_making);
    assert!(curve != merge && curve != sparse, "{curve}, {sparse}");
    assert_eq!(sparse, "generated curve, seed 0, scene 0, traffic=0.1");
}
