//! Real scenes come to a result.

use std::path::Path;

use results::parquet::Table;

use crate::stage::{Stage, real_scenes, shared};

/// The results of all 20 s scenes under `driver`.
fn results(driver: &str, folder: &Path) -> (Stage, Table) {
    let stage = Stage::new();
    let ended =
        stage.sim(&format!("run --driver {driver} --record none --out run --timing --scenarios {}", folder.display()));
    eprintln!("{}\n{}", ended.out, ended.err);
    assert!(matches!(ended.code, Some(0 | 1)), "{}", ended.err);
    let table = Table::read(&stage.path("run/results.parquet")).unwrap();
    (stage, table)
}

#[test]
fn every_20_s_scene_comes_to_a_result_under_idm() {
    for folder in ["womd-derived/20s", "womd-derived/20s-partial"] {
        let Some(folder) = real_scenes(folder) else { return };
        let (_stage, table) = results("idm", &folder);
        let failed: Vec<_> =
            table.text("end_detail").unwrap().into_iter().zip(table.flags("failed").unwrap()).collect();
        assert!(failed.iter().all(|(_, failed)| !failed), "{failed:?}");
    }
}

#[test]
fn what_is_odd_about_scenes_is_said_by_the_run_and_stands_in_its_results() {
    let Some(folder) = shared("cases/scenes") else { return };
    let scenes = folder.join("07-no-edge-no-limit.tfrecord");
    let stage = Stage::new();
    let ended = stage.sim(&format!("run --driver idm --record none --out run {}", scenes.display()));
    assert_eq!(ended.code, Some(0), "{}", ended.err);
    assert!(ended.out.contains("cannot be judged in full (see --scenes)"), "{}", ended.out);
    let table = Table::read(&stage.path("run/results.parquet")).unwrap();
    let (findings, unjudged) = (table.text("findings").unwrap(), table.text("unjudged").unwrap());
    let numbers = table.numbers().unwrap();
    for row in 0..findings.len() {
        assert_eq!(unjudged[row].contains("off road"), numbers["off_road"][row].is_none(), "{unjudged:?}");
        assert_eq!(unjudged[row].contains("speeding"), numbers["speeding"][row].is_none(), "{unjudged:?}");
        assert_eq!(unjudged[row].contains("off road"), findings[row].contains("no-road-edges"), "{findings:?}");
    }
    assert!(["off road", "speeding"].iter().all(|term| unjudged.iter().any(|text| text == term)), "{unjudged:?}");
    let by_scene = stage.sim("table run --scenes").out;
    assert!(by_scene.contains("[not"), "{by_scene}");
}

#[test]
fn the_human_drives_every_20_s_scene_without_a_fault() {
    for folder in ["womd-derived/20s", "womd-derived/20s-partial"] {
        let Some(folder) = real_scenes(folder) else { return };
        let (_stage, table) = results("human", &folder);
        assert!(table.flags("failed").unwrap().iter().all(|failed| !failed));
        let numbers = table.numbers().unwrap();
        for metric in
            ["at_fault_collision", "off_route", "position_error_3s_m", "position_error_5s_m", "position_error_10s_m"]
        {
            let bad: Vec<_> = table
                .text("scene")
                .unwrap()
                .into_iter()
                .zip(&numbers[metric])
                .filter(|(_, value)| value.is_some_and(|value| value != 0.0))
                .collect();
            assert!(bad.is_empty(), "{metric}: {bad:?}");
        }
    }
}
