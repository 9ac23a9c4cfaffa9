//! `scenarios generate` and `families`: what lies in the folder afterwards, whatever happened in between.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

use insta::assert_snapshot;
use scenarios::generated::{COMMON, FAMILIES, Parameter};
use scenarios::{SceneEntry, SceneSet};

use crate::cli::run_in;

/// Runs `scenarios generate` in `folder`; how large scenes are is the families' affair.
fn generate(folder: &Path, arguments: &str) -> String {
    let words: Vec<&str> = ["generate"].into_iter().chain(arguments.split_whitespace()).collect();
    let said = run_in(folder, &words);
    match said.split_once(" (").zip(said.split_once(" MB)")) {
        Some(((before, _), (_, after))) => format!("{before} (N MB){after}"),
        None => said,
    }
}

/// All files of a folder, by name.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let name = |entry: &fs::DirEntry| entry.file_name().to_string_lossy().into_owned();
    fs::read_dir(folder).unwrap().map(Result::unwrap).map(|e| (name(&e), fs::read(e.path()).unwrap())).collect()
}

fn open(folder: &Path) -> SceneSet {
    SceneSet::open(&[folder.to_string_lossy().into_owned()]).unwrap()
}

const TWO: &str = "--family curve,following --count 5 --seed 7 --shard-size 2";

#[test]
fn scenes_lie_in_shards_and_a_second_time_nothing_is_made() {
    let folder = tempfile::tempdir().unwrap();
    let first = generate(folder.path(), &format!("{TWO} --out scenes"));
    let again = generate(folder.path(), &format!("{TWO} --out scenes"));
    let names: Vec<String> = files(&folder.path().join("scenes")).into_keys().collect();
    assert_snapshot!([first, again, names.join("\n")].concat());
}

#[test]
fn the_bytes_are_the_same_for_any_number_of_threads_and_after_any_interruption() {
    for packed in ["", "--gzip"] {
        let folder = tempfile::tempdir().unwrap();
        let make = |name: &str, more: &str| generate(folder.path(), &format!("{TWO} {packed} --out {name} {more}"));
        make("one", "--jobs 1");
        make("three", "--jobs 3");
        let whole = files(&folder.path().join("one"));
        assert_eq!(whole.len(), 7);
        assert!(whole == files(&folder.path().join("three")), "threads make a difference");
        // As a process leaves it that is killed in the middle of a shard.
        let three = folder.path().join("three");
        for (name, bytes) in whole.iter().filter(|(name, _)| name.starts_with("following") || name.contains("-00001-"))
        {
            fs::remove_file(three.join(name)).unwrap();
            fs::write(three.join(format!("{name}.partial")), &bytes[..bytes.len() / 2]).unwrap();
        }
        let said = make("three", "--jobs 2");
        assert!(said.contains("note: 2 of 6 shards are there already and stay"), "{said}");
        assert!(whole == files(&three), "an interruption makes a difference");
    }
}

#[test]
fn what_is_written_is_what_a_scene_set_gives() {
    let folder = tempfile::tempdir().unwrap();
    generate(folder.path(), &format!("{TWO} --out plain"));
    generate(folder.path(), &format!("{TWO} --out packed --gzip"));
    let wish = |family: &str| format!("[[generate]]\nfamily = '{family}'\nseed = 7\ncount = 5\n");
    fs::write(folder.path().join("set.toml"), wish("curve") + &wish("following")).unwrap();
    let hashes = |input: &str| -> Vec<(String, String)> {
        let set = open(&folder.path().join(input));
        let hash = |(at, entry): (usize, &SceneEntry)| (entry.id.to_string(), set.sha256(at).unwrap());
        set.entries().iter().enumerate().map(hash).collect()
    };
    assert_eq!(hashes("plain"), hashes("set.toml"));
    assert_eq!(hashes("packed"), hashes("set.toml"));
    let globbed = SceneSet::open(&[folder.path().join("plain/*").to_string_lossy().into_owned()]).unwrap();
    assert_eq!((globbed.entries().len(), globbed.notes().len()), (10, 0), "the settings are no scenes");
}

#[test]
fn a_folder_takes_scenes_of_one_command_alone() {
    let folder = tempfile::tempdir().unwrap();
    let mut said = vec![generate(folder.path(), "--family curve --count 2 --out scenes")];
    let mut again = |arguments: &str| said.push(generate(folder.path(), &format!("{arguments} --out scenes")));
    again("--family curve --count 3 --seed 4 --gzip");
    again("--family curve --count 3 --seed 4 --gzip --force");
    let path = folder.path().join("scenes/generated.toml");
    let settings = fs::read_to_string(&path).unwrap();
    let from = settings.rfind('"').unwrap() - 64;
    fs::write(&path, [&settings[..from], "not", &settings[from + 3..]].concat()).unwrap();
    again("--family curve --count 3 --seed 4 --gzip");
    fs::write(&path, "count = 'many'").unwrap();
    again("--family curve --count 1");
    fs::remove_file(&path).unwrap();
    again("--family curve --count 3 --seed 4 --gzip");
    again("--family curve --count 1 --force");
    assert_snapshot!(said.concat());
    let names: Vec<String> = files(&folder.path().join("scenes")).into_keys().collect();
    assert_eq!(names, ["curve-0.tfrecord-00000-of-00001", "curve-4.tfrecord-00000-of-00001.gz", "generated.toml"]);
}

#[test]
fn two_do_not_generate_into_one_folder_at_a_time() {
    let folder = tempfile::tempdir().unwrap();
    let lock = fs::File::create(folder.path().join("generated.toml")).unwrap();
    lock.lock().unwrap();
    assert_snapshot!(generate(folder.path(), "--family curve --count 1 --out ."));
    drop(lock);
    assert!(generate(folder.path(), "--family curve --count 1 --out .").contains("1 scene in ."));
}

#[test]
fn wrong_usage_says_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("file"), "").unwrap();
    let said = [
        "",
        "--family spaghetti-junction --count 1 --out x",
        "--family all --count 0 --out x",
        "--family all --count 1 --out x --jobs 0",
        "--family all --count 1 --out x --shard-size 0",
        "--family all --count 1 --out x --seed 9223372036854775808",
        "--family all --count 1 --out x --set gap",
        "--family all --count 1 --out x --set gap=1 --set gap=2",
        "--family all --count 1 --out file",
    ]
    .map(|arguments| generate(folder.path(), arguments));
    assert_snapshot!(said.concat() + &run_in(folder.path(), &["families", "spaghetti-junction"]));
    assert!(!folder.path().join("x").exists(), "wrong usage leaves no folder");
    let unknown = generate(folder.path(), "--family all --count 1 --out x --set moons=2");
    assert!(unknown.contains("has no parameter moons; it has "), "{unknown}");
}

#[test]
fn every_family_is_listed_and_shown() {
    let folder = tempfile::tempdir().unwrap();
    let list = run_in(folder.path(), &["families"]);
    for family in FAMILIES {
        assert!(list.lines().any(|line| line.starts_with(family.name) && line.ends_with(family.about)), "{list}");
        let shown = run_in(folder.path(), &["families", family.name]);
        assert!(shown.contains(family.about) && shown.ends_with("--- exit 0\n"), "{shown}");
        assert!(family.all_parameters().all(|parameter| shown.contains(parameter.about)), "{shown}");
    }
}

#[test]
fn the_docs_tell_of_every_family_and_parameter() {
    let page = include_str!("../../../docs/scenes.md");
    let names = |parameters: &[Parameter]| {
        parameters.iter().map(|parameter| format!("`{}`", parameter.name)).collect::<Vec<_>>().join(", ")
    };
    for family in FAMILIES {
        let row = format!("| `{}` | {} | {} |", family.name, family.about, names(family.parameters));
        assert!(page.contains(&row), "docs/scenes.md lacks\n{row}");
    }
    for Parameter { name, about, .. } in COMMON {
        let row = format!("| `{name}` | {about} |");
        assert!(page.contains(&row), "docs/scenes.md lacks\n{row}");
    }
}

#[test]
fn ctrl_c_leaves_whole_shards() {
    let folder = tempfile::tempdir().unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_scenarios"));
    command.current_dir(folder.path()).args("generate --family all --count 100000 --shard-size 2 --out x".split(' '));
    let mut child = command.stderr(std::process::Stdio::piped()).spawn().unwrap();
    let shards = || fs::read_dir(folder.path().join("x")).map_or(0, Iterator::count);
    for _ in 0..600 {
        if shards() > 4 {
            break;
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    let names: Vec<String> = files(&folder.path().join("x")).into_keys().collect();
    assert!(names.iter().all(|name| name == "generated.toml" || name.ends_with("-of-50000")), "{names:?}");
    assert_eq!(open(&folder.path().join("x")).entries().len(), 2 * (names.len() - 1));
}
