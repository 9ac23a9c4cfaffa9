//! Under `paper` the real nodes get the numbers that the authors' simulator gave the same policies, where both are at hand.

use std::path::Path;

use results::parquet::Table;
use vectors::shared;

use crate::stage::{Stage, real_scenes};

/// Our names of their metrics.
const METRICS: [(&str, &str); 10] = [
    ("progress_m", "progress"),
    ("mean_abs_acceleration_mps2", "acc"),
    ("mean_abs_jerk_mps3", "jerk"),
    ("mean_abs_lateral_acceleration_mps2", "lat_acc"),
    ("human_mean_abs_acceleration_mps2", "human_acc"),
    ("human_mean_abs_jerk_mps3", "human_jerk"),
    ("human_mean_abs_lateral_acceleration_mps2", "human_lat_acc"),
    ("position_error_3s_m", "l2_3s"),
    ("position_error_5s_m", "l2_5s"),
    ("position_error_10s_m", "l2_10s"),
];

fn compare(driver: &str, scenes: &Path, vectors: &Path) {
    let stage = Stage::new();
    let scenes = scenes.display();
    stage.good_sim(&format!("run --protocol paper --driver {driver} --record none --out run --scenarios {scenes}"));
    let table = Table::read(&stage.path("run/results.parquet")).unwrap();
    let (reasons, numbers) = (table.text("end_reason").unwrap(), table.numbers().unwrap());
    assert!(table.text("protocol").unwrap().iter().all(|protocol| protocol == "paper"));
    let mut compared = 0;
    for (row, scene) in table.text("scene").unwrap().iter().enumerate() {
        let Ok(text) = std::fs::read(vectors.join(format!("{scene}__{driver}.json"))) else { continue };
        let theirs: serde_json::Value = serde_json::from_slice(&text).unwrap();
        assert_eq!(reasons[row].replace('-', "_"), theirs["end_reason"].as_str().unwrap(), "{scene}");
        for (our_name, their_name) in METRICS {
            let (ours, theirs) = (numbers[our_name][row].unwrap(), theirs["metrics"][their_name].as_f64().unwrap());
            assert!((ours - theirs).abs() < 1e-6, "{driver} {scene} {our_name}: {ours}, the authors {theirs}");
        }
        compared += 1;
    }
    assert!(compared >= 6, "only {compared} scenes compared");
}

#[test]
fn the_nodes_human_and_constant_velocity_drive_as_the_authors_policies() {
    let Some(scenes) = real_scenes("womd-derived/20s") else { return };
    let Some(vectors) = shared("dipp/closed-loop-vectors") else { return };
    for driver in ["human", "constant-velocity"] {
        compare(driver, &scenes, &vectors);
    }
}

#[test]
fn motion_is_refused_and_the_protocol_is_named_everywhere() {
    let stage = Stage::new();
    let refused = stage.sim("run --protocol paper --motion playback");
    assert_eq!(refused.code, Some(2));
    assert!(refused.err.contains("--motion has no meaning under the protocol paper"), "{}", refused.err);
    let ended = stage.good_sim("run --protocol paper --driver idm --scenarios small.toml --record all");
    assert!(ended.out.starts_with("driver idm, protocol paper, motion first-pose, 3 scenes"), "{}", ended.out);
    let run = std::fs::read_to_string(stage.path("runs/idm-paper-1/run.toml")).unwrap();
    assert!(run.contains("[settings.protocol]\nname = \"paper\""), "{run}");
    // The same command again: nothing is driven, and the same is said.
    assert_eq!(
        stage
            .good_sim("run --protocol paper --driver idm --scenarios small.toml --record all --out runs/idm-paper-1")
            .out,
        ended.out
    );
    let other =
        stage.sim("run --protocol strict --driver idm --scenarios small.toml --record all --out runs/idm-paper-1");
    assert_eq!(other.code, Some(2));
    assert!(other.err.contains("settings.protocol.name: \"paper\" there, \"strict\" here"), "{}", other.err);
}
