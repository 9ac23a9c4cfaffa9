//! Real WOMD scenes.

use scenarios::{SceneSet, womd};

use crate::real_data;

fn open(folders: &[&str]) -> Option<SceneSet> {
    let data = real_data()?;
    let folders: Vec<String> = folders.iter().map(|f| data.join(f).to_string_lossy().into_owned()).collect();
    Some(SceneSet::open(&folders).unwrap())
}

#[test]
fn every_real_scene_loads() {
    let Some(set) = open(&["womd/9s", "womd-derived"]) else { return };
    assert_eq!(set.entries().len(), 2 + 7 + 4 + 39);
    for (index, entry) in set.entries().iter().enumerate() {
        let (scene, _) = set.load(index).unwrap();
        assert_eq!(scene.id(), &entry.id);
        let nine = entry.source.to_string().contains("9s");
        assert!(if nine { scene.steps() == 91 } else { (197..=200).contains(&scene.steps()) }, "{}", entry.id);
        assert!(scene.av().states.iter().all(Option::is_some), "{}: the AV is valid throughout", entry.id);
    }
}

#[test]
fn writing_and_reading_every_real_scene_is_the_identity() {
    let Some(set) = open(&["womd/9s", "womd-derived"]) else { return };
    for index in 0..set.entries().len() {
        let (scene, _) = set.load(index).unwrap();
        let bytes = womd::write(&scene);
        let (again, findings) = womd::read(&bytes).unwrap();
        assert_eq!(*scene, again);
        // What was odd has been mended, so only what cannot be mended is found again.
        assert!(findings.iter().all(|finding| !finding.to_string().contains("dropped")), "{findings:?}");
        assert_eq!(womd::write(&again), bytes);
    }
}

#[test]
fn counts_are_those_of_the_data_sets_table() {
    let Some(set) = open(&["womd-derived/20s"]) else { return };
    let index = set.entries().iter().position(|entry| entry.id.as_str() == "b36a6d0bc9e525bc").unwrap();
    let (scene, _) = set.load(index).unwrap();
    assert_eq!((scene.steps(), scene.map().lanes.len(), scene.map().crosswalks.len()), (200, 222, 10));
    assert_eq!(scene.map().stop_signs.len(), 7);
    assert_eq!((0..scene.steps()).filter(|step| !scene.signals(*step).is_empty()).count(), 183);
}

#[test]
fn packed_scenes_are_those_that_their_list_names() {
    let Some(data) = real_data() else { return };
    let Ok(list) = std::fs::read_to_string(data.join("train-9s/scenes.csv")) else {
        eprintln!("skipped: no packed scenes here");
        return;
    };
    let set = open(&["train-9s"]).unwrap();
    let listed: Vec<Vec<&str>> = list.lines().skip(1).map(|line| line.split(',').collect()).collect();
    assert_eq!((set.entries().len(), listed.len()), (419, 419));
    // Every twentieth, the last first: each is reached by itself.
    for index in (0..listed.len()).rev().step_by(20) {
        let (scene, _) = set.load(index).unwrap();
        assert_eq!(scene.id().as_str(), listed[index][0]);
        assert_eq!((scene.steps(), scene.tracks().len()), (91, listed[index][4].parse().unwrap()));
        assert_eq!(scene.map().lanes.len(), listed[index][11].parse::<usize>().unwrap());
    }
}
