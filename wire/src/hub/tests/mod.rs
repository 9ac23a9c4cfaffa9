//! The hub and nodes over real sessions, in one process. Here are nodes of the SDK, honest ones and such that fail; in `rogues` those
//! that are made by hand.

mod rogues;

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
        zenoh_config: None,
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
    Cast { planner, predictor: None, traffic: None, recorder: None }
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
    let mut line = line(&hub, Cast { planner: &seats[0], predictor: Some(&seats[1]), traffic: None, recorder: None });
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
    let mut line = line(&hub, Cast { planner: &seats[0], predictor: None, traffic: None, recorder: Some(&seats[1]) });
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
fn a_recorder_hears_nothing_of_an_episode_that_was_begun_with_another() {
    let hub = hub();
    let planner = planner_seat(&hub);
    let recorder = || hub.seat(Role::Recorder, &Workers::All).unwrap();
    let first = recorder();
    let cast = |recorder| Cast { recorder: Some(recorder), ..alone(&planner) };
    let cut = line(&hub, cast(&first));
    let second = recorder();
    let session = open_client(hub.endpoint()).unwrap();
    let place = Place::seat(hub.run(), second.secret()).unwrap();
    let heard = session.declare_subscriber(place.whole_tape()).wait().unwrap();
    let node = NodeId::new(Role::Recorder, Workers::All, "recorder", &session.zid().to_string()).unwrap();
    let _token = session.liveliness().declare_token(node.key(&place)).wait().unwrap();
    wait(&hub, &second);
    // Begun before the second was there, and after: whose recorder was chosen too early.
    let end = |mut line: EpisodeLine| {
        line.publish_record(&Default::default());
        line.publish_end(Default::default());
    };
    end(cut);
    end(line(&hub, cast(&first)));
    // The same scene again, on the same worker: of this alone it hears.
    end(line(&hub, cast(&second)));
    let channel = |sample: Sample| sample.key_expr().as_str().rsplit('/').next().map(str::to_owned);
    let mut channels = Vec::new();
    while channels.last().is_none_or(|last| last != "end") {
        channels.extend(channel(heard.recv_timeout(DEADLINE).unwrap().expect("it is told")));
    }
    assert_eq!(channels, ["scene", "record", "end"]);
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
