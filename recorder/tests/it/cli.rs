//! The command line: what it prints, and with which exit code.

use std::path::Path;
use std::process::Command;

use recorder::message::{Body, Message};
use wire::keys::Channel;
use wire::proto;

use crate::mcap_of;
use crate::synthetic::{self, SMALL, Size};

/// Output, errors and exit code, with the folder's name left out.
fn recorder(folder: &Path, arguments: &[&str]) -> String {
    let output =
        Command::new(env!("CARGO_BIN_EXE_recorder")).args(arguments).current_dir(folder).env_clear().output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    format!("{}{}exit code {}", text(&output.stdout), text(&output.stderr), output.status.code().unwrap())
}

#[test]
fn info_shows_what_a_recording_holds() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.mcap"), mcap_of(&synthetic::episode("crossing-1", SMALL))).unwrap();
    let shown = recorder(folder.path(), &["info", "--settings", "a.mcap"]);
    // The compressed size may change with zstd.
    insta::assert_snapshot!(shown.replace(&shown[..shown.find('\n').unwrap()], "a.mcap  SIZE"));
}

#[test]
fn info_says_up_to_where_a_cut_file_goes() {
    let folder = tempfile::tempdir().unwrap();
    let whole = mcap_of(&synthetic::episode("crossing-1", Size { agents: 40, steps: 60, futures: 1 }));
    std::fs::write(folder.path().join("a.mcap.partial"), &whole[..whole.len() / 2]).unwrap();
    let shown = recorder(folder.path(), &["info", "a.mcap.partial"]);
    assert!(shown.contains("  cut off     after ") && shown.contains("end         not recorded"), "{shown}");
    assert!(shown.ends_with("exit code 0"), "{shown}");
}

#[test]
fn a_recording_with_a_flipped_bit_is_damaged_and_not_cut_off() {
    let folder = tempfile::tempdir().unwrap();
    let mut bytes = mcap_of(&synthetic::episode("crossing-1", Size { agents: 40, steps: 150, futures: 2 }));
    let place = bytes.len() / 2;
    bytes[place] ^= 0x10;
    std::fs::write(folder.path().join("a.mcap"), bytes).unwrap();
    let shown = recorder(folder.path(), &["info", "a.mcap"]);
    assert!(shown.contains("  damaged     after ") && !shown.contains("cut off"), "{shown}");
    assert!(
        shown.contains("  not whole   observations ") && shown.contains("  end         horizon reached"),
        "{shown}"
    );
    let shown = recorder(folder.path(), &["export", "a.mcap"]);
    assert!(shown.contains("warning: a.mcap is damaged (") && shown.ends_with("exit code 0"), "{shown}");
}

#[test]
fn a_recording_that_says_something_else_than_was_told_is_found_out() {
    let folder = tempfile::tempdir().unwrap();
    let mut episode = synthetic::episode("crossing-1", SMALL);
    let record = episode.iter_mut().find(|message| message.channel() == Channel::Record).unwrap();
    *record =
        Message::encode(Body::Record(Box::new(proto::StepRecord { at_fault_collision: true, ..Default::default() })));
    std::fs::write(folder.path().join("a.mcap"), mcap_of(&episode)).unwrap();
    let shown = recorder(folder.path(), &["info", "a.mcap"]);
    assert!(shown.contains("\n  changed     it does not hold what was told: its digest is another\n"), "{shown}");
}

#[test]
fn a_file_without_an_end_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    for command in ["info", "export"] {
        let shown = recorder(folder.path(), &[command, "/dev/zero"]);
        assert!(shown.starts_with("error: /dev/zero is no recording: it has more than 1024 MiB\n"), "{shown}");
        assert!(shown.ends_with("exit code 2"), "{shown}");
    }
}

#[test]
fn export_draws_what_recording_draws() {
    let folder = tempfile::tempdir().unwrap();
    let episode = synthetic::episode("crossing-1", SMALL);
    std::fs::write(folder.path().join("a.mcap"), mcap_of(&episode)).unwrap();
    assert_eq!(recorder(folder.path(), &["export", "a.mcap"]), "a.rrd\nexit code 0");
    assert!(std::fs::read(folder.path().join("a.rrd")).unwrap() == crate::rrd_of(&episode));
    assert_eq!(
        recorder(folder.path(), &["export", "a.mcap", "--run", "other", "--rrd", "b.rrd"]),
        "b.rrd\nexit code 0"
    );
    assert!(std::fs::read(folder.path().join("b.rrd")).unwrap() != crate::rrd_of(&episode));
}

#[test]
fn export_replaces_nothing_unasked_and_never_its_own_recording() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    let episode = synthetic::episode("crossing-1", SMALL);
    let recording = mcap_of(&episode);
    std::fs::write(file("a.mcap"), &recording).unwrap();
    std::fs::write(file("b.mcap.partial"), &recording).unwrap();
    std::fs::write(file("a.rrd"), "mine").unwrap();
    std::fs::write(file("b.rrd.partial"), "the live recorder's").unwrap();
    std::os::unix::fs::symlink("a.mcap", file("link.rrd")).unwrap();
    let shown = [
        recorder(folder.path(), &["export", "a.mcap", "--rrd", "a.mcap", "--force"]),
        recorder(folder.path(), &["export", "a.mcap", "--rrd", "link.rrd", "--force"]),
        recorder(folder.path(), &["export", "b.mcap.partial", "--rrd", "b.mcap"]),
        recorder(folder.path(), &["export", "a.mcap"]),
        recorder(folder.path(), &["export", "b.mcap.partial"]),
    ];
    insta::assert_snapshot!(shown.join("\n\n"));
    assert!(std::fs::read(file("a.mcap")).unwrap() == recording);
    assert!(std::fs::read(file("b.mcap.partial")).unwrap() == recording);
    assert_eq!(std::fs::read(file("a.rrd")).unwrap(), b"mine");
    assert_eq!(recorder(folder.path(), &["export", "a.mcap", "--force"]), "a.rrd\nexit code 0");
    assert!(std::fs::read(file("a.rrd")).unwrap() == crate::rrd_of(&episode));
}

#[test]
fn what_is_no_recording_is_refused_with_a_reason() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("noise.mcap"), b"What is this?").unwrap();
    let shown = [
        recorder(folder.path(), &["info", "nowhere.mcap"]),
        recorder(folder.path(), &["info", "noise.mcap"]),
        recorder(folder.path(), &["export", "noise.mcap"]),
        recorder(folder.path(), &["record", "--endpoint", "tcp/127.0.0.1:1", "--run", "a/b", "--out", "x"]),
    ];
    insta::assert_snapshot!(shown.join("\n\n"));
}

#[test]
fn the_help() {
    let folder = tempfile::tempdir().unwrap();
    let shown = ["--help", "record", "export", "info"].map(|command| {
        let arguments = if command == "--help" { vec![command] } else { vec![command, "--help"] };
        recorder(folder.path(), &arguments)
    });
    insta::assert_snapshot!(shown.join("\n\n"));
}
