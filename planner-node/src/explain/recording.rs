//! One step of a recording: what was seen, what was expected, and what was planned; and what a planner that remembers knew by then.

use std::path::{Path, PathBuf};

use recording::{Damage, Event, Fault, LoadError, METADATA, METADATA_SETTINGS, NotMcap, Reader};
use thiserror::Error;
use wire::convert::compact;
use wire::proto;
use world::observation::{Briefing, Observation};
use world::plan::{Plan, Prediction, UncheckedPlan, UncheckedPrediction};

use super::PlannerOfRun;

/// A step as it was recorded.
#[derive(Clone, Debug)]
pub struct RecordedStep {
    /// What was told before the first step.
    pub briefing: Briefing,
    /// What was seen.
    pub observation: Observation,
    /// What was expected, if anyone predicted.
    pub prediction: Option<Prediction>,
    /// What was planned.
    pub plan: Plan,
    /// What was seen before, the oldest first: at most 24 steps, fewer where the recording is damaged.
    pub before: Vec<Observation>,
    /// What was planned at the step before.
    pub last: Option<Plan>,
    /// Who planned, as far as the run says so.
    pub planner: PlannerOfRun,
}

/// The most steps that are read before the one asked for: 2.4 s, as far as any planner remembers.
pub const BEFORE: u32 = 24;

/// Why a recording's step cannot be told.
#[derive(Debug, Error)]
pub enum RecordingError {
    /// The file cannot be read.
    #[error(transparent)]
    Load(#[from] LoadError),
    /// The file is no recording.
    #[error("cannot use {}: {why}", path.display())]
    NotMcap {
        /// The file.
        path: PathBuf,
        /// Why.
        why: NotMcap,
    },
    /// The recording stops before the step is told: its recorder was killed, or the disk was full.
    #[error("{path} is cut off before step {step} is told; it tells {told}\nhint: the command of its run, given again, drives what is missing", told = steps(*last))]
    CutOff {
        /// The file.
        path: PathBuf,
        /// The step asked for.
        step: u32,
        /// The last step that it tells.
        last: Option<u32>,
    },
    /// The file is damaged, and what it still holds does not tell the step.
    #[error("{path} is damaged, and step {step} is not told ({first}); it tells {told}\nhint: fetch the file again, or drive the scene again", told = steps(*last))]
    Damaged {
        /// The file.
        path: PathBuf,
        /// The step asked for.
        step: u32,
        /// The last step that it tells.
        last: Option<u32>,
        /// What is damaged first.
        first: Damage,
    },
    /// There is not even a scene.
    #[error("{path} has no scene: it is empty, cut off before it, or no recording of reloop\nhint: `recorder info {path}` says what it holds", path = path.display())]
    NoScene {
        /// The file.
        path: PathBuf,
    },
    /// A message cannot be understood.
    #[error("{path}: {topic} of step {step}: {what}")]
    Message {
        /// The file.
        path: PathBuf,
        /// Its topic.
        topic: &'static str,
        /// The step asked for.
        step: u32,
        /// What is wrong with it.
        what: String,
    },
    /// The recording does not have such a message.
    #[error("{path} has no {topic} of step {step}; it tells {told}\nhint: `recorder info {path}` says what it holds", path = path.display(), told = steps(*last))]
    Missing {
        /// The file.
        path: PathBuf,
        /// The topic.
        topic: &'static str,
        /// The step asked for.
        step: u32,
        /// The last step that it tells.
        last: Option<u32>,
    },
}

/// Which steps there are, in words.
fn steps(last: Option<u32>) -> String {
    last.map_or_else(|| "no step".to_owned(), |last| format!("steps 0 to {last}"))
}

const SCENE: &str = "/reloop/scene";
const OBSERVATION: &str = "/reloop/observation";
const PREDICTION: &str = "/reloop/prediction";
const PLAN: &str = "/reloop/plan";

/// Reads the step from a recording; one that is cut off or damaged will do, if it still tells the step.
///
/// # Errors
/// [`RecordingError`].
pub fn read_step(path: &Path, step: u32) -> Result<RecordedStep, RecordingError> {
    step_of(&recording::load(path)?, path, step)
}

/// Reads the step from the bytes of a recording; `path` is for errors.
///
/// # Errors
/// [`RecordingError`].
pub fn step_of(bytes: &[u8], path: &Path, step: u32) -> Result<RecordedStep, RecordingError> {
    let mut reader = Reader::new(bytes).map_err(|why| RecordingError::NotMcap { path: path.to_owned(), why })?;
    let wrong = |topic, what| RecordingError::Message { path: path.to_owned(), topic, step, what };
    let (mut briefing, mut observation, mut prediction, mut plan) = (None, None, None, None);
    let (mut before, mut planned_before) = (Vec::<Observation>::new(), None);
    let (mut planner, mut last, mut damage, mut is_cut_off) = (PlannerOfRun::default(), None, None, false);
    while let Some(event) = reader.next() {
        let message = match event {
            Event::Message(message) => message,
            Event::Metadata { name: METADATA, entries } => {
                let settings = entries.iter().find(|(key, _)| *key == METADATA_SETTINGS);
                planner = settings.map(|(_, settings)| PlannerOfRun::of(settings)).unwrap_or_default();
                continue;
            }
            Event::Damage(Damage { fault: Fault::CutOff, .. }) => {
                is_cut_off = true;
                continue;
            }
            Event::Damage(found) => {
                damage.get_or_insert(found);
                continue;
            }
            Event::Metadata { .. } | Event::Channel(_) => continue,
        };
        let data = message.data;
        // A message of another step may be as damaged as it likes.
        let misread = |what: String| Damage {
            at: message.at,
            fault: Fault::Message { topic: message.channel.topic.clone(), why: what },
        };
        match message.channel.topic.as_str() {
            SCENE if briefing.is_none() => match decoded::<proto::Scene, Briefing>(data) {
                Ok(told) => briefing = Some(told),
                Err(what) => drop(damage.get_or_insert(misread(what))),
            },
            // Without its scene it cannot be read, and the scene's absence is what is told.
            OBSERVATION => match briefing.as_ref().map(|briefing| observed(data, briefing)) {
                None => {}
                Some(Ok(seen)) if seen.step == step => observation = observation.or(Some(seen)),
                Some(Ok(seen)) => {
                    let is_next = before.last().is_none_or(|before| before.step < seen.step);
                    if is_next && seen.step < step && step - seen.step <= BEFORE {
                        before.push(seen);
                    }
                }
                Some(Err(what)) => drop(damage.get_or_insert(misread(what))),
            },
            PREDICTION => match decoded::<proto::Prediction, UncheckedPrediction>(&compact::unpack(data)) {
                Ok(expected) if expected.step == step => {
                    prediction = Some(expected.check(step).map_err(|e| wrong(PREDICTION, e.to_string()))?);
                }
                Ok(_) => {}
                Err(what) => drop(damage.get_or_insert(misread(what))),
            },
            PLAN => match decoded::<proto::Plan, UncheckedPlan>(data) {
                Ok(planned) => {
                    last = last.max(Some(planned.step));
                    if planned.step == step {
                        plan = Some(planned.check(step).map_err(|e| wrong(PLAN, e.to_string()))?);
                        break;
                    }
                    if planned.step + 1 == step {
                        let number = planned.step;
                        planned_before = planned.check(number).ok();
                    }
                }
                Err(what) => drop(damage.get_or_insert(misread(what))),
            },
            _ => {}
        }
    }
    let path = path.to_owned();
    match (briefing, observation, plan, damage) {
        (Some(briefing), Some(observation), Some(plan), _) => {
            Ok(RecordedStep { briefing, observation, prediction, plan, before, last: planned_before, planner })
        }
        (.., Some(first)) => Err(RecordingError::Damaged { path, step, last, first }),
        (None, ..) => Err(RecordingError::NoScene { path }),
        _ if is_cut_off => Err(RecordingError::CutOff { path, step, last }),
        (_, observation, ..) => {
            let topic = if observation.is_none() { OBSERVATION } else { PLAN };
            Err(RecordingError::Missing { path, topic, step, last })
        }
    }
}

/// The bytes of an observation of the episode of `briefing`.
fn observed(data: &[u8], briefing: &Briefing) -> Result<Observation, String> {
    let message = wire::convert::decode(data).map_err(|e| e.to_string())?;
    wire::convert::observation(message, &briefing.reference_line).map_err(|e| e.to_string())
}

/// A message's bytes as what they mean.
fn decoded<M, T>(data: &[u8]) -> Result<T, String>
where
    M: wire::convert::Message,
    T: TryFrom<M>,
    T::Error: ToString,
{
    T::try_from(wire::convert::decode(data).map_err(|e| e.to_string())?).map_err(|e| e.to_string())
}
