//! An episode's messages in canonical order, whatever the order in which they arrive.
//!
//! Planner and predictor answer at the same time, so no two drives are told alike; recordings are to be byte-identical all
//! the same. The order is: scene; for each step its observation, prediction (if the run has a predictor), plan, moves (if its agents react), record and
//! events; end. A step is given out as soon as it is complete, so that a recorder that is killed leaves all steps before.
//!
//! All that the simulator tells is recorded, also the answer that it refused. What a lying node answers beyond one plan and
//! one prediction a step comes before the end.

use std::collections::{BTreeMap, VecDeque};

use thiserror::Error;
use wire::keys::Channel;
use wire::proto;

use crate::message::{Body, Message};

/// The most bytes of an episode that may wait for what comes before them. An honest episode of 300 agents waits with a few
/// megabytes; only a node that floods the bus gets here.
pub const WAITING_BYTES: usize = 256 << 20;

/// Why no more messages of an episode are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum SequenceError {
    /// Too much waits.
    #[error("more than {} MiB of messages wait for an earlier one that is missing (step {step})", WAITING_BYTES >> 20)]
    Flooded {
        /// The first step that is not complete.
        step: u32,
    },
}

/// How many messages of each channel there are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[allow(missing_docs, reason = "as the channels")]
pub struct Counts {
    pub observations: u32,
    pub predictions: u32,
    pub plans: u32,
    pub moves: u32,
    pub records: u32,
    pub events: u32,
}

impl Counts {
    /// What the simulator says it told.
    #[must_use]
    pub fn of_end(end: &proto::EpisodeEnd) -> Self {
        Self {
            observations: end.observations,
            predictions: end.predictions,
            plans: end.plans,
            moves: end.moves,
            records: end.records,
            events: end.events,
        }
    }

    /// One message more of a channel.
    pub fn add(&mut self, channel: Channel) {
        match channel {
            Channel::Observation => self.observations += 1,
            Channel::Prediction => self.predictions += 1,
            Channel::Plan => self.plans += 1,
            Channel::Moves => self.moves += 1,
            Channel::Record => self.records += 1,
            Channel::Event => self.events += 1,
            Channel::Scene | Channel::End | Channel::Recorded => {}
        }
    }

    /// The first channel whose number is not the `expected` one, and both numbers.
    #[must_use]
    pub fn first_difference(&self, expected: &Self) -> Option<(&'static str, u32, u32)> {
        [
            ("observations", self.observations, expected.observations),
            ("predictions", self.predictions, expected.predictions),
            ("plans", self.plans, expected.plans),
            ("moves", self.moves, expected.moves),
            ("records", self.records, expected.records),
            ("events", self.events, expected.events),
        ]
        .into_iter()
        .find(|(_, arrived, expected)| arrived != expected)
    }
}

/// What there is of each step beside a plan.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Answers {
    /// A prediction.
    pub predictor: bool,
    /// Moves of agents that react.
    pub traffic: bool,
}

/// The messages of one step, so far.
#[derive(Default)]
struct Slot {
    observation: Option<Message>,
    prediction: Option<Message>,
    plan: Option<Message>,
    moves: Option<Message>,
    record: Option<Message>,
    events: Vec<Message>,
    /// Events that the record announces; unknown until it is here.
    expected_events: Option<u32>,
}

impl Slot {
    fn is_complete(&self, Answers { predictor, traffic }: Answers) -> bool {
        self.observation.is_some()
            && self.plan.is_some()
            && self.record.is_some()
            && (!predictor || self.prediction.is_some())
            && (!traffic || self.moves.is_some())
            && self.expected_events.is_some_and(|expected| self.events.len() as u64 >= u64::from(expected))
    }

    /// Its messages in order.
    fn into_messages(mut self) -> impl Iterator<Item = Message> {
        // Events of a step come in no order that all deliveries share but that of their bytes: kind, then text.
        self.events.sort_by(|a, b| a.payload.cmp(&b.payload));
        let answers = [self.observation, self.prediction, self.plan, self.moves, self.record];
        answers.into_iter().flatten().chain(self.events)
    }

    fn count(&self, counts: &mut Counts) {
        counts.observations += u32::from(self.observation.is_some());
        counts.records += u32::from(self.record.is_some());
        counts.plans += u32::from(self.plan.is_some());
        counts.moves += u32::from(self.moves.is_some());
        counts.predictions += u32::from(self.prediction.is_some());
        counts.events += self.events.len() as u32;
    }
}

/// The messages of one episode on their way into order. Pure: knows no bus, no file and no clock.
pub struct Sequence {
    /// What a step waits for.
    answers: Answers,
    /// Until it is here nothing is given out.
    scene: Option<Message>,
    scene_given: bool,
    /// Steps that are not complete, or come after one that is not.
    steps: BTreeMap<u32, Slot>,
    /// The first step that is not complete.
    next_step: u32,
    /// Answers that are one too many for their step, or come after it was given out.
    strays: Vec<Message>,
    end: Option<Message>,
    ready: VecDeque<Message>,
    /// Of what was given out.
    given: Counts,
    waiting_bytes: usize,
    ignored: u64,
}

impl Sequence {
    /// The empty sequence of a run whose steps have these answers.
    #[must_use]
    pub fn new(answers: Answers) -> Self {
        Self {
            answers,
            scene: None,
            scene_given: false,
            steps: BTreeMap::new(),
            next_step: 0,
            strays: Vec::new(),
            end: None,
            ready: VecDeque::new(),
            given: Counts::default(),
            waiting_bytes: 0,
            ignored: 0,
        }
    }

    /// Takes a message, in whatever order. A second scene, observation, record or end where one belongs is ignored.
    ///
    /// # Errors
    /// [`SequenceError::Flooded`]; the sequence is then of no use but for [`Sequence::close`].
    pub fn push(&mut self, message: Message) -> Result<(), SequenceError> {
        let bytes = message.payload.len();
        if self.place(message) {
            self.waiting_bytes += bytes;
        } else {
            self.ignored += 1;
        }
        self.give_complete_steps();
        if self.waiting_bytes > WAITING_BYTES {
            return Err(SequenceError::Flooded { step: self.next_step });
        }
        Ok(())
    }

    /// The next message in order, if it is certain which.
    pub fn pop(&mut self) -> Option<Message> {
        self.ready.pop_front()
    }

    /// Whether the end is here, and all that it counts.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        self.scene_given && self.end().is_some_and(|end| self.counts() == Counts::of_end(end))
    }

    /// Whether the scene came.
    #[must_use]
    pub fn has_scene(&self) -> bool {
        self.scene_given
    }

    /// How the episode ended, once that is known.
    #[must_use]
    pub fn end(&self) -> Option<&proto::EpisodeEnd> {
        match &self.end.as_ref()?.body {
            Body::End(end) => Some(end),
            _ => None,
        }
    }

    /// What arrived.
    #[must_use]
    pub fn counts(&self) -> Counts {
        let mut counts = self.given;
        self.steps.values().for_each(|slot| slot.count(&mut counts));
        for stray in &self.strays {
            counts.add(stray.channel());
        }
        counts
    }

    /// Messages that came twice.
    #[must_use]
    pub fn ignored(&self) -> u64 {
        self.ignored
    }

    /// Gives out all that is here, complete or not. Call it when the episode is whole, or nothing more will come.
    pub fn close(&mut self) {
        self.give_scene();
        self.given = self.counts();
        for (_, slot) in std::mem::take(&mut self.steps) {
            self.ready.extend(slot.into_messages());
        }
        self.strays.sort_by(|a, b| (a.step(), a.channel(), &a.payload).cmp(&(b.step(), b.channel(), &b.payload)));
        self.ready.extend(self.strays.drain(..));
        self.ready.extend(self.end.take());
        self.waiting_bytes = 0;
    }

    /// Puts the message where it belongs; false where it belongs nowhere.
    fn place(&mut self, message: Message) -> bool {
        let step = message.step();
        let is_late = step < self.next_step;
        let place = match &message.body {
            Body::Scene(_) if self.scene_given => return false,
            Body::Scene(_) => &mut self.scene,
            Body::End(_) => &mut self.end,
            Body::Observation(_) | Body::Record(_) if is_late => return false,
            _ if is_late => {
                self.strays.push(message);
                return true;
            }
            body => {
                let slot = self.steps.entry(step).or_default();
                match body {
                    Body::Observation(_) => &mut slot.observation,
                    Body::Prediction(_) => &mut slot.prediction,
                    Body::Plan(_) => &mut slot.plan,
                    Body::Moves(_) => &mut slot.moves,
                    Body::Record(record) => {
                        slot.expected_events.get_or_insert(record.events);
                        &mut slot.record
                    }
                    _ => {
                        slot.events.push(message);
                        return true;
                    }
                }
            }
        };
        match (&place, &message.body) {
            (None, _) => *place = Some(message),
            (Some(_), Body::Prediction(_) | Body::Plan(_) | Body::Moves(_)) => self.strays.push(message),
            (Some(_), _) => return false,
        }
        true
    }

    fn give_scene(&mut self) {
        if let Some(scene) = self.scene.take() {
            self.waiting_bytes -= scene.payload.len().min(self.waiting_bytes);
            self.ready.push_back(scene);
            self.scene_given = true;
        }
    }

    fn give_complete_steps(&mut self) {
        self.give_scene();
        while self.scene_given && self.steps.get(&self.next_step).is_some_and(|slot| slot.is_complete(self.answers)) {
            let Some(slot) = self.steps.remove(&self.next_step) else { break };
            slot.count(&mut self.given);
            for message in slot.into_messages() {
                self.waiting_bytes -= message.payload.len().min(self.waiting_bytes);
                self.ready.push_back(message);
            }
            self.next_step += 1;
        }
    }
}
