//! An index stands for the set that it was made of.

use std::fs;
use std::path::Path;

use miniz_oxide::deflate::compress_to_vec_zlib;
use scenarios::generated::Family;
use scenarios::{IndexError, SceneSet, SetError, tfrecord};

fn records(ids: &[&str]) -> Vec<u8> {
    let family = Family::named("curve").unwrap();
    let mut file = Vec::new();
    for id in ids {
        tfrecord::append_record(&mut file, &family.payload(id, 1, 0, &Default::default()).unwrap());
    }
    file
}

/// A folder of a plain file, a packed one, and a scene set that names both beside generated scenes.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.tfrecord"), records(&["a", "b"])).unwrap();
    fs::write(folder.path().join("c.tfrecord"), compress_to_vec_zlib(&records(&["c", "d", "e"]), 6)).unwrap();
    let set = "files = ['a.tfrecord', 'c.tfrecord']\nexclude = ['d']\n[[generate]]\nfamily = 'cut-in'\nseed = 7\ncount = 2\n\
               parameters = { gap = [4.0, 7.1] }\n[[generate]]\nfamily = 'all'\n";
    fs::write(folder.path().join("set.toml"), set).unwrap();
    folder
}

fn open(path: &Path) -> Result<SceneSet, SetError> {
    SceneSet::open(&[path.to_string_lossy().into_owned()])
}

fn index(folder: &Path) -> SceneSet {
    let set = open(&folder.join("set.toml")).unwrap();
    fs::write(folder.join("scenes.index"), set.index(folder)).unwrap();
    set
}

fn problem(path: &Path) -> IndexError {
    match open(path).unwrap_err() {
        SetError::Index { problem, .. } => problem,
        error => panic!("{error}"),
    }
}

#[test]
fn it_holds_the_same_scenes_and_loads_them() {
    let folder = folder();
    let set = index(folder.path());
    let indexed = open(&folder.path().join("scenes.index")).unwrap();
    assert_eq!(set.entries(), indexed.entries());
    // The last ones first: a packed file is entered from its beginning, nothing else being known of it.
    for at in [8, 5, 4, 3, 2, 1, 0] {
        assert_eq!(set.load(at).unwrap(), indexed.load(at).unwrap());
        assert_eq!(set.sha256(at).unwrap(), indexed.sha256(at).unwrap());
    }
    // It stands wherever files do.
    fs::write(folder.path().join("of.toml"), "files = ['scenes.index']\nscenes = ['e', 'cut-in-7-1']").unwrap();
    let few = open(&folder.path().join("of.toml")).unwrap();
    assert_eq!(few.entries().iter().map(|entry| entry.id.as_str()).collect::<Vec<_>>(), ["e", "cut-in-7-1"]);
}

#[test]
fn it_moves_with_its_folder() {
    let folder = folder();
    let elsewhere = tempfile::tempdir().unwrap();
    index(folder.path());
    let moved = elsewhere.path().join("moved");
    fs::rename(folder.path(), &moved).unwrap();
    assert!(open(&moved.join("scenes.index")).unwrap().load(0).is_ok());
    // Alone it names places that are none any more.
    let alone = elsewhere.path().join("scenes.index");
    fs::copy(moved.join("scenes.index"), &alone).unwrap();
    assert!(matches!(problem(&alone), IndexError::Stale(file) if file.ends_with("a.tfrecord")));
}

#[test]
fn a_file_that_changed_makes_it_stale() {
    let folder = folder();
    let path = folder.path().join("scenes.index");
    let (a, c) = (folder.path().join("a.tfrecord"), folder.path().join("c.tfrecord"));
    let stale = |of: &Path| match problem(&path) {
        IndexError::Stale(file) => assert_eq!(file, of),
        problem => panic!("{problem}"),
    };
    index(folder.path());
    let file = fs::File::options().write(true).open(&a).unwrap();
    file.set_modified(std::time::UNIX_EPOCH + std::time::Duration::from_secs(9)).unwrap();
    stale(&a);
    index(folder.path());
    let times = fs::metadata(&c).unwrap().modified().unwrap();
    fs::write(&c, [fs::read(&c).unwrap(), vec![0]].concat()).unwrap();
    fs::File::options().write(true).open(&c).unwrap().set_modified(times).unwrap();
    stale(&c);
    fs::remove_file(&c).unwrap();
    stale(&c);
    // What changes behind its back is found when it is loaded.
    let folder = self::folder();
    index(folder.path());
    let set = open(&folder.path().join("scenes.index")).unwrap();
    let mut bytes = records(&["a", "x"]);
    bytes.truncate(records(&["a", "b"]).len());
    fs::write(folder.path().join("a.tfrecord"), bytes).unwrap();
    assert!(set.load(0).is_ok());
    assert!(set.load(1).unwrap_err().to_string().ends_with("the file has changed since it was opened"));
}

#[test]
fn a_damaged_one_is_refused() {
    let folder = folder();
    let path = folder.path().join("scenes.index");
    index(folder.path());
    let whole = fs::read(&path).unwrap();
    for at in (21..whole.len()).step_by(7) {
        let mut bytes = whole.clone();
        bytes[at] ^= 1;
        fs::write(&path, bytes).unwrap();
        assert!(matches!(problem(&path), IndexError::Damaged), "byte {at}");
    }
    fs::write(&path, &whole[..whole.len() - 1]).unwrap();
    assert!(matches!(problem(&path), IndexError::Damaged));
    fs::write(&path, [b"reloop scene index 2", &whole[20..]].concat()).unwrap();
    assert!(matches!(problem(&path), IndexError::Version));
}
