//! The recorder process on a real bus: started, told an episode, left, killed.

use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, sync_channel};
use std::time::Duration;

use prost::Message as _;
use recorder::export::export;
use recorder::message::{Body, Message};
use wire::hub::{Hub, Seat};
use wire::keys::{Address, Answering, Channel, Place, Role, RunName, Secret, Worker, Workers};
use wire::{proto, session};
use world::scene::SceneId;
use zenoh::{Session, Wait};

use crate::synthetic::{self, SMALL, Size};
use crate::{mcap_of, read_all, rrd_of};

const TIMEOUT: Duration = Duration::from_secs(20);

/// A run with a recorder, and somebody who plays all other parts.
struct Stage {
    hub: Hub,
    /// Kept because dropping it takes it away.
    _seat: Seat,
    place: Place,
    recorder: Child,
    player: Session,
    answers: Receiver<proto::Recorded>,
}

impl Stage {
    fn set(folder: &Path) -> Self {
        let run: RunName = "test".parse().unwrap();
        let hub = Hub::open(&run).unwrap();
        let settings = synthetic::SETTINGS.to_owned();
        hub.publish_run_info(&proto::RunInfo { run: run.to_string(), settings, predictor: true, ..Default::default() })
            .unwrap();
        let seat = hub.seat(Role::Recorder, &Workers::All).unwrap();
        let place = Place::seat(&run, seat.secret()).unwrap();
        let recorder = Command::new(env!("CARGO_BIN_EXE_recorder"))
            .args(["record", "--exit-with-parent", "--endpoint", hub.endpoint(), "--run", "test", "--out"])
            .arg(folder)
            .env(Secret::VARIABLE, seat.secret().reveal())
            .env_remove("RUST_LOG")
            .stdin(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let player = session::open_client(hub.endpoint()).unwrap();
        let (sender, answers) = sync_channel(16);
        player
            .declare_subscriber(&place.everything()[0])
            .callback(move |sample| {
                if Answering::parse(sample.key_expr().as_str()).is_some() {
                    sender.send(proto::Recorded::decode(&*sample.payload().to_bytes()).unwrap()).unwrap();
                }
            })
            .background()
            .wait()
            .unwrap();
        hub.wait_for_nodes(&[&seat], TIMEOUT, &|| false).unwrap();
        Self { hub, _seat: seat, place, recorder, player, answers }
    }

    fn say(&self, worker: usize, scene: &str, messages: &[Message]) {
        for message in messages {
            let channel = message.channel();
            let address = Address { worker: Worker::numbered(worker), scene: SceneId::new(scene).unwrap(), channel };
            session::send(&self.player, &self.place.tape(&address), message.payload.clone()).unwrap();
        }
    }
}

impl Drop for Stage {
    fn drop(&mut self) {
        let _ = self.recorder.kill();
        let _ = self.recorder.wait();
    }
}

fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<String> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn episodes_of_all_workers_are_recorded_and_answered() {
    let folder = tempfile::tempdir().unwrap();
    let stage = Stage::set(folder.path());
    let (first, second) = (synthetic::episode("a", SMALL), synthetic::episode("b", SMALL));
    // Side by side, and one of them backwards.
    stage.say(0, "a", &first[..10]);
    stage.say(1, "b", &second.iter().rev().cloned().collect::<Vec<_>>());
    stage.say(0, "a", &first[10..]);
    let mut answers: Vec<_> = (0..2).map(|_| stage.answers.recv_timeout(TIMEOUT).unwrap()).collect();
    answers.sort_by(|a, b| a.scene.cmp(&b.scene));
    for (answer, (scene, episode)) in answers.iter().zip([("a", &first), ("b", &second)]) {
        let expected = proto::Recorded {
            scene: scene.to_owned(),
            observations: 5,
            plans: 5,
            predictions: 5,
            records: 5,
            events: 2,
            error: String::new(),
            digest: synthetic::digest(episode).to_bytes(),
            moves: 0,
        };
        assert_eq!(*answer, expected);
    }
    assert_eq!(names(folder.path()), ["a.mcap", "a.rrd", "b.mcap", "b.rrd"]);
    for (name, episode) in [("a", first), ("b", second)] {
        assert!(std::fs::read(folder.path().join(format!("{name}.mcap"))).unwrap() == mcap_of(&episode));
        let drawn = std::fs::read(folder.path().join(format!("{name}.rrd"))).unwrap();
        assert!(drawn == rrd_of(&episode));
        let (recording, again) = (folder.path().join(format!("{name}.mcap")), folder.path().join("again.rrd"));
        assert_eq!(export(&recording, &again, None, true).unwrap(), None);
        assert!(std::fs::read(again).unwrap() == drawn, "an export is the file that was recorded");
    }
}

#[test]
fn a_message_that_never_comes_is_named_and_the_file_stays_partial() {
    let folder = tempfile::tempdir().unwrap();
    let stage = Stage::set(folder.path());
    let mut episode = synthetic::episode("a", SMALL);
    episode.remove(3);
    stage.say(0, "a", &episode);
    let answer = stage.answers.recv_timeout(TIMEOUT).unwrap();
    assert_eq!(answer.error, "not whole: plans 4 of 5 arrived");
    assert_eq!(names(folder.path()), ["a.mcap.partial", "a.rrd.partial"]);
}

#[test]
fn what_somebody_else_said_in_the_simulator_s_place_is_noticed() {
    let folder = tempfile::tempdir().unwrap();
    let stage = Stage::set(folder.path());
    let mut episode = synthetic::episode("a", SMALL);
    let record = episode.iter_mut().find(|message| message.channel() == Channel::Record).unwrap();
    let Body::Record(told) = &record.body else { unreachable!() };
    *record = Message::encode(Body::Record(Box::new(proto::StepRecord { at_fault_collision: true, ..**told })));
    stage.say(0, "a", &episode);
    let answer = stage.answers.recv_timeout(TIMEOUT).unwrap();
    assert_eq!(answer.error, "not what was told: the digest of what arrived is another");
    assert_eq!(names(folder.path()), ["a.mcap.partial", "a.rrd.partial"]);
}

#[test]
fn a_recording_without_its_scene_is_not_whole_though_all_that_is_counted_came() {
    let folder = tempfile::tempdir().unwrap();
    let stage = Stage::set(folder.path());
    stage.say(0, "a", &synthetic::episode("a", SMALL)[1..]);
    let answer = stage.answers.recv_timeout(TIMEOUT).unwrap();
    assert_eq!(answer.error, "not whole: no scene arrived");
    assert_eq!(names(folder.path()), ["a.mcap.partial", "a.rrd.partial"]);
}

#[test]
fn when_standard_input_ends_it_leaves_and_what_came_is_readable() {
    let folder = tempfile::tempdir().unwrap();
    let mut stage = Stage::set(folder.path());
    let episode = synthetic::episode("a", SMALL);
    stage.say(0, "a", &episode[..11]);
    // What was said is with the recorder once an episode said after it is answered.
    stage.say(0, "b", &synthetic::episode("b", SMALL));
    stage.answers.recv_timeout(TIMEOUT).unwrap();
    drop(stage.recorder.stdin.take());
    assert_eq!(stage.recorder.wait().unwrap().code(), Some(0));
    let said = std::io::read_to_string(stage.recorder.stderr.take().unwrap()).unwrap();
    assert_eq!(said, "", "a stop that is asked for is no error");
    let (contents, messages) = read_all(&std::fs::read(folder.path().join("a.mcap.partial")).unwrap()).unwrap();
    assert!(contents.is_cut_off);
    assert!(messages == episode[..11]);
}

#[test]
fn killed_it_leaves_all_closed_chunks() {
    let folder = tempfile::tempdir().unwrap();
    let mut stage = Stage::set(folder.path());
    let episode = synthetic::episode("a", Size { agents: 60, steps: 60, futures: 1 });
    stage.say(0, "a", &episode[..200]);
    stage.say(0, "b", &synthetic::episode("b", SMALL));
    stage.answers.recv_timeout(TIMEOUT).unwrap();
    stage.recorder.kill().unwrap();
    stage.recorder.wait().unwrap();
    let (contents, messages) = read_all(&std::fs::read(folder.path().join("a.mcap.partial")).unwrap()).unwrap();
    assert!(contents.is_cut_off);
    assert!(messages.len() > 100, "{}", messages.len());
    assert!(messages == episode[..messages.len()]);
}

#[test]
fn it_leaves_when_the_simulator_does() {
    let folder = tempfile::tempdir().unwrap();
    let mut stage = Stage::set(folder.path());
    let Stage { hub, recorder, .. } = &mut stage;
    let gone = std::mem::replace(hub, Hub::open(&"other".parse().unwrap()).unwrap());
    drop(gone);
    assert_eq!(recorder.wait().unwrap().code(), Some(0));
}
