//! `sim blame`: failures are driven again, and what saves them is told.

use crate::stage::Stage;

#[test]
fn a_driver_that_looks_at_nobody_is_saved_by_one_that_does() {
    let stage = Stage::new();
    stage.sim("run --scenarios small.toml --driver constant-velocity --record failures --out run");
    let told = stage.good_sim("blame run --format json").out;
    let blamed: serde_json::Value = serde_json::from_str(&told).unwrap();
    let failures = blamed["failures"].as_array().unwrap();
    assert!(!failures.is_empty(), "{told}");
    for failure in failures {
        // With nothing changed it fails as it did.
        let again = &failure["outcomes"][0];
        assert_eq!((&again["fault"], &again["step"]), (&failure["fault"], &failure["step"]), "{told}");
        assert_eq!(failure["outcomes"][1]["came"], "not-driven", "it has no predictions");
    }
    let other = &blamed["summary"][2];
    assert_eq!((&other["remedy"], &other["driven"]), (&"other-driver".into(), &failures.len().into()), "{told}");
    assert!(other["saved"].as_u64().unwrap() > 0, "{told}");
    let text = stage.good_sim("blame run").out;
    assert!(text.contains("the driver idm saves "), "{text}");
}

#[test]
fn what_has_no_recording_is_driven_from_its_start_first_with_the_same_outcome() {
    let stage = Stage::new();
    let run = "run --scenarios small.toml --driver constant-velocity --set horizon=120";
    stage.sim(&format!("{run} --record failures --out one/run"));
    stage.sim(&format!("{run} --record none --out two/run"));
    let tables = ["one", "two"].map(|folder| stage.good_sim(&format!("blame {folder}/run --format csv --before 20")));
    assert_eq!(tables[0].out, tables[1].out);
    assert!(tables[1].err.contains("have no recording"), "{}", tables[1].err);
    let nobody = stage.sim("blame one/run --episodes nobody");
    assert!(nobody.code == Some(2) && nobody.err.contains("has no failed episode nobody"), "{nobody:?}");
}
