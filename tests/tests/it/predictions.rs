//! `sim predictions`: what was predicted in a drive against what then happened.

use crate::stage::Stage;

/// Mean errors by horizon of all agents.
fn errors(csv: &str) -> Vec<f64> {
    let rows = csv.lines().filter(|line| line.contains(",all,"));
    rows.map(|line| line.split(',').nth(4).unwrap().parse().unwrap()).collect()
}

#[test]
fn who_knows_the_log_makes_no_error_and_who_guesses_makes_one_that_grows() {
    let stage = Stage::new();
    stage.good_sim("run --scenarios small.toml --driver gn-oracle --out oracle");
    stage.good_sim("run --scenarios small.toml --driver gn-ctrv --out ctrv");
    let oracle = errors(&stage.good_sim("predictions oracle --format csv").out);
    assert_eq!(oracle.len(), 4);
    assert!(oracle.iter().all(|error| *error < 1e-9), "{oracle:?}");
    let ctrv = errors(&stage.good_sim("predictions ctrv --format csv").out);
    assert!(ctrv[1] > 0.0 && ctrv[1] < ctrv[2] && ctrv[2] < ctrv[3], "{ctrv:?}");
    let both = stage.good_sim("predictions oracle ctrv").out;
    assert!(both.contains("oracle: ") && both.contains("\nctrv: ") && both.contains("90 to 100 %"), "{both}");
}

#[test]
fn what_cannot_be_scored_is_said() {
    let stage = Stage::new();
    stage.good_sim("run --scenarios small.toml --driver idm --out idm");
    let nobody = stage.sim("predictions idm");
    assert!(nobody.code == Some(2) && nobody.err.contains("nobody predicts"), "{nobody:?}");
    stage.good_sim("run --scenarios small.toml --driver gn-ctrv --record none --out ctrv");
    let nothing = stage.sim("predictions ctrv");
    assert!(nothing.code == Some(2) && nothing.err.contains("--record all"), "{nothing:?}");
    let none = stage.sim("predictions nowhere");
    assert!(none.code == Some(2) && none.err.contains("holds no run"), "{none:?}");
}
