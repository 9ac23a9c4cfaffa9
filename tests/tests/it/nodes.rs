//! Nodes that die, stall or lie cost their own episode and nothing else.

use nix::sys::signal::{Signal, kill};
use results::parquet::Table;

use crate::stage::{Ended, Stage, assert_same, program};

/// Runs the liar on the small set; the second scene is the one that is lied about.
fn drive(stage: &Stage, more: &str) -> Ended {
    let mut command = stage.command(&format!("run --scenarios small.toml --parallel 2 --out run {more}"));
    command.arg("--planner-command").arg(program("liar"));
    let output = command.output().unwrap();
    let left = stage.processes();
    assert!(left.is_empty(), "left running: {left:?}");
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    Ended { code: output.status.code(), out: text(output.stdout), err: text(output.stderr) }
}

/// What a run says of each episode: scene, reason, detail, digest, what is wrong with its recording.
fn episodes(stage: &Stage) -> Vec<[String; 5]> {
    let results = Table::read(&stage.path("run/results.parquet")).unwrap();
    let [scenes, reasons, details, digests, errors] =
        ["scene", "end_reason", "end_detail", "episode_sha256", "recording_error"]
            .map(|name| results.text(name).unwrap());
    let rows = scenes.into_iter().zip(reasons).zip(details).zip(digests).zip(errors);
    rows.map(|((((scene, reason), detail), digest), error)| [scene, reason, detail, digest, error]).collect()
}

/// The liar tells `lie` at step 20 of the second scene: that episode fails with `reason`, all else is as if nobody had lied.
fn costs_its_episode(lie: &str, more: &str, reason: &str) {
    let honest = Stage::new();
    assert_eq!(drive(&honest, more).code, Some(0));
    let undisturbed = episodes(&honest);
    let scene = &undisturbed[1][0];

    let stage = Stage::with_lie(&format!("{scene} 20 {lie}"));
    let ended = drive(&stage, more);
    assert_eq!(ended.code, Some(1), "{ended:?}");
    assert!(ended.out.contains(&format!("{scene} failed (driver-failed): {reason}")), "{}", ended.out);
    let disturbed = episodes(&stage);
    assert_eq!(disturbed[1][1], "driver-failed");
    assert!(disturbed[1][2].starts_with(reason), "{}", disturbed[1][2]);
    for (there, here) in undisturbed.iter().zip(&disturbed) {
        assert!(there[0] == *scene || there == here, "{there:?}\n{here:?}");
        assert_eq!(here[4], "", "the recording of a failed drive is whole as far as it went");
    }
    let own = format!("episodes/{scene}.");
    let mut files = [honest.files("run"), stage.files("run")];
    for files in &mut files {
        assert!(files.contains_key(&format!("{own}mcap")));
        files.retain(|name, _| name.starts_with("episodes/") && !name.starts_with(&own));
    }
    assert_same(&files[0], &files[1]);
}

#[test]
fn a_node_that_dies() {
    costs_its_episode("die", "", "step 20: the planner is gone: the planner ");
}

#[test]
fn a_node_that_is_stopped() {
    costs_its_episode("stop", "--deadline 1s", "step 20: the planner gave no answer within 1 s");
}

#[test]
fn a_node_that_falls_silent() {
    costs_its_episode("silence", "--deadline 1s", "step 20: the planner gave no answer within 1 s");
}

#[test]
fn a_node_that_stays_silent_after_an_exception_is_told_from_a_slow_one() {
    let reason = "step 20: the planner gave no answer within 1 s: the planner raised ValueError: no lane here";
    costs_its_episode("raise", "--deadline 1s", reason);
}

#[test]
fn a_node_that_has_no_answer_says_why() {
    costs_its_episode("error", "", "step 20: the planner's answer is refused: it cannot answer: I would rather not");
}

#[test]
fn a_node_that_answers_not_a_number() {
    costs_its_episode("nan", "", "step 20: the planner's answer is refused: state 7 is not finite, or beyond 1e7");
}

#[test]
fn a_node_that_answers_too_few_states() {
    costs_its_episode("length", "", "step 20: the planner's answer is refused: it has 49 states, but 50 are needed");
}

#[test]
fn a_node_that_answers_too_few_controls() {
    costs_its_episode(
        "controls",
        "",
        "step 20: the planner's answer is refused: it has 10 controls, but 50 are needed",
    );
}

#[test]
fn a_node_that_answers_another_step() {
    costs_its_episode(
        "step",
        "",
        "step 20: the planner's answer is refused: it answers step 21, but step 20 was asked for",
    );
}

/// Fifty short drives in ordinary traffic.
const FIFTY: &str = r#"
[[generate]]
family = "cruise"
seed = 5
count = 50
parameters = { traffic = 0.2, parked = 0.1, people = 0.5 }
"#;

#[test]
fn of_fifty_episodes_exactly_the_disturbed_ones_fail_and_every_other_is_as_if_nothing_had_happened() {
    let lies = [
        (3, "die"),
        (11, "stop"),
        (12, "nan"),
        (24, "silence"),
        (25, "length"),
        (33, "die"),
        (41, "error"),
        (49, "step"),
    ];
    let lie = |(scene, lie): &(u32, &str)| format!("cruise-5-{scene} 9 {lie}");
    let lied = lies.iter().map(lie).collect::<Vec<_>>().join(";");
    let ended = [Stage::new(), Stage::with_lie(&lied)].map(|stage| {
        std::fs::write(stage.path("small.toml"), FIFTY).unwrap();
        let ended = drive(&stage, "--set horizon=20 --deadline 1s");
        (stage, ended)
    });
    let [(honest, undisturbed), (stage, disturbed)] = &ended;
    assert_eq!((undisturbed.code, disturbed.code), (Some(0), Some(1)), "{disturbed:?}");
    let all = episodes(honest).into_iter().zip(episodes(stage));
    let mut failed = Vec::new();
    for (number, (there, here)) in (0..).zip(all) {
        if here[1] == "driver-failed" {
            failed.push(number);
            assert!(
                disturbed.out.contains(&format!("{} failed (driver-failed): step 9:", here[0])),
                "{}",
                disturbed.out
            );
        } else {
            assert_eq!(there, here);
        }
    }
    assert_eq!(failed, lies.map(|(scene, _)| scene));
    assert_eq!(disturbed.out.matches("failed (driver-failed)").count(), lies.len(), "{}", disturbed.out);
    let mut files = [honest.files("run"), stage.files("run")];
    let is_disturbed =
        |name: &str| lies.iter().any(|(scene, _)| name.starts_with(&format!("episodes/cruise-5-{scene}.")));
    files.iter_mut().for_each(|files| files.retain(|name, _| name.starts_with("episodes/") && !is_disturbed(name)));
    assert_eq!(files[0].len(), 2 * (50 - lies.len()));
    assert_same(&files[0], &files[1]);
}

#[test]
fn a_node_of_another_version_is_refused_and_both_versions_named() {
    let stage = Stage::with_lie("x 0 version");
    let ended = drive(&stage, "--record none");
    assert_eq!(ended.code, Some(2), "{ended:?}");
    let [ours, theirs] = [wire::WIRE_VERSION, wire::WIRE_VERSION + 1].map(|version| format!("version {version}"));
    assert!(ended.err.contains(&ours) && ended.err.contains(&theirs), "{}", ended.err);
}

#[test]
fn a_planner_that_cannot_be_started_ends_the_run_with_a_hint() {
    let stage = Stage::new();
    let mut command = stage.command("run --scenarios small.toml --record none --parallel 1 --out run");
    let output = command.args(["--planner-command", "/no/such/planner"]).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(said.contains("planner w0 exited with code 127 before it was on the bus"), "{said}");
    stage.wait_until_alone();
}

#[test]
fn a_planner_killed_from_outside_costs_one_episode() {
    let stage = Stage::new();
    let mut sim = stage.start("run --driver idm --scenarios small.toml --parallel 1 --record none --out run");
    let planner = stage.wait_for("planner-node");
    crate::stage::wait_until("an episode is done", || stage.parts("run") > 0);
    kill(planner, Signal::SIGKILL).unwrap();
    let code = sim.wait().unwrap().code();
    let failed = episodes(&stage).iter().filter(|episode| episode[1] == "driver-failed").count();
    // It may have been killed between two episodes; then the next one fails, or it was the last.
    assert!(failed <= 1);
    assert_eq!(code, Some(failed as i32));
}
