//! What a scene set can be made of, and in what order.

use std::fs;
use std::path::Path;
use std::sync::Arc;

use scenarios::generated::{FAMILIES, Family};
use scenarios::{SceneSet, SetError, tfrecord};

/// A folder with `a/2.tfrecord` (scenes c, d), `a/1.tfrecord-00000-of-00001` (b), a pickle, `b.tfrecord` (a) and a text.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, ids: &[&str]| {
        let mut file = Vec::new();
        for id in ids {
            tfrecord::append_record(
                &mut file,
                &Family::named("curve").unwrap().payload(id, 1, 0, &Default::default()).unwrap(),
            );
        }
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, file).unwrap();
    };
    write("a/2.tfrecord", &["c", "d"]);
    write("a/1.tfrecord-00000-of-00001", &["b"]);
    write("b.tfrecord", &["a"]);
    write("renamed.bin", &["e"]);
    fs::write(folder.path().join("a/sd_training.tfrecord-00000.pkl"), b"\x80\x04.").unwrap();
    fs::write(folder.path().join("notes.txt"), "nothing").unwrap();
    folder
}

fn open(folder: &Path, inputs: &[&str]) -> Result<SceneSet, SetError> {
    let full =
        |input: &&str| if *input == "demo" { "demo".into() } else { folder.join(input).to_string_lossy().into_owned() };
    SceneSet::open(&inputs.iter().map(full).collect::<Vec<String>>())
}

fn ids(folder: &Path, inputs: &[&str]) -> Vec<String> {
    open(folder, inputs).unwrap().entries().iter().map(|entry| entry.id.to_string()).collect()
}

#[test]
fn folders_go_by_names_files_by_records_and_inputs_as_they_are_given() {
    let folder = folder();
    assert_eq!(ids(folder.path(), &[""]), ["b", "c", "d", "a"]);
    assert_eq!(ids(folder.path(), &["b.tfrecord", "a"]), ["a", "b", "c", "d"]);
    assert_eq!(ids(folder.path(), &["*.tfrecord", "a/*-of-*"]), ["a", "b"]);
    assert_eq!(ids(folder.path(), &["renamed.bin"]), ["e"], "a TFRecord by another name goes by content");
}

#[test]
fn nothing_means_the_demo_set() {
    let set = SceneSet::open(&[]).unwrap();
    let names: Vec<String> = FAMILIES.iter().map(|family| format!("demo-{}", family.name)).collect();
    assert_eq!(set.entries().iter().map(|entry| entry.id.to_string()).collect::<Vec<_>>(), names);
    let again = SceneSet::open(&["demo".into()]).unwrap();
    assert_eq!(set.entries(), again.entries());
}

#[test]
fn a_scene_set_file_takes_files_globs_and_families_and_keeps_what_it_names() {
    let folder = folder();
    let write = |text: &str| fs::write(folder.path().join("set.toml"), text).unwrap();
    write("files = ['b.tfrecord', 'a']\n[[generate]]\nfamily = 'cut-in'\nseed = 7\ncount = 2");
    assert_eq!(ids(folder.path(), &["set.toml"]), ["a", "b", "c", "d", "cut-in-7-0", "cut-in-7-1"]);
    write("[[generate]]\nfamily = 'cut-in'\nname = 'near'");
    assert_eq!(ids(folder.path(), &["set.toml"]), ["near-0-0"]);
    write("[[generate]]\nfamily = 'cut-in'\nparameters = { moons = 2 }");
    let error = open(folder.path(), &["set.toml"]).unwrap_err();
    assert!(error.to_string().contains("cut-in has no parameter moons; it has "), "{error}");
    write("globs = ['a/[12]*']\nscenes = ['d', 'b']");
    assert_eq!(ids(folder.path(), &["set.toml"]), ["b", "d"], "kept in the set's order");
    write("globs = ['a/[12]*']\nscenes = ['d', 'x', 'y']");
    let error = open(folder.path(), &["set.toml"]).unwrap_err();
    assert!(error.to_string().ends_with("`scenes` names x, y, which none of its files holds"), "{error}");
}

fn notes(folder: &Path, inputs: &[&str]) -> Vec<String> {
    let set = open(folder, inputs).unwrap();
    set.notes().iter().map(|note| note.to_string().replace(&*folder.to_string_lossy(), "HERE")).collect()
}

#[test]
fn a_record_that_is_there_again_counts_once_and_another_of_its_id_is_an_error_that_names_both_places() {
    let folder = folder();
    assert_eq!(ids(folder.path(), &["a", "a/2.tfrecord"]), ["b", "c", "d"]);
    assert_eq!(
        notes(folder.path(), &["b.tfrecord", "b.tfrecord"]),
        ["the scene a counts once: HERE/b.tfrecord (record 0) has the same bytes as HERE/b.tfrecord (record 0)"]
    );
    let mut file = Vec::new();
    tfrecord::append_record(
        &mut file,
        &Family::named("curve").unwrap().payload("c", 2, 0, &Default::default()).unwrap(),
    );
    fs::write(folder.path().join("other.tfrecord"), file).unwrap();
    let error = open(folder.path(), &["a", "other.tfrecord"]).unwrap_err();
    let SetError::Duplicate { id, places } = error else { panic!("{error}") };
    assert_eq!(id.as_str(), "c");
    assert!(places[0].to_string().contains("2.tfrecord (record 0)"));
    assert!(places[1].to_string().contains("other.tfrecord (record 0)"));
}

#[test]
fn side_files_are_passed_over_and_said() {
    let folder = folder();
    for name in ["a/2.tfrecord.index", "a/.2.tfrecord.swp", "a/2.tfrecord.md5", "a/2.tfrecord-00001-of-00002_.gstmp"] {
        fs::write(folder.path().join(name), "no records").unwrap();
    }
    assert_eq!(ids(folder.path(), &["a"]), ["b", "c", "d"]);
    assert_eq!(
        notes(folder.path(), &["a"]),
        ["HERE/a: passed over .2.tfrecord.swp, 2.tfrecord-00001-of-00002_.gstmp, 2.tfrecord.index and 2 more"]
    );
    assert_eq!(ids(folder.path(), &["a/2.tfrecord*"]), ["c", "d"]);
    let named = open(folder.path(), &["a/2.tfrecord.index"]).unwrap_err();
    assert!(matches!(named, SetError::Record(_)), "what is named itself is not passed over: {named}");
}

#[test]
fn all_means_each_family_and_a_name_goes_before() {
    let folder = tempfile::tempdir().unwrap();
    let write = |text: &str| fs::write(folder.path().join("set.toml"), text).unwrap();
    write("[[generate]]\nfamily = 'all'\nseed = 5");
    let names: Vec<String> = FAMILIES.iter().map(|family| format!("{}-5-0", family.name)).collect();
    assert_eq!(ids(folder.path(), &["set.toml"]), names);
    write("[[generate]]\nfamily = 'all'\nseed = 5\nname = 'n'");
    let names: Vec<String> = FAMILIES.iter().map(|family| format!("n-{}-5-0", family.name)).collect();
    assert_eq!(ids(folder.path(), &["set.toml"]), names);
}

#[test]
fn exclude_leaves_scenes_out() {
    let folder = folder();
    fs::write(folder.path().join("set.toml"), "files = ['a', 'b.tfrecord']\nexclude = ['c', 'x']").unwrap();
    assert_eq!(ids(folder.path(), &["set.toml"]), ["b", "d", "a"]);
    let said = notes(folder.path(), &["set.toml"]);
    assert_eq!(said[1], "HERE/set.toml: `exclude` names x, which none of its files holds");
}

#[test]
fn a_survey_goes_on_past_what_gives_no_scene() {
    let folder = folder();
    let mut file = Vec::new();
    tfrecord::append_record(&mut file, b"\x2a\x05laser\x62\x01\x00");
    tfrecord::append_record(
        &mut file,
        &Family::named("curve").unwrap().payload("e", 1, 0, &Default::default()).unwrap(),
    );
    tfrecord::append_record(&mut file, b"\xff\xff\xff");
    tfrecord::append_record(
        &mut file,
        &Family::named("curve").unwrap().payload("f", 1, 0, &Default::default()).unwrap(),
    );
    file.pop();
    fs::write(folder.path().join("a/0.tfrecord"), file).unwrap();
    let (set, bad) = SceneSet::survey(&[folder.path().join("a").to_string_lossy().into_owned()]).unwrap();
    assert_eq!(set.entries().iter().map(|entry| entry.id.as_str()).collect::<Vec<_>>(), ["e", "b", "c", "d"]);
    assert_eq!(bad.iter().map(|error| error.record).collect::<Vec<_>>(), [0, 2, 3]);
    assert!(bad[0].to_string().ends_with("the record holds the laser data of scene laser alone: no tracks and no map"));
    assert!(matches!(open(folder.path(), &["a"]).unwrap_err(), SetError::Record(error) if error.record == 0));
    // What tells its name can be left out by it.
    let set = |text: &str| {
        fs::write(folder.path().join("set.toml"), text).unwrap();
        SceneSet::survey(&[folder.path().join("set.toml").to_string_lossy().into_owned()]).unwrap().1.len()
    };
    assert_eq!((set("files = ['a']"), set("files = ['a']\nexclude = ['laser']")), (3, 2));
}

#[test]
fn a_path_that_is_not_there_is_told_by_what_it_looks_like() {
    let folder = folder();
    let error = |input: &str| {
        let error = open(folder.path(), &[input]).unwrap_err();
        format!("{error}\nhint: {}", error.hint()).replace(&*folder.path().to_string_lossy(), "HERE")
    };
    insta::assert_snapshot!(error("nowhere.tfrecord"), @"
    there is no HERE/nowhere.tfrecord
    hint: paths are relative to the folder that the command is called in; the word demo means the built-in scenes
    ");
    insta::assert_snapshot!(error("training_20s.tfrecord@1000"), @"
    there is no HERE/training_20s.tfrecord@1000: shards of that name are HERE/training_20s.tfrecord-00000-of-01000 and so on
    hint: give the shards by a glob, 'NAME-*-of-*', or their folder
    ");
    fs::write(folder.path().join("log"), b"SQLite format 3\0").unwrap();
    insta::assert_snapshot!(error("log"), @"
    HERE/log is an SQLite database (a nuPlan log?), not a TFRecord
    hint: nuPlan's logs are not read: give WOMD's TFRecord files, in scenario format
    ");
    fs::write(folder.path().join("scene"), b"\x80\x04\x95\x0b\0\0\0\0\0\0\0}").unwrap();
    insta::assert_snapshot!(error("scene"), @"
    HERE/scene: byte 12: the pickle is cut off: 1 more bytes belong to it here
    hint: the file is cut off, damaged or no pickle: fetch it again and compare its checksum
    ");
    fs::create_dir(folder.path().join("nuplan")).unwrap();
    fs::write(folder.path().join("nuplan/2021.db"), b"SQLite format 3\0").unwrap();
    insta::assert_snapshot!(error("nuplan"), @"
    the folder HERE/nuplan holds no scenes, but 2021.db
    hint: nuPlan's logs are not read: give WOMD's TFRecord files, in scenario format
    ");
}

#[test]
fn what_an_exported_file_holds_is_what_is_driven() {
    let folder = tempfile::tempdir().unwrap();
    let demo = SceneSet::open(&[]).unwrap();
    for (index, entry) in demo.entries().iter().enumerate() {
        let mut file = Vec::new();
        tfrecord::append_record(&mut file, &demo.payload(index).unwrap());
        fs::write(folder.path().join(format!("{index:03}-{}.tfrecord", entry.id)), file).unwrap();
    }
    let files = open(folder.path(), &[""]).unwrap();
    for index in 0..demo.entries().len() {
        assert_eq!(demo.sha256(index).unwrap(), files.sha256(index).unwrap());
        assert_eq!(demo.load(index).unwrap(), files.load(index).unwrap());
    }
}

#[test]
fn a_set_loads_from_many_threads() {
    let folder = folder();
    fs::write(folder.path().join("set.toml"), "[[generate]]\nfamily = 'cut-in'\ncount = 3").unwrap();
    let set = Arc::new(open(folder.path(), &["", "set.toml"]).unwrap());
    let alone: Vec<_> = (0..set.entries().len()).map(|index| set.load(index).unwrap()).collect();
    let threads: Vec<_> = (0..4)
        .map(|_| {
            let set = Arc::clone(&set);
            std::thread::spawn(move || (0..set.entries().len()).map(|i| set.load(i).unwrap()).collect::<Vec<_>>())
        })
        .collect();
    for thread in threads {
        assert_eq!(thread.join().unwrap(), alone);
    }
}
