//! Agents that react: the same bytes however a run is driven, and what a process costs that drives them badly.

use std::sync::Arc;

use episode::Episode;
use episode::metrics::{Counted, METRICS};
use evaluation::drives::Run;
use results::parquet::Table;

use crate::stage::{Ended, Stage, assert_same, program};

/// How many agents reacted, over all steps of each episode.
fn reacted(stage: &Stage, run: &str) -> Vec<u32> {
    let results = Table::read(&stage.path(&format!("{run}/results.parquet"))).unwrap();
    results.counts("reactive_agent_steps").unwrap()
}

#[test]
fn reactive_runs_are_the_same_for_any_number_of_workers_and_in_process() {
    for traffic in ["mixed", "network"] {
        let stage = Stage::new();
        let run = format!("run --scenarios small.toml --driver constant-velocity --traffic {traffic} --traffic-seed 3");
        for how in ["one --parallel 1", "three --parallel 3", "here --in-process --parallel 2"] {
            let ended = stage.good_sim(&format!("{run} --out {how}"));
            assert!(ended.out.contains(&format!("traffic {traffic}")), "{}", ended.out);
        }
        assert!(reacted(&stage, "one").iter().sum::<u32>() > 50, "{:?}", reacted(&stage, "one"));
        let first = stage.files("one");
        assert!(first.keys().any(|name| name.ends_with(".mcap")));
        assert_same(&first, &stage.files("three"));
        assert_same(&first, &stage.files("here"));
    }
}

#[test]
fn a_reactive_drive_is_driven_again_by_its_recording() {
    let stage = Stage::new();
    stage.good_sim(
        "run --scenarios small.toml --driver constant-velocity --traffic idm --traffic-set radius=80 --out run",
    );
    let ended = stage.good_sim("replay run");
    assert!(ended.out.contains("the same"), "{}", ended.out);
}

#[test]
fn a_reactive_run_is_judged_again_among_those_who_reacted() {
    let stage = Stage::new();
    let run = "run --scenarios small.toml --driver constant-velocity --in-process --record none";
    stage.good_sim(&format!("{run} --traffic mixed --out run"));
    let scenes = stage.path("small.toml").display().to_string();
    let read = Run::open(&stage.path("run"), &[scenes]).unwrap();
    let told = read.results.numbers().unwrap();
    let protocol = &read.file.settings.protocol;
    let others = read.each(&[], |index, driven| {
        let driven = driven.unwrap();
        let again = driven.retrace(protocol, |_, _| ()).unwrap().measure(Counted::ALL);
        let mut among = Episode::new(Arc::clone(&driven.scene), protocol).unwrap();
        among.retrace(driven.steps());
        for ((metric, again), replayed) in METRICS.iter().zip(again).zip(among.measure(Counted::ALL)) {
            // Speeds are reckoned from velocities again.
            let is_close = match (again, told[metric.name][index]) {
                (Some(again), Some(told)) => (again - told).abs() < 1e-9,
                (again, told) => again == told,
            };
            assert!(is_close, "{} of {}: {again:?}", metric.name, driven.scene.id());
            assert_eq!(replayed, again, "{} of {}, replayed among them", metric.name, driven.scene.id());
        }
        driven.scene.tracks() != driven.logged.tracks()
    });
    assert!(others.unwrap().contains(&true));

    let validity = stage.good_sim("validity run").out;
    assert!(validity.contains("Others reacted (traffic mixed): "), "{validity}");
    let scores = stage.good_sim("score run --as navsim,waymax,alpasim").out;
    assert!(scores.contains("constant-velocity"), "{scores}");
}

#[test]
fn where_agents_react_fewer_are_replayed_that_would_have_had_to() {
    let stage = Stage::new();
    let run = "run demo --driver gn-ctrv --in-process --record none";
    stage.good_sim(&format!("{run} --out replayed"));
    stage.good_sim(&format!("{run} --traffic idm --out run"));
    let realism = stage.good_sim("evaluate --traffic replayed run --format csv").out;
    let of = |figure: &str, run: usize| {
        let line = realism.lines().filter(|line| line.contains(figure)).nth(run).unwrap_or_else(|| panic!("{realism}"));
        line.split(',').rev().nth(1).unwrap().parse::<f64>().ok()
    };
    assert_eq!((of("agents that reacted", 0), of(",headway,", 0)), (None, None));
    assert_eq!(of("their steps", 1), Some(f64::from(reacted(&stage, "run").iter().sum::<u32>())));
    let [replayed, reactive] = [0, 1].map(|run| of("would have had to react", run).unwrap());
    assert!(reactive < replayed, "{realism}");
    let refused = stage.sim("evaluate --traffic run --drivers idm");
    assert!(refused.code == Some(2) && refused.err.contains("cannot be used with"), "{refused:?}");
}

#[test]
fn what_cannot_be_meant_is_refused() {
    let stage = Stage::new();
    for (arguments, reason) in [
        ("run --protocol paper --traffic idm", "agents that react need the protocol strict: paper is"),
        ("run --traffic-seed 4", "--traffic-seed and --traffic-set are for agents that react, and all are replayed"),
        ("run --traffic idm --traffic-set radius=-1", "radius"),
        ("run --traffic idm --traffic-set foo=3", "--traffic-set foo=3: unknown field `foo`"),
        ("run --traffic-command=", "a value is required for '--traffic-command <COMMAND>'"),
        ("matrix --drivers idm --traffic idm,none,idm --out m", "--traffic names idm twice"),
        ("matrix --drivers idm --protocols paper,paper --out m", "--protocols names paper twice"),
        ("run --in-process --traffic-command true", "--in-process drives with"),
    ] {
        let ended = stage.sim(arguments);
        assert!(ended.code == Some(2) && ended.err.contains(reason), "{ended:?}");
    }
}

/// Drives the small set among traffic of a process that is not ours.
fn drive(stage: &Stage, more: &str) -> Ended {
    let mut command =
        stage.command(&format!("run --scenarios small.toml --driver constant-velocity --parallel 2 --out run {more}"));
    command.arg("--traffic-command").arg(program("rogue_traffic"));
    let output = command.output().unwrap();
    let left = stage.processes();
    assert!(left.is_empty(), "left running: {left:?}");
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    Ended { code: output.status.code(), out: text(output.stdout), err: text(output.stderr) }
}

/// What a run says of each episode: scene, reason, detail, digest.
fn episodes(stage: &Stage) -> Vec<[String; 4]> {
    let results = Table::read(&stage.path("run/results.parquet")).unwrap();
    let [scenes, reasons, details, digests] =
        ["scene", "end_reason", "end_detail", "episode_sha256"].map(|name| results.text(name).unwrap());
    let rows = scenes.into_iter().zip(reasons).zip(details).zip(digests);
    rows.map(|(((scene, reason), detail), digest)| [scene, reason, detail, digest]).collect()
}

#[test]
fn traffic_that_dies_is_silent_or_lies_costs_its_own_episode_and_nothing_else() {
    let honest = Stage::new();
    let ended = drive(&honest, "");
    assert_eq!(ended.code, Some(0), "{ended:?}");
    let undisturbed = episodes(&honest);
    let reactive = reacted(&honest, "run").iter().position(|steps| *steps > 0).unwrap();
    let scene = undisturbed[reactive][0].clone();
    for (lie, more, reason) in [
        ("die", "", "step 10: the traffic is gone"),
        ("silence", "--deadline 1s", "step 10: the traffic gave no answer within 1 s"),
        ("error", "", "step 10: the traffic's answer is refused: it cannot answer: I would rather not"),
        ("step", "", "step 10: the traffic's answer is refused: it answers step 11, but step 10 was asked for"),
        ("jump", "", "the traffic's answer is refused: track "),
    ] {
        let stage = Stage::with_lie(&format!("{scene} 10 {lie}"));
        let ended = drive(&stage, more);
        assert_eq!(ended.code, Some(1), "{lie}: {ended:?}");
        for (there, here) in undisturbed.iter().zip(&episodes(&stage)) {
            if there[0] == scene {
                assert!(here[1] == "driver-failed" && here[2].contains(reason), "{lie}: {here:?}");
            } else {
                assert_eq!(there, here, "{lie}");
            }
        }
    }
}
