//! One step of a recording: what was seen, what was expected, and what was planned.

use std::path::{Path, PathBuf};

use mcap::read::{LinearReader, Options as ReadOptions};
use mcap::records::Record;
use mcap::{McapError, MessageStream};
use thiserror::Error;
use wire::proto;
use world::observation::{Briefing, Observation};
use world::plan::{Plan, Prediction, UncheckedPlan, UncheckedPrediction};

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
    /// What the planner's command gave as `--weights`, if the run says so.
    pub weights: Option<String>,
}

/// Why a recording's step cannot be told.
#[derive(Debug, Error)]
pub enum RecordingError {
    /// The file cannot be read.
    #[error("cannot read {path}")]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The file is no recording, or is damaged before its first message.
    #[error("{path} is no readable recording ({why})\nhint: recordings are the files RUN/episodes/SCENE.mcap")]
    Mcap {
        /// The file.
        path: PathBuf,
        /// Why.
        why: Box<McapError>,
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
    /// The file goes on before the step is told, but not with what was recorded.
    #[error("{path} is damaged before step {step} is told ({why}); it tells {told}\nhint: fetch the file again, or drive the scene again", told = steps(*last))]
    Damaged {
        /// The file.
        path: PathBuf,
        /// The step asked for.
        step: u32,
        /// The last step that it tells.
        last: Option<u32>,
        /// Why reading stopped.
        why: Box<McapError>,
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

/// Reads the step from a recording; one that is cut off will do, if the step is told before.
///
/// # Errors
/// [`RecordingError`].
pub fn read_step(path: &Path, step: u32) -> Result<RecordedStep, RecordingError> {
    let bytes = std::fs::read(path).map_err(|source| RecordingError::Io { path: path.to_owned(), source })?;
    let broken = |why| RecordingError::Mcap { path: path.to_owned(), why: Box::new(why) };
    let wrong = |topic, what| RecordingError::Message { path: path.to_owned(), topic, step, what };
    let (mut briefing, mut observation, mut prediction, mut plan) = (None, None, None, None);
    let (mut last, mut broken_by) = (None, None);
    for message in MessageStream::new_with_options(&bytes, ReadOptions::IgnoreEndMagic.into()).map_err(broken)? {
        let message = match message {
            Ok(message) => message,
            Err(why) => {
                broken_by = Some(why);
                break;
            }
        };
        let data = message.data.as_ref();
        match message.channel.topic.as_str() {
            SCENE => briefing = Some(decoded::<proto::Scene, Briefing>(data).map_err(|e| wrong(SCENE, e))?),
            OBSERVATION => {
                let seen: Observation = decoded::<proto::Observation, _>(data).map_err(|e| wrong(OBSERVATION, e))?;
                observation = observation.or(Some(seen).filter(|seen| seen.step == step));
            }
            PREDICTION => {
                let expected: UncheckedPrediction =
                    decoded::<proto::Prediction, _>(data).map_err(|e| wrong(PREDICTION, e))?;
                if expected.step == step {
                    prediction = Some(expected.check(step).map_err(|e| wrong(PREDICTION, e.to_string()))?);
                }
            }
            PLAN => {
                let planned: UncheckedPlan = decoded::<proto::Plan, _>(data).map_err(|e| wrong(PLAN, e))?;
                last = last.max(Some(planned.step));
                if planned.step == step {
                    plan = Some(planned.check(step).map_err(|e| wrong(PLAN, e.to_string()))?);
                    break;
                }
            }
            _ => {}
        }
    }
    let path = path.to_owned();
    match (briefing, observation, plan, broken_by) {
        (Some(briefing), Some(observation), Some(plan), _) => {
            Ok(RecordedStep { briefing, observation, prediction, plan, weights: weights_of_run(&bytes) })
        }
        (None, .., None | Some(McapError::UnexpectedEof)) => Err(RecordingError::NoScene { path }),
        (None, .., Some(why)) => Err(broken(why)),
        (.., Some(McapError::UnexpectedEof)) => Err(RecordingError::CutOff { path, step, last }),
        (.., Some(why)) => Err(RecordingError::Damaged { path, step, last, why: Box::new(why) }),
        (_, observation, ..) => {
            let topic = if observation.is_none() { OBSERVATION } else { PLAN };
            Err(RecordingError::Missing { path, topic, step, last })
        }
    }
}

/// What follows `--weights` in the planner's command, as the run's settings tell it; they come before all messages.
fn weights_of_run(bytes: &[u8]) -> Option<String> {
    let records = LinearReader::new_with_options(bytes, ReadOptions::IgnoreEndMagic.into()).ok()?;
    let settings = records.map_while(Result::ok).take_while(|record| !matches!(record, Record::Chunk { .. }));
    let settings = settings.filter_map(|record| match record {
        Record::Metadata(mut metadata) if metadata.name == "reloop" => metadata.metadata.remove("run.toml"),
        _ => None,
    });
    let run: toml::Table = settings.last()?.parse().ok()?;
    let command = run.get("settings")?.get("planner")?.get("command")?.as_str()?;
    let (_, after) = command.split_once("--weights")?;
    Some(after.trim_start_matches('=').split_whitespace().next()?.to_owned())
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
