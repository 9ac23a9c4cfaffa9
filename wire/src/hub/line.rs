//! One episode on the bus, as the simulator sees it.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::{Duration, Instant};

use prost::Message as _;
use thiserror::Error;
use world::observation::{Briefing, Observation};
use world::plan::{UncheckedPlan, UncheckedPrediction};
use world::scene::SceneId;
use zenoh::bytes::ZBytes;

use super::{Shared, lock};
use crate::convert::{MessageError, decode};
use crate::keys::{Address, Channel, Role, Worker};
use crate::proto;
use crate::session::{self, SessionError};

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
    /// All that arrived, accepted or not: the recorder hears the same.
    plans: AtomicU32,
    predictions: AtomicU32,
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
        match channel {
            Channel::Plan => self.plans.fetch_add(1, Ordering::Relaxed),
            Channel::Prediction => self.predictions.fetch_add(1, Ordering::Relaxed),
            _ => 0,
        };
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
    observations: u32,
    records: u32,
    events: u32,
}

impl EpisodeLine {
    pub(super) fn open(
        shared: &Arc<Shared>,
        worker: &Worker,
        scene: &SceneId,
        expects_prediction: bool,
    ) -> Result<Self, LineError> {
        let (sender, incoming) = sync_channel(INBOX);
        let inbox = Arc::new(Inbox {
            sender,
            plans: AtomicU32::new(0),
            predictions: AtomicU32::new(0),
            flooded: AtomicBool::new(false),
        });
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
            observations: 0,
            records: 0,
            events: 0,
        })
    }

    /// Tells the nodes what they may know before the first step.
    ///
    /// # Errors
    /// [`LineError::Bus`].
    pub fn announce(&self, briefing: &Briefing) -> Result<(), LineError> {
        let payload = ZBytes::from(proto::Scene::from(briefing).encode_to_vec());
        let key = self.key(Channel::Scene);
        lock(&self.shared.documents).insert(key.clone(), payload.clone());
        Ok(session::send(&self.shared.session, &key, payload)?)
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
        let until = Instant::now() + deadline;
        self.look_for_nodes()?;
        self.send(Channel::Observation, &proto::Observation::from(observation))?;
        self.observations += 1;

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
                    plan = Some(take::<proto::Plan, _>(Role::Planner, &bytes)?);
                }
                Incoming::Answer(Channel::Prediction, bytes) if self.expects_prediction => {
                    prediction = Some(take::<proto::Prediction, _>(Role::Predictor, &bytes)?);
                }
                Incoming::Answer(..) => {}
            }
        }
    }

    /// Tells how a step went.
    ///
    /// # Errors
    /// [`LineError::Bus`].
    pub fn publish_record(&mut self, record: &proto::StepRecord) -> Result<(), LineError> {
        self.records += 1;
        self.send(Channel::Record, record)
    }

    /// Tells what happened.
    ///
    /// # Errors
    /// [`LineError::Bus`].
    pub fn publish_event(&mut self, event: &proto::Event) -> Result<(), LineError> {
        self.events += 1;
        self.send(Channel::Event, event)
    }

    /// Tells how the episode ended, and how many messages of each kind there were. Gives back what was told.
    ///
    /// # Errors
    /// [`LineError::Bus`].
    pub fn publish_end(&mut self, mut end: proto::EpisodeEnd) -> Result<proto::EpisodeEnd, LineError> {
        end.observations = self.observations;
        end.plans = self.inbox.plans.load(Ordering::Relaxed);
        end.predictions = self.inbox.predictions.load(Ordering::Relaxed);
        end.records = self.records;
        end.events = self.events;
        self.send(Channel::End, &end)?;
        Ok(end)
    }

    /// Waits until the recorder has closed the episode's recording, at most `deadline`, and compares what it has with `end`.
    ///
    /// # Errors
    /// [`LineError`] where there is no recording, or not a whole one.
    pub fn await_recorded(&mut self, end: &proto::EpisodeEnd, deadline: Duration) -> Result<(), LineError> {
        let until = Instant::now() + deadline;
        loop {
            if !self.shared.nodes.serve(Role::Recorder, &self.worker) {
                return Err(LineError::NodeLost { role: Role::Recorder });
            }
            if let Incoming::Answer(Channel::Recorded, bytes) = self.receive(until, deadline, Role::Recorder)? {
                let recorded = decode::<proto::Recorded>(&bytes.to_bytes())
                    .map_err(|error| LineError::BadAnswer { role: Role::Recorder, error })?;
                return compare(end, &recorded);
            }
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
        self.incoming.recv_timeout(until.saturating_duration_since(Instant::now())).map_err(|e| match e {
            // The inbox holds a sender for as long as the line lives.
            RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected => LineError::NoAnswer { role, deadline },
        })
    }

    fn send(&self, channel: Channel, message: &impl prost::Message) -> Result<(), LineError> {
        Ok(session::send(&self.shared.session, &self.key(channel), message.encode_to_vec())?)
    }

    fn key(&self, channel: Channel) -> String {
        Address { worker: self.worker.clone(), scene: self.scene.clone(), channel }.key(&self.shared.run)
    }
}

impl Drop for EpisodeLine {
    fn drop(&mut self) {
        lock(&self.shared.inboxes).remove(&(self.worker.clone(), self.scene.clone()));
        lock(&self.shared.documents).remove(&self.key(Channel::Scene));
    }
}

fn take<P: crate::convert::Message, W: TryFrom<P, Error = MessageError>>(role: Role, bytes: &ZBytes) -> Result<W, LineError> {
    let answer = decode::<P>(&bytes.to_bytes()).and_then(W::try_from);
    answer.map_err(|error| LineError::BadAnswer { role, error })
}

fn compare(end: &proto::EpisodeEnd, recorded: &proto::Recorded) -> Result<(), LineError> {
    if !recorded.error.is_empty() {
        return Err(LineError::NotRecorded(recorded.error.clone()));
    }
    let counts = [
        ("observations", end.observations, recorded.observations),
        ("plans", end.plans, recorded.plans),
        ("predictions", end.predictions, recorded.predictions),
        ("records", end.records, recorded.records),
        ("events", end.events, recorded.events),
    ];
    match counts.into_iter().find(|(_, sent, arrived)| sent != arrived) {
        None => Ok(()),
        Some((what, sent, recorded)) => Err(LineError::NotWhole { what, sent, recorded }),
    }
}
