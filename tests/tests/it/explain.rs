//! What `planner-node explain` says of a plan that was chosen among proposals is what was driven.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use planner_node::explain::{Explanation, Trials, explain_step, read_step};

use crate::stage::{Stage, program};

/// Recordings of a run.
fn recordings(stage: &Stage, run: &str) -> Vec<PathBuf> {
    let files = fs::read_dir(stage.path(&format!("{run}/episodes"))).unwrap().map(|file| file.unwrap().path());
    let mut files: Vec<PathBuf> = files.filter(|path| path.extension().is_some_and(|kind| kind == "mcap")).collect();
    files.sort();
    files
}

/// All proposals of a step, tried again; the best, as it is found and as it is recorded.
fn tried(recording: &Path, step: u32) -> (Trials, (String, f64), (String, f64)) {
    let recorded = read_step(recording, step).unwrap();
    let Explanation::Trials(trials) = explain_step(step, &recorded, None).unwrap() else {
        panic!("{} was chosen among proposals", recording.display());
    };
    let told = recorded.plan.diagnostics();
    let (name, score) = trials.best().unwrap();
    let found = (name.to_owned(), score);
    (trials, found, (told.status.clone(), told.objective[0].1))
}

#[test]
fn the_best_proposal_and_its_score_are_found_again_to_the_bit() {
    let stage = Stage::new();
    for driver in ["proposals", "contingency"] {
        let run = format!("run --scenarios small.toml --driver {driver} --set horizon=40 --record all");
        stage.good_sim(&format!("{run} --in-process --out {driver}"));
        let recordings = recordings(&stage, driver);
        assert_eq!(recordings.len(), 3);
        for recording in &recordings {
            for step in [0, 1, 7, 23, 24, 25, 26, 39] {
                let (trials, found, recorded) = tried(recording, step);
                assert_eq!(found, recorded, "{} step {step}", recording.display());
                assert!(trials.notes().is_empty(), "{} step {step}: {trials}", recording.display());
            }
        }
    }
    // Who takes over has heard all, but its plans of before are not recorded.
    stage.good_sim("replay contingency --from 26 --driver proposals --out fork");
    let fork = &recordings(&stage, "fork")[0];
    assert!(tried(fork, 25).0.notes()[0].starts_with("up to step 26 another run's plans"));
    assert!(tried(fork, 26).0.notes()[0].starts_with("its last plan is not recorded"));
    let (trials, found, recorded) = tried(fork, 27);
    assert_eq!(found, recorded);
    assert!(trials.notes().is_empty(), "{trials}");
    let printed =
        Command::new(program("planner-node")).arg("explain").arg(fork).args(["--step", "27"]).output().unwrap();
    assert_eq!(String::from_utf8(printed.stdout).unwrap(), trials.to_string());
}
