//! Nodes that speak out of turn, and strangers: nothing of it is counted, and nothing is silent.

use super::*;

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
    let named = "planner rogue (worker *) speaks version 99 of the messages, this simulator version 3";
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
        assert_eq!(error, format!("{said}\n  hint: whoever runs the simulator decides it; its log says the same"));
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
