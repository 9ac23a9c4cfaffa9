//! Drivers over the prediction network: the repository's weights are whole, and with those that the authors' code trained drives end as in
//! its own simulator.

use std::fs;
use std::path::{Path, PathBuf};

use network::cql::Policy;
use network::weights::{Variant, Weights};
use results::parquet::Table;
use results::{files, weights};

use crate::stage::{Stage, program, shared};

/// A file of the repository's folder of weights.
fn ours(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../weights").join(name)
}

#[test]
fn the_weights_of_the_repository_are_those_of_its_list_and_of_their_networks() {
    let variants =
        [(weights::BUILT_IN, Variant::Joint), (weights::IL_PRED, Variant::Separate), (weights::IL, Variant::Imitation)];
    for (name, variant) in variants {
        let sum = files::sha256([ours(name).as_path()]).unwrap();
        let listed: Vec<&str> = weights::sums().filter(|(_, of)| *of == name).map(|(sum, _)| sum).collect();
        assert_eq!(listed, [sum], "{name}: write weights/SHA256SUMS anew");
        // Whatever is not finite is refused.
        let read = Weights::read(&fs::read(ours(name)).unwrap()).unwrap();
        assert_eq!(read.variant(), variant, "{name}");
    }
    let sum = files::sha256([ours(weights::CQL).as_path()]).unwrap();
    assert!(weights::sums().any(|listed| listed == (&*sum, weights::CQL)), "write weights/SHA256SUMS anew");
    Policy::read(&fs::read(ours(weights::CQL)).unwrap()).unwrap();
    assert_eq!(weights::sums().count(), variants.len() + 1);
}

#[test]
fn each_driver_drives_with_the_weights_of_the_repository() {
    let stage = Stage::new();
    for (driver, name) in
        [("sep", weights::IL_PRED), ("il-pred", weights::IL_PRED), ("il", weights::IL), ("cql", weights::CQL)]
    {
        let weights = ours(name);
        let ended = stage.sim(&format!(
            "run --scenarios small.toml --record none --set horizon=10 --driver {driver} --weights {} --out {driver}",
            weights.display()
        ));
        assert_eq!(ended.code, Some(0), "{driver}: {}", ended.err);
    }
}

fn drives_as_theirs(driver: &str, model: &str, weights: &str) {
    let (Some(trained), Some(scenes)) = (shared("dipp/trained"), shared("data/womd-derived/20s")) else { return };
    let stage = Stage::new();
    let weights = trained.join(weights);
    let line = format!(
        "run {} --protocol paper --driver {driver} --weights {} --features authors --record none --out run",
        scenes.display(),
        weights.display()
    );
    let ended = stage.sim(&line);
    assert_eq!(ended.code, Some(0), "{}", ended.err);
    let table = Table::read(&stage.path("run/results.parquet")).unwrap();
    let (ids, ends) = (table.text("scene").unwrap(), table.text("end_reason").unwrap());
    let (steps, progress) = (table.counts("steps").unwrap(), table.numbers().unwrap().remove("progress_m").unwrap());
    let csv = fs::read_to_string(trained.join("closed_loop.csv")).unwrap();
    let mut compared = 0;
    for row in csv.lines().skip(1).map(|line| line.split(',').collect::<Vec<_>>()).filter(|row| row[1] == model) {
        let Some(own) = ids.iter().position(|id| id == row[0]) else { continue };
        let theirs: (u32, String, f64) = (row[2].parse().unwrap(), row[3].replace('_', "-"), row[6].parse().unwrap());
        assert_eq!((steps[own], &ends[own]), (theirs.0, &theirs.1), "{model} in {}", row[0]);
        let apart = (progress[own].unwrap() / theirs.2 - 1.0).abs();
        // One drive is 0.6 % apart: searches that stop before they have converged make metres of a rounding.
        assert!(apart <= 0.01, "{model} in {}: {:?} m, theirs {} m", row[0], progress[own], theirs.2);
        compared += 1;
    }
    assert_eq!(compared, 7);
}

#[test]
fn dipp_drives_as_the_authors() {
    drives_as_theirs("dipp", "dipp42", "dipp42.f16.safetensors");
}

#[test]
fn sep_drives_as_the_authors() {
    drives_as_theirs("sep", "sep42", "sep42.f16.safetensors");
}

#[test]
fn il_pred_drives_as_the_authors() {
    drives_as_theirs("il-pred", "ilpred42", "sep42.f16.safetensors");
}

#[test]
fn a_recorded_step_is_explained() {
    let stage = Stage::new();
    stage.good_sim("run --scenarios small.toml --set horizon=10 --out run");
    let recording = fs::read_dir(stage.path("run/episodes")).unwrap().map(|file| file.unwrap().path());
    let recording = recording.into_iter().find(|path| path.extension().is_some_and(|kind| kind == "mcap")).unwrap();
    let explained = std::process::Command::new(program("predictor-node"))
        .args(["explain".as_ref(), recording.as_os_str(), "--step".as_ref(), "3".as_ref()])
        .output()
        .unwrap();
    let said = String::from_utf8(explained.stdout).unwrap();
    assert!(said.contains("step 3: what the network was shown") && said.contains("\nAV\n  agents "), "{said}");
    assert!(said.contains("  lanes     "), "{said}");
}

#[test]
fn a_driver_without_its_weights_says_what_it_needs() {
    let stage = Stage::new();
    let ended = stage.sim("run --driver sep --out run");
    assert_eq!(ended.code, Some(2));
    assert!(ended.err.contains("hint: --weights weights/il-pred.f16.safetensors"), "{}", ended.err);
    let other = stage.sim("run --driver idm --weights x.safetensors --out run");
    assert_eq!(other.code, Some(2));
    assert!(other.err.contains("hint: --driver dipp, sep, il-pred or il, or --predictor network"), "{}", other.err);
}
