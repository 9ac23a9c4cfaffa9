//! The network and its features against the numbers of the authors' code.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may panic, and prints its table")]

use std::sync::Arc;

use network::inference::Network;
use network::verify;
use network::weights::Weights;
use scenarios::SceneSet;
use world::scene::Scene;

fn scenes() -> Option<impl FnMut(&str) -> Option<Arc<Scene>>> {
    let folder = vectors::shared("data/womd-derived/20s")?;
    let set = SceneSet::open(&[folder.display().to_string()]).unwrap();
    Some(move |name: &str| {
        let index = set.entries().iter().position(|entry| entry.id.as_str() == name)?;
        Some(set.load(index).unwrap().0)
    })
}

#[test]
fn every_feature_of_the_authors_frames_holds() {
    let (Some(folder), Some(scenes)) = (vectors::shared("dipp/feature-vectors"), scenes()) else { return };
    let report = verify::verify_features(&folder, scenes).unwrap();
    println!("{report}");
    assert!(report.holds(), "{report}");
}

/// Compares the drives of `model`, a network of these weights, in the scenes that `wanted` takes.
fn drives(weights: &str, model: &str, wanted: impl Fn(&str) -> bool) -> Option<vectors::Report> {
    let folder = vectors::shared("dipp/trained")?;
    let bytes = std::fs::read(folder.join(format!("{weights}.f16.safetensors"))).unwrap();
    let network = Network::new(&Weights::read(&bytes).unwrap()).unwrap();
    let mut scenes = scenes()?;
    let scene = |name: &str| if wanted(name) { scenes(name) } else { None };
    let report = verify::verify_drives(&network, (&folder.join("drives"), model), scene).unwrap();
    println!("{report}");
    Some(report)
}

#[test]
fn a_trained_network_says_at_every_step_of_a_drive_what_the_authors_does() {
    // One with controls and predictions, and the shortest.
    let wanted = |name: &str| name == "53e9adfdac0eb822" || name == "b36a6d0bc9e525bc";
    let Some(report) = drives("dipp42", "dipp42", wanted) else { return };
    assert!(report.holds(), "{report}");
}

#[test]
#[ignore = "a minute"]
fn trained_networks_do_so_in_all_their_drives() {
    for model in ["dipp42", "sep42"] {
        let Some(report) = drives(model, model, |_| true) else { return };
        assert!(report.holds(), "{report}");
    }
    let Some(report) = drives("sep42", "ilpred42", |_| true) else { return };
    let text = report.to_string();
    // Of these drives neither controls nor predictions are written down.
    assert_eq!(text.matches("OUT").count() - text.matches("never compared").count(), 1, "{text}");
}

#[test]
fn every_file_of_vectors_is_known_by_what_it_holds() {
    use verify::Kind;
    let folders = [
        ("dipp/feature-vectors", Some(Kind::Features)),
        ("dipp/network-vectors", Some(Kind::Outputs)),
        ("dipp/trained/drives", Some(Kind::Drive)),
    ];
    for (folder, kind) in folders {
        let Some(folder) = vectors::shared(folder) else { return };
        for path in vectors::npz_files(&folder).unwrap() {
            assert_eq!(Kind::of(&vectors::Npz::read(&path).unwrap()), kind);
        }
    }
}

#[test]
fn the_authors_first_frame_is_what_a_live_drive_begins_with() {
    let Some(folder) = vectors::shared("dipp/feature-vectors") else { return };
    let Some(mut scenes) = scenes() else { return };
    for (name, file) in
        [("53e9adfdac0eb822", "53e9adfdac0eb822_019.npz"), ("b36a6d0bc9e525bc", "b36a6d0bc9e525bc_019.npz")]
    {
        let scene = scenes(name).unwrap();
        let episode = episode::Episode::new(scene, &episode::protocol::Protocol::Paper).unwrap();
        let briefing = episode.briefing();
        let window = network::features::History::new(&briefing).observe(&episode.observe());
        let features = network::features::SceneFeatures::new(&briefing.map, network::features::Settings::Authors);
        let (live, wanted) =
            (features.at(&window).frame, verify::frame(&vectors::Npz::read(&folder.join(file)).unwrap()).unwrap());
        assert!(live.ego == wanted.ego && live.neighbors == wanted.neighbors, "{name}: agents");
        assert!(live.lanes == wanted.lanes && live.crosswalks == wanted.crosswalks, "{name}: map");
    }
}
