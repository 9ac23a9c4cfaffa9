//! A service drives what is asked for, in turns; killed at any moment, it loses nothing and drives nothing twice.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::os::unix::fs::MetadataExt as _;
use std::process::{Child, Output, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use results::parquet::Table;
use wire::keys::Secret;
use wire::proto::EpisodeEnd;
use wire::proto::service::refusal::Code;
use wire::proto::service::{Ask, Close, Fork, Open, Session, Settings, Step, Submit, ask, reply};
use wire::service::{Client, ServiceError};

use crate::hosts::certificates;
use crate::killed::Moments;
use crate::python::{python, tests};
use crate::stage::{Stage, assert_same, program, wait_until};

const SECRET: &str = "sesame";

/// A service that runs, and where it is.
struct Service<'a> {
    stage: &'a Stage,
    arguments: String,
    endpoint: String,
    process: Child,
}

impl<'a> Service<'a> {
    /// Starts one that offers the small set.
    fn start(stage: &'a Stage, arguments: &str) -> Self {
        Self::start_at(stage, "tcp/127.0.0.1:0", arguments)
    }

    fn start_at(stage: &'a Stage, endpoint: &str, arguments: &str) -> Self {
        let arguments = format!("serve --runs served --sets small.toml {arguments}");
        let process = begin(stage, &format!("{arguments} --endpoint {endpoint}"));
        let mut service = Self { stage, arguments, endpoint: String::new(), process };
        wait_until("the service says where it is", || {
            let said = service.said();
            let place =
                said.lines().find_map(|line| line.strip_prefix("serving at ")?.split(';').next().map(str::to_owned));
            service.endpoint = place.unwrap_or_default();
            !service.endpoint.is_empty()
        });
        service
    }

    fn said(&self) -> String {
        fs::read_to_string(self.stage.path("service.log")).unwrap()
    }

    /// Kills it, and starts it again at once: what it drove may still be on its way out.
    fn killed_and_started(&mut self) {
        self.process.kill().unwrap();
        self.process.wait().unwrap();
        self.process = begin(self.stage, &format!("{} --endpoint {}", self.arguments, self.endpoint));
    }

    fn client(&self, arguments: &str) -> Output {
        let mut command = self.stage.command(&format!("{arguments} --endpoint {}", self.endpoint));
        command.env("RELOOP_SECRET", SECRET).output().unwrap()
    }

    /// A client's good end, and what it printed.
    fn good(&self, arguments: &str) -> String {
        let output = self.client(arguments);
        assert_eq!(output.status.code(), Some(0), "{arguments}: {output:?}\nservice: {}", self.said());
        String::from_utf8(output.stdout).unwrap()
    }

    /// A client's bad end, and what it said.
    fn bad(&self, arguments: &str) -> String {
        let output = self.client(arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments}: {output:?}");
        String::from_utf8(output.stderr).unwrap()
    }

    fn connect(&self) -> Client {
        Client::connect(&self.endpoint, Secret::from(SECRET), None).unwrap()
    }
}

#[test]
fn a_service_that_listens_by_tls_is_asked_by_who_has_a_certificate_and_by_nobody_else() {
    let stage = Stage::new();
    let Some(()) = certificates(&stage) else { return };
    let service = Service::start_at(&stage, "tls/localhost:0", "--zenoh-config sim.json5");
    let submitted = service.good(
        "submit --driver idm --sets small --record none --latency 80ms --in-process --watch --zenoh-config viewer.json5",
    );
    assert!(submitted.contains("latency") && submitted.contains("digest "), "{submitted}");
    for who in ["stranger", "nobody"] {
        let said = service.bad(&format!("status --zenoh-config {who}.json5"));
        assert!(said.contains("certificate") && said.contains("hint: "), "{said}");
    }
    assert!(service.good("status --zenoh-config viewer.json5").contains("3 of 3"));
}

impl Drop for Service<'_> {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

fn begin(stage: &Stage, arguments: &str) -> Child {
    let log = File::options().create(true).append(true).open(stage.path("service.log")).unwrap();
    let mut command = stage.command(arguments);
    command.env("RELOOP_SECRET", SECRET).stdin(Stdio::null()).stdout(Stdio::null()).stderr(log).spawn().unwrap()
}

/// Runs `sim` to its good end beside a service.
fn good_beside(stage: &Stage, arguments: &str) -> String {
    let output = stage.command(arguments).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{arguments}: {output:?}");
    String::from_utf8(output.stdout).unwrap()
}

/// Each file that holds what was driven, and which file it is: one that was written anew is another.
fn stored(stage: &Stage, run: &str) -> BTreeMap<String, (u64, i64)> {
    let mut files = BTreeMap::new();
    let mut note = |path: std::path::PathBuf| {
        if let Ok(metadata) = fs::metadata(&path) {
            files.insert(path.display().to_string(), (metadata.ino(), metadata.mtime_nsec()));
        }
    };
    note(stage.path(run).join("digest"));
    for entry in fs::read_dir(stage.path(run).join("parts")).into_iter().flatten().flatten() {
        if entry.file_name().to_string_lossy().ends_with(".part") {
            note(entry.path());
        }
    }
    files
}

/// Three runs are queued and the service is killed so often, at moments spread over their time; then they are let to their end.
fn killed(seed: u64, kills: usize, at_once: usize) {
    const RUNS: [&str; 3] = ["idm", "constant-velocity", "human"];
    let stage = Stage::new();
    let began = Instant::now();
    for driver in RUNS {
        stage.good_sim(&format!("run --driver {driver} --scenarios small.toml --parallel 1 --out {driver}"));
    }
    let whole = began.elapsed();
    let mut moments = Moments(seed);
    let mut done = 0;
    while done < kills {
        let mut service = Service::start(&stage, "--workers 2");
        let start = |arguments: String| {
            let mut client = stage.command(&format!("{arguments} --endpoint {}", service.endpoint));
            client.env("RELOOP_SECRET", SECRET).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap()
        };
        let submit = |driver: &str| start(format!("submit --driver {driver} --sets small --name {driver}"));
        assert!(submit(RUNS[0]).wait().unwrap().success());
        // Clients whose service is killed ask again.
        let watcher = start(format!("watch {} --ends", RUNS[0]));
        let submits = [submit(RUNS[1]), submit(RUNS[2])];
        let mut before: [BTreeMap<String, (u64, i64)>; 3] = Default::default();
        for _ in 0..at_once.min(kills - done) {
            sleep(whole.mul_f64(0.7 * moments.next().unwrap()));
            if RUNS.iter().all(|run| stage.path(&format!("served/{run}/digest")).exists()) {
                break;
            }
            service.killed_and_started();
            done += 1;
            for (before, driver) in before.iter_mut().zip(RUNS) {
                let now = stored(&stage, &format!("served/{driver}"));
                let changed: Vec<_> =
                    before.iter().filter(|(path, file)| now.get(*path).is_some_and(|now| now != *file)).collect();
                assert!(changed.is_empty(), "driven twice: {changed:?}");
                let is_done = now.keys().any(|path| path.ends_with("digest"));
                assert!(
                    is_done || before.keys().all(|path| now.contains_key(path)),
                    "lost: {before:?}, there are {now:?}"
                );
                *before = now;
            }
        }
        for mut submit in submits {
            assert!(submit.wait().unwrap().success());
        }
        let watched = watcher.wait_with_output().unwrap();
        let heard = String::from_utf8(watched.stderr).unwrap();
        assert_eq!(
            (watched.status.code(), heard.lines().filter(|line| line.contains(" after ")).count()),
            (Some(0), 3),
            "{heard}"
        );
        for driver in RUNS {
            service.good(&format!("watch {driver}"));
            assert_same(&stage.files(driver), &stage.files(&format!("served/{driver}")));
        }
        drop(service);
        stage.wait_until_alone();
        fs::remove_dir_all(stage.path("served")).unwrap();
        fs::remove_file(stage.path("service.log")).unwrap();
    }
}

#[test]
fn a_service_killed_at_random_moments_loses_nothing_and_drives_nothing_twice() {
    killed(7, 3, 3);
}

#[test]
#[ignore = "takes minutes"]
fn a_service_killed_at_20_random_moments_loses_nothing_and_drives_nothing_twice() {
    killed(8, 20, 4);
}

#[test]
fn a_run_is_submitted_watched_and_comes_to_what_sim_run_comes_to() {
    let stage = Stage::new();
    let service = Service::start(&stage, "--workers 2");
    assert!(service.good("status").contains("no run was submitted"));
    let offer = service.good("status --offer");
    assert!(
        offer.contains("small: 3 scenes") && offer.contains("demo: 20 scenes") && offer.contains("idm:"),
        "{offer}"
    );
    assert_eq!(service.good("submit --driver idm --sets small --record none"), "idm-strict-1\n");
    let watched = service.good("watch idm-strict-1");
    let own = good_beside(&stage, "run --driver idm --scenarios small.toml --record none --out own");
    // Both are the table, and where the run is.
    assert_eq!(watched.split("\n\n").next(), own.split("\n\n").next());
    assert_same(&stage.files("own"), &stage.files("served/idm-strict-1"));
    let status = service.good("status --json");
    let status: serde_json::Value = serde_json::from_str(&status).unwrap();
    assert_eq!((status[0]["state"].as_str(), status[0]["done"].as_u64()), (Some("done"), Some(3)));
    // Who watches what is over sees all of it.
    let ends = service.client("watch idm-strict-1 --ends --format csv");
    assert_eq!(String::from_utf8(ends.stderr).unwrap().lines().count(), 3);
    let table = good_beside(&stage, "table served/idm-strict-1 --format csv");
    assert_eq!(String::from_utf8(ends.stdout).unwrap(), table);
}

#[test]
fn agents_react_in_a_run_of_a_service_as_in_one_of_sim_run() {
    let stage = Stage::new();
    let service = Service::start(&stage, "--workers 2 --allow-commands");
    let rogue = program("rogue_traffic").display().to_string();
    for (name, traffic) in [
        ("drawn", "--traffic mixed --traffic-seed 3 --traffic-set radius=80".to_owned()),
        ("mine", format!("--traffic-command {rogue} --traffic-set radius=80")),
    ] {
        let drive = format!("--driver constant-velocity --record none {traffic}");
        service.good(&format!("submit {drive} --sets small --name {name}"));
        let watched = service.good(&format!("watch {name}"));
        assert!(watched.contains("traffic "), "{watched}");
        good_beside(&stage, &format!("run {drive} --scenarios small.toml --out own-{name}"));
        assert_same(&stage.files(&format!("own-{name}")), &stage.files(&format!("served/{name}")));
    }
    assert!(service.bad("submit --driver idm --traffic-seed 4").contains("all are replayed"));
    assert!(service.bad("submit --driver idm --traffic idm --protocol paper").contains("need the protocol strict"));
}

#[test]
fn what_may_not_be_had_is_refused_and_told_what_to_do() {
    let stage = Stage::new();
    let service = Service::start(&stage, "--most-queued 1 --runs-at-once 1");
    let said = service.bad("submit --planner-command true");
    assert!(said.contains("starts no programs") && said.contains("hint:"), "{said}");
    assert!(service.bad("submit --driver idm --traffic-command true").contains("traffic-command is not taken"));
    assert!(service.bad("submit --driver idm --sets /etc/passwd").contains("paths are not taken"));
    assert!(service.bad("submit --driver idm --name ../out").contains("names of run"));
    assert!(service.bad("submit --driver idm --set horizon=-1").contains("horizon=-1"));
    assert!(service.bad("submit --driver sep").contains("needs weights"));
    assert!(service.bad("watch nothing").contains("there is no run \"nothing\""));
    assert!(service.bad("cancel nothing").contains("there is no run"));
    let stranger =
        stage.command(&format!("status --endpoint {}", service.endpoint)).env("RELOOP_SECRET", "semolina").output();
    let said = String::from_utf8(stranger.unwrap().stderr).unwrap();
    assert!(said.contains("knows this secret") && said.contains("hint:"), "{said}");
    // One is driven, one waits, and no other may.
    service.good("submit --driver idm --name one");
    wait_until("it begins", || service.said().contains("one begins"));
    assert!(service.bad("submit --driver human --name one").contains("another run called one"));
    service.good("submit --driver idm --name two");
    assert!(service.bad("submit --driver idm --name three").contains("as many as may"));
    // The same once more is the same run.
    assert_eq!(service.good("submit --driver idm --name two"), "two\n");
    fs::create_dir(stage.path("served/mine")).unwrap();
    assert!(service.bad("submit --driver idm --name mine").contains("no run of this service"));
}

#[test]
fn a_cancelled_run_stops_and_goes_on_if_it_is_submitted_again() {
    let stage = Stage::new();
    let mut service = Service::start(&stage, "--workers 1");
    let submit = "submit --driver idm --record none --name mine";
    service.good(submit);
    wait_until("an episode is done", || stage.parts("served/mine") > 0);
    service.good("cancel mine");
    assert_eq!(service.client("watch mine").status.code(), Some(2));
    wait_until("it has stopped", || !stage.processes().iter().any(|(_, name)| name == "planner-node"));
    service.killed_and_started();
    sleep(Duration::from_millis(500));
    assert!(service.good("status mine").contains("cancelled"));
    service.good(submit);
    service.good("watch mine");
    let kept = stage.files("served/mine");
    good_beside(&stage, "run --driver idm --record none --parallel 2 --out own");
    assert_same(&stage.files("own"), &kept);
}

#[test]
fn clients_take_turns() {
    let stage = Stage::new();
    let service = Service::start(&stage, "--runs-at-once 1");
    for (client, name) in [("ann", "a1"), ("ann", "a2"), ("ann", "a3"), ("bob", "b1")] {
        service.good(&format!(
            "submit --driver idm --in-process --record none --sets small --client {client} --name {name}"
        ));
    }
    for run in ["a1", "a2", "a3", "b1"] {
        service.good(&format!("watch {run}"));
    }
    let said = service.said();
    let begun: Vec<&str> = said.lines().filter_map(|line| line.split_once(" begins").map(|(name, _)| name)).collect();
    assert_eq!(begun, ["a1", "b1", "a2", "a3"]);
}

#[test]
fn a_service_that_is_told_to_leave_leaves_and_its_runs_go_on_later() {
    let stage = Stage::new();
    let mut service = Service::start(&stage, "--workers 2");
    service.good("submit --driver idm --record none --name long");
    wait_until("an episode is done", || stage.parts("served/long") > 0);
    kill(Pid::from_raw(service.process.id() as i32), Signal::SIGTERM).unwrap();
    assert_eq!(service.process.wait().unwrap().code(), Some(0));
    stage.wait_until_alone();
    let second = begin(&stage, &format!("{} --endpoint {}", service.arguments, service.endpoint));
    service.process = second;
    service.good("watch long");
    let other =
        stage.command("serve --runs served --endpoint tcp/127.0.0.1:0").env("RELOOP_SECRET", SECRET).output().unwrap();
    assert!(String::from_utf8(other.stderr).unwrap().contains("another service works in served"));
}

#[test]
fn a_run_that_cannot_be_driven_fails_with_its_reason() {
    let stage = Stage::new();
    let service = Service::start(&stage, "--allow-commands");
    service.good("submit --planner-command false --record none --sets small --name broken");
    let said = service.bad("watch broken");
    assert!(said.contains("broken is failed") && said.contains("exited with code 1"), "{said}");
}

fn idm() -> Settings {
    Settings { driver: "idm".to_owned(), in_process: true, scenes: vec!["small".to_owned()], ..Settings::default() }
}

fn held(client: &Client, what: ask::What) -> Session {
    match client.ask(what) {
        Ok(reply::What::Session(session)) => *session,
        other => panic!("{other:?}"),
    }
}

fn open(client: &Client, settings: Settings, scene: &str) -> Session {
    held(client, ask::What::Open(Open { client: "me".to_owned(), settings: Some(settings), scene: scene.to_owned() }))
}

fn step(client: &Client, session: &str, steps: u32) -> Session {
    held(client, ask::What::Step(Step { session: session.to_owned(), steps }))
}

/// Drives a session to its end.
fn to_the_end(client: &Client, session: &str) -> EpisodeEnd {
    loop {
        if let Some(end) = step(client, session, 1000).end {
            return end;
        }
    }
}

/// Whether an end is that of a row of results.
fn assert_is_row(table: &Table, scene: &str, end: &EpisodeEnd) {
    let row = table.text("scene").unwrap().iter().position(|there| there == scene).unwrap();
    assert_eq!(table.counts("steps").unwrap()[row], end.steps);
    let mut compared = 0;
    for metric in &end.metrics {
        if let Ok(column) = table.number(&metric.name) {
            let value = metric.value.filter(|value| !value.is_nan());
            assert_eq!(column[row].map(f64::to_bits), value.map(f64::to_bits), "{}", metric.name);
            compared += 1;
        }
    }
    assert!(compared > 20, "{compared}");
}

#[test]
fn a_session_stepped_to_its_end_comes_to_what_a_run_comes_to_and_so_does_a_fork() {
    let stage = Stage::new();
    stage.good_sim("run --driver idm --scenarios small.toml --out own");
    let own = Table::read(&stage.path("own/results.parquet")).unwrap();
    let scene = own.text("scene").unwrap()[1].clone();
    let service = Service::start(&stage, "--session-idle 60s");
    let client = service.connect();
    let opened = open(&client, idm(), &scene);
    assert!(opened.briefing.is_some() && opened.observation.is_some() && opened.step == 0, "{opened:?}");
    let driven = step(&client, &opened.session, 7);
    assert_eq!((driven.step, driven.records.len(), driven.observation.unwrap().step), (7, 7, 7));
    assert_eq!(driven.plan.unwrap().step, 6);
    let looked = step(&client, &opened.session, 0);
    assert_eq!((looked.step, looked.records.len()), (7, 0));
    assert_is_row(&own, &scene, &to_the_end(&client, &opened.session));

    // Another driver takes over, as in a fork of a run.
    let other = Settings { driver: "constant-velocity".to_owned(), scenes: Vec::new(), ..idm() };
    let fork = Fork { session: opened.session.clone(), step: 7, settings: Some(other) };
    let forked = held(&client, ask::What::Fork(fork));
    assert_eq!((forked.step, forked.driver.as_str()), (7, "constant-velocity"));
    good_beside(&stage, "replay own --from 7 --driver constant-velocity --record none --out forked");
    let table = Table::read(&stage.path("forked/results.parquet")).unwrap();
    assert_is_row(&table, &scene, &to_the_end(&client, &forked.session));
    for session in [opened.session, forked.session] {
        held(&client, ask::What::Close(Close { session: session.clone() }));
        let gone = || client.ask(ask::What::Step(Step { session: session.clone(), steps: 1 }));
        wait_until("it is closed", || matches!(gone(), Err(ServiceError::Refused { code: Code::NoSuchSession, .. })));
    }
}

#[test]
fn sessions_are_bounded_and_idle_ones_are_closed() {
    let stage = Stage::new();
    let service = Service::start(&stage, "--most-sessions 1 --session-idle 1s");
    let client = service.connect();
    let ask_open = |scene: &str| {
        client.ask(ask::What::Open(Open { client: "me".to_owned(), settings: Some(idm()), scene: scene.to_owned() }))
    };
    let refused = ask_open("nowhere").unwrap_err();
    assert!(refused.to_string().contains("no scene nowhere"), "{refused}");
    let scene = stage_scene(&service);
    let opened = open(&client, idm(), &scene);
    let full = ask_open(&scene).unwrap_err();
    assert!(matches!(full, ServiceError::Refused { code: Code::Full, .. }), "{full}");
    let far = Fork { session: opened.session.clone(), step: 9, settings: Some(idm()) };
    let refused = client.ask(ask::What::Fork(far)).unwrap_err();
    assert!(refused.to_string().contains("only 0 steps"), "{refused}");
    wait_until("the idle one is closed", || ask_open(&scene).is_ok());
}

/// A scene of the small set.
fn stage_scene(service: &Service<'_>) -> String {
    let offer: serde_json::Value = serde_json::from_str(&service.good("status --offer --json")).unwrap();
    let sets = offer["scene_sets"].as_array().unwrap();
    sets.iter().find(|set| set["name"] == "small").unwrap()["ids"][0].as_str().unwrap().to_owned()
}

#[test]
fn a_session_is_held_in_the_terminal_and_a_planner_of_ones_own_drives_in_it() {
    use std::io::Write as _;
    let stage = Stage::new();
    let service = Service::start(&stage, "--allow-commands");
    let scene = stage_scene(&service);
    let mut command = stage.command(&format!("session --sets small --scene {scene} --endpoint {}", service.endpoint));
    command.args(["--planner-command", "planner-node --planner idm"]).env("RELOOP_SECRET", SECRET);
    let mut held = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    held.stdin
        .take()
        .unwrap()
        .write_all(b"step 3\nstate\nplan\nfork 2 constant-velocity\nstep\njump\nsessions\nrun\n")
        .unwrap();
    let output = held.wait_with_output().unwrap();
    let said = String::from_utf8(output.stdout).unwrap();
    assert_eq!(output.status.code(), Some(0), "{said}");
    for expected in [
        ": command drives",
        "step 2: at (",
        "before step 3 of",
        "the plan of step 2",
        "constant-velocity drives",
        "(this one)",
        "the episode is over",
    ] {
        assert!(said.contains(expected), "{expected}: {said}");
    }
    assert!(String::from_utf8(output.stderr).unwrap().contains("\"jump\" is no command"));
}

#[test]
fn a_service_is_asked_from_python() {
    let Some(python) = python() else { return };
    let stage = Stage::new();
    let service = Service::start(&stage, "");
    let mut tests = tests(&python);
    tests.arg("test_service").env("RELOOP_SERVICE", &service.endpoint).env("RELOOP_SECRET", SECRET);
    let tested = tests.output().unwrap();
    let said = String::from_utf8_lossy(&tested.stderr).into_owned();
    assert!(tested.status.success() && !said.contains("skipped"), "{said}\nservice: {}", service.said());
}

#[test]
fn questions_that_are_none_and_floods_of_them_leave_the_service_as_it_is() {
    use zenoh::Wait as _;
    let stage = Stage::new();
    let service = Service::start(&stage, "");
    let session = wire::session::open_client(&service.endpoint).unwrap();
    let key = format!("reloop/@service-{SECRET}/1/ask");
    let huge = Submit { client: "c".repeat(60_000), ..Submit::default() };
    let huge = prost::Message::encode_to_vec(&Ask { what: Some(ask::What::Submit(huge)) });
    for bytes in [Vec::new(), vec![0xff; 1000], vec![0; 300_000], huge] {
        let replies = session.get(&key).payload(bytes).wait().unwrap();
        assert!(replies.recv().unwrap().into_result().is_ok());
    }
    // Nobody waits for these.
    for _ in 0..10_000 {
        drop(session.get(&key).payload(vec![0x1a, 0x00]).wait().unwrap());
    }
    assert!(service.good("status --offer").contains("scene sets"));
}
