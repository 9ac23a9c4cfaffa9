//! The binary: what it prints and how it ends.

use std::path::Path;
use std::process::{Command, Stdio};

use insta::assert_snapshot;
use scenarios::generated::{FAMILIES, Family};

use crate::road;

/// Runs `scenarios` in `folder`: its output, its errors and its exit code, as a person would see them.
pub(crate) fn run_in(folder: &Path, arguments: &[&str]) -> String {
    let mut command = Command::new(env!("CARGO_BIN_EXE_scenarios"));
    let output =
        command.args(arguments).current_dir(folder).env_remove("RUST_LOG").env("COLUMNS", "100").output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
    let part = |name: &str, text: String| if text.is_empty() { String::new() } else { format!("--- {name}\n{text}") };
    let parts = [part("stdout", text(&output.stdout)), part("stderr", text(&output.stderr))].concat();
    format!("{parts}--- exit {}\n", output.status.code().unwrap())
}

fn run(arguments: &[&str]) -> String {
    run_in(tempfile::tempdir().unwrap().path(), arguments)
}

/// Writes `road.tfrecord`, whose scenes are no generator's: `clean`, in which there is nothing to find, and `crash`, in which the AV drives over
/// what stands on the road.
fn write_road(folder: &Path) {
    let mut crash = road::scene("crash");
    let mut stands = crash.tracks[crash.av_index].states[40];
    stands.as_mut().unwrap().length = 4.0;
    crash.tracks[0].states = vec![stands; road::STEPS];
    crash.map.lanes.iter_mut().for_each(|lane| lane.speed_limit_mph = 0.0);
    let mut file = Vec::new();
    for parts in [road::scene("clean"), crash] {
        let (scene, _) = parts.check().unwrap();
        scenarios::tfrecord::append_record(&mut file, &scenarios::womd::write(&scene));
    }
    std::fs::write(folder.join("road.tfrecord"), file).unwrap();
}

fn run_on_road(arguments: &[&str]) -> String {
    let folder = tempfile::tempdir().unwrap();
    write_road(folder.path());
    run_in(folder.path(), arguments)
}

#[test]
fn list() {
    assert_snapshot!(run_on_road(&["list", "road.tfrecord"]));
}

#[test]
fn the_demo_set_is_listed_and_there_is_nothing_wrong_with_it() {
    let list = run(&["list"]);
    let rows: Vec<&str> = list.lines().filter(|line| line.starts_with("demo-")).collect();
    assert_eq!(rows.len(), FAMILIES.len(), "{list}");
    for (row, Family { name, .. }) in rows.iter().zip(FAMILIES) {
        assert!(row.starts_with(&format!("demo-{name} ")), "{row}");
        assert!(row.ends_with(&format!("  0  generated {name}, seed 0, scene 0")), "no errors: {row}");
    }
    assert!(list.ends_with("--- exit 0\n"), "{list}");
    let lint = run(&["lint", "--at-least", "error"]);
    assert!(lint.contains(&format!("{} scenes: no errors", FAMILIES.len())), "{lint}");
    assert!(lint.ends_with("--- exit 0\n"), "{lint}");
}

#[test]
fn inspect() {
    assert_snapshot!(run_on_road(&["inspect", "road.tfrecord"]));
}

#[test]
fn a_generated_scene_says_what_it_was_made_of() {
    let said = run(&["inspect", "demo", "--scene", "demo-red-light", "--scene", "demo-crosswalk"]);
    let lines: Vec<&str> = said.lines().collect();
    assert_eq!(lines[1..3], ["demo-red-light", "  from      generated red-light, seed 0, scene 0"], "{said}");
    assert!(lines.contains(&"  from      generated crosswalk, seed 0, scene 0"), "{said}");
}

#[test]
fn lint() {
    assert_snapshot!(run_on_road(&["lint", "road.tfrecord"]));
}

#[test]
fn lint_of_a_clean_scene() {
    assert_snapshot!(run_on_road(&["lint", "road.tfrecord", "--scene", "clean"]));
}

#[test]
fn lint_of_a_scene_that_cannot_be_judged_exits_with_1() {
    let folder = tempfile::tempdir().unwrap();
    let parts = world::scene::SceneParts { map: world::map::Map::default(), ..road::scene("nowhere") };
    let (scene, _) = parts.check().unwrap();
    let mut file = Vec::new();
    scenarios::tfrecord::append_record(&mut file, &scenarios::womd::write(&scene));
    std::fs::write(folder.path().join("x.tfrecord"), file).unwrap();
    assert_snapshot!(run_in(folder.path(), &["lint", "x.tfrecord", "--at-least", "error"]));
}

#[test]
fn export_and_list_again() {
    let folder = tempfile::tempdir().unwrap();
    write_road(folder.path());
    let first = run_in(folder.path(), &["export", "road.tfrecord", "--out", "scenes"]);
    let again = run_in(folder.path(), &["export", "road.tfrecord", "--out", "scenes"]);
    let list = run_in(folder.path(), &["list", "scenes"]);
    assert_snapshot!([first, again, list].concat());
}

#[test]
fn errors_say_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8]| std::fs::write(folder.path().join(name), bytes).unwrap();
    write("cut.tfrecord", &[0x73, 0x8a, 0x0e, 0, 0, 0, 0, 0, 0x19, 0x37, 0x44, 0x11, 9, 9]);
    write("packed.tfrecord.gz", &[0x1f, 0x8b, 8, 0, 0, 0, 0, 0, 0, 3, 1, 2, 3]);
    write("notes.txt", b"dear diary");
    write("typo.toml", b"file = ['x']\n");
    write("family.toml", b"[[generate]]\nfamily = 'spaghetti-junction'\n");
    write("name.toml", b"[[generate]]\nfamily = 'curve'\nname = 'a b'\n");
    write("range.toml", b"[[generate]]\nfamily = 'all'\nparameters = { traffic = 'much' }\n");
    write("many.toml", b"[[generate]]\nfamily = 'curve'\ncount = 100000000\n");
    write("nope.toml", b"files = ['data/nope.tfrecord']\n");
    write("none.toml", b"globs = ['data/*']\n");
    write("sd_training.tfrecord-0.pkl", b"\x80\x04\x95\x0b\0\0\0\0\0\0\0}\x94\x8c\x01a\x94K\x01s.");
    std::fs::create_dir(folder.path().join("empty")).unwrap();
    let inputs = "cut.tfrecord packed.tfrecord.gz sd_training.tfrecord-0.pkl notes.txt typo.toml family.toml name.toml range.toml many.toml \
                  nope.toml none.toml empty gone *.none";
    let mut texts: Vec<String> = inputs.split(' ').map(|input| run_in(folder.path(), &["list", input])).collect();
    texts.push(run_in(folder.path(), &["export", "demo", "--out", "notes.txt"]));
    assert_snapshot!(texts.concat());
}

#[test]
fn an_unknown_scene_and_wrong_usage() {
    assert_snapshot!(
        [run(&["list", "--scene", "demo-spaghetti-junction"]), run(&["lint", "--at-least", "much"])].concat()
    );
}

#[test]
fn a_reader_that_has_seen_enough_is_no_error() {
    let mut command = Command::new(env!("CARGO_BIN_EXE_scenarios"));
    let mut child = command.arg("inspect").stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success(), "{output:?}");
    assert!(output.stderr.is_empty(), "{output:?}");
}

#[test]
fn the_word_demo_means_the_built_in_set_whatever_lies_here_by_that_name() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("demo")).unwrap();
    let built_in = run_in(folder.path(), &["list", "demo"]);
    assert!(
        built_in.contains("demo-following") && built_in.contains("what lies here by that name is ./demo"),
        "{built_in}"
    );
    let own = run_in(folder.path(), &["list", "./demo"]);
    assert!(own.contains("error: the folder ./demo holds no scenes"), "{own}");
}

#[test]
fn samples_are_fetched_after_the_licence_alone_and_only_those_that_are_known() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("other.whl"), "another package").unwrap();
    std::fs::create_dir(folder.path().join("there")).unwrap();
    std::fs::write(folder.path().join("there/1.pkl"), "mine").unwrap();
    let fetch = |rest: &[&str]| run_in(folder.path(), &[&["fetch", "metadrive-samples"], rest].concat());
    let unasked = fetch(&["--out", "samples"]);
    assert!(
        unasked.contains("non-commercial use alone") && unasked.contains("https://waymo.com/open/terms"),
        "{unasked}"
    );
    assert!(
        unasked.contains("error: the licence has to be agreed to") && unasked.ends_with("--- exit 2\n"),
        "{unasked}"
    );
    let wrong = fetch(&["--out", "samples", "--yes", "--from", "other.whl"]);
    assert!(wrong.contains("error: other.whl has the SHA-256 ") && wrong.contains("nothing of it was used"), "{wrong}");
    assert!(!folder.path().join("samples").exists());
    let gone = fetch(&["--out", "samples", "--yes", "--from", "gone.whl"]);
    assert!(gone.contains("error: gone.whl: "), "{gone}");
    let there = fetch(&["--out", "there", "--yes", "--from", "other.whl"]);
    assert!(there.contains("error: there/1.pkl is there already"), "{there}");
}
