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
            tfrecord::append_record(&mut file, &Family::named("curve").unwrap().payload(id, 1, 0).unwrap());
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
    write("globs = ['a/[12]*']\nscenes = ['d', 'b']");
    assert_eq!(ids(folder.path(), &["set.toml"]), ["b", "d"], "kept in the set's order");
    write("globs = ['a/[12]*']\nscenes = ['d', 'x', 'y']");
    let error = open(folder.path(), &["set.toml"]).unwrap_err();
    assert!(error.to_string().ends_with("`scenes` names x, y, which none of its files holds"), "{error}");
}

#[test]
fn a_scene_that_is_there_twice_is_an_error_that_names_both_places() {
    let folder = folder();
    let error = open(folder.path(), &["a", "a/2.tfrecord"]).unwrap_err();
    let SetError::Duplicate { id, first, second } = error else { panic!("{error}") };
    assert_eq!(id.as_str(), "c");
    assert!(
        first.to_string().contains("2.tfrecord (record 0)") && second.to_string().contains("2.tfrecord (record 0)")
    );
}

#[test]
fn what_an_exported_file_holds_is_what_is_driven() {
    let folder = tempfile::tempdir().unwrap();
    let demo = SceneSet::open(&[]).unwrap();
    for (index, entry) in demo.entries().iter().enumerate() {
        let mut file = Vec::new();
        tfrecord::append_record(&mut file, &demo.payload(index).unwrap());
        fs::write(folder.path().join(format!("{index}-{}.tfrecord", entry.id)), file).unwrap();
    }
    let files = open(folder.path(), &[""]).unwrap();
    for index in 0..demo.entries().len() {
        assert_eq!(demo.entries()[index].sha256, files.entries()[index].sha256);
        assert_eq!(demo.load(index).unwrap(), files.load(index).unwrap());
    }
}

#[test]
fn a_set_loads_from_many_threads() {
    let folder = folder();
    let set = Arc::new(open(folder.path(), &["", "demo"]).unwrap());
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
