//! The hub and nodes over real sessions, in one process: honest nodes, and nodes that lie, fall silent, fail or are of
//! another version.

use std::sync::Arc;
use std::time::{Duration, Instant};

use prost::Message as _;
use world::observation::Briefing;
use world::plan::{PLAN_STEPS, PlanState, UncheckedPlan, UncheckedPrediction};
use zenoh::Wait;

use super::*;
use crate::convert::MessageError;
use crate::digest::Digest;
use crate::node::desk::tests::{briefing, observation};
use crate::node::{
    Options, Planner, PlannerFactory, Predictor, PredictorFactory, StepInput, Stop, serve_planner, serve_predictor,
};
use crate::session::open_client;

const DEADLINE: Duration = Duration::from_secs(20);
const SHORT: Duration = Duration::from_millis(500);

type Plan = fn(&StepInput<'_>) -> Result<UncheckedPlan, String>;

struct By {
    plan: Plan,
    needs_prediction: bool,
}

impl PlannerFactory for By {
    fn start(&self, _: &Briefing) -> Result<Box<dyn Planner>, String> {
        Ok(Box::new(ByFunction(self.plan)))
    }

    fn needs_prediction(&self) -> bool {
        self.needs_prediction
    }
}

struct ByFunction(Plan);

impl Planner for ByFunction {
    fn plan(&mut self, step: &StepInput<'_>) -> Result<UncheckedPlan, String> {
        (self.0)(step)
    }
}

struct Nobody;

impl PredictorFactory for Nobody {
    fn start(&self, _: &Briefing) -> Result<Box<dyn Predictor>, String> {
        Ok(Box::new(Self))
    }
}

impl Predictor for Nobody {
    fn predict(&mut self, step: &StepInput<'_>) -> Result<UncheckedPrediction, String> {
        Ok(UncheckedPrediction { step: step.observation.step, ..Default::default() })
    }
}

fn whole(step: &StepInput<'_>) -> Result<UncheckedPlan, String> {
    Ok(UncheckedPlan {
        step: step.observation.step,
        states: vec![PlanState::default(); PLAN_STEPS],
        ..Default::default()
    })
}

fn hub() -> Hub {
    Hub::open(&"test".parse().unwrap()).unwrap()
}

fn options(hub: &Hub, worker: &str) -> Options {
    Options {
        endpoint: hub.endpoint().to_owned(),
        run: hub.run().clone(),
        worker: worker.parse().unwrap(),
        name: None,
        exit_with_parent: false,
    }
}

fn planner(hub: &Hub, plan: Plan, needs_prediction: bool) -> std::thread::JoinHandle<Stop> {
    let options = options(hub, "w0");
    std::thread::spawn(move || serve_planner(&options, Arc::new(By { plan, needs_prediction })).unwrap())
}

fn wanted(role: Role) -> Wanted {
    Wanted { role, workers: Workers::One(Worker::numbered(0)), name: None }
}

fn wait(hub: &Hub, role: Role) {
    hub.wait_for_nodes(&[wanted(role)], DEADLINE, &|| false).unwrap();
}

fn line(hub: &Hub, expects_prediction: bool) -> EpisodeLine {
    let mut line = hub.episode(&Worker::numbered(0), &SceneId::new("s").unwrap(), expects_prediction).unwrap();
    line.announce(&briefing()).unwrap();
    line
}

/// What a step ends with where the planner is `plan`.
fn step_with(plan: Plan) -> Result<UncheckedPlan, LineError> {
    step_within(plan, DEADLINE)
}

fn step_within(plan: Plan, deadline: Duration) -> Result<UncheckedPlan, LineError> {
    let hub = hub();
    let node = planner(&hub, plan, false);
    wait(&hub, Role::Planner);
    let result = line(&hub, false).step(&observation(0), deadline).map(|(plan, _)| plan);
    hub.close();
    assert_eq!(node.join().unwrap(), Stop::SimGone);
    result
}

#[test]
fn an_honest_planner_is_heard_at_every_step_and_all_is_counted() {
    let hub = hub();
    let node = planner(&hub, whole, false);
    wait(&hub, Role::Planner);
    let mut line = line(&hub, false);
    for step in 0..20 {
        let (plan, prediction) = line.step(&observation(step), DEADLINE).unwrap();
        assert_eq!(prediction, None);
        assert!(plan.check(step).is_ok());
        line.publish_record(&Default::default());
    }
    line.publish_event(&Default::default());
    let end = line.publish_end(Default::default()).unwrap();
    assert_eq!((end.observations, end.plans, end.predictions, end.records, end.events), (20, 20, 0, 20, 1));
    hub.close();
    assert_eq!(node.join().unwrap(), Stop::SimGone);
}

#[test]
fn nodes_hear_each_other_through_the_simulator() {
    let hub = hub();
    let needs_it = |step: &StepInput<'_>| match step.prediction {
        Some(prediction) if prediction.step() == step.observation.step => whole(step),
        _ => Err("no prediction".to_owned()),
    };
    hub.publish_run_info(&proto::RunInfo { predictor: true, ..Default::default() }).unwrap();
    let _planner = planner(&hub, needs_it, true);
    let options = options(&hub, "*");
    let _predictor = std::thread::spawn(move || serve_predictor(&options, Arc::new(Nobody)));
    hub.wait_for_nodes(&[wanted(Role::Planner), wanted(Role::Predictor)], DEADLINE, &|| false).unwrap();
    let mut line = line(&hub, true);
    for step in 0..20 {
        let (plan, prediction) = line.step(&observation(step), DEADLINE).unwrap();
        assert_eq!((plan.step, prediction.unwrap().step), (step, step));
    }
}

#[test]
fn a_planner_that_needs_predictions_joins_no_run_that_has_none() {
    let hub = hub();
    hub.publish_run_info(&proto::RunInfo { predictor: false, ..Default::default() }).unwrap();
    let factory = By { plan: whole, needs_prediction: true };
    let error = serve_planner(&options(&hub, "w0"), Arc::new(factory)).unwrap_err();
    assert_eq!(
        error.to_string(),
        "this planner needs a predictor, and run test has none\n  hint: give it one with `sim run --predictor ctrv`"
    );
    assert_eq!(hub.nodes(), []);
}

#[test]
fn a_lying_planner_is_passed_on_to_be_judged() {
    let not_a_number = |step: &StepInput<'_>| {
        let mut plan = whole(step)?;
        plan.states[3].x = f64::NAN;
        Ok(plan)
    };
    assert_eq!(
        step_with(not_a_number).unwrap().check(0).unwrap_err().to_string(),
        "state 3 is not finite, or beyond 1e7"
    );
    let other_step = |step: &StepInput<'_>| Ok(UncheckedPlan { step: 7, ..whole(step)? });
    assert_eq!(
        step_with(other_step).unwrap().check(0).unwrap_err().to_string(),
        "it answers step 7, but step 0 was asked for"
    );
    let too_short = |step: &StepInput<'_>| Ok(UncheckedPlan { states: vec![], ..whole(step)? });
    assert_eq!(step_with(too_short).unwrap().check(0).unwrap_err().to_string(), "it has 0 states, but 50 are needed");
}

#[test]
fn a_silent_planner_is_waited_for_until_the_deadline_and_no_longer() {
    let start = Instant::now();
    let error = step_within(
        |_| {
            std::thread::sleep(2 * SHORT);
            Err(String::new())
        },
        SHORT,
    );
    assert_eq!(error.unwrap_err().to_string(), "the planner gave no answer within 0.5 s");
    assert!(start.elapsed() >= SHORT);
}

#[test]
fn a_planner_that_fails_or_panics_is_quoted() {
    let error = step_with(|_| Err("the route is empty".to_owned())).unwrap_err().to_string();
    assert_eq!(error, "the planner's answer is refused: it cannot answer: the route is empty");
    let error = step_with(|_| panic!("boom")).unwrap_err().to_string();
    assert_eq!(error, "the planner's answer is refused: it cannot answer: it panicked: boom");
}

/// A node made by hand: its token, and whatever the test does with its session.
fn rogue(hub: &Hub, version: u32) -> (Session, LivelinessToken) {
    let session = open_client(hub.endpoint()).unwrap();
    let mut node = NodeId::new(Role::Planner, Workers::All, "rogue").unwrap();
    node.version = version;
    let token = session.liveliness().declare_token(node.key(hub.run())).wait().unwrap();
    (session, token)
}

#[test]
fn a_node_of_another_version_is_refused_with_both_versions_named() {
    let hub = hub();
    let _rogue = rogue(&hub, 99);
    let error = hub.wait_for_nodes(&[wanted(Role::Planner)], DEADLINE, &|| false).unwrap_err();
    let named = "planner rogue (worker *) speaks version 99 of the messages, this simulator version 1";
    assert!(error.to_string().starts_with(named), "{error}");
}

#[test]
fn who_is_missing_is_named_and_an_interrupt_ends_the_wait() {
    let hub = hub();
    let error = hub.wait_for_nodes(&[wanted(Role::Planner)], Duration::from_millis(50), &|| false).unwrap_err();
    assert_eq!(error.to_string(), "after 0.05 s still missing: planner of any name (worker w0)");
    let error = hub.wait_for_nodes(&[wanted(Role::Planner)], Duration::from_secs(3600), &|| true).unwrap_err();
    assert_eq!(error, BarrierError::Cancelled);
}

#[test]
fn noise_instead_of_a_plan_is_refused() {
    let hub = hub();
    let (session, _token) = rogue(&hub, crate::WIRE_VERSION);
    wait(&hub, Role::Planner);
    let mut line = line(&hub, false);
    let key = Address { worker: Worker::numbered(0), scene: SceneId::new("s").unwrap(), channel: Channel::Plan }
        .key(hub.run());
    session::send(&session, &key, vec![0xff; 30]).unwrap();
    let error = line.step(&observation(0), DEADLINE).unwrap_err();
    assert!(matches!(error, LineError::BadAnswer { error: MessageError::Malformed { .. }, .. }), "{error}");
}

#[test]
fn a_node_that_floods_its_line_is_stopped_there() {
    let hub = hub();
    let (session, _token) = rogue(&hub, crate::WIRE_VERSION);
    wait(&hub, Role::Planner);
    let mut line = line(&hub, false);
    let address = Address { worker: Worker::numbered(0), scene: SceneId::new("s").unwrap(), channel: Channel::Plan };
    for _ in 0..1000 {
        session::send(&session, &address.key(hub.run()), proto::Plan::default().encode_to_vec()).unwrap();
    }
    let floods = |_| matches!(line.step(&observation(0), DEADLINE), Err(LineError::Flooded));
    assert!((0..1000).any(floods), "it is never noticed");
}

#[test]
fn a_node_that_leaves_ends_the_wait_at_once() {
    let hub = hub();
    let events = hub.watch();
    let (session, token) = rogue(&hub, crate::WIRE_VERSION);
    wait(&hub, Role::Planner);
    let mut line = line(&hub, false);
    let leaving = std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(100));
        token.undeclare().wait().unwrap();
        session
    });
    let start = Instant::now();
    assert_eq!(line.step(&observation(0), DEADLINE).unwrap_err().to_string(), "the planner is gone");
    assert!(start.elapsed() < DEADLINE);
    leaving.join().unwrap();
    let events: Vec<NodeEvent> = events.try_iter().collect();
    assert!(matches!(events.as_slice(), [NodeEvent::Joined(_), NodeEvent::Left(_)]), "{events:?}");
}

#[test]
fn a_late_node_asks_for_the_scene_and_gets_it() {
    let hub = hub();
    let mut line = line(&hub, false);
    let _node = planner(&hub, whole, false);
    wait(&hub, Role::Planner);
    assert!(line.step(&observation(5), DEADLINE).unwrap().0.check(5).is_ok());
}

#[test]
fn the_runs_settings_can_be_asked_for() {
    let hub = hub();
    let info = proto::RunInfo { run: "test".to_owned(), settings: "seed = 1".to_owned(), ..Default::default() };
    hub.publish_run_info(&info).unwrap();
    let session = open_client(hub.endpoint()).unwrap();
    let reply = session.get(keys::info(hub.run())).wait().unwrap().recv().unwrap();
    let bytes = reply.result().unwrap().payload().to_bytes().into_owned();
    assert_eq!(proto::RunInfo::decode(bytes.as_slice()).unwrap(), info);
}

#[test]
fn a_recording_is_compared_with_what_was_sent() {
    let hub = hub();
    let session = open_client(hub.endpoint()).unwrap();
    let recorder = NodeId::new(Role::Recorder, Workers::All, "recorder").unwrap();
    let _token = session.liveliness().declare_token(recorder.key(hub.run())).wait().unwrap();
    wait(&hub, Role::Recorder);
    let mut line = line(&hub, false);
    line.publish_record(&Default::default());
    let end = line.publish_end(Default::default()).unwrap();
    let key = Address { worker: Worker::numbered(0), scene: SceneId::new("s").unwrap(), channel: Channel::Recorded }
        .key(hub.run());
    // As a recorder finds it, in whatever order.
    let mut digest = Digest::default();
    digest.add(Channel::Record, &[]);
    digest.add(Channel::Scene, &proto::Scene::from(&briefing()).encode_to_vec());
    assert_eq!(end.digest, digest.to_bytes());
    digest.add(Channel::End, &end.encode_to_vec());
    let recorded = proto::Recorded { records: 1, digest: digest.to_bytes(), ..Default::default() };
    let mut answered = |recorded: proto::Recorded| {
        session::send(&session, &key, recorded.encode_to_vec()).unwrap();
        line.await_recorded(DEADLINE).map_err(|error| error.to_string())
    };
    assert_eq!(answered(recorded.clone()), Ok(()));
    let error = answered(proto::Recorded { records: 0, ..recorded.clone() });
    assert_eq!(error, Err("the recording is not whole: records 1 sent, 0 recorded".to_owned()));
    let other = Err("the recording does not hold what was told: its digest is another".to_owned());
    digest.add(Channel::Plan, &[]);
    assert_eq!(answered(proto::Recorded { digest: digest.to_bytes(), ..recorded.clone() }), other);
    assert_eq!(answered(proto::Recorded { digest: Vec::new(), ..recorded }), other);
}

#[test]
fn an_episode_is_open_once() {
    let hub = hub();
    let first = line(&hub, false);
    let again = hub.episode(&Worker::numbered(0), &SceneId::new("s").unwrap(), false);
    assert!(matches!(again, Err(LineError::Busy { .. })));
    drop(first);
    line(&hub, false);
}
