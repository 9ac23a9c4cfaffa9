//! Nodes of other hosts and other users: who may come in, who may do what, and what a flood does. `docs/hosts.md` has a table of it that
//! names these tests. They need openssl, and one of them root; where that is missing they skip, and say so.

use std::fs;
use std::io::Read as _;
use std::net::TcpListener;
use std::os::unix::fs::{MetadataExt as _, PermissionsExt as _};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

use prost::Message as _;
use results::parquet::Table;
use wire::keys::{Answering, Channel, NodeId, Place, Role, RunName, Secret, Worker, Workers};
use wire::session::ZenohFile;
use wire::{proto, session};
use zenoh::sample::{Locality, Sample};
use zenoh::{Session, Wait};

use crate::stage::{Ended, Stage, program, wait_until};

const RUN: &str = "external-strict";
const SECRET: &str = "between-us";
const DRIVE: &str = "run --scenarios small.toml --planner external --record none --parallel 2 --out run -v";

/// The guide's own script and configurations, in the stage's folder: an authority, `sim`, `planner` and `viewer`, and `stranger` of
/// another authority. None, with a word about it, where there is no openssl.
pub fn certificates(stage: &Stage) -> Option<()> {
    if !Command::new("openssl").arg("version").output().is_ok_and(|output| output.status.success()) {
        eprintln!("skipped: no openssl");
        return None;
    }
    let hosts = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().join("examples/hosts");
    let authority = |folder: &str, names: &[&str]| {
        let made =
            Command::new("sh").arg(hosts.join("authority.sh")).arg(stage.path(folder)).args(names).output().unwrap();
        assert!(made.status.success(), "{made:?}");
    };
    authority("certificates", &["localhost", "planner", "viewer"]);
    authority("others", &["localhost", "stranger"]);
    for name in ["stranger.pem", "stranger-key.pem"] {
        fs::rename(stage.path("others").join(name), stage.path("certificates").join(name)).unwrap();
    }
    fs::copy(hosts.join("sim.json5"), stage.path("sim.json5")).unwrap();
    let planner = fs::read_to_string(hosts.join("planner.json5")).unwrap();
    for name in ["planner", "viewer", "stranger"] {
        fs::write(stage.path(&format!("{name}.json5")), planner.replace("/planner", &format!("/{name}"))).unwrap();
    }
    let ca = "{ transport: { link: { tls: { root_ca_certificate: 'certificates/ca.pem' } } } }";
    fs::write(stage.path("nobody.json5"), ca).unwrap();
    Some(())
}

/// A port that nobody listens on.
pub fn free_port() -> u16 {
    TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}

/// A run that waits for a planner at this endpoint.
fn start(stage: &Stage, endpoint: &str, more: &[&str]) -> Child {
    let mut sim = stage.command(DRIVE);
    sim.args(["--endpoint", endpoint]).args(more).env(Secret::VARIABLE, SECRET);
    sim.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

/// The same by TLS, for a planner whose certificate says `planner`.
fn start_locked(stage: &Stage) -> (Child, String) {
    let endpoint = format!("tls/localhost:{}", free_port());
    let sim = start(stage, &endpoint, &["--zenoh-config", "sim.json5", "--planner-certificate", "planner"]);
    (sim, endpoint)
}

/// The same for whoever comes by the loopback.
fn start_open(stage: &Stage) -> (Child, String) {
    let endpoint = format!("tcp/127.0.0.1:{}", free_port());
    (start(stage, &endpoint, &[]), endpoint)
}

/// Our planner, by the configuration of this name, for all workers.
fn planner(stage: &Stage, endpoint: &str, whose: &str) -> Command {
    let mut command = stage.beside("planner-node");
    command.args([
        "--planner",
        "constant-velocity",
        "--name",
        whose,
        "--endpoint",
        endpoint,
        "--run",
        RUN,
        "--worker",
        "*",
    ]);
    if endpoint.starts_with("tls/") {
        command.args(["--zenoh-config", &format!("{whose}.json5")]);
    }
    command.env(Secret::VARIABLE, SECRET).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
    command
}

fn ended(child: Child) -> Ended {
    let output = child.wait_with_output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    Ended { code: output.status.code(), out: text(output.stdout), err: text(output.stderr) }
}

fn digests(stage: &Stage, run: &str) -> Vec<String> {
    Table::read(&stage.path(run).join("results.parquet")).unwrap().text("episode_sha256").unwrap()
}

/// The same drives, without anybody from outside.
fn undisturbed(stage: &Stage) -> Vec<String> {
    let arguments =
        "run --scenarios small.toml --record none --driver constant-velocity --parallel 1 --out undisturbed";
    stage.good_sim(arguments);
    digests(stage, "undisturbed")
}

/// The right planner comes after all, and the run is as if nobody else had: what the sim said.
fn ends_well(stage: &Stage, sim: Child, endpoint: &str) -> Ended {
    let node = ended(planner(stage, endpoint, "planner").spawn().unwrap());
    assert_eq!(node.code, Some(0), "{node:?}");
    let sim = ended(sim);
    assert_eq!(sim.code, Some(0), "{sim:?}");
    assert_eq!(digests(stage, "run"), undisturbed(stage));
    sim
}

/// Somebody with this configuration is refused: the node says `theirs` and a hint, the sim says `ours`.
fn is_refused(whose: &str, theirs: &str, ours: &str) {
    let stage = Stage::new();
    let Some(()) = certificates(&stage) else { return };
    let (sim, endpoint) = start_locked(&stage);
    let refused = ended(planner(&stage, &endpoint, whose).spawn().unwrap());
    assert_eq!(refused.code, Some(2), "{refused:?}");
    assert!(refused.err.contains(theirs) && refused.err.contains("hint: "), "{refused:?}");
    let sim = ends_well(&stage, sim, &endpoint);
    assert!(sim.err.contains(ours), "{sim:?}");
}

#[test]
fn a_planner_with_the_right_certificate_drives_and_the_run_says_which_configuration_it_had() {
    let stage = Stage::new();
    let Some(()) = certificates(&stage) else { return };
    let (sim, endpoint) = start_locked(&stage);
    let said = ends_well(&stage, sim, &endpoint);
    assert!(said.err.contains(&format!("--endpoint {endpoint}")), "{said:?}");
    let file = fs::read_to_string(stage.path("run/run.toml")).unwrap();
    let sum = results::files::sha256([&*stage.path("sim.json5")]).unwrap();
    assert!(file.contains(&sum) && file.contains("planner-certificates = [\"planner\"]"), "{file}");
    assert!(!file.contains(SECRET) && !file.contains("enable_mtls"), "{file}");
}

#[test]
fn a_certificate_of_another_authority_is_refused() {
    let theirs = "it does not know the authority of this node's certificate";
    is_refused("stranger", theirs, "somebody who came by TLS is refused: its certificate is not of our authority");
}

#[test]
fn who_has_no_certificate_is_refused() {
    let theirs = "it lets in nobody without a certificate";
    is_refused("nobody", theirs, "somebody who came by TLS is refused: it has no certificate");
}

#[test]
fn the_certificate_of_a_viewer_does_not_make_a_planner_of_who_knows_the_secret() {
    let refused = "planner viewer (worker *) is refused: its certificate is of viewer, and the planner of this run must have that of planner";
    is_refused("viewer", refused, refused);
}

/// A session at the run's endpoint, as soon as there is one.
fn connect(endpoint: &str, zenoh_file: Option<&ZenohFile>) -> Session {
    session::open_client_with(endpoint, zenoh_file)
        .or_else(|_| session::open_client_with(endpoint, zenoh_file))
        .unwrap()
}

/// An answer that ends an episode when it is believed.
fn lie(session: &Session, seat: &Place, whose: &str) {
    let plan = Answering { worker: Worker::numbered(0), channel: Channel::Plan, session: whose.to_owned() };
    let answer = proto::Answer { episode: 1, what: Some(proto::answer::What::Done(proto::Done {})) };
    let _ = session::send(session, &seat.answer(&plan), answer.encode_to_vec());
}

#[test]
fn a_viewer_who_knows_the_secret_hears_nothing_at_the_seat_and_10_000_lies_in_the_planners_name_are_not_heard() {
    // Its own session is by TLS, too.
    session::settle_for("tls/localhost");
    let stage = Stage::new();
    let Some(()) = certificates(&stage) else { return };
    let (sim, endpoint) = start_locked(&stage);
    let viewer = connect(&endpoint, Some(&ZenohFile::read(&stage.path("viewer.json5")).unwrap()));
    let name: RunName = RUN.parse().unwrap();
    let seat = Place::seat(&name, &Secret::from(SECRET)).unwrap();
    let [heard, taped] = [(); 2].map(|()| Arc::new(Mutex::new(Vec::<String>::new())));
    let listen = |key: String, keys: &Arc<Mutex<Vec<String>>>| {
        let keys = Arc::clone(keys);
        let hear = move |sample: Sample| keys.lock().unwrap().push(sample.key_expr().to_string());
        // What it says itself it hears anyway.
        viewer.declare_subscriber(key).allowed_origin(Locality::Remote).callback(hear).wait().unwrap()
    };
    // Also by a wildcard that no rule includes.
    let _at_the_seat = listen(seat.told(&Workers::All), &heard);
    let _anywhere = listen(format!("**/@seat-{SECRET}/**"), &heard);
    let _tape = listen(Place::open_floor(&name).whole_tape(), &taped);
    let node = planner(&stage, &endpoint, "planner").spawn().unwrap();
    // Sessions name themselves in the keys they answer under: the viewer takes the planner's name there.
    let mut whose = None;
    wait_until("the planner is there", || {
        let mut tokens = viewer.liveliness().get(seat.nodes()).wait().unwrap().into_iter();
        whose = tokens.find_map(|reply| NodeId::parse(reply.result().ok()?.key_expr().as_str())?.session);
        whose.is_some()
    });
    for _ in 0..10_000 {
        lie(&viewer, &seat, whose.as_ref().unwrap());
    }
    let _ = session::send(&viewer, &seat.told(&Workers::One(Worker::numbered(0))), vec![1]);
    let (node, sim) = (ended(node), ended(sim));
    assert_eq!((node.code, sim.code), (Some(0), Some(0)), "{node:?} {sim:?}");
    assert_eq!(digests(&stage, "run"), undisturbed(&stage));
    assert!(heard.lock().unwrap().is_empty(), "nothing of the seat: {heard:?}");
    assert!(!taped.lock().unwrap().is_empty(), "what is driven may be watched");
    assert!(!sim.err.contains("somebody else"), "the router let none of it through: {sim:?}");
}

#[test]
fn certificates_cannot_decide_where_nobody_is_asked_for_one() {
    let stage = Stage::new();
    fs::write(stage.path("plain.json5"), "{}").unwrap();
    let refused = stage.sim(
        "run --planner external --endpoint tcp/127.0.0.1:0 --zenoh-config plain.json5 --planner-certificate planner --out run",
    );
    assert_eq!(refused.code, Some(2));
    assert!(refused.err.contains("nobody is asked for one") && refused.err.contains("hint: "), "{refused:?}");
}

#[test]
fn a_configuration_with_a_fault_is_named_before_anything_starts() {
    let stage = Stage::new();
    fs::write(stage.path("bad.json5"), "{ transport: { link: { tls: { enable_mtls: 'yes' } } } }").unwrap();
    let refused = stage.sim("run --zenoh-config bad.json5 --out run");
    assert_eq!(refused.code, Some(2));
    assert!(refused.err.contains("bad.json5: transport/link/tls/enable_mtls: expected a boolean"), "{refused:?}");
    assert!(!stage.path("run").exists());
}

#[test]
fn without_an_endpoint_no_port_is_listened_on_and_with_one_that_one_alone() {
    let stage = Stage::new();
    for (endpoint, ports) in [(None, 0), (Some(free_port()), 1)] {
        let more = endpoint.map(|port| format!("--endpoint tcp/127.0.0.1:{port}")).unwrap_or_default();
        let mut sim = stage.start(&format!("run --driver idm --record none --parallel 1 --out {ports} {more}"));
        stage.wait_for("planner-node");
        let listening: Vec<String> = listening(&stage);
        sim.kill().unwrap();
        sim.wait().unwrap();
        stage.wait_until_alone();
        assert_eq!(listening.len(), ports, "{listening:?}");
        let ours = |line: &String| line.starts_with(&format!("0100007F:{:04X}", endpoint.unwrap()));
        assert!(listening.iter().all(ours), "{listening:?}");
    }
}

/// The TCP sockets on which processes of this stage listen, as /proc has them.
fn listening(stage: &Stage) -> Vec<String> {
    let mut sockets = Vec::new();
    for (pid, _) in stage.processes() {
        for entry in fs::read_dir(format!("/proc/{pid}/fd")).into_iter().flatten().flatten() {
            sockets.extend(fs::read_link(entry.path()).map(|to| to.display().to_string()));
        }
    }
    let tables = ["/proc/net/tcp", "/proc/net/tcp6"].map(|table| fs::read_to_string(table).unwrap_or_default());
    let lines =
        tables.iter().flat_map(|table| table.lines().skip(1)).map(|line| line.split_whitespace().collect::<Vec<_>>());
    let ours = lines.filter(|line| line[3] == "0A" && sockets.contains(&format!("socket:[{}]", line[9])));
    ours.map(|line| line[1].to_owned()).collect()
}

#[test]
fn who_comes_by_the_loopback_without_a_certificate_hears_nothing_of_what_is_driven_and_who_shares_the_user_does() {
    let stage = Stage::new();
    let (mut sim, endpoint) = start_open(&stage);
    let floor = Place::open_floor(&RUN.parse().unwrap());
    let count = |endpoint: &str| {
        let heard = Arc::new(AtomicUsize::new(0));
        let session = connect(endpoint, None);
        let counted = Arc::clone(&heard);
        let hear = move |_| _ = counted.fetch_add(1, Ordering::Relaxed);
        let tape = session.declare_subscriber(floor.whole_tape()).callback(hear).wait().unwrap();
        (heard, session, tape)
    };
    let outside = count(&endpoint);
    let mut said = String::new();
    let inside = socket_of(&mut sim, &mut said);
    let inside = count(&inside);
    ends_well(&stage, sim, &endpoint);
    assert!(inside.0.load(Ordering::Relaxed) > 0);
    assert_eq!(outside.0.load(Ordering::Relaxed), 0);
}

/// The run's own socket, as its log says it; what was read of the log goes to `said`.
fn socket_of(sim: &mut Child, said: &mut String) -> String {
    let log = sim.stderr.as_mut().unwrap();
    let mut byte = [0];
    while !said.contains(" at unixsock-stream/") || !said.ends_with('\n') {
        assert_eq!(log.read(&mut byte).unwrap(), 1, "{said}");
        said.push(byte[0] as char);
    }
    said.rsplit_once(" at ").unwrap().1.trim().to_owned()
}

/// A program of the workspace, run by the user nobody; none where this test is not root's.
fn as_nobody(program: &Path) -> Option<Command> {
    let is_root = fs::metadata("/proc/self").unwrap().uid() == 0;
    if !is_root || !Command::new("setpriv").arg("--version").output().is_ok_and(|output| output.status.success()) {
        eprintln!("skipped: only root can be another user, and setpriv is needed");
        return None;
    }
    let mut command = Command::new("setpriv");
    command.args(["--reuid=65534", "--regid=65534", "--clear-groups", "--"]).arg(program);
    command.current_dir("/").env_clear();
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    Some(command)
}

/// A copy of a program that everybody may run.
fn for_everybody(folder: &tempfile::TempDir, name: &str) -> PathBuf {
    fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o755)).unwrap();
    let copy = folder.path().join(name);
    fs::copy(program(name), &copy).unwrap();
    copy
}

#[test]
fn another_user_of_the_host_finds_no_secret_and_is_refused_at_both_doors() {
    let (stage, folder) = (Stage::new(), tempfile::tempdir().unwrap());
    let node = for_everybody(&folder, "planner-node");
    let Some(mut cat) = as_nobody(Path::new("/bin/cat")) else { return };
    let (mut sim, endpoint) = start_open(&stage);
    let mut said = String::new();
    let socket = socket_of(&mut sim, &mut said);
    let pid = sim.id();
    assert!(fs::read_to_string(format!("/proc/{pid}/environ")).unwrap().contains(SECRET), "its user may read it");
    // Not in what everybody may read, and closed to others where it is.
    let seen = cat.arg(format!("/proc/{pid}/environ")).output().unwrap();
    assert!(!seen.status.success() && seen.stdout.is_empty(), "{seen:?}");
    for (pid, _) in stage.processes() {
        let arguments = fs::read_to_string(format!("/proc/{pid}/cmdline")).unwrap_or_default();
        assert!(!arguments.contains(SECRET), "{arguments}");
    }
    let refused = |endpoint: &str| {
        let mut node = as_nobody(&node).unwrap();
        node.args(["--planner", "constant-velocity", "--name", "other", "--endpoint", endpoint]);
        ended(node.args(["--run", RUN]).spawn().unwrap())
    };
    let (at_the_port, at_the_socket) = (refused(&endpoint), refused(&socket));
    let sim = ends_well(&stage, sim, &endpoint);
    let word = "planner other (worker *) is refused: it does not know the run's secret";
    assert_eq!(at_the_port.code, Some(2), "{at_the_port:?}");
    assert!(at_the_port.err.contains(word), "{at_the_port:?}");
    assert_eq!(at_the_socket.code, Some(2), "{at_the_socket:?}");
    assert!(at_the_socket.err.contains("it belongs to another user of this machine"), "{at_the_socket:?}");
    assert!(sim.err.contains(word) && !sim.err.contains(SECRET), "{sim:?}");
    let holds = |bytes: &[u8]| bytes.windows(SECRET.len()).any(|window| window == SECRET.as_bytes());
    assert!(
        !holds(&fs::read(stage.path("run/run.toml")).unwrap())
            && !stage.files("run").values().any(|bytes| holds(bytes))
    );
}

#[test]
fn a_flood_of_10_000_messages_fills_neither_the_log_nor_the_memory_and_changes_nothing() {
    let stage = Stage::new();
    let (sim, endpoint) = start_open(&stage);
    let stranger = connect(&endpoint, None);
    let floor = Place::open_floor(&RUN.parse().unwrap());
    let me = stranger.zid().to_string();
    // Held until it is over: 100 tokens of nodes that nobody let in, beside the messages.
    let mut tokens = Vec::new();
    for number in 0..100 {
        let node = NodeId::new(Role::Planner, Workers::All, &format!("many-{number}"), &me).unwrap();
        tokens.push(stranger.liveliness().declare_token(node.key(&floor)).wait().unwrap());
    }
    let payload = vec![7; 10_000];
    let memory = |what: &str| {
        let status = fs::read_to_string(format!("/proc/{}/status", sim.id())).unwrap_or_default();
        let line =
            status.lines().find_map(|line| line.strip_prefix(what)?.trim().strip_suffix(" kB")?.parse::<u64>().ok());
        line.map_or(0, |kilobytes| kilobytes / 1024)
    };
    let before = memory("VmHWM:");
    let noise = |number: u64| format!("reloop/{RUN}/w0/noise-{}", number % 7);
    (0..10_000).for_each(|number| session::send(&stranger, &noise(number), payload.clone()).unwrap());
    let after = memory("VmHWM:");
    // And on, while it drives. Nobody waits for it: in Zenoh 1.10.2 who waits for room to send when the connection ends, waits on.
    std::thread::spawn(move || (0..).try_for_each(|number| session::send(&stranger, &noise(number), payload.clone())));
    let sim = ends_well(&stage, sim, &endpoint);
    let told = sim.err.lines().filter(|line| line.contains("not counted") || line.contains("is refused")).count();
    assert!((1..=101).contains(&told), "{told} lines tell of it");
    assert!(sim.err.contains("more of this follows, and is not told"), "{sim:?}");
    assert!(after < before + 64, "from {before} to {after} MB");
}
