//! Whoever else is on the bus: second planners, strays, and others who speak where they should not. Nothing of it is silent, and nothing
//! of it changes a result.

use std::fs;
use std::net::{TcpListener, TcpStream};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use prost::Message as _;
use results::parquet::Table;
use wire::envelope::{self, Telling};
use wire::keys::{Address, Answering, Channel, NodeId, Place, Role, RunName, Secret, Worker, Workers};
use wire::{proto, session};
use world::scene::SceneId;
use zenoh::{Session, Wait};

use crate::stage::{Ended, Stage, program, wait_until};

const SECRET: &str = "between-us";

/// An endpoint that nobody listens on.
fn endpoint() -> String {
    format!("tcp/{}", TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap())
}

/// Columns of a run's results, as text.
fn column(stage: &Stage, run: &str, name: &str) -> Vec<String> {
    Table::read(&stage.path(run).join("results.parquet")).unwrap().text(name).unwrap()
}

fn ended(child: Child) -> Ended {
    let output = child.wait_with_output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    Ended { code: output.status.code(), out: text(output.stdout), err: text(output.stderr) }
}

/// A planner-node that was told no secret.
fn planner_node(stage: &Stage, endpoint: &str, run: &str) -> Command {
    let mut command = stage.beside("planner-node");
    command.args(["--planner", "constant-velocity", "--name", "mine", "--endpoint", endpoint, "--run", run]);
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
    command
}

/// The digests of a run that nobody disturbs.
fn undisturbed(stage: &Stage, scenes: &str) -> Vec<String> {
    stage.good_sim(&format!("run {scenes} --driver constant-velocity --record none --parallel 1 --out undisturbed"));
    column(stage, "undisturbed", "episode_sha256")
}

#[test]
fn the_second_of_two_planners_on_a_worker_is_refused_and_both_are_named() {
    let stage = Stage::new();
    let planner = program("planner-node");
    let script = stage.path("two.sh");
    let one = format!("'{}' --planner constant-velocity \"$@\"", planner.display());
    // The shell gives a process in the background no standard input of its own accord.
    fs::write(&script, format!("exec 3<&0\n{one} <&3 &\n{one}\nwait\n")).unwrap();
    let mut command =
        stage.command("run --scenarios small.toml --record none --parallel 2 --out run --planner-command");
    let output = command.arg(format!("sh {}", script.display())).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(0), "{said}");
    for worker in ["w0", "w1"] {
        let refused = format!(
            "planner {worker}.1 (worker {worker}) is refused: planner {worker}.1 (worker {worker}) answers already"
        );
        assert!(
            said.lines().any(|line| line.contains("WARN") && line.contains(&refused)),
            "the sim names both: {said}"
        );
        assert!(said.lines().any(|line| !line.contains("WARN") && line.contains(&refused)), "the node too: {said}");
    }
    assert_eq!(column(&stage, "run", "episode_sha256"), undisturbed(&stage, "--scenarios small.toml"));
}

#[test]
fn a_stray_planner_is_refused_and_both_are_named() {
    let stage = Stage::new();
    let endpoint = endpoint();
    let arguments =
        format!("run --driver constant-velocity --record none --parallel 1 --out run --endpoint {endpoint}");
    let sim = stage.start(&arguments);
    stage.wait_for("planner-node");
    wait_until("an episode is done", || stage.parts("run") > 0);
    let stray = ended(planner_node(&stage, &endpoint, "constant-velocity-strict").spawn().unwrap());
    let sim = ended(sim);
    let refused = "planner mine (worker *) is refused: it does not know the run's secret; planner w0.1 (worker w0) answers already";
    assert_eq!(stray.code, Some(2), "{stray:?}");
    assert!(stray.err.contains(refused) && stray.err.contains("hint: "), "{stray:?}");
    assert_eq!(sim.code, Some(0), "{sim:?}");
    assert!(sim.err.contains(refused), "{sim:?}");
}

#[test]
fn a_planner_that_knows_another_secret_than_the_runs_says_so_and_leaves() {
    let stage = Stage::new();
    let endpoint = endpoint();
    let mut sim = stage.command("run --planner external --scenarios small.toml --record none --out run --endpoint");
    let mut sim = sim.arg(&endpoint).env("RELOOP_SECRET", "right").spawn().unwrap();
    let mut stray = planner_node(&stage, &endpoint, "external-strict");
    let stray = ended(stray.env("RELOOP_SECRET", "wrong").spawn().unwrap());
    sim.kill().unwrap();
    sim.wait().unwrap();
    assert_eq!(stray.code, Some(2), "{stray:?}");
    assert!(stray.err.contains("does not know this node") && stray.err.contains("hint: is RELOOP_SECRET"), "{stray:?}");
}

#[test]
fn what_a_stranger_puts_on_the_bus_changes_nothing_and_is_named() {
    let stage = Stage::new();
    let expected = undisturbed(&stage, "");
    let endpoint = endpoint();
    let (over, run) = (AtomicBool::new(false), "constant-velocity-strict");
    let name: RunName = run.parse().unwrap();
    let said = std::thread::scope(|scope| {
        scope.spawn(|| {
            let session = connect(&endpoint, &over);
            let floor = Place::open_floor(&name);
            let worker = Worker::numbered(0);
            let tape = |channel| {
                floor.tape(&Address { worker: worker.clone(), scene: SceneId::new("curve-3-0").unwrap(), channel })
            };
            let plan = Answering { worker: worker.clone(), channel: Channel::Plan, session: "f00".to_owned() };
            let end = proto::EpisodeEnd { reason: 6, ..Default::default() }.encode_to_vec();
            let keys = [
                format!("reloop/{run}/w0/curve-3-0/scene"),
                format!("reloop/{run}/w0/curve-3-0/end"),
                floor.told(&Workers::One(worker.clone())),
                floor.answer(&plan),
                tape(Channel::Record),
                tape(Channel::Plan),
                tape(Channel::End),
            ];
            while !over.load(Ordering::Relaxed) {
                keys.iter().for_each(|key| drop(session::send(&session, key, end.clone())));
                std::thread::sleep(std::time::Duration::from_millis(5));
            }
        });
        let arguments = format!("run --driver constant-velocity --parallel 1 --out run --endpoint {endpoint}");
        let ended = stage.sim(&arguments);
        over.store(true, Ordering::Relaxed);
        ended
    });
    assert_eq!(said.code, Some(0), "{said:?}");
    assert_eq!(column(&stage, "run", "episode_sha256"), expected);
    assert!(column(&stage, "run", "recording_error").iter().all(String::is_empty), "no recorder hears a stranger");
    for what in [
        "w0/curve-3-0/scene",
        "w0/curve-3-0/end",
        "w0/told",
        "w0/plan/f00",
        "@tape/w0/curve-3-0/record",
        "@tape/w0/curve-3-0/end",
    ] {
        let named = format!("somebody put reloop/{run}/{what} on the bus: it is not counted");
        assert!(said.err.contains(&named), "{what} is not named: {}", said.err);
    }
}

#[test]
fn an_answer_too_many_fails_its_episode_also_after_the_last_step() {
    let stage = Stage::new();
    let sim = by_hand(&stage, |episode, step, telling| match telling {
        Telling::Observation if episode == 2 && step == 2 => vec![plan(episode, step), plan(episode, step)],
        Telling::Observation => vec![plan(episode, step)],
        Telling::End if episode == 1 => vec![plan(episode, step), done(episode)],
        Telling::End => vec![done(episode)],
        _ => vec![],
    });
    assert_eq!(sim.code, Some(1), "{sim:?}");
    let too_many = "the planner says more than it was asked for: one plan too many";
    let details = column(&stage, "run", "end_detail");
    assert_eq!(details[0], format!("after the last step: {too_many}"), "{details:?}");
    // The second may be there before the next step is asked for, or be taken for the answer to that.
    assert!(details[1].contains(too_many) || details[1].contains("answers step 2, but step 3"), "{details:?}");
    let reasons = column(&stage, "run", "end_reason");
    assert_eq!(reasons.iter().filter(|reason| *reason == "driver-failed").count(), 2, "{reasons:?}");
}

#[test]
fn who_speaks_in_the_simulators_name_to_a_planner_fails_its_episode() {
    let stage = Stage::new();
    let sim = by_hand(&stage, |episode, step, telling| match telling {
        Telling::Observation if episode == 1 && step == 2 => vec![], // for `by_hand`: a second scene, by the planner itself
        Telling::Observation => vec![plan(episode, step)],
        Telling::End => vec![done(episode)],
        _ => vec![],
    });
    assert_eq!(sim.code, Some(1), "{sim:?}");
    let details = column(&stage, "run", "end_detail");
    assert_eq!(details[0], "step 2: somebody else spoke to the planner in the simulator's name");
    assert!(
        sim.err.contains("somebody else speaks to planner by-hand (worker *) in the simulator's name (w0/told)"),
        "{sim:?}"
    );
}

fn plan(episode: u64, step: u32) -> proto::Answer {
    let states = vec![proto::PlanState::default(); world::plan::PLAN_STEPS];
    proto::Answer { episode, what: Some(proto::answer::What::Plan(proto::Plan { step, states, ..Default::default() })) }
}

fn done(episode: u64) -> proto::Answer {
    proto::Answer { episode, what: Some(proto::answer::What::Done(proto::Done {})) }
}

fn connect(endpoint: &str, over: &AtomicBool) -> Session {
    let address = endpoint.strip_prefix("tcp/").unwrap();
    while TcpStream::connect(address).is_err() {
        assert!(!over.load(Ordering::Relaxed), "the sim never listened");
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
    session::open_client(endpoint).unwrap()
}

/// A run whose external planner says what `reply` makes of episode, step and what was told. Where it makes nothing of an observation,
/// it tells itself a scene, in the simulator's name.
fn by_hand(stage: &Stage, reply: impl Fn(u64, u32, Telling) -> Vec<proto::Answer> + Send + Sync + 'static) -> Ended {
    let endpoint = endpoint();
    let over = Arc::new(AtomicBool::new(false));
    let (to, stop) = (endpoint.clone(), Arc::clone(&over));
    let planner = std::thread::spawn(move || {
        let session = connect(&to, &stop);
        let place = Place::seat(&"external-strict".parse().unwrap(), &Secret::from(SECRET)).unwrap();
        let me = session.zid().to_string();
        let answer = Answering { worker: Worker::numbered(0), channel: Channel::Plan, session: me.clone() };
        let (speaker, told_key, answer_key) =
            (session.clone(), place.told(&Workers::One(Worker::numbered(0))), place.answer(&answer));
        let told = session.declare_subscriber(place.told(&Workers::All)).callback(move |sample| {
            let bytes = sample.payload().to_bytes();
            let (episode, telling, message) = envelope::open::<Telling>(&bytes).unwrap();
            let step = match telling {
                Telling::Observation => proto::Observation::decode(message).unwrap().step,
                _ => 0,
            };
            let answers = reply(episode, step, telling);
            if telling == Telling::Observation && answers.is_empty() {
                let scene = envelope::seal(episode, Telling::Scene, vec![].into());
                session::send(&speaker, &told_key, scene).unwrap();
            }
            for answer in answers {
                let _ = session::send(&speaker, &answer_key, answer.encode_to_vec());
            }
        });
        let _told = told.wait().unwrap();
        let node = NodeId::new(Role::Planner, Workers::All, "by-hand", &me).unwrap();
        let _token = session.liveliness().declare_token(node.key(&place)).wait().unwrap();
        while !stop.load(Ordering::Relaxed) {
            std::thread::sleep(std::time::Duration::from_millis(10));
        }
    });
    let arguments = format!(
        "run --scenarios small.toml --planner external --record none --parallel 1 --out run --endpoint {endpoint}"
    );
    let output = stage.command(&arguments).env(Secret::VARIABLE, SECRET).output().unwrap();
    over.store(true, Ordering::Relaxed);
    planner.join().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    Ended { code: output.status.code(), out: text(output.stdout), err: text(output.stderr) }
}
