//! `sim replay`: what was driven is driven again, and a difference is named.

use std::fs;

use scenarios::generated::FAMILIES;

use crate::stage::Stage;

#[test]
fn recorded_episodes_of_the_demo_set_are_the_same_again() {
    let stage = Stage::new();
    for (driver, protocol) in [("idm", "strict"), ("idm", "paper"), ("human", "strict")] {
        let run = format!("runs/{driver}-{protocol}-1");
        stage.good_sim(&format!("run --driver {driver} --protocol {protocol}"));
        let ended = stage.good_sim(&format!("replay {run}"));
        assert!(ended.out.starts_with(&format!("{run}: {} episodes of ", FAMILIES.len())), "{}", ended.out);
        assert!(ended.out.ends_with("are the same to the byte, 0 differ\n"), "{}", ended.out);
    }
}

#[test]
fn what_differs_is_named_by_step_and_field() {
    let stage = Stage::new();
    stage.good_sim("run --scenarios small.toml --driver idm");
    let path = stage.path("runs/idm-strict-1/run.toml");
    let settings = fs::read_to_string(&path).unwrap();
    let with = |from: &str, to: &str| {
        assert!(settings.contains(from));
        fs::write(&path, settings.replacen(from, to, 1)).unwrap();
        let ended = stage.sim("replay runs/idm-strict-1");
        assert_eq!(ended.code, Some(1), "{ended:?}");
        ended.out
    };
    let told = with("horizon = 150", "horizon = 149");
    assert_eq!(told.matches(": scene.horizon: 150 in the recording, 149 now").count(), 3, "{told}");
    let told = with("max-acceleration = 5.0", "max-acceleration = 0.2");
    assert!(told.contains(": step ") && told.contains(" in the recording, "), "{told}");
    fs::write(&path, &settings).unwrap();
    // One episode alone, and one that is not there.
    let alone = stage.good_sim("replay runs/idm-strict-1 --episodes curve-3-0").out;
    assert!(alone.contains(": 1 episodes of "), "{alone}");
    let nobody = stage.sim("replay runs/idm-strict-1 --episodes nobody");
    assert!(nobody.code == Some(2) && nobody.err.contains("has no episode nobody"), "{nobody:?}");
    let damaged = stage.path("runs/idm-strict-1/episodes/curve-3-0.mcap");
    let mut bytes = fs::read(&damaged).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(&damaged, bytes).unwrap();
    let ended = stage.sim("replay runs/idm-strict-1");
    assert!(ended.code == Some(1) && ended.out.contains("curve-3-0") && ended.out.contains("damaged"), "{ended:?}");
}

#[test]
fn without_recordings_there_is_nothing_to_replay() {
    let stage = Stage::new();
    stage.good_sim("run --scenarios small.toml --driver idm --record none");
    let ended = stage.sim("replay runs/idm-strict-1");
    assert!(ended.code == Some(2) && ended.err.contains("--record all"), "{ended:?}");
}
