//! The Python SDK: installed as its guide says, its examples drive under the real `sim`, and its own tests pass.
//!
//! Needs Python 3.11 with `venv`; and once a package index, for what it depends on. It skips, and says so, where there is neither.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use results::parquet::Table;

use crate::hosts::{certificates, free_port};
use crate::stage::{Ended, Stage, assert_same, program};

/// What the package and its tests need of the package index, installed first: where even that cannot be had, there is no index.
const FROM_THE_INDEX: [&str; 7] =
    ["eclipse-zenoh~=1.10.2", "mcap<2", "numpy", "pandas", "protobuf<8", "pyarrow", "setuptools>=77"];

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().to_owned()
}

fn ran(command: &mut Command) -> Output {
    command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"))
}

fn said(output: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}

/// All that is installed, as text: whether it is what the environment holds already.
fn sources() -> Vec<u8> {
    let package = repository().join("python");
    let mut folders = vec![package.join("src/reloop")];
    let mut files = vec![package.join("pyproject.toml")];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            match path.extension().and_then(|extension| extension.to_str()) {
                Some("py" | "binpb" | "typed") => files.push(path),
                _ if path.is_dir() => folders.push(path),
                _ => {}
            }
        }
    }
    files.sort();
    files.iter().flat_map(|file| [file.display().to_string().into_bytes(), fs::read(file).unwrap()].concat()).collect()
}

/// The Python of an environment with the package in it, made once for each state of the package; none, with a word about it, where there is no
/// Python or no package index.
pub fn python() -> Option<PathBuf> {
    let target = std::env::current_exe().unwrap().ancestors().nth(3).unwrap().to_owned();
    let environment = target.join("python-sdk-venv");
    // Each test is a process of its own: the first makes it, the others wait.
    let lock = File::create(target.join("python-sdk-venv.lock")).unwrap();
    lock.lock().unwrap();
    let (python, stamp) = (environment.join("bin/python"), environment.join("reloop-sources"));
    let sources = sources();
    if fs::read(&stamp).is_ok_and(|installed| installed == sources) {
        return Some(python);
    }
    let new_enough = "import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))";
    let found = Command::new("python3").args(["-c", new_enough]).output();
    if !found.is_ok_and(|output| output.status.success()) {
        eprintln!("skipped: no python3 of version 3.11 or later, with venv");
        return None;
    }
    let made = ran(Command::new("python3").args(["-m", "venv"]).arg(&environment));
    assert!(made.status.success(), "{}", said(&made));
    let pip = || {
        let mut command = Command::new(&python);
        command.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check"]);
        command
    };
    let needed = ran(pip().args(FROM_THE_INDEX));
    if !needed.status.success() {
        eprintln!("skipped: no package index, or it has not what the package needs: {}", said(&needed));
        return None;
    }
    // From a copy, for setuptools leaves files beside what it builds.
    let copy = tempfile::tempdir().unwrap();
    let copied = ran(Command::new("cp").arg("-r").arg(repository().join("python")).arg(copy.path()));
    assert!(copied.status.success(), "{}", said(&copied));
    let installed = ran(pip().arg("--upgrade").arg(copy.path().join("python")));
    assert!(installed.status.success(), "{}", said(&installed));
    // Of the same version, pip leaves what is installed as it is.
    let again = ran(pip().args(["--force-reinstall", "--no-deps"]).arg(copy.path().join("python")));
    assert!(again.status.success(), "{}", said(&again));
    fs::write(stamp, sources).unwrap();
    Some(python)
}

fn example(name: &str) -> PathBuf {
    repository().join("python/examples").join(name)
}

/// Drives the small set with this sim and this planner.
fn drive(stage: &Stage, sim: &Path, planner: &str, arguments: &str) -> Ended {
    let mut command = stage.command_of(sim, &format!("run --scenarios small.toml {arguments}"));
    let output = command.args(["--planner-command", planner]).output().unwrap();
    stage.wait_until_alone();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    Ended { code: output.status.code(), out: text(output.stdout), err: text(output.stderr) }
}

/// Some of the package's own tests, or all.
pub fn tests(python: &Path) -> Command {
    let mut tests = Command::new(python);
    tests.args(["-m", "unittest"]).current_dir(repository().join("python/tests")).env("PYTHONDONTWRITEBYTECODE", "1");
    tests
}

/// Its results and recordings, as the package reads them, say the same.
fn read_by_the_package(python: &Path, run: &Path) {
    let tested = ran(tests(python).arg("test_runs").env("RELOOP_FINISHED_RUN", run));
    assert!(tested.status.success() && !said(&tested).contains("skipped"), "{}", said(&tested));
}

#[test]
fn the_messages_that_are_built_in_are_those_of_the_bus() {
    for (name, descriptors) in [("reloop", wire::FILE_DESCRIPTOR_SET), ("service", wire::SERVICE_DESCRIPTOR_SET)] {
        let built_in = fs::read(repository().join(format!("python/src/reloop/{name}.binpb"))).unwrap();
        let hint = "write them anew: python -m reloop.messages wire/proto/*.proto";
        assert!(built_in == descriptors, "python/src/reloop/{name}.binpb is not wire/proto/{name}.proto; {hint}");
    }
}

#[test]
fn the_guide_shows_the_example_in_fifteen_lines() {
    let planner = fs::read_to_string(example("planner.py")).unwrap();
    assert!(planner.lines().count() <= 15);
    let guide = fs::read_to_string(repository().join("docs/python.md")).unwrap();
    assert!(
        guide.contains(&format!("```python\n{planner}```")),
        "docs/python.md does not show python/examples/planner.py"
    );
}

#[test]
fn fifteen_lines_drive_to_the_end_and_the_run_is_read_as_frames_and_arrays() {
    let Some(python) = python() else { return };
    let planner = format!("'{}' '{}'", python.display(), example("planner.py").display());
    let stage = Stage::new();
    for (workers, run) in [(1, "one"), (2, "two")] {
        let arguments = format!("--predictor ctrv --parallel {workers} --out {run}");
        let ended = drive(&stage, &program("sim"), &planner, &arguments);
        assert_eq!(ended.code, Some(0), "{ended:?}");
    }
    assert_same(&stage.files("one"), &stage.files("two"));
    let table = Table::read(&stage.path("one/results.parquet")).unwrap();
    assert_eq!(table.text("end_reason").unwrap(), ["horizon"; 3]);
    assert_eq!(table.number("at_fault_collision").unwrap(), [Some(0.0); 3]);
    let progress = table.number("progress_m").unwrap();
    assert!(progress.iter().all(|metres| metres.is_some_and(|metres| metres > 20.0)), "{progress:?}");
    read_by_the_package(&python, &stage.path("one"));
}

#[test]
fn a_predictor_in_python_predicts_under_the_real_sim() {
    let Some(python) = python() else { return };
    let stage = Stage::new();
    let command = |file: &str| format!("'{}' '{}'", python.display(), example(file).display());
    let mut sim = stage.command("run --scenarios small.toml --parallel 1 --out run");
    let output =
        sim.args(["--planner-command", &command("planner.py"), "--predictor-command", &command("predictor.py")]);
    let output = ran(output);
    stage.wait_until_alone();
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    read_by_the_package(&python, &stage.path("run"));
    // And a planner of ours plans by its predictions.
    let mut sim = stage.command("run --scenarios small.toml --record none --driver gn-ctrv --out other");
    let output = ran(sim.args(["--predictor-command", &command("predictor.py")]));
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    let table = Table::read(&stage.path("other/results.parquet")).unwrap();
    assert_eq!(table.text("driver").unwrap(), ["gn-ctrv-command"; 3]);
}

#[test]
fn traffic_in_python_reacts_and_is_the_same_for_any_number_of_workers() {
    let Some(python) = python() else { return };
    let stage = Stage::new();
    let traffic = format!("'{}' '{}'", python.display(), example("traffic.py").display());
    for (workers, run) in [(1, "one"), (2, "two")] {
        let arguments =
            format!("run --scenarios small.toml --driver constant-velocity --parallel {workers} --out {run}");
        let output = ran(stage.command(&arguments).args(["--traffic-command", &traffic]));
        stage.wait_until_alone();
        assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    }
    assert_same(&stage.files("one"), &stage.files("two"));
    let table = Table::read(&stage.path("one/results.parquet")).unwrap();
    assert_eq!(table.text("traffic").unwrap(), ["command"; 3]);
    let reacted = table.counts("reactive_agent_steps").unwrap();
    assert!(reacted.iter().sum::<u32>() > 50, "{reacted:?}");
}

#[test]
fn an_exception_of_traffic_in_python_is_the_reason() {
    let Some(python) = python() else { return };
    let stage = Stage::new();
    let text = "import reloop\n\n\
                @reloop.traffic\n\
                def mine(step, taken):\n    \
                    return [(agent.state.x, float('nan'), 0, 0, 0) for agent in taken]\n\n\
                reloop.serve(mine)\n";
    fs::write(stage.path("mine.py"), text).unwrap();
    let mut sim = stage.command("run --scenarios small.toml --driver constant-velocity --record none --out run");
    let output = ran(sim.args(["--traffic-command", &format!("'{}' mine.py", python.display())]));
    stage.wait_until_alone();
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    let details = Table::read(&stage.path("run/results.parquet")).unwrap().text("end_detail").unwrap();
    let reason = "the traffic's answer is refused: it cannot answer: AnswerError: the states, row 0: y is nan";
    assert!(details.iter().any(|detail| detail.contains(reason)), "{details:?}");
}

#[test]
fn nodes_in_python_keep_every_rule_of_the_bus() {
    let Some(python) = python() else { return };
    for (which, file, rules) in [
        ("--planner-command", "planner.py", 16),
        ("--predictor-command", "predictor.py", 16),
        ("--traffic-command", "traffic.py", 17),
    ] {
        let stage = Stage::new();
        let command = format!("'{}' '{}'", python.display(), example(file).display());
        let output = ran(stage.command("check-node --golden golden.json").args([which, &command]));
        stage.wait_until_alone();
        let text = said(&output);
        assert!(
            output.status.success() && text.contains(&format!("{rules} hold, 0 in doubt, 0 broken, 0 skipped")),
            "{text}"
        );
    }
}

#[test]
fn a_planner_that_somebody_starts_by_hand_serves_all_workers_by_tcp_and_by_tls() {
    let Some(python) = python() else { return };
    let stage = Stage::new();
    let Some(()) = certificates(&stage) else { return };
    let planner = format!("'{}' '{}'", python.display(), example("planner.py").display());
    let ended = drive(&stage, &program("sim"), &planner, "--record none --parallel 1 --out started --label external");
    assert_eq!(ended.code, Some(0), "{ended:?}");
    let locked = ["--zenoh-config", "sim.json5", "--planner-certificate", "planner"];
    for (run, endpoint, more) in [("tcp", "tcp/127.0.0.1", &locked[..0]), ("tls", "tls/localhost", &locked[..])] {
        let endpoint = format!("{endpoint}:{}", free_port());
        let arguments = format!(
            "run --scenarios small.toml --planner external --record none --parallel 2 --out {run} --endpoint {endpoint}"
        );
        let mut sim = stage.command(&arguments);
        let sim = sim
            .args(more)
            .env("RELOOP_SECRET", "between-us")
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let by_hand = |whose: &str| {
            let mut node = Command::new(&python);
            node.arg(example("planner.py")).args([
                "--worker",
                "*",
                "--endpoint",
                &endpoint,
                "--run",
                "external-strict",
            ]);
            node.env("RELOOP_SECRET", "between-us").current_dir(stage.path("")).stdin(Stdio::null());
            ran(if run == "tls" { node.args(["--zenoh-config", &format!("{whose}.json5")]) } else { &mut node })
        };
        if run == "tls" {
            let stranger = by_hand("stranger");
            let why = "it does not know the authority of this node's certificate\n  hint: ";
            assert!(stranger.status.code() == Some(2) && said(&stranger).contains(why), "{}", said(&stranger));
        }
        let node = by_hand("planner");
        let sim = sim.wait_with_output().unwrap();
        assert_eq!((node.status.code(), sim.status.code()), (Some(0), Some(0)), "{} {}", said(&node), said(&sim));
        let digests =
            |run: &str| Table::read(&stage.path(run).join("results.parquet")).unwrap().text("episode_sha256").unwrap();
        assert_eq!(digests(run), digests("started"));
    }
}

#[test]
fn an_exception_in_a_plan_is_the_reason_and_its_traceback_is_in_the_log() {
    let Some(python) = python() else { return };
    let stage = Stage::new();
    let text = "import reloop\n\n\
                @reloop.planner\n\
                def plan(step):\n    \
                    if step.number == 7:\n        \
                        raise LookupError('no way ahead')\n    \
                    return [(step.av.x, step.av.y, step.av.heading, 0)] * 50\n\n\
                reloop.serve(plan)\n";
    fs::write(stage.path("mine.py"), text).unwrap();
    let planner = format!("'{}' mine.py", python.display());
    let ended = drive(&stage, &program("sim"), &planner, "--record none --parallel 1 --out run");
    assert_eq!(ended.code, Some(1), "{ended:?}");
    let details = Table::read(&stage.path("run/results.parquet")).unwrap().text("end_detail").unwrap();
    assert!(details.iter().all(|detail| detail.contains("LookupError: no way ahead (mine.py:6)")), "{details:?}");
    let log = fs::read_to_string(stage.path("run/logs/w0.log")).unwrap();
    assert!(log.contains("mine.py:6 in plan: raise LookupError('no way ahead')"), "{log}");
}

#[test]
fn its_own_tests_pass() {
    let Some(python) = python() else { return };
    let tested = ran(&mut tests(&python));
    assert!(tested.status.success(), "{}", said(&tested));
}
