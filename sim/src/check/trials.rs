//! The trials: each finds out about a rule or two. None but the first needs the node of another: a node that fails is started anew.

use std::path::Path;
use std::time::{Duration, Instant};

use prost::Message as _;
use wire::envelope::{self, Saying, Telling};
use wire::hub::Line as _;
use wire::keys::{Role, Worker, Workers};
use wire::{WIRE_VERSION, convert, proto};

use super::answers::{Answer, Driven, difference, in_place, in_time};
use super::course::Course;
use super::golden::{Golden, GoldenError};
use super::rule::{Finding, Rule, Verdict};
use super::stand::{Node, Stand, Trouble};
use super::traffic::{hand_over, moves};
use crate::run::process::Process;

/// How long a node may take to leave.
const LEAVING: Duration = Duration::from_secs(5);

/// How long a node that nobody knows may wait to be let in.
const UNKNOWN: Duration = Duration::from_secs(20);

/// How it ends who leaves as it should.
const IN_PEACE: &str = "exited with code 0";

/// How long something that may come is waited for.
const LULL: Duration = Duration::from_millis(300);

/// Steps after which an episode is cut short.
const SHORT: usize = 10;

/// What came of the first drives: the courses that were driven to their end, and the answers along them.
struct Known<'a> {
    driven: Vec<(&'a Course, Driven)>,
}

/// What is asked for beside the rules.
pub struct Wishes<'a> {
    /// Rules that are not to be looked at. Those of the first drives always are.
    pub skip: &'a [Rule],
    /// The file of answers.
    pub golden: Option<&'a Path>,
    /// Whether it is written anew.
    pub bless: bool,
}

/// All trials. The bus is closed at the end of them.
///
/// # Errors
/// [`GoldenError`] where the file of answers cannot be read or written.
pub fn all(stand: Stand, courses: &[Course], wishes: &Wishes<'_>) -> Result<Vec<Finding>, GoldenError> {
    let role = stand.subject().role;
    // Before anything is driven: whoever has no such file waits for nothing.
    let before = match wishes.golden {
        Some(path) if !wishes.bless && path.exists() => Some(Golden::read(path, role)?),
        _ => None,
    };
    let is_wanted = |rule: Rule| !wishes.skip.contains(&rule);
    // Begun first and seen last: it may take its time.
    let unknown = is_wanted(Rule::Unknown).then(|| begin_unknown(&stand));
    let mut findings = Vec::new();
    let (known, node) = first_drives(&stand, courses, &mut findings);
    let is_driven = !known.driven.is_empty();
    if is_driven && is_wanted(Rule::Repeats) {
        findings.push(Finding::of(Rule::Repeats, repeats(&stand, &known)));
    }
    let repeats = !findings.iter().any(|finding| finding.rule == Rule::Repeats && finding.verdict == Verdict::Broken);
    // What was driven before can make a difference only where nothing else does.
    if is_driven && repeats && is_wanted(Rule::Forgets) {
        findings.push(Finding::of(Rule::Forgets, forgets(&stand, &known, node)));
    } else {
        drop(node);
    }
    let trials: [(Rule, &dyn Fn() -> Finding); 6] = [
        (Rule::OddScenes, &|| Finding::of(Rule::OddScenes, odd_scenes(&stand, &known))),
        (Rule::CutShort, &|| Finding::of(Rule::CutShort, cut_short(&stand, &known))),
        (Rule::Noise, &|| Finding::of(Rule::Noise, noise(&stand, &known))),
        (Rule::Version, &|| version(&stand, &known)),
        (Rule::AllWorkers, &|| all_workers(&stand, &known)),
        (Rule::Late, &|| Finding::of(Rule::Late, late(&stand, &known))),
    ];
    for (rule, trial) in trials {
        if is_driven && is_wanted(rule) {
            findings.push(trial());
        }
    }
    if let Some(path) = wishes.golden.filter(|_| is_driven) {
        findings.push(golden_answers(role, &known, before, path)?);
    }
    if is_wanted(Rule::Second) {
        findings.push(Finding::of(Rule::Second, second(&stand, &known)));
    }
    if let Some(unknown) = unknown {
        findings.push(Finding::of(Rule::Unknown, unknown.and_then(|(process, start)| leaves_unknown(process, start))));
    }
    if is_wanted(Rule::Leaves) {
        findings.push(leaves(stand));
    }
    let is_open = |rule: &Rule| rule.is_of(role) && findings.iter().all(|finding| finding.rule != *rule);
    for rule in Rule::ALL.into_iter().filter(is_open).collect::<Vec<_>>() {
        let why = match rule {
            rule if !is_wanted(rule) => "--skip",
            Rule::Golden if wishes.golden.is_none() => "no --golden FILE",
            Rule::Forgets if is_driven => "it does not repeat",
            _ => "no course was driven to its end",
        };
        findings.push(Finding::skipped(rule, why));
    }
    findings.sort_by_key(|finding| finding.rule);
    Ok(findings)
}

fn one() -> Workers {
    Workers::One(Worker::numbered(0))
}

fn fresh(stand: &Stand) -> Result<Node<'_>, String> {
    stand.start(&stand.seats(&one())?)
}

fn first_drives<'a, 's>(
    stand: &'s Stand,
    courses: &'a [Course],
    findings: &mut Vec<Finding>,
) -> (Known<'a>, Option<Node<'s>>) {
    let mut known = Known { driven: Vec::new() };
    let mut node = match fresh(stand) {
        Ok(node) => {
            findings.push(Finding::holds(Rule::Joins, format!("on the bus after {:.2} s", node.joined.as_secs_f64())));
            Some(node)
        }
        Err(error) => {
            findings.push(Finding::broken(Rule::Joins, error));
            return (known, None);
        }
    };
    let (mut wrong, mut late, mut impossible) = (Vec::new(), Vec::new(), Vec::new());
    for course in courses {
        let driven = match &mut node {
            Some(node) => node.drive(course),
            None => Err(Trouble::Wrong("it cannot be started again".to_owned())),
        };
        match driven {
            Ok(driven) => known.driven.push((course, driven)),
            Err(trouble) => {
                match trouble {
                    Trouble::Late(said) => late.push(said),
                    Trouble::Wrong(said) => wrong.push(said),
                    Trouble::Impossible(said) => impossible.push(said),
                }
                drop(node.take());
                node = fresh(stand).ok();
            }
        }
    }
    let steps = || known.driven.iter().flat_map(|(course, driven)| course.steps.iter().zip(&driven.answers));
    let count = steps().count();
    findings.push(match wrong.first() {
        Some(first) => Finding::broken(Rule::Answers, more(first, wrong.len())),
        None => Finding::holds(Rule::Answers, format!("{count} whole answers on {} courses", known.driven.len())),
    });
    let times = known.driven.iter().flat_map(|(_, driven)| driven.times.iter().copied()).collect::<Vec<_>>();
    match late.first() {
        Some(first) => findings.push(Finding::broken(Rule::InTime, more(first, late.len()))),
        None if times.is_empty() => {}
        None => findings.push(in_time(times, stand.deadline)),
    }
    let role = stand.subject().role;
    if role == Role::Traffic {
        match impossible.first() {
            Some(first) => findings.push(Finding::broken(Rule::Moves, more(first, impossible.len()))),
            None if count > 0 => findings.push(moves(&known.driven)),
            None => {}
        }
        if count > 0 {
            findings.push(hand_over(&known.driven));
        }
    } else if count > 0 {
        let answers = steps().map(|((observation, _), answer)| (observation, answer));
        findings.push(in_place(role, answers));
    }
    (known, node)
}

fn more(first: &str, count: usize) -> String {
    if count == 1 { first.to_owned() } else { format!("{first}; and {} more", count - 1) }
}

impl Known<'_> {
    /// Drives the first known course, and compares.
    fn again(&self, node: &mut Node<'_>) -> Result<String, String> {
        let Some((course, known)) = self.driven.first() else { return Err("no course is known".to_owned()) };
        same(node, course, known).map(|()| "the same answers".to_owned())
    }
}

/// Drives a course again: are the answers those that are known?
fn same(node: &mut Node<'_>, course: &Course, known: &Driven) -> Result<(), String> {
    let driven = node.drive(course).map_err(Trouble::said)?;
    match difference(&known.answers, &driven.answers) {
        None => Ok(()),
        Some(difference) => Err(format!("{}: {difference}", course.name)),
    }
}

fn repeats(stand: &Stand, known: &Known<'_>) -> Result<String, String> {
    let mut node = fresh(stand)?;
    for (course, known) in &known.driven {
        same(&mut node, course, known).map_err(|said| format!("in another process, {said}"))?;
    }
    Ok("another process gives the same answers, to the last bit".to_owned())
}

/// Drives all courses once more, backwards: what came before each is other than it was.
fn forgets(stand: &Stand, known: &Known<'_>, first: Option<Node<'_>>) -> Result<String, String> {
    let mut node = first.map_or_else(|| fresh(stand), Ok)?;
    for (course, known) in known.driven.iter().rev() {
        same(&mut node, course, known).map_err(|said| format!("after other courses, {said}"))?;
    }
    Ok("the same process gives the same answers in another order".to_owned())
}

fn odd_scenes(stand: &Stand, known: &Known<'_>) -> Result<String, String> {
    let odd: Vec<Course> = known.driven.first().into_iter().flat_map(|(course, _)| course.odd()).collect();
    let mut node = fresh(stand)?;
    for course in &odd {
        node.drive(course).map_err(Trouble::said)?;
    }
    let names: Vec<&str> = odd.iter().map(|course| course.name.as_str()).collect();
    Ok(format!("whole answers to {}", names.join(", ")))
}

fn cut_short(stand: &Stand, known: &Known<'_>) -> Result<String, String> {
    let mut node = fresh(stand)?;
    for (course, _) in &known.driven {
        node.drive(&course.cut(SHORT))
            .map_err(|trouble| format!("cut short after {SHORT} steps: {}", trouble.said()))?;
    }
    // And one of which only the scene was told.
    if let Some((course, _)) = known.driven.first() {
        node.drive(&course.cut(0)).map_err(|trouble| format!("ended before its first step: {}", trouble.said()))?;
    }
    known.again(&mut node).map_err(|said| format!("after episodes that were cut short, {said}"))?;
    Ok(format!("episodes that end after {SHORT} steps, or after none, cost no other"))
}

/// What no decoder can read, or should not believe.
fn noises(episode: u64) -> [(&'static str, Vec<u8>); 4] {
    let seal = |telling, bytes: &[u8]| envelope::seal(episode, telling, bytes.to_vec().into()).to_bytes().into_owned();
    [
        ("an empty message", Vec::new()),
        ("bytes that are no message", (0..200_u8).map(|byte| byte.wrapping_mul(37) | 0x80).collect()),
        ("an observation that cannot be read", seal(Telling::Observation, &[0x0a, 0xff, 0xff, 0xff, 0xff, 0x0f])),
        ("a kind of message that is not known yet", vec![0x08, 1, 0xfa, 0x01, 3, 1, 2, 3]),
    ]
}

fn noise(stand: &Stand, known: &Known<'_>) -> Result<String, String> {
    let Some((course, _)) = known.driven.first() else { return Err("no course is known".to_owned()) };
    let role = stand.subject().role;
    let mut node = fresh(stand)?;
    for number in 0..noises(0).len() {
        let mut line = node.line(0, course).map_err(Trouble::said)?;
        let Some((what, bytes)) = noises(line.number()).into_iter().nth(number) else { continue };
        let survived = (|| -> Result<(), Trouble> {
            let wrong = |error: wire::hub::LineError| Trouble::Wrong(error.to_string());
            line.announce(&course.briefing).map_err(wrong)?;
            node.step(&mut line, course, 0, &mut Driven::default())?;
            line.tell_bytes(role, bytes).map_err(wrong)?;
            // It may say that it cannot read that, or nothing.
            while line.overhear(LULL).map_err(wrong)?.is_some() {}
            node.dismiss(&mut line, course)
        })();
        survived.map_err(|trouble| {
            let gone = node.process().wait(LULL).map(|how| format!("; it {how}")).unwrap_or_default();
            format!("after {what}: {}{gone}", trouble.said())
        })?;
        drop(line);
        known.again(&mut node).map_err(|said| format!("after {what}, {said}"))?;
    }
    let names = noises(0).map(|(what, _)| what);
    Ok(format!("it lives on after {}", names.join(", ")))
}

fn version(stand: &Stand, known: &Known<'_>) -> Finding {
    let Some((course, _)) = known.driven.first() else { return Finding::skipped(Rule::Version, "no course is known") };
    let other = WIRE_VERSION + 1000;
    let role = stand.subject().role;
    let said = (|| -> Result<Option<Vec<u8>>, String> {
        let node = fresh(stand)?;
        let mut line = node.line(0, course).map_err(Trouble::said)?;
        let scene = proto::Scene { wire_version: other, ..proto::Scene::from(&course.briefing) };
        let observation = course.steps.first().map(|(observation, _)| proto::Observation::from(observation));
        let mut told = vec![
            (Telling::Scene, scene.encode_to_vec()),
            (Telling::Observation, observation.unwrap_or_default().encode_to_vec()),
        ];
        if let Some((seen, taken)) = course.reacting(0, None).filter(|_| role == Role::Traffic) {
            told.push((Telling::Taken, convert::taken_agents(seen.step, &taken).encode_to_vec()));
        }
        for (telling, bytes) in told {
            let sealed = envelope::seal(line.number(), telling, bytes.into()).to_bytes().into_owned();
            match line.tell_bytes(role, sealed) {
                // To leave is an answer too.
                Err(wire::hub::LineError::NodeLost { .. }) => return Ok(None),
                told => told.map_err(|error| error.to_string())?,
            }
        }
        match line.overhear(stand.deadline.min(LEAVING)) {
            Err(wire::hub::LineError::NodeLost { .. }) => Ok(None),
            heard => heard.map_err(|error| error.to_string()),
        }
    })();
    match said {
        Err(said) => Finding::broken(Rule::Version, said),
        Ok(None) => Finding::doubtful(Rule::Version, format!("it says nothing of a scene of version {other}")),
        Ok(Some(answer)) => match refusal(&answer) {
            Some(error) => Finding::holds(Rule::Version, format!("it refuses a scene of version {other}: {error}")),
            None => Finding::broken(
                Rule::Version,
                format!("it answers a scene of version {other} as if it were {WIRE_VERSION}"),
            ),
        },
    }
}

/// Why there is no answer, if this says so.
fn refusal(answer: &[u8]) -> Option<String> {
    let (_, saying, bytes) = envelope::open::<Saying>(answer).ok()?;
    let error = match saying {
        Saying::Plan => proto::Plan::decode(bytes).ok()?.error,
        Saying::Prediction => proto::Prediction::decode(bytes).ok()?.error,
        Saying::Moves => proto::TrafficMoves::decode(bytes).ok()?.error,
        Saying::Done => return None,
    };
    (!error.is_empty()).then(|| error.escape_debug().to_string())
}

fn all_workers(stand: &Stand, known: &Known<'_>) -> Finding {
    let [first, second] = [known.driven.first(), known.driven.last()];
    let (Some((one, one_known)), Some((other, other_known))) = (first, second) else {
        return Finding::skipped(Rule::AllWorkers, "no course is known");
    };
    let driven = (|| -> Result<[Vec<Answer>; 2], String> {
        let node = stand.start(&stand.seats(&Workers::All)?)?;
        let both = || -> Result<[Driven; 2], Trouble> {
            let mut lines = [node.line(0, one)?, node.line(1, other)?];
            let mut driven = [Driven::default(), Driven::default()];
            for (line, course) in lines.iter_mut().zip([one, other]) {
                line.announce(&course.briefing).map_err(|error| Trouble::Wrong(error.to_string()))?;
            }
            for at in 0..one.steps.len().max(other.steps.len()) {
                for ((line, course), driven) in lines.iter_mut().zip([one, other]).zip(&mut driven) {
                    node.step(line, course, at, driven)?;
                }
            }
            for (line, course) in lines.iter_mut().zip([one, other]) {
                node.dismiss(line, course)?;
            }
            Ok(driven)
        };
        both().map(|driven| driven.map(|driven| driven.answers)).map_err(Trouble::said)
    })();
    match driven {
        // Needed only where somebody starts it by hand.
        Err(said) => Finding::doubtful(Rule::AllWorkers, format!("with --worker '*': {said}")),
        Ok(driven) => {
            let known = [one_known, other_known];
            let apart = driven.iter().zip(known).find_map(|(now, known)| difference(&known.answers, now));
            match apart {
                Some(apart) => Finding::broken(Rule::AllWorkers, format!("two workers at once: {apart}")),
                None => Finding::holds(Rule::AllWorkers, "two workers at once get the same answers"),
            }
        }
    }
}

fn late(stand: &Stand, known: &Known<'_>) -> Result<String, String> {
    let mut node = fresh(stand)?;
    known.again(&mut node)?;
    let seats = node.seats().clone();
    drop(node);
    stand.wait_until_left(LEAVING)?;
    let mut node = stand.start(&seats).map_err(|said| format!("after another was killed at its seat: {said}"))?;
    known.again(&mut node).map_err(|said| format!("at a seat that was another's, {said}"))?;
    Ok("another takes the seat of one that was killed, and gives the same answers".to_owned())
}

fn golden_answers(role: Role, known: &Known<'_>, before: Option<Golden>, path: &Path) -> Result<Finding, GoldenError> {
    let now = Golden::of(role, known.driven.iter().map(|(course, driven)| (course.name.as_str(), &driven.answers[..])));
    match before {
        Some(before) => Ok(Finding::of(Rule::Golden, before.compare(&now))),
        None => {
            now.write(path)?;
            Ok(Finding::holds(Rule::Golden, format!("{} answers are written to {}", now.len(), path.display())))
        }
    }
}

/// A second node at a seat is to leave, and to cost the first nothing.
fn second(stand: &Stand, known: &Known<'_>) -> Result<String, String> {
    let mut node = fresh(stand)?;
    let mut other = stand.begin(node.seats())?;
    let how =
        left(&mut other, stand.start_timeout.max(LEAVING), false).map_err(|said| format!("at a taken seat {said}"))?;
    if known.driven.is_empty() {
        return Ok(format!("at a taken seat it {how}"));
    }
    known.again(&mut node).map_err(|said| format!("after a second came to its seat, {said}"))?;
    Ok(format!("at a taken seat it {how}, and the first drives on"))
}

/// Starts one that no run knows; what becomes of it is seen later.
fn begin_unknown(stand: &Stand) -> Result<(Process, Instant), String> {
    let seats = stand.seats(&one())?;
    Ok((stand.begin_unknown(&seats)?, Instant::now()))
}

fn leaves_unknown(mut process: Process, start: Instant) -> Result<String, String> {
    match process.wait(UNKNOWN.saturating_sub(start.elapsed())) {
        None => Err(format!("with a secret that nobody knows it stays for over {} s", UNKNOWN.as_secs())),
        Some(how) if how == IN_PEACE => Err(format!("with a secret that nobody knows it {how}, as if all were well")),
        Some(how) => Ok(format!("with a secret that nobody knows it {how}")),
    }
}

/// How it left, if it did, and with the right kind of code.
fn left(process: &mut Process, patience: Duration, in_peace: bool) -> Result<String, String> {
    let how = process.wait(patience).ok_or_else(|| format!("it stays for over {} s", patience.as_secs()))?;
    match (how == IN_PEACE, in_peace) {
        (true, true) | (false, false) => Ok(how),
        (true, false) => Err(format!("it {how}, as if all were well")),
        (false, true) => Err(format!("it {how}")),
    }
}

fn leaves(stand: Stand) -> Finding {
    let ways = (|| -> Result<Vec<String>, String> {
        let mut doubts = Vec::new();
        let mut node = fresh(&stand)?;
        node.process().end_input();
        if let Err(said) = left(node.process(), LEAVING, true) {
            doubts.push(format!("at the end of standard input {said}"));
        }
        drop(node);
        let mut node = fresh(&stand)?;
        match node.terminate(LEAVING).as_deref() {
            // Who has no handler ends by the signal: that is in order too.
            Some(IN_PEACE | "was killed by SIGTERM" | "exited with code 143, as after SIGTERM") => {}
            Some(how) => doubts.push(format!("on SIGTERM it {how}")),
            None => return Err(format!("on SIGTERM it stays for over {} s", LEAVING.as_secs())),
        }
        Ok(doubts)
    })();
    let mut doubts = match ways {
        Ok(doubts) => doubts,
        Err(said) => return Finding::broken(Rule::Leaves, said),
    };
    let mut process = match fresh(&stand).map(Node::into_process) {
        Ok(process) => process,
        Err(said) => return Finding::broken(Rule::Leaves, said),
    };
    stand.close();
    match left(&mut process, LEAVING, true) {
        Err(said) if said.contains("stays") => {
            return Finding::broken(Rule::Leaves, format!("after the sim is gone {said}"));
        }
        Err(said) => doubts.push(format!("after the sim is gone {said}")),
        Ok(_) => {}
    }
    if doubts.is_empty() {
        Finding::holds(Rule::Leaves, "at the end of standard input, on SIGTERM, and when the sim leaves")
    } else {
        Finding::doubtful(Rule::Leaves, doubts.join("; "))
    }
}
