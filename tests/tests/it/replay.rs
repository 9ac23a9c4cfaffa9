//! `sim replay`: what was driven is driven again, and a difference is named; a drive that is taken over is the same until then.

use std::fs;

use results::parquet::Table;
use scenarios::generated::FAMILIES;

use crate::stage::{Stage, program};

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

#[test]
fn nodes_that_drive_again_say_the_same() {
    let stage = Stage::new();
    for driver in ["idm", "gn-ctrv"] {
        let run = format!("runs/{driver}-strict-1");
        stage.good_sim(&format!("run --driver {driver} --set horizon=40"));
        let ended = stage.good_sim(&format!("replay {run} --live"));
        assert!(ended.out.starts_with(&format!("{run}: {} episodes of ", FAMILIES.len())), "{}", ended.out);
        assert!(ended.out.ends_with("are the same when driven again, 0 differ\n"), "{}", ended.out);
    }
}

/// Runs `sim` with the liar as planner.
fn with_liar(stage: &Stage, arguments: &str) -> (Option<i32>, String) {
    let mut command = stage.command(arguments);
    command.env("LIAR", program("liar"));
    if arguments.starts_with("run") {
        command.args(["--planner-command", "\"$LIAR\""]);
    }
    let output = command.output().unwrap();
    stage.wait_until_alone();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.code(), text(output.stdout) + &text(output.stderr))
}

#[test]
fn a_planner_that_says_something_else_is_called_guilty_at_its_step_and_field() {
    let stage = Stage::with_lie("curve-3-0 17 chance");
    let (code, told) = with_liar(&stage, "run --scenarios small.toml --out run");
    assert_eq!(code, Some(0), "{told}");
    // By its plans it is the same: they were driven.
    stage.good_sim("replay run");
    let (code, told) = with_liar(&stage, "replay run --live");
    assert_eq!(code, Some(1), "{told}");
    assert!(told.contains("curve-3-0: step 17, plan.states[7].x: "), "{told}");
    assert!(told.contains("the planner is to blame"), "{told}");
    assert!(told.contains("run: 2 episodes of ") && told.contains("1 differ"), "{told}");
}

#[test]
fn other_weights_than_drove_are_refused() {
    let stage = Stage::new();
    stage.good_sim("run --scenarios small.toml --driver dipp --set horizon=2 --out run");
    std::fs::write(stage.path("other.safetensors"), "other").unwrap();
    let ended = stage.sim("replay run --live --weights other.safetensors");
    assert!(ended.code == Some(2) && ended.err.contains("other weights than other.safetensors"), "{ended:?}");
    stage.good_sim("run --scenarios small.toml --driver idm --set horizon=2 --out idm");
    let ended = stage.sim("replay idm --live --weights other.safetensors");
    assert!(ended.code == Some(2) && ended.err.contains("the run has none"), "{ended:?}");
}

#[test]
fn a_drive_that_its_own_driver_takes_over_is_the_same_to_the_byte() {
    let stage = Stage::new();
    for driver in ["idm", "gn-ctrv"] {
        stage.good_sim(&format!("run --scenarios small.toml --driver {driver} --set horizon=60 --out {driver}"));
        stage.good_sim(&format!("replay {driver} --from 25 --label {driver} --out {driver}-fork"));
        let (run, fork) = (stage.files(driver), stage.files(&format!("{driver}-fork")));
        for name in ["results.parquet", "steps.parquet", "digest"] {
            assert!(run[name] == fork[name], "{driver}: {name} differs");
        }
        let settings = fs::read_to_string(stage.path(&format!("{driver}-fork/run.toml"))).unwrap();
        assert!(settings.contains("[settings.fork]") && settings.contains("step = 25"), "{settings}");
        // It can be driven again in both ways.
        stage.good_sim(&format!("replay {driver}-fork"));
        stage.good_sim(&format!("replay {driver}-fork --live"));
    }
}

#[test]
fn until_another_takes_over_the_drive_is_the_same_and_then_it_is_its_own() {
    let stage = Stage::new();
    stage.good_sim("run --scenarios small.toml --driver constant-velocity --out run");
    let ended = stage.sim("replay run --episode curve-3-0 --from 20 --driver idm");
    assert!(
        ended.out.contains("driver idm-from-20") && ended.out.contains("forked at step 20 of constant-velocity"),
        "{ended:?}"
    );
    let fork = "runs/idm-from-20-strict-1";
    let rows = |run: &str| {
        let table = Table::read(&stage.path(&format!("{run}/steps.parquet"))).unwrap();
        let (scenes, numbers) = (table.text("scene").unwrap(), table.numbers().unwrap());
        let of = |row: usize| numbers.iter().map(|(name, values)| (name.clone(), values[row])).collect::<Vec<_>>();
        (0..scenes.len()).filter(|row| scenes[*row] == "curve-3-0").map(of).collect::<Vec<_>>()
    };
    let (before, after) = (rows("run"), rows(fork));
    assert_eq!(before[..20], after[..20]);
    assert_ne!(before[20], after[20]);
    // It is a run: it can be compared, and driven again.
    let compared = stage.good_sim(&format!("compare run {fork}"));
    assert!(compared.out.contains("idm-from-20"), "{}", compared.out);
    stage.good_sim(&format!("replay {fork}"));
    stage.good_sim(&format!("replay {fork} --live"));
    let late = stage.sim("replay run --episode curve-3-0 --from 1000 --driver idm");
    assert!(
        late.code == Some(2) && late.err.contains("curve-3-0 cannot be taken over at step 1000: it ends after"),
        "{late:?}"
    );
}
