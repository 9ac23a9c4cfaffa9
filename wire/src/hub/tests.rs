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
use crate::envelope::{self, Telling};
use crate::keys::Answering;
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

fn w0() -> Workers {
    Workers::One(Worker::numbered(0))
}

fn planner_seat(hub: &Hub) -> Seat {
    hub.seat(Role::Planner, &w0()).unwrap()
}

fn options(hub: &Hub, worker: &str, secret: Option<&Seat>) -> Options {
    Options {
        endpoint: hub.endpoint().to_owned(),
        run: hub.run().clone(),
        worker: worker.parse().unwrap(),
        name: Some("by-test".to_owned()),
        secret: secret.map(|seat| seat.secret().clone()),
        exit_with_parent: false,
    }
}

fn planner(hub: &Hub, seat: &Seat, plan: Plan, needs_prediction: bool) -> std::thread::JoinHandle<Stop> {
    let options = options(hub, "w0", Some(seat));
    std::thread::spawn(move || serve_planner(&options, Arc::new(By { plan, needs_prediction })).unwrap())
}

fn wait(hub: &Hub, seat: &Seat) {
    hub.wait_for_nodes(&[seat], DEADLINE, &|| false).unwrap();
}

fn scene() -> SceneId {
    SceneId::new("s").unwrap()
}

fn alone(planner: &Seat) -> Cast<'_> {
    Cast { planner, predictor: None, recorder: None }
}

fn line(hub: &Hub, cast: Cast<'_>) -> EpisodeLine {
    let mut line = hub.episode(&Worker::numbered(0), &scene(), cast).unwrap();
    line.announce(&briefing()).unwrap();
    line
}

/// What a step ends with where the planner is `plan`.
fn step_with(plan: Plan) -> Result<UncheckedPlan, LineError> {
    step_within(plan, DEADLINE)
}

fn step_within(plan: Plan, deadline: Duration) -> Result<UncheckedPlan, LineError> {
    let hub = hub();
    let seat = planner_seat(&hub);
    let node = planner(&hub, &seat, plan, false);
    wait(&hub, &seat);
    let result = line(&hub, alone(&seat)).step(&observation(0), deadline).map(|(plan, _)| plan);
    hub.close();
    assert_eq!(node.join().unwrap(), Stop::SimGone);
    result
}

#[test]
fn an_honest_planner_is_heard_at_every_step_and_all_is_counted() {
    let hub = hub();
    let seat = planner_seat(&hub);
    let node = planner(&hub, &seat, whole, false);
    wait(&hub, &seat);
    for _ in 0..3 {
        let mut line = line(&hub, alone(&seat));
        for step in 0..20 {
            let (plan, prediction) = line.step(&observation(step), DEADLINE).unwrap();
            assert_eq!(prediction, None);
            assert!(plan.check(step).is_ok());
            line.publish_record(&Default::default());
        }
        line.publish_event(&Default::default());
        line.dismiss(&Default::default(), DEADLINE).unwrap();
        let end = line.publish_end(Default::default());
        assert_eq!((end.observations, end.plans, end.predictions, end.records, end.events), (20, 20, 0, 20, 1));
    }
    hub.close();
    assert_eq!(node.join().unwrap(), Stop::SimGone);
}

#[test]
fn a_planner_hears_what_the_predictor_says_from_the_simulator() {
    let hub = hub();
    let needs_it = |step: &StepInput<'_>| match step.prediction {
        Some(prediction) if prediction.step() == step.observation.step => whole(step),
        _ => Err("no prediction".to_owned()),
    };
    hub.publish_run_info(&proto::RunInfo { predictor: true, ..Default::default() }).unwrap();
    let seats = [planner_seat(&hub), hub.seat(Role::Predictor, &w0()).unwrap()];
    let _planner = planner(&hub, &seats[0], needs_it, true);
    let options = options(&hub, "*", Some(&seats[1]));
    let _predictor = std::thread::spawn(move || serve_predictor(&options, Arc::new(Nobody)));
    hub.wait_for_nodes(&[&seats[0], &seats[1]], DEADLINE, &|| false).unwrap();
    let mut line = line(&hub, Cast { planner: &seats[0], predictor: Some(&seats[1]), recorder: None });
    for step in 0..20 {
        let (plan, prediction) = line.step(&observation(step), DEADLINE).unwrap();
        assert_eq!((plan.step, prediction.unwrap().step), (step, step));
    }
    line.dismiss(&Default::default(), DEADLINE).unwrap();
}

#[test]
fn a_planner_that_needs_predictions_joins_no_run_that_has_none() {
    let hub = hub();
    hub.publish_run_info(&proto::RunInfo { predictor: false, ..Default::default() }).unwrap();
    let factory = By { plan: whole, needs_prediction: true };
    let seat = planner_seat(&hub);
    let error = serve_planner(&options(&hub, "w0", Some(&seat)), Arc::new(factory)).unwrap_err();
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

#[test]
fn a_plan_too_large_is_said_to_be_too_large() {
    let error = step_with(|step| {
        Ok(UncheckedPlan { states: vec![PlanState { x: 1.0, ..Default::default() }; 30_000], ..whole(step)? })
    });
    let error = error.unwrap_err().to_string();
    let said = "the planner's answer is refused: it cannot answer: its plan has 330000 bytes; at most 262144 are taken";
    assert_eq!(error, said);
}

/// A node made by hand: its token, and whatever the test does with it.
struct Rogue {
    session: Session,
    place: Place,
    token: Option<LivelinessToken>,
}

impl Rogue {
    /// One that is connected, and has shown no token yet.
    fn standing(hub: &Hub, seat: &Seat) -> Self {
        let session = open_client(hub.endpoint()).unwrap();
        Self { session, place: Place::seat(hub.run(), seat.secret()).unwrap(), token: None }
    }

    fn new(hub: &Hub, seat: &Seat, version: u32) -> Self {
        let mut rogue = Self::standing(hub, seat);
        rogue.sit(version);
        rogue
    }

    fn sit(&mut self, version: u32) {
        let mut node = NodeId::new(Role::Planner, Workers::All, "rogue", &self.session.zid().to_string()).unwrap();
        node.version = version;
        self.token = Some(self.session.liveliness().declare_token(node.key(&self.place)).wait().unwrap());
    }

    fn answer_key(&self, channel: Channel) -> String {
        let session = self.session.zid().to_string();
        self.place.answer(&Answering { worker: Worker::numbered(0), channel, session })
    }

    fn answer(&self, answer: &proto::Answer) {
        session::send(&self.session, &self.answer_key(Channel::Plan), answer.encode_to_vec()).unwrap();
    }
}

/// The plan that answers `step`, in its envelope.
fn plan_of(episode: u64, step: u32) -> proto::Answer {
    let plan = UncheckedPlan { step, states: vec![PlanState::default(); PLAN_STEPS], ..Default::default() };
    proto::Answer { episode, what: Some(proto::answer::What::Plan((&plan).into())) }
}

/// Answers what is told, as `reply` says, from a thread of the transport.
fn replies(rogue: &Rogue, reply: impl Fn(u64, Telling) -> Vec<proto::Answer> + Send + Sync + 'static) {
    let (session, key) = (rogue.session.clone(), rogue.answer_key(Channel::Plan));
    let told = rogue.session.declare_subscriber(rogue.place.told(&Workers::All));
    let told = told.callback(move |sample| {
        let bytes = sample.payload().to_bytes();
        let (episode, telling, _) = envelope::open::<Telling>(&bytes).unwrap();
        for answer in reply(episode, telling) {
            session::send(&session, &key, answer.encode_to_vec()).unwrap();
        }
    });
    told.background().wait().unwrap();
}

#[test]
fn a_node_of_another_version_is_refused_with_both_versions_named() {
    let hub = hub();
    let seat = planner_seat(&hub);
    let _rogue = Rogue::new(&hub, &seat, 99);
    let error = hub.wait_for_nodes(&[&seat], DEADLINE, &|| false).unwrap_err();
    let named = "planner rogue (worker *) speaks version 99 of the messages, this simulator version 2";
    assert!(error.to_string().starts_with(named), "{error}");
}

#[test]
fn who_is_missing_is_named_and_an_interrupt_ends_the_wait() {
    let hub = hub();
    let seat = planner_seat(&hub);
    let error = hub.wait_for_nodes(&[&seat], Duration::from_millis(50), &|| false).unwrap_err();
    assert_eq!(error.to_string(), "after 0.05 s still missing: planner (worker w0)");
    let error = hub.wait_for_nodes(&[&seat], Duration::from_secs(3600), &|| true).unwrap_err();
    assert_eq!(error, BarrierError::Cancelled);
}

#[test]
fn noise_instead_of_a_plan_is_refused() {
    let hub = hub();
    let seat = planner_seat(&hub);
    let rogue = Rogue::new(&hub, &seat, crate::WIRE_VERSION);
    wait(&hub, &seat);
    let mut line = line(&hub, alone(&seat));
    session::send(&rogue.session, &rogue.answer_key(Channel::Plan), vec![0xff; 30]).unwrap();
    let error = line.step(&observation(0), DEADLINE).unwrap_err();
    assert!(matches!(error, LineError::BadAnswer { error: MessageError::Malformed { .. }, .. }), "{error}");
}

#[test]
fn a_node_that_floods_its_line_is_stopped_there() {
    let hub = hub();
    let seat = planner_seat(&hub);
    let rogue = Rogue::new(&hub, &seat, crate::WIRE_VERSION);
    wait(&hub, &seat);
    let mut line = line(&hub, alone(&seat));
    for _ in 0..1000 {
        session::send(&rogue.session, &rogue.answer_key(Channel::Plan), vec![]).unwrap();
    }
    let floods = |_| matches!(line.step(&observation(0), DEADLINE), Err(LineError::Flooded));
    assert!((0..1000).any(floods), "it is never noticed");
}

#[test]
fn an_answer_too_many_is_noticed_at_any_step_and_after_the_last() {
    let hub = hub();
    let seat = planner_seat(&hub);
    let mut rogue = Rogue::standing(&hub, &seat);
    let done = |episode| proto::Answer { episode, what: Some(proto::answer::What::Done(proto::Done {})) };
    replies(&rogue, move |episode, telling| match telling {
        Telling::Observation => vec![plan_of(episode, 0)],
        Telling::End if episode == 1 => vec![plan_of(episode, 1), done(episode)],
        Telling::End => vec![done(episode)],
        _ => vec![],
    });
    rogue.sit(crate::WIRE_VERSION);
    wait(&hub, &seat);
    let mut first = line(&hub, alone(&seat));
    first.step(&observation(0), DEADLINE).unwrap();
    let error = first.dismiss(&Default::default(), DEADLINE).unwrap_err().to_string();
    assert_eq!(error, "the planner says more than it was asked for: one plan too many");
    drop(first);
    let mut second = line(&hub, alone(&seat));
    second.step(&observation(0), DEADLINE).unwrap();
    rogue.answer(&plan_of(2, 0));
    std::thread::sleep(SHORT);
    let error = second.step(&observation(1), DEADLINE).unwrap_err().to_string();
    assert_eq!(error, "the planner says more than it was asked for: one plan too many");
    drop(second);
    let mut third = line(&hub, alone(&seat));
    third.step(&observation(0), DEADLINE).unwrap();
    third.dismiss(&Default::default(), DEADLINE).unwrap();
}

#[test]
fn a_late_answer_to_an_episode_that_is_over_harms_no_other() {
    let hub = hub();
    let seat = planner_seat(&hub);
    let mut rogue = Rogue::standing(&hub, &seat);
    replies(&rogue, |episode, telling| match (telling, episode) {
        (Telling::Observation, 2) => vec![plan_of(1, 9), plan_of(2, 0)],
        _ => vec![],
    });
    rogue.sit(crate::WIRE_VERSION);
    wait(&hub, &seat);
    let error = line(&hub, alone(&seat)).step(&observation(0), SHORT).unwrap_err();
    assert!(matches!(error, LineError::NoAnswer { .. }), "{error}");
    let (plan, _) = line(&hub, alone(&seat)).step(&observation(0), DEADLINE).unwrap();
    assert_eq!(plan.step, 0);
}

#[test]
fn an_answer_that_does_not_say_its_episode_is_refused() {
    let hub = hub();
    let seat = planner_seat(&hub);
    let mut rogue = Rogue::standing(&hub, &seat);
    replies(&rogue, |_, telling| if telling == Telling::Observation { vec![plan_of(0, 0)] } else { vec![] });
    rogue.sit(crate::WIRE_VERSION);
    wait(&hub, &seat);
    let error = line(&hub, alone(&seat)).step(&observation(0), DEADLINE).unwrap_err().to_string();
    assert_eq!(error, "the planner's answer is refused: it is for episode 0, but episode 1 is on");
}

#[test]
fn a_node_that_leaves_ends_the_wait_at_once() {
    let hub = hub();
    let events = hub.watch();
    let seat = planner_seat(&hub);
    let rogue = Rogue::new(&hub, &seat, crate::WIRE_VERSION);
    wait(&hub, &seat);
    let mut line = line(&hub, alone(&seat));
    let leaving = std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(100));
        rogue.token.unwrap().undeclare().wait().unwrap();
        rogue.session
    });
    let start = Instant::now();
    assert_eq!(line.step(&observation(0), DEADLINE).unwrap_err().to_string(), "the planner is gone");
    assert!(start.elapsed() < DEADLINE);
    leaving.join().unwrap();
    let events: Vec<NodeEvent> = events.try_iter().collect();
    assert!(matches!(events.as_slice(), [NodeEvent::Joined(_), NodeEvent::Left(_)]), "{events:?}");
}

#[test]
fn a_second_planner_is_refused_by_name_and_the_first_goes_on() {
    let hub = hub();
    let events = hub.watch();
    let seat = planner_seat(&hub);
    let _first = planner(&hub, &seat, whole, false);
    wait(&hub, &seat);
    let mut line = line(&hub, alone(&seat));
    // The same name, even: two of one command.
    for worker in ["w0", "*"] {
        let second = By { plan: |_| Err("never asked".to_owned()), needs_prediction: false };
        let error = serve_planner(&options(&hub, worker, Some(&seat)), Arc::new(second)).unwrap_err().to_string();
        let said = format!("planner by-test (worker {worker}) is refused: planner by-test (worker w0) answers already");
        assert_eq!(error, said);
    }
    for step in 0..20 {
        assert!(line.step(&observation(step), DEADLINE).unwrap().0.check(step).is_ok());
    }
    let refused = events.try_iter().filter(|event| matches!(event, NodeEvent::Refused(_))).count();
    assert_eq!(refused, 2);
}

#[test]
fn a_stranger_is_told_who_answers_and_what_it_lacks() {
    let hub = hub();
    let seat = planner_seat(&hub);
    let _first = planner(&hub, &seat, whole, false);
    wait(&hub, &seat);
    let stranger = By { plan: whole, needs_prediction: false };
    let error = serve_planner(&options(&hub, "*", None), Arc::new(stranger)).unwrap_err().to_string();
    let said = "planner by-test (worker *) is refused: it does not know the run's secret; planner by-test (worker w0) \
                answers already\n  hint: `sim run` says the secret of a planner that it waits for; put it into RELOOP_SECRET";
    assert_eq!(error, said);
}

#[test]
fn what_strangers_say_reaches_no_node_and_is_noticed() {
    let hub = hub();
    let seat = planner_seat(&hub);
    let _node = planner(&hub, &seat, whole, false);
    wait(&hub, &seat);
    let mut line = line(&hub, alone(&seat));
    let stranger = open_client(hub.endpoint()).unwrap();
    let floor = Place::open_floor(hub.run());
    let told = proto::Told { episode: 1, what: Some(proto::told::What::End(Default::default())) }.encode_to_vec();
    let address = keys::Address { worker: Worker::numbered(0), scene: scene(), channel: Channel::Record };
    for key in [floor.told(&w0()), floor.tape(&address), keys::info(hub.run()), "reloop/test/w0/s/plan".to_owned()] {
        session::send(&stranger, &key, told.clone()).unwrap();
    }
    // A second simulator, and one that answers for the first.
    let _token = stranger.liveliness().declare_token(NodeId::sim().key(&floor)).wait().unwrap();
    let lie = |query: Query| query.reply(query.key_expr().clone(), vec![1, 2, 3]).wait().unwrap();
    stranger.declare_queryable(keys::info(hub.run())).callback(lie).background().wait().unwrap();
    for step in 0..20 {
        assert!(line.step(&observation(step), DEADLINE).unwrap().0.check(step).is_ok());
    }
    line.dismiss(&Default::default(), DEADLINE).unwrap();
    let until = Instant::now() + DEADLINE;
    while hub.shared.notices.load(Ordering::Relaxed) < 4 {
        assert!(Instant::now() < until, "{} of 4 noticed", hub.shared.notices.load(Ordering::Relaxed));
        std::thread::sleep(Duration::from_millis(5));
    }
    // Nobody but the simulator answers.
    hub.publish_run_info(&proto::RunInfo { run: "test".to_owned(), ..Default::default() }).unwrap();
    let asking = open_client(hub.endpoint()).unwrap();
    let replies: Vec<_> = asking.get(keys::info(hub.run())).wait().unwrap().into_iter().collect();
    assert_eq!(replies.len(), 1);
}

#[test]
fn who_knows_the_secret_and_speaks_in_the_simulators_name_ends_the_episode() {
    let hub = hub();
    let seat = planner_seat(&hub);
    let _node = planner(&hub, &seat, whole, false);
    wait(&hub, &seat);
    let mut line = line(&hub, alone(&seat));
    line.step(&observation(0), DEADLINE).unwrap();
    let intruder = open_client(hub.endpoint()).unwrap();
    let place = Place::seat(hub.run(), seat.secret()).unwrap();
    let told = proto::Told { episode: 1, what: Some(proto::told::What::Scene(Default::default())) }.encode_to_vec();
    session::send(&intruder, &place.told(&w0()), told).unwrap();
    std::thread::sleep(SHORT);
    let error = line.step(&observation(1), DEADLINE).unwrap_err().to_string();
    assert_eq!(error, "somebody else spoke to the planner in the simulator's name");
}

#[test]
fn an_answer_of_another_session_is_not_counted() {
    let hub = hub();
    let seat = planner_seat(&hub);
    let _node = planner(&hub, &seat, whole, false);
    wait(&hub, &seat);
    let mut line = line(&hub, alone(&seat));
    // It knows the secret, and is refused; it answers all the same.
    let rogue = Rogue::new(&hub, &seat, crate::WIRE_VERSION);
    rogue.answer(&plan_of(1, 0));
    std::thread::sleep(SHORT);
    for step in 0..5 {
        assert!(line.step(&observation(step), DEADLINE).unwrap().0.check(step).is_ok());
    }
    line.dismiss(&Default::default(), DEADLINE).unwrap();
    assert!(hub.shared.notices.load(Ordering::Relaxed) >= 2, "its token and its answer");
}

#[test]
fn who_listens_in_may_ask_for_the_scene() {
    let hub = hub();
    let seat = planner_seat(&hub);
    let open = line(&hub, alone(&seat));
    let session = open_client(hub.endpoint()).unwrap();
    let address = keys::Address { worker: Worker::numbered(0), scene: scene(), channel: Channel::Scene };
    let key = Place::open_floor(hub.run()).tape(&address);
    let ask = || session.get(&key).wait().unwrap().recv().ok();
    let bytes = ask().unwrap().result().unwrap().payload().to_bytes().into_owned();
    assert_eq!(proto::Scene::decode(bytes.as_slice()).unwrap().scene, "s");
    drop(open);
    assert!(ask().is_none());
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
    let seats = [planner_seat(&hub), hub.seat(Role::Recorder, &Workers::All).unwrap()];
    let session = open_client(hub.endpoint()).unwrap();
    let recorder = NodeId::new(Role::Recorder, Workers::All, "recorder", &session.zid().to_string()).unwrap();
    let place = Place::seat(hub.run(), seats[1].secret()).unwrap();
    let _token = session.liveliness().declare_token(recorder.key(&place)).wait().unwrap();
    wait(&hub, &seats[1]);
    let mut line = line(&hub, Cast { planner: &seats[0], predictor: None, recorder: Some(&seats[1]) });
    line.publish_record(&Default::default());
    let end = line.publish_end(Default::default());
    let (worker, channel) = (Worker::numbered(0), Channel::Recorded);
    let key = place.answer(&Answering { worker, channel, session: session.zid().to_string() });
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
fn a_worker_has_one_episode_at_a_time() {
    let hub = hub();
    let seat = planner_seat(&hub);
    let first = line(&hub, alone(&seat));
    let again = hub.episode(&Worker::numbered(0), &scene(), alone(&seat));
    assert!(matches!(again, Err(LineError::Busy { .. })));
    drop(first);
    line(&hub, alone(&seat));
}
