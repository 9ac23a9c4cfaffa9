//! Scenes that are damaged, replaced or packed.

use std::fs;

use results::folder::read_run_file;
use results::parquet::Table;

use crate::stage::{Stage, assert_same};

/// A stage with the folder `scenes`: the small set, a file a scene.
fn stage() -> Stage {
    let stage = Stage::new();
    export(&stage, "small.toml");
    stage
}

fn export(stage: &Stage, set: &str) {
    let output = stage.beside("scenarios").args(["export", set, "--out", "scenes", "--force"]).output().unwrap();
    assert!(output.status.success(), "{output:?}");
}

fn column(stage: &Stage, run: &str, name: &str) -> Vec<String> {
    Table::read(&stage.path(run).join("results.parquet")).unwrap().text(name).unwrap()
}

const RUN: &str = "run --driver idm --scenarios scenes --record none --parallel 1";

#[test]
fn a_damaged_scene_costs_its_own_episode_unless_all_are_verified_first() {
    let stage = stage();
    stage.good_sim(&format!("{RUN} --out whole"));
    let path = stage.path("scenes/following-3-0.tfrecord");
    let sound = fs::read(&path).unwrap();
    let mut bytes = sound.clone();
    // Behind its id, near its end.
    let at = bytes.len() - 1000;
    bytes[at] ^= 1;
    fs::write(&path, bytes).unwrap();

    let verified = stage.sim(&format!("{RUN} --verify --out run"));
    assert_eq!(verified.code, Some(2), "{verified:?}");
    let named = "scenes/following-3-0.tfrecord: record 0 at byte 0: the checksum of the payload is ";
    assert!(verified.err.contains(named) && !stage.path("run").exists(), "{verified:?}");

    let ended = stage.sim(&format!("{RUN} --out run"));
    assert_eq!(ended.code, Some(1), "{ended:?}");
    assert_eq!(column(&stage, "run", "end_reason")[1], "undrivable");
    assert!(column(&stage, "run", "end_detail")[1].contains(named));
    for other in [0, 2] {
        let of = |run: &str| column(&stage, run, "episode_sha256")[other].clone();
        assert_eq!(of("run"), of("whole"));
    }
    let hashes = |run: &str| -> Vec<String> {
        let file = read_run_file(&stage.path(run)).unwrap().unwrap();
        file.scenes.into_iter().map(|line| line.sha256).collect()
    };
    let whole = hashes("whole");
    assert!(whole.iter().all(|hash| hash.len() == 64), "{whole:?}");
    assert_eq!(hashes("run"), [whole[0].clone(), String::new(), whole[2].clone()]);
    assert_eq!(column(&stage, "run", "scene_sha256"), hashes("run"));
    let again = stage.sim(&format!("{RUN} --out run"));
    assert!(again.err.contains("is finished already"), "{again:?}");
    // Whoever judges the drives again judges those that there are.
    for judged in ["validity run", "score run --as nuplan,navsim", "report run --html page.html"] {
        let ended = stage.sim(judged);
        assert!(!ended.err.contains("error: ") && !ended.out.is_empty(), "{judged}: {ended:?}");
    }
    // It is fetched again, and driven then.
    fs::write(&path, sound).unwrap();
    stage.good_sim(&format!("{RUN} --out run --retry failed"));
    assert_same(&stage.files("whole"), &stage.files("run"));
    assert_eq!(hashes("run"), whole);
}

#[test]
fn a_stopped_run_goes_on_over_the_same_scenes_alone() {
    let stage = stage();
    stage.good_sim(&format!("{RUN} --out whole"));
    let mut sim = stage.start(&format!("{RUN} --out run"));
    crate::stage::wait_until("an episode is done", || stage.parts("run") > 0);
    sim.kill().unwrap();
    sim.wait().unwrap();
    stage.wait_until_alone();
    // A scene of the same name that is another one.
    let small = fs::read_to_string(stage.path("small.toml")).unwrap();
    fs::write(stage.path("other.toml"), small.replace("people = 0.5", "people = 0.6")).unwrap();
    export(&stage, "other.toml");
    for run in ["run", "whole"] {
        let refused = stage.sim(&format!("{RUN} --out {run}"));
        assert_eq!(refused.code, Some(2), "{refused:?}");
        assert!(refused.err.contains(" has other content"), "{refused:?}");
    }
    export(&stage, "small.toml");
    stage.good_sim(&format!("{RUN} --out run"));
    assert_same(&stage.files("whole"), &stage.files("run"));
    let settings = |run: &str| fs::read(stage.path(run).join("run.toml")).unwrap();
    assert!(settings("run") == settings("whole"));
}

#[test]
fn nodes_that_read_the_log_find_scenes_wherever_they_are_and_leave_nothing() {
    let stage = Stage::new();
    for (folder, packed) in [("plain", None), ("packed", Some("--gzip"))] {
        let words = ["generate", "--family", "following,curve", "--count", "2", "--seed", "3", "--out", folder];
        let output = stage.beside("scenarios").args(words).args(packed).output().unwrap();
        assert!(output.status.success(), "{output:?}");
    }
    let words = ["index", "packed", "--out", "packed.index"];
    assert!(stage.beside("scenarios").args(words).status().unwrap().success());
    let made = |family| format!("[[generate]]\nfamily = '{family}'\nseed = 3\ncount = 2\n");
    fs::write(stage.path("made.toml"), made("curve") + &made("following")).unwrap();
    fs::create_dir(stage.path("tmp")).unwrap();
    for scenes in ["made.toml", "plain", "packed", "packed.index"] {
        let words =
            format!("run --driver human --predictor oracle --record none --scenarios {scenes} --out of-{scenes}");
        let output = stage.command(&words).env("TMPDIR", stage.path("tmp")).output().unwrap();
        assert!(output.status.success(), "{output:?}");
        assert_eq!(fs::read_dir(stage.path("tmp")).unwrap().count(), 0);
        assert_same(&stage.files("of-made.toml"), &stage.files(&format!("of-{scenes}")));
    }
}
