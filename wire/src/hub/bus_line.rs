//! The line of one episode over the bus.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};

use prost::Message as _;
use world::observation::{Briefing, Observation};
use world::plan::{Plan, UncheckedPlan};
use world::scene::SceneId;
use world::traffic::{Taken, UncheckedMoves};
use zenoh::Wait;
use zenoh::bytes::ZBytes;
use zenoh::pubsub::Publisher;

use super::inbox::{Inbox, Incoming, Patience};
use super::line::{Answers, Line, counted};
use super::line_error::LineError;
use super::seat::{Inner, Seat};
use super::{Shared, lock};
use crate::convert::{self, Message, MessageError, decode, shown};
use crate::digest::Digest;
use crate::envelope::{self, Saying, Telling};
use crate::keys::{Address, Channel, NodeId, Place, Role, Worker};
use crate::proto;
use crate::session::SessionError;

/// The nodes that an episode is driven with.
#[derive(Clone, Copy)]
pub struct Cast<'a> {
    /// Answers with plans.
    pub planner: &'a Seat,
    /// Answers with predictions, if the driver has one.
    pub predictor: Option<&'a Seat>,
    /// Drives the agents that react, if any do.
    pub traffic: Option<&'a Seat>,
    /// Writes it down, if somebody does.
    pub recorder: Option<&'a Seat>,
}

/// One of the cast, at this line.
struct Member {
    seat: Arc<Inner>,
    /// Who sat there when the line was opened. Another who comes later was not told the scene.
    node: Option<NodeId>,
    /// None for the recorder, who hears the tape.
    teller: Option<Arc<Publisher<'static>>>,
}

impl Member {
    fn is_there(&self) -> bool {
        self.node.is_some() && self.seat.node() == self.node
    }
}

/// The line of one episode. Dropping it ends it: what comes later is nobody's.
pub struct EpisodeLine {
    shared: Arc<Shared>,
    worker: Worker,
    scene: SceneId,
    /// Its number: answers say it, lest a late one is taken for that of another episode.
    episode: u64,
    /// Planner, predictor, traffic, recorder, as far as there are such.
    cast: Vec<Member>,
    expects_prediction: bool,
    incoming: Receiver<Incoming>,
    inbox: Arc<Inbox>,
    /// What was told.
    counts: proto::Recorded,
    /// Of what was told; none where nobody could hear it from its beginning on.
    digest: Option<Digest>,
}

impl EpisodeLine {
    pub(super) fn open(
        shared: &Arc<Shared>,
        worker: &Worker,
        scene: &SceneId,
        [planner, predictor, traffic, recorder]: [Option<&Seat>; 4],
    ) -> Result<Self, LineError> {
        let (inbox, incoming) = Inbox::open();
        let mut line = Self {
            shared: Arc::clone(shared),
            worker: worker.clone(),
            scene: scene.clone(),
            episode: shared.episodes.fetch_add(1, Ordering::Relaxed) + 1,
            cast: Vec::new(),
            expects_prediction: predictor.is_some(),
            incoming,
            inbox,
            counts: proto::Recorded::default(),
            digest: shared.tape.is_heard().then(Digest::default),
        };
        for seat in [planner, predictor, traffic, recorder].into_iter().flatten() {
            let seat = Arc::clone(seat.inner());
            if !seat.listen(worker, &line.inbox) {
                return Err(LineError::Busy { scene: scene.clone(), worker: worker.clone() });
            }
            let node = seat.node();
            line.cast.push(Member { seat: Arc::clone(&seat), node, teller: None });
            if seat.role != Role::Recorder {
                let teller = seat.teller(worker)?;
                line.cast.iter_mut().last().into_iter().for_each(|member| member.teller = Some(Arc::clone(&teller)));
            }
        }
        Ok(line)
    }

    fn ask(
        &mut self,
        observation: &Observation,
        deadline: Duration,
        driven: Option<&Plan>,
    ) -> Result<Answers, LineError> {
        self.look_for_nodes()?;
        let payload = ZBytes::from(proto::Observation::from(observation).encode_to_vec());
        let mut told = vec![(Channel::Observation, payload.clone())];
        let answers = self.exchange(&payload, deadline, &mut told);
        // Only now: the tape's thread would take the time in which the answer is awaited.
        self.tell_step(told, driven);
        answers
    }

    /// Tells everybody who listens in what was said at a step, and as the plan what was driven, if that was another.
    pub(super) fn tell_step(&mut self, mut told: Vec<(Channel, ZBytes)>, driven: Option<&Plan>) {
        if let Some(driven) = driven {
            let payload = ZBytes::from(proto::Plan::from(driven.clone()).encode_to_vec());
            told.iter_mut()
                .filter(|(channel, _)| *channel == Channel::Plan)
                .for_each(|(_, plan)| *plan = payload.clone());
        }
        for (channel, _) in &told {
            match channel {
                Channel::Observation => self.counts.observations += 1,
                Channel::Prediction => self.counts.predictions += 1,
                Channel::Plan => self.counts.plans += 1,
                Channel::Moves => self.counts.moves += 1,
                _ => {}
            }
        }
        self.tell(told);
    }

    /// Sends an observation and waits for its answers, which go into `told` as they come.
    fn exchange(
        &mut self,
        observation: &ZBytes,
        deadline: Duration,
        told: &mut Vec<(Channel, ZBytes)>,
    ) -> Result<Answers, LineError> {
        self.expect_silence()?;
        // A planner is told the observation together with what is predicted of it: so it is woken once.
        let first = if self.expects_prediction { Role::Predictor } else { Role::Planner };
        self.tell_node(first, Telling::Observation, observation)?;
        let mut patience = Patience::new(&self.shared.pulse, deadline);
        let (mut plan, mut prediction) = (None, None);
        while plan.is_none() || (self.expects_prediction && prediction.is_none()) {
            let missing = if self.expects_prediction && prediction.is_none() { Role::Predictor } else { Role::Planner };
            let (role, envelope) = match self.receive(&mut patience, missing)? {
                Incoming::Answer(role, envelope) if role != Role::Recorder => (role, envelope),
                other => {
                    self.expect_nothing(other)?;
                    continue;
                }
            };
            let bytes = envelope.to_bytes();
            match self.opened(role, &bytes)? {
                None => {}
                Some((Saying::Plan, bytes)) if role == Role::Planner && plan.is_none() => {
                    let message = taken::<proto::Plan>(role, bytes)?;
                    told.push((Channel::Plan, bytes.into()));
                    plan = Some(UncheckedPlan::try_from(message).map_err(LineError::bad(role))?);
                }
                Some((Saying::Prediction, bytes)) if role == Role::Predictor && prediction.is_none() => {
                    let read = match convert::prediction(bytes) {
                        // What is none at all is passed on to nobody.
                        Err(error @ (MessageError::Malformed { .. } | MessageError::TooBig { .. })) => {
                            return Err(LineError::BadAnswer { role, error });
                        }
                        read => read.map_err(LineError::bad(role)),
                    };
                    let payload = ZBytes::from(bytes);
                    told.push((Channel::Prediction, payload.clone()));
                    // First on to who waits for it.
                    self.tell_node(Role::Planner, Telling::Observation, observation)?;
                    self.tell_node(Role::Planner, Telling::Prediction, &payload)?;
                    prediction = Some(read?);
                }
                Some((saying, _)) => return Err(LineError::surplus(role, saying)),
            }
        }
        // Both are there, or one is and no other is expected.
        plan.map(|plan| (plan, prediction)).ok_or(LineError::NodeLost { role: Role::Planner })
    }

    /// What an answer holds; none where it is of an earlier episode, whose line did not wait for it.
    fn opened<'b>(&self, role: Role, bytes: &'b [u8]) -> Result<Option<(Saying, &'b [u8])>, LineError> {
        let (episode, saying, message) = envelope::open::<Saying>(bytes).map_err(LineError::bad(role))?;
        if episode == self.episode {
            return Ok(Some((saying, message)));
        }
        if (1..self.episode).contains(&episode) {
            tracing::debug!("the {role} answers episode {episode}, which is over");
            return Ok(None);
        }
        let (expected, got) = (self.episode, episode);
        Err(LineError::BadAnswer { role, error: MessageError::OtherEpisode { expected, got } })
    }

    /// What has come before anything is asked.
    fn expect_silence(&self) -> Result<(), LineError> {
        while let Ok(incoming) = self.incoming.try_recv() {
            self.expect_nothing(incoming)?;
        }
        Ok(())
    }

    /// What comes while nothing is asked.
    fn expect_nothing(&self, incoming: Incoming) -> Result<(), LineError> {
        match incoming {
            Incoming::NodeLost => self.look_for_nodes(),
            Incoming::Intruded(role) => Err(LineError::Intruded { role }),
            // What the recorder says late of an earlier episode.
            Incoming::Answer(Role::Recorder, _) => Ok(()),
            Incoming::Answer(role, envelope) => match self.opened(role, &envelope.to_bytes())? {
                None => Ok(()),
                Some((saying, _)) => Err(LineError::surplus(role, saying)),
            },
        }
    }

    /// The number of the episode in this run.
    #[must_use]
    pub fn number(&self) -> u64 {
        self.episode
    }

    fn compare(&self, recorded: &proto::Recorded) -> Result<(), LineError> {
        if !recorded.error.is_empty() {
            return Err(LineError::NotRecorded(shown(&recorded.error)));
        }
        let told = &self.counts;
        let counts = [
            ("observations", told.observations, recorded.observations),
            ("plans", told.plans, recorded.plans),
            ("predictions", told.predictions, recorded.predictions),
            ("records", told.records, recorded.records),
            ("events", told.events, recorded.events),
            ("moves", told.moves, recorded.moves),
        ];
        match counts.into_iter().find(|(_, sent, arrived)| sent != arrived) {
            None if self.digest.as_ref().is_none_or(|digest| recorded.digest != digest.to_bytes()) => {
                Err(LineError::OtherDigest)
            }
            None => Ok(()),
            Some((what, sent, recorded)) => Err(LineError::NotWhole { what, sent, recorded }),
        }
    }

    /// Tells a node these bytes, whatever they are: what a simulator that is broken, or of another version, would say. For who
    /// wants to see what the node makes of it.
    ///
    /// # Errors
    /// [`LineError::NodeLost`], [`LineError::Bus`].
    pub fn tell_bytes(&self, to: Role, bytes: Vec<u8>) -> Result<(), LineError> {
        self.look_for_nodes()?;
        let bytes = ZBytes::from(bytes);
        for (_, teller) in self.tellers().filter(|(role, _)| *role == to) {
            teller.put(bytes.clone()).wait().map_err(SessionError::bus("send"))?;
        }
        Ok(())
    }

    /// The next answer, unopened, or none where there is none within `patience`: for who has told bytes.
    ///
    /// # Errors
    /// [`LineError::NodeLost`].
    pub fn overhear(&mut self, patience: Duration) -> Result<Option<Vec<u8>>, LineError> {
        match self.incoming.recv_timeout(patience) {
            Ok(Incoming::Answer(_, envelope)) => Ok(Some(envelope.to_bytes().into_owned())),
            Ok(_) => self.look_for_nodes().map(|()| None),
            Err(_) => Ok(None),
        }
    }

    fn look_for_nodes(&self) -> Result<(), LineError> {
        let gone = |member: &&Member| member.teller.is_some() && !member.is_there();
        match self.cast.iter().rev().find(gone) {
            Some(member) => Err(LineError::NodeLost { role: member.seat.role }),
            None => Ok(()),
        }
    }

    fn receive(&self, patience: &mut Patience<'_>, role: Role) -> Result<Incoming, LineError> {
        if self.inbox.is_flooded() {
            return Err(LineError::Flooded);
        }
        loop {
            // The inbox holds a sender for as long as the line lives: what fails is that time is up.
            let left = patience.until.saturating_duration_since(Instant::now());
            if let Ok(incoming) = self.incoming.recv_timeout(left) {
                return Ok(incoming);
            }
            if !patience.renewed() {
                return Err(LineError::NoAnswer { role, deadline: patience.deadline });
            }
        }
    }

    /// Who answers, and what tells them.
    fn tellers(&self) -> impl Iterator<Item = (Role, &Publisher<'static>)> {
        self.cast.iter().filter_map(|member| member.teller.as_deref().map(|teller| (member.seat.role, teller)))
    }

    fn tell_nodes(&self, telling: Telling, message: &ZBytes) -> Result<(), LineError> {
        [Role::Planner, Role::Predictor, Role::Traffic]
            .into_iter()
            .try_for_each(|role| self.tell_node(role, telling, message))
    }

    fn tell_node(&self, to: Role, telling: Telling, message: &ZBytes) -> Result<(), LineError> {
        for (_, teller) in self.tellers().filter(|(role, _)| *role == to) {
            let envelope = envelope::seal(self.episode, telling, message.clone());
            teller.put(envelope).wait().map_err(SessionError::bus("send"))?;
        }
        Ok(())
    }

    fn recorder(&self) -> Option<&Member> {
        self.cast.iter().find(|member| member.seat.role == Role::Recorder)
    }

    /// Tells everybody who listens in.
    fn tell(&mut self, messages: Vec<(Channel, ZBytes)>) {
        if !self.shared.tape.is_heard() {
            return;
        }
        if let Some(digest) = &mut self.digest {
            messages.iter().for_each(|(channel, payload)| digest.add(*channel, &payload.to_bytes()));
        }
        let addressed = messages.into_iter().map(|(channel, payload)| (self.address(channel), payload));
        self.shared.tape.push(self.recorder().map(|recorder| recorder.seat.number), addressed.collect());
    }

    fn address(&self, channel: Channel) -> Address {
        Address { worker: self.worker.clone(), scene: self.scene.clone(), channel }
    }

    /// The key at which whoever listens in may ask for the scene.
    fn document(&self) -> String {
        Place::open_floor(&self.shared.run).tape(&self.address(Channel::Scene))
    }
}

impl Line for EpisodeLine {
    fn announce(&mut self, briefing: &Briefing) -> Result<(), LineError> {
        let payload = ZBytes::from(proto::Scene::from(briefing).encode_to_vec());
        lock(&self.shared.documents).insert(self.document(), payload.clone());
        self.tell_nodes(Telling::Scene, &payload)?;
        self.tell(vec![(Channel::Scene, payload)]);
        Ok(())
    }

    fn step(&mut self, observation: &Observation, deadline: Duration) -> Result<Answers, LineError> {
        self.ask(observation, deadline, None)
    }

    fn led_step(&mut self, observation: &Observation, driven: &Plan, deadline: Duration) -> Result<Answers, LineError> {
        self.ask(observation, deadline, Some(driven))
    }

    fn moves(
        &mut self,
        observation: &Observation,
        taken: &[Taken],
        deadline: Duration,
    ) -> Result<UncheckedMoves, LineError> {
        self.look_for_nodes()?;
        self.expect_silence()?;
        let role = Role::Traffic;
        let seen = proto::Observation::from(observation).encode_to_vec();
        self.tell_node(role, Telling::Observation, &seen.into())?;
        let taken = convert::taken_agents(observation.step, taken).encode_to_vec();
        self.tell_node(role, Telling::Taken, &taken.into())?;
        let mut patience = Patience::new(&self.shared.pulse, deadline);
        loop {
            let (from, envelope) = match self.receive(&mut patience, role)? {
                Incoming::Answer(from, envelope) if from != Role::Recorder => (from, envelope),
                other => {
                    self.expect_nothing(other)?;
                    continue;
                }
            };
            let bytes = envelope.to_bytes();
            match self.opened(from, &bytes)? {
                None => {}
                Some((Saying::Moves, bytes)) if from == role => {
                    let message = self::taken::<proto::TrafficMoves>(role, bytes)?;
                    self.tell_step(vec![(Channel::Moves, bytes.into())], None);
                    return UncheckedMoves::try_from(message).map_err(LineError::bad(role));
                }
                Some((saying, _)) => return Err(LineError::surplus(from, saying)),
            }
        }
    }

    fn dismiss(&mut self, end: &proto::EpisodeEnd, deadline: Duration) -> Result<(), LineError> {
        self.tell_end(end)?;
        let mut patience = Patience::new(&self.shared.pulse, deadline);
        let mut waited_for: Vec<Role> = self.tellers().map(|(role, _)| role).collect();
        while let Some(role) = waited_for.first() {
            let (role, envelope) = match self.receive(&mut patience, *role)? {
                Incoming::Answer(role, envelope) if role != Role::Recorder => (role, envelope),
                other => {
                    self.expect_nothing(other)?;
                    continue;
                }
            };
            match self.opened(role, &envelope.to_bytes())? {
                None => {}
                Some((Saying::Done, _)) if waited_for.contains(&role) => waited_for.retain(|other| *other != role),
                Some((saying, _)) => return Err(LineError::surplus(role, saying)),
            }
        }
        Ok(())
    }

    fn tell_end(&self, end: &proto::EpisodeEnd) -> Result<(), LineError> {
        self.tell_nodes(Telling::End, &end.encode_to_vec().into())
    }

    fn publish_record(&mut self, record: &proto::StepRecord) {
        self.counts.records += 1;
        self.tell(vec![(Channel::Record, record.encode_to_vec().into())]);
    }

    fn publish_event(&mut self, event: &proto::Event) {
        self.counts.events += 1;
        self.tell(vec![(Channel::Event, event.encode_to_vec().into())]);
    }

    fn publish_end(&mut self, end: proto::EpisodeEnd) -> proto::EpisodeEnd {
        let mut end = counted(end, &self.counts);
        end.digest = self.digest.as_ref().map(|digest| digest.to_bytes()).unwrap_or_default();
        self.tell(vec![(Channel::End, end.encode_to_vec().into())]);
        end
    }

    fn await_recorded(&mut self, deadline: Duration) -> Result<(), LineError> {
        let mut patience = Patience::new(&self.shared.pulse, deadline);
        loop {
            if !self.recorder().is_some_and(Member::is_there) {
                return Err(LineError::NodeLost { role: Role::Recorder });
            }
            match self.receive(&mut patience, Role::Recorder)? {
                Incoming::Answer(Role::Recorder, bytes) => {
                    return self.compare(&taken(Role::Recorder, &bytes.to_bytes())?);
                }
                Incoming::Intruded(Role::Recorder) => return Err(LineError::Intruded { role: Role::Recorder }),
                // The drive is over: what its nodes do now is of no account.
                _ => {}
            }
        }
    }
}

impl Drop for EpisodeLine {
    fn drop(&mut self) {
        self.cast.iter().for_each(|member| member.seat.listen_no_more(&self.worker));
        lock(&self.shared.documents).remove(&self.document());
    }
}

fn taken<P: Message>(role: Role, bytes: &[u8]) -> Result<P, LineError> {
    decode(bytes).map_err(LineError::bad(role))
}
