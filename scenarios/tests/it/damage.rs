//! Damaged and foreign files: each is refused by its own error, which names file, record and offset.

use std::fs;
use std::path::Path;

use scenarios::generated::Family;
use scenarios::tfrecord::{self, FrameProblem};
use scenarios::womd::WomdError;
use scenarios::{Content, RecordError, RecordProblem, SceneSet, SetError};

fn payload(id: &str) -> Vec<u8> {
    Family::named("curve").unwrap().payload(id, 1, 0, &Default::default()).unwrap()
}

/// A file of two scenes, and where the second begins.
fn two_scenes() -> (Vec<u8>, usize) {
    let mut file = Vec::new();
    tfrecord::append_record(&mut file, &payload("one"));
    let second = file.len();
    tfrecord::append_record(&mut file, &payload("two"));
    (file, second)
}

/// Opens a file of these bytes, and has a look at it while it is there.
fn look<T>(bytes: &[u8], look: impl FnOnce(Result<SceneSet, SetError>) -> T) -> T {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.tfrecord-00000-of-00001");
    fs::write(&path, bytes).unwrap();
    look(SceneSet::open(&[path.to_string_lossy().into_owned()]))
}

fn open(bytes: &[u8]) -> Result<SceneSet, SetError> {
    look(bytes, |opened| opened)
}

fn of_record(error: SetError) -> RecordError {
    match error {
        SetError::Record(error) => {
            assert!(error.to_string().contains("x.tfrecord-00000-of-00001: record"), "{error}");
            error
        }
        error => panic!("{error}"),
    }
}

fn record_error(bytes: &[u8]) -> RecordError {
    of_record(open(bytes).unwrap_err())
}

fn in_frame(error: RecordError) -> (u64, u64, FrameProblem) {
    let RecordProblem::Frame(problem) = error.problem else { panic!("{error}") };
    (error.record, error.offset, problem)
}

fn frame_problem(bytes: &[u8]) -> (u64, u64, FrameProblem) {
    in_frame(record_error(bytes))
}

#[test]
fn a_file_cut_off_in_a_payload_or_a_header() {
    let (file, second) = two_scenes();
    let cut = frame_problem(&file[..file.len() - 1]);
    let (expected, got) = ((file.len() - second - 12) as u64, (file.len() - second - 13) as u64);
    assert_eq!(cut, (1, second as u64, FrameProblem::TruncatedPayload { expected, got }));
    let cut = frame_problem(&file[..second + 5]);
    assert_eq!(cut, (1, second as u64, FrameProblem::TruncatedHeader { got: 5 }));
    assert_eq!(open(&file[..second]).unwrap().entries().len(), 1);
}

#[test]
fn a_flipped_bit_in_any_of_the_four_parts() {
    let (file, second) = two_scenes();
    for (at, header) in [(second, true), (second + 9, true), (second + 500, false), (file.len() - 2, false)] {
        let mut file = file.clone();
        file[at] ^= 4;
        // A damaged length is found at opening, a damaged payload when it is loaded.
        let loaded = || look(&file, |set| of_record(set.unwrap().load(1).unwrap_err()));
        let (record, offset, problem) = if header { frame_problem(&file) } else { in_frame(loaded()) };
        assert_eq!((record, offset), (1, second as u64));
        assert_eq!(matches!(problem, FrameProblem::HeaderChecksum { .. }), header, "{problem}");
        assert_eq!(matches!(problem, FrameProblem::PayloadChecksum { .. }), !header, "{problem}");
    }
}

#[test]
fn a_length_that_cannot_be_is_refused_before_anything_is_allocated() {
    let length = (1_u64 << 60).to_le_bytes();
    let mut file = length.to_vec();
    file.extend_from_slice(&tfrecord::masked_crc32c(&length).to_le_bytes());
    assert_eq!(frame_problem(&file), (0, 0, FrameProblem::TooLong { length: 1 << 60 }));
}

fn foreign(bytes: &[u8]) -> Content {
    let error = record_error(bytes);
    let RecordProblem::Foreign(content) = error.problem else { panic!("{error}") };
    content
}

#[test]
fn files_that_are_something_else() {
    // pickle.dumps({}, protocol=5)
    assert_eq!(foreign(b"\x80\x05}\x94."), Content::Pickle);
    assert_eq!(foreign(b"\x80\x04\x95\x0b\0\0\0\0\0\0\0}\x94\x8c\x01a\x94K\x01s."), Content::Pickle);
    assert_eq!(foreign(b"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 1\n"), Content::LfsPointer);
    assert_eq!(foreign(b"SQLite format 3\0and more"), Content::Sqlite);
    assert!(matches!(open(b"").unwrap_err(), SetError::NoScenes { .. }));
}

fn womd_problem(payload: &[u8]) -> WomdError {
    let mut file = Vec::new();
    tfrecord::append_record(&mut file, payload);
    let set = match open(&file) {
        Ok(set) => set,
        Err(SetError::Record(RecordError { problem: RecordProblem::Womd(problem), .. })) => return problem,
        Err(error) => panic!("{error}"),
    };
    // Its file is gone by now: read the payload itself.
    assert_eq!(set.entries().len(), 1);
    scenarios::womd::read(payload).unwrap_err()
}

#[test]
fn records_that_are_no_scenario() {
    // Example { features: Features { feature: { "state/x": ... } } }
    assert_eq!(
        womd_problem(b"\x0a\x0b\x0a\x09\x0a\x07state/x").to_string(),
        "the tf.Example: the feature scenario/id is missing"
    );
    // Frame { context: Context { name: "1" }, timestamp_micros: 5 }
    assert_eq!(womd_problem(b"\x0a\x03\x0a\x011\x10\x05"), WomdError::NotAScenario);
    assert!(matches!(womd_problem(b"\xff\xff\xff"), WomdError::Protobuf(_)));
    assert!(matches!(womd_problem(b""), WomdError::Scene(_)));
}

#[test]
fn a_file_that_changes_after_it_was_opened() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.tfrecord");
    let write = |path: &Path, payload: &[u8]| {
        let mut file = Vec::new();
        tfrecord::append_record(&mut file, payload);
        fs::write(path, file).unwrap();
    };
    write(&path, &payload("one"));
    let set = SceneSet::open(&[path.to_string_lossy().into_owned()]).unwrap();
    set.load(0).unwrap();
    write(&path, &payload("two"));
    let error = set.load(0).unwrap_err();
    assert!(matches!(error, SetError::Record(RecordError { problem: RecordProblem::Changed, .. })), "{error}");
    fs::remove_file(&path).unwrap();
    let error = set.load(0).unwrap_err();
    assert!(matches!(error, SetError::Record(RecordError { problem: RecordProblem::Io(_), .. })), "{error}");
}
