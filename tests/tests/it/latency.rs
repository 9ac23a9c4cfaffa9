//! Plans that take effect later than at once: the same bytes for any number of workers, in process and over the bus; what was measured
//! is driven again by its trace; drives are replayed and taken over as any others.

use std::fs;
use std::thread::sleep;
use std::time::{Duration, Instant};

use results::parquet::Table;
use results::trace::Trace;

use crate::stage::{PATIENCE, Stage, assert_same};

/// A run over the small set, with so many steps at most.
fn run(stage: &Stage, arguments: &str, out: &str) -> String {
    let ended = stage.good_sim(&format!("run --scenarios small.toml --set horizon=40 {arguments} --out {out}"));
    ended.out.replace(&format!("folder {out}"), "")
}

fn digest(stage: &Stage, run: &str) -> String {
    fs::read_to_string(stage.path(run).join("digest")).unwrap()
}

#[test]
fn a_latency_is_the_same_for_any_number_of_workers_and_in_process() {
    let stage = Stage::new();
    for (number, latency) in ["fixed:130ms", "dist:lognormal:80ms:400ms:loss=0.1"].into_iter().enumerate() {
        let outs = ["", "--parallel 1", "--in-process --parallel 2"].map(|how| {
            let out = format!("{number}{}", how.replace(' ', ""));
            (run(&stage, &format!("--driver gn-ctrv --latency {latency} {how}"), &out), out)
        });
        let first = stage.files(&outs[0].1);
        assert!(first.contains_key("latency.csv"));
        for (told, out) in &outs {
            assert_same(&first, &stage.files(out));
            assert_eq!(*told, outs[0].0);
        }
        assert!(outs[0].0.contains("latency "), "{}", outs[0].0);
    }
}

#[test]
fn no_delay_is_no_latency_and_a_trace_of_none_drives_the_same() {
    let stage = Stage::new();
    run(&stage, "--driver idm", "without");
    run(&stage, "--driver idm --latency 0ms", "zero");
    assert_same(&stage.files("without"), &stage.files("zero"));
    // Delays that are shorter than a microsecond, and so none, but under a latency.
    run(&stage, "--driver idm --latency dist:uniform:0:0", "none");
    let [without, none] = ["without", "none"].map(|run| {
        let steps = Table::read(&stage.path(run).join("steps.parquet")).unwrap();
        let mut numbers = steps.numbers().unwrap();
        let ages = numbers.remove("plan_age_s");
        (format!("{numbers:?}{:?}", steps.text("events")), ages)
    });
    assert!(without.0 == none.0 && without.1.is_none());
    assert!(none.1.unwrap().iter().all(|age| *age == Some(0.0)));
}

#[test]
fn what_was_measured_is_driven_again_by_its_trace_to_the_byte() {
    let stage = Stage::new();
    for how in ["", "--in-process"] {
        let [measured, traced] = ["measured", "traced"].map(|name| format!("{name}{how}"));
        run(&stage, &format!("--driver idm {how} --latency measured"), &measured);
        run(&stage, &format!("--driver idm {how} --latency trace:{measured}/latency.csv --parallel 1"), &traced);
        assert_eq!(digest(&stage, &measured), digest(&stage, &traced));
        let files = |run: &str| {
            let mut files = stage.files(run);
            // Recordings hold the settings too: of the messages in them `replay` tells.
            files.retain(|name, _| !name.starts_with("episodes/"));
            files
        };
        assert_same(&files(&measured), &files(&traced));
        let (trace, _) = Trace::read(&stage.path(&measured).join("latency.csv")).unwrap();
        assert!(trace.delays_us("curve-3-0").iter().all(|delay| delay.is_some_and(|delay| delay > 0)));
        for run in [measured, traced] {
            for replay in [format!("replay {run}"), format!("replay {run} --live --parallel 1")] {
                let told = stage.good_sim(&replay).out;
                assert!(told.contains("3 episodes of") && told.contains(", 0 differ"), "{told}");
            }
        }
    }
}

#[test]
fn a_measured_run_that_was_killed_goes_on_and_its_trace_is_whole() {
    let stage = Stage::new();
    let arguments =
        "run --scenarios small.toml --driver gn-ctrv --record none --parallel 1 --latency measured --out run";
    let mut sim = stage.start(arguments);
    let begin = Instant::now();
    while stage.parts("run") == 0 && begin.elapsed() < PATIENCE {
        sleep(Duration::from_millis(2));
    }
    sim.kill().unwrap();
    sim.wait().unwrap();
    stage.wait_until_alone();
    stage.good_sim(arguments);
    let again = arguments.replace("measured --out run", "trace:run/latency.csv --out again");
    stage.good_sim(&again);
    assert_eq!(digest(&stage, "run"), digest(&stage, "again"));
}

#[test]
fn late_and_lost_plans_are_counted_and_without_a_plan_the_av_keeps_its_speed() {
    let stage = Stage::new();
    let row = |latency: &str, out: &str| {
        run(&stage, &format!("--driver idm --record none --latency {latency}"), out);
        let results = Table::read(&stage.path(out).join("results.parquet")).unwrap();
        let steps: Vec<u32> = results.counts("steps").unwrap();
        let ages = results.number("mean_plan_age_s").unwrap();
        (steps, results.counts("plans_late").unwrap(), results.counts("plans_lost").unwrap(), ages)
    };
    // Three steps pass before the first plan is there; then each is as old as the delay says.
    let (steps, late, lost, ages) = row("250ms", "late");
    assert_eq!(late, steps.iter().map(|steps| steps - 2).collect::<Vec<_>>());
    assert_eq!(lost, [0; 3]);
    // In the step in which the first one comes there was none before.
    assert!(ages.iter().all(|age| age.is_some_and(|age| (age - 0.25).abs() < 1e-9)), "{ages:?}");
    let (steps, late, lost, ages) = row("dist:uniform:0:0:loss=1", "lost");
    assert_eq!((late, lost, ages), (vec![0; 3], steps, vec![None; 3]));
    let table = Table::read(&stage.path("lost/steps.parquet")).unwrap();
    assert!(table.number("acceleration_mps2").unwrap().iter().all(|value| *value == Some(0.0)));
}

#[test]
fn a_drive_under_a_latency_is_taken_over_with_the_plans_that_are_under_way() {
    let stage = Stage::new();
    for (number, latency) in ["fixed:270ms", "measured", "dist:normal:150ms:80ms:loss=0.1"].into_iter().enumerate() {
        run(&stage, &format!("--driver idm --latency {latency}"), &format!("{number}"));
        stage.good_sim(&format!("replay {number} --from 15 --label idm --out {number}-fork"));
        let rows = |run: String| {
            let steps = Table::read(&stage.path(&run).join("steps.parquet")).unwrap();
            let (step, x) = (steps.counts("step").unwrap(), steps.number("av_x_m").unwrap());
            let ages = steps.number("plan_age_s").unwrap();
            // What is measured after the step is measured anew.
            let until = if latency == "measured" { 15 } else { u32::MAX };
            let rows = step.into_iter().zip(x.into_iter().zip(ages));
            rows.filter(|(step, _)| *step < until).collect::<Vec<_>>()
        };
        assert_eq!(rows(number.to_string()), rows(format!("{number}-fork")), "{latency}");
        stage.good_sim(&format!("replay {number}-fork"));
    }
}

#[test]
fn what_cannot_be_meant_is_refused_with_the_reason() {
    let stage = Stage::new();
    let refused = |arguments: &str| {
        let ended = stage.sim(&format!("run --scenarios small.toml --record none --out refused {arguments}"));
        assert_eq!(ended.code, Some(2), "{ended:?}");
        assert!(!stage.path("refused").join("results.parquet").exists());
        ended.err
    };
    assert!(
        refused("--driver idm --protocol paper --latency 80ms")
            .contains("--latency has no meaning under the protocol paper")
    );
    assert!(refused("--driver human --latency 80ms").contains("is played back"));
    assert!(refused("--driver idm --latency 6s").contains("6s is too late: a plan has ended after 5 s"));
    assert!(refused("--driver idm --latency trace:nowhere.csv").contains("nowhere.csv"));
    fs::write(stage.path("bad.csv"), "scene,when").unwrap();
    assert!(refused("--driver idm --latency trace:bad.csv").contains("it is no trace of latencies"));
    stage.good_sim("run --driver idm --record none --set horizon=3 --latency 80ms --out other");
    let told = refused("--driver idm --latency trace:other/latency.csv");
    assert!(told.contains("says nothing of the scene following-3-0"), "{told}");
    // One that is too short costs the episode, which says so.
    run(&stage, "--driver idm --record none --latency 80ms", "long");
    let short = "run --scenarios small.toml --driver idm --record none --latency trace:long/latency.csv --out short";
    let ended = stage.sim(short);
    assert!(ended.code == Some(1) && ended.out.contains("the trace of latencies ends before it"), "{ended:?}");
}

#[test]
fn a_matrix_of_latencies_is_a_table_and_a_plot() {
    let stage = Stage::new();
    let matrix =
        "matrix --scenarios small.toml --set horizon=30 --drivers idm,constant-velocity --latency 0,80ms,0.3s --out m";
    let ended = stage.good_sim(matrix);
    for name in ["idm-strict", "idm-strict-fixed-80ms", "constant-velocity-strict-fixed-300ms"] {
        assert!(stage.path("m").join(name).join("digest").exists(), "{name}");
    }
    assert!(ended.out.contains("idm (no latency)") && ended.out.contains("idm (fixed:300ms)"), "{}", ended.out);
    assert!(!ended.out.contains("not to be compared"), "{}", ended.out);
    let plot = fs::read_to_string(stage.path("m/latency.svg")).unwrap();
    assert!(plot.starts_with("<svg") && plot.contains("nuPlan score") && plot.contains("constant-velocity"), "{plot}");
    // The same of finished runs.
    stage.good_sim("table m/idm-strict m/idm-strict-fixed-80ms --plot idm.svg");
    assert!(fs::read_to_string(stage.path("idm.svg")).unwrap().starts_with("<svg"));
    let alone = stage.sim("table m/idm-strict --plot one.svg");
    assert!(alone.code == Some(2) && alone.err.contains("two latencies"), "{alone:?}");
    let compared = stage.good_sim("compare m/idm-strict m/idm-strict-fixed-80ms").out;
    assert!(compared.contains("another latency: none in A, fixed:80ms in B"), "{compared}");
    let twice = stage.sim("matrix --scenarios small.toml --drivers idm --latency 80ms,0.08s --out n");
    assert!(twice.code == Some(2) && twice.err.contains("is there twice"), "{twice:?}");
}
