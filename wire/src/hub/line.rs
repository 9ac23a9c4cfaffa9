//! One episode on the bus, as the simulator sees it.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::time::{Duration, Instant};

use prost::Message as _;
use thiserror::Error;
use world::observation::{Briefing, Observation};
use world::plan::{UncheckedPlan, UncheckedPrediction};
use world::scene::SceneId;
use zenoh::Wait;
use zenoh::bytes::ZBytes;
use zenoh::pubsub::Publisher;

use super::{Shared, lock};
use crate::convert::{Message, MessageError, decode};
use crate::digest::Digest;
use crate::keys::{Address, Channel, Role, Worker};
use crate::proto;
use crate::session::{self, SessionError};
use crate::waiting;

/// Answers that may wait in a line's inbox. An honest node sends one and waits for the next observation.
const INBOX: usize = 64;

/// Why a step has no answer, or an episode no recording.
#[derive(Debug, Error)]
pub enum LineError {
    /// It did not come in time.
    #[error("the {role} gave no answer within {} s", deadline.as_secs_f64())]
    NoAnswer {
        /// Who was waited for.
        role: Role,
        /// How long.
        deadline: Duration,
    },
    /// It died, left, or was never there.
    #[error("the {role} is gone")]
    NodeLost {
        /// Who.
        role: Role,
    },
    /// It says something that is no answer, or that it has none.
    #[error("the {role}'s answer is refused: {error}")]
    BadAnswer {
        /// Who.
        role: Role,
        /// Why.
        error: MessageError,
    },
    /// Answers come that nobody asked for.
    #[error("more than {INBOX} answers wait: a node sends what it was not asked for")]
    Flooded,
    /// The recording lacks something.
    #[error("the recording is not whole: {what} {sent} sent, {recorded} recorded")]
    NotWhole {
        /// Of what.
        what: &'static str,
        /// As many as were sent.
        sent: u32,
        /// As many as are in the recording.
        recorded: u32,
    },
    /// The recording has as many messages as there were, but not those.
    #[error("the recording does not hold what was told: its digest is another")]
    OtherDigest,
    /// The recorder could not write.
    #[error("the recorder failed: {0}")]
    NotRecorded(String),
    /// The episode is already open.
    #[error("episode {scene} is already on at worker {worker}")]
    Busy {
        /// The episode.
        scene: SceneId,
        /// The worker.
        worker: Worker,
    },
    /// The session failed.
    #[error(transparent)]
    Bus(#[from] SessionError),
}

/// What the transport's callbacks put down for a line, and what the line takes up.
pub(super) struct Inbox {
    sender: SyncSender<Incoming>,
    /// The queue ran over.
    flooded: AtomicBool,
}

enum Incoming {
    Answer(Channel, ZBytes),
    /// Some node that may be this line's is gone: look.
    NodeLost,
}

impl Inbox {
    pub(super) fn deliver(&self, channel: Channel, payload: &ZBytes) {
        self.push(Incoming::Answer(channel, payload.clone()));
    }

    pub(super) fn node_lost(&self) {
        self.push(Incoming::NodeLost);
    }

    fn push(&self, incoming: Incoming) {
        if self.sender.try_send(incoming).is_err() {
            self.flooded.store(true, Ordering::Relaxed);
        }
    }
}

/// The line of one episode. Dropping it ends it: what comes later is nobody's.
pub struct EpisodeLine {
    shared: Arc<Shared>,
    worker: Worker,
    scene: SceneId,
    expects_prediction: bool,
    inbox: Arc<Inbox>,
    incoming: Receiver<Incoming>,
    observations: Publisher<'static>,
    /// What was told.
    counts: proto::Recorded,
    digest: Digest,
}

impl EpisodeLine {
    pub(super) fn open(
        shared: &Arc<Shared>,
        worker: &Worker,
        scene: &SceneId,
        expects_prediction: bool,
    ) -> Result<Self, LineError> {
        let (sender, incoming) = sync_channel(INBOX);
        let address = Address { worker: worker.clone(), scene: scene.clone(), channel: Channel::Observation };
        let observations = session::publisher(&shared.session, address.key(&shared.run))?;
        let inbox = Arc::new(Inbox { sender, flooded: AtomicBool::new(false) });
        let mut inboxes = lock(&shared.inboxes);
        let place = (worker.clone(), scene.clone());
        if inboxes.contains_key(&place) {
            return Err(LineError::Busy { scene: scene.clone(), worker: worker.clone() });
        }
        inboxes.insert(place, Arc::clone(&inbox));
        drop(inboxes);
        Ok(Self {
            shared: Arc::clone(shared),
            worker: worker.clone(),
            scene: scene.clone(),
            expects_prediction,
            inbox,
            incoming,
            observations,
            counts: proto::Recorded::default(),
            digest: Digest::default(),
        })
    }

    /// Tells the nodes what they may know before the first step.
    ///
    /// # Errors
    /// [`LineError::Bus`].
    pub fn announce(&mut self, briefing: &Briefing) -> Result<(), LineError> {
        let payload = ZBytes::from(proto::Scene::from(briefing).encode_to_vec());
        lock(&self.shared.documents).insert(self.address(Channel::Scene).key(&self.shared.run), payload.clone());
        self.tell_nodes(Channel::Scene, payload)
    }

    /// Sends `observation` and waits until it is answered, at most `deadline`. The answers are unchecked: whether they are
    /// for this step and whole is for the caller to see.
    ///
    /// # Errors
    /// [`LineError`]: no answer, a dead node, an answer that is none.
    pub fn step(
        &mut self,
        observation: &Observation,
        deadline: Duration,
    ) -> Result<(UncheckedPlan, Option<UncheckedPrediction>), LineError> {
        self.look_for_nodes()?;
        self.counts.observations += 1;
        let payload = ZBytes::from(proto::Observation::from(observation).encode_to_vec());
        let mut told = vec![(Channel::Observation, payload.clone())];
        let answers = self.exchange(payload, deadline, &mut told);
        // Only now: the tape's thread would take the time in which the answer is awaited.
        self.tell(told);
        answers
    }

    /// Sends an observation and waits for its answers, which go into `told` as they come.
    fn exchange(
        &mut self,
        observation: ZBytes,
        deadline: Duration,
        told: &mut Vec<(Channel, ZBytes)>,
    ) -> Result<(UncheckedPlan, Option<UncheckedPrediction>), LineError> {
        self.observations.put(observation).wait().map_err(SessionError::bus("send"))?;
        let until = Instant::now() + deadline;
        let (mut plan, mut prediction) = (None, None);
        loop {
            match (plan.take(), self.expects_prediction, prediction.take()) {
                (Some(whole), false, _) => return Ok((whole, None)),
                (Some(whole), true, Some(with)) => return Ok((whole, Some(with))),
                (some, _, other) => (plan, prediction) = (some, other),
            }
            let missing = if self.expects_prediction && prediction.is_none() { Role::Predictor } else { Role::Planner };
            match self.receive(until, deadline, missing)? {
                Incoming::NodeLost => self.look_for_nodes()?,
                Incoming::Answer(Channel::Plan, bytes) => {
                    let message = taken::<proto::Plan>(Role::Planner, &bytes)?;
                    self.counts.plans += 1;
                    told.push((Channel::Plan, bytes));
                    plan = Some(UncheckedPlan::try_from(message).map_err(LineError::bad(Role::Planner))?);
                }
                Incoming::Answer(Channel::Prediction, bytes) if self.expects_prediction => {
                    let message = taken::<proto::Prediction>(Role::Predictor, &bytes)?;
                    self.counts.predictions += 1;
                    told.push((Channel::Prediction, bytes));
                    prediction = Some(UncheckedPrediction::try_from(message).map_err(LineError::bad(Role::Predictor))?);
                }
                Incoming::Answer(..) => {}
            }
        }
    }

    /// Tells how a step went.
    pub fn publish_record(&mut self, record: &proto::StepRecord) {
        self.counts.records += 1;
        self.tell(vec![(Channel::Record, record.encode_to_vec().into())]);
    }

    /// Tells what happened.
    pub fn publish_event(&mut self, event: &proto::Event) {
        self.counts.events += 1;
        self.tell(vec![(Channel::Event, event.encode_to_vec().into())]);
    }

    /// Tells how the episode ended, how many messages of each kind there were, and their digest. Gives back what was told.
    ///
    /// # Errors
    /// [`LineError::Bus`].
    pub fn publish_end(&mut self, mut end: proto::EpisodeEnd) -> Result<proto::EpisodeEnd, LineError> {
        end.observations = self.counts.observations;
        end.plans = self.counts.plans;
        end.predictions = self.counts.predictions;
        end.records = self.counts.records;
        end.events = self.counts.events;
        end.digest = self.digest.to_bytes();
        self.tell_nodes(Channel::End, end.encode_to_vec().into())?;
        Ok(end)
    }

    /// Waits until the recorder has closed the episode's recording, at most `deadline`, and compares what it has with what
    /// was told.
    ///
    /// # Errors
    /// [`LineError`] where there is no recording, or not a whole one.
    pub fn await_recorded(&mut self, deadline: Duration) -> Result<(), LineError> {
        let until = Instant::now() + deadline;
        loop {
            if !self.shared.nodes.serve(Role::Recorder, &self.worker) {
                return Err(LineError::NodeLost { role: Role::Recorder });
            }
            if let Incoming::Answer(Channel::Recorded, bytes) = self.receive(until, deadline, Role::Recorder)? {
                return self.compare(&taken(Role::Recorder, &bytes)?);
            }
        }
    }

    fn compare(&self, recorded: &proto::Recorded) -> Result<(), LineError> {
        if !recorded.error.is_empty() {
            return Err(LineError::NotRecorded(recorded.error.clone()));
        }
        let told = &self.counts;
        let counts = [
            ("observations", told.observations, recorded.observations),
            ("plans", told.plans, recorded.plans),
            ("predictions", told.predictions, recorded.predictions),
            ("records", told.records, recorded.records),
            ("events", told.events, recorded.events),
        ];
        match counts.into_iter().find(|(_, sent, arrived)| sent != arrived) {
            None if recorded.digest != self.digest.to_bytes() => Err(LineError::OtherDigest),
            None => Ok(()),
            Some((what, sent, recorded)) => Err(LineError::NotWhole { what, sent, recorded }),
        }
    }

    fn look_for_nodes(&self) -> Result<(), LineError> {
        for role in [Role::Predictor, Role::Planner] {
            let needed = role == Role::Planner || self.expects_prediction;
            if needed && !self.shared.nodes.serve(role, &self.worker) {
                return Err(LineError::NodeLost { role });
            }
        }
        Ok(())
    }

    fn receive(&self, until: Instant, deadline: Duration, role: Role) -> Result<Incoming, LineError> {
        if self.inbox.flooded.load(Ordering::Relaxed) {
            return Err(LineError::Flooded);
        }
        // The inbox holds a sender for as long as the line lives: what fails is that time is up.
        waiting::receive(&self.incoming, Some(until)).ok_or(LineError::NoAnswer { role, deadline })
    }

    /// Tells the nodes, and everybody who listens in.
    fn tell_nodes(&mut self, channel: Channel, payload: ZBytes) -> Result<(), LineError> {
        self.send(channel, payload.clone())?;
        self.tell(vec![(channel, payload)]);
        Ok(())
    }

    fn send(&self, channel: Channel, payload: ZBytes) -> Result<(), LineError> {
        Ok(session::send(&self.shared.session, &self.address(channel).key(&self.shared.run), payload)?)
    }

    /// Tells everybody who listens in.
    fn tell(&mut self, messages: Vec<(Channel, ZBytes)>) {
        messages.iter().for_each(|(channel, payload)| self.digest.add(*channel, &payload.to_bytes()));
        let keyed =
            messages.into_iter().map(|(channel, payload)| (self.address(channel).tape_key(&self.shared.run), payload));
        self.shared.tape.push(keyed.collect());
    }

    fn address(&self, channel: Channel) -> Address {
        Address { worker: self.worker.clone(), scene: self.scene.clone(), channel }
    }
}

impl Drop for EpisodeLine {
    fn drop(&mut self) {
        lock(&self.shared.inboxes).remove(&(self.worker.clone(), self.scene.clone()));
        lock(&self.shared.documents).remove(&self.address(Channel::Scene).key(&self.shared.run));
    }
}

impl LineError {
    fn bad(role: Role) -> impl FnOnce(MessageError) -> Self {
        move |error| Self::BadAnswer { role, error }
    }
}

fn taken<P: Message>(role: Role, bytes: &ZBytes) -> Result<P, LineError> {
    decode(&bytes.to_bytes()).map_err(LineError::bad(role))
}
