//! Plans and predictions. Their numbers are not looked at here: [`UncheckedPlan::check`] and [`UncheckedPrediction::check`]
//! do that, for answers from inside the process too.

use world::geometry::Pose;
use world::plan::{
    Control, Diagnostics, Future, Plan, PlanState, PredictedTrajectory, Prediction, UncheckedPlan, UncheckedPrediction,
};
use world::scene::TrackId;

use super::scene::MAX_AGENTS;
use super::{Checked, Message, MessageError, bounded, each, finite, same_length, shown, unsigned};
use crate::proto;

/// Futures, terms of an objective, weights.
const MAX_ENTRIES: usize = 1_000;
/// Bytes of a name or a status.
const MAX_TEXT: usize = 1_000;
/// Of an error's text, as much is passed on.
const MAX_ERROR_CHARS: usize = 2_000;

impl From<Control> for proto::Control {
    fn from(control: Control) -> Self {
        Self { acceleration: control.acceleration, steering: control.steering }
    }
}

impl From<proto::Control> for Control {
    fn from(control: proto::Control) -> Self {
        Self { acceleration: unsigned(control.acceleration), steering: unsigned(control.steering) }
    }
}

pub(super) fn control(control: &proto::Control) -> Checked<Control> {
    Ok(Control {
        acceleration: finite("acceleration", control.acceleration)?,
        steering: finite("steering", control.steering)?,
    })
}

impl From<&UncheckedPlan> for proto::Plan {
    fn from(plan: &UncheckedPlan) -> Self {
        let state = |s: &PlanState| proto::PlanState { x: s.x, y: s.y, heading: s.heading, speed: s.speed };
        let term = |(name, value): &(String, f64)| proto::ObjectiveTerm { name: name.clone(), value: *value };
        Self {
            step: plan.step,
            states: plan.states.iter().map(state).collect(),
            controls: plan.controls.iter().copied().map(Into::into).collect(),
            objective: plan.diagnostics.objective.iter().map(term).collect(),
            iterations: plan.diagnostics.iterations,
            status: plan.diagnostics.status.clone(),
            error: String::new(),
        }
    }
}

impl From<Plan> for proto::Plan {
    fn from(plan: Plan) -> Self {
        (&plan.into_unchecked()).into()
    }
}

impl TryFrom<proto::Plan> for UncheckedPlan {
    type Error = MessageError;

    fn try_from(message: proto::Plan) -> Result<Self, MessageError> {
        refuse(&message.error)?;
        plan(message).map_err(|e| e.of(proto::Plan::NAME))
    }
}

fn plan(message: proto::Plan) -> Checked<UncheckedPlan> {
    bounded("status", MAX_TEXT, message.status.len())?;
    let state = |s: proto::PlanState| PlanState {
        x: unsigned(s.x),
        y: unsigned(s.y),
        heading: unsigned(s.heading),
        speed: unsigned(s.speed),
    };
    Ok(UncheckedPlan {
        step: message.step,
        states: message.states.into_iter().map(state).collect(),
        controls: message.controls.into_iter().map(Into::into).collect(),
        diagnostics: Diagnostics {
            objective: each("objective", MAX_ENTRIES, message.objective, |term| {
                bounded("name", MAX_TEXT, term.name.len())?;
                Ok((shown(&term.name), unsigned(term.value)))
            })?,
            iterations: message.iterations,
            status: shown(&message.status),
        },
    })
}

impl From<&UncheckedPrediction> for proto::Prediction {
    fn from(prediction: &UncheckedPrediction) -> Self {
        let trajectory = |t: &PredictedTrajectory| proto::PredictedTrajectory {
            track: t.track.0,
            x: t.poses.iter().map(|pose| pose.x).collect(),
            y: t.poses.iter().map(|pose| pose.y).collect(),
            heading: t.poses.iter().map(|pose| pose.heading).collect(),
            ..Default::default()
        };
        let future = |f: &Future| proto::Future {
            probability: f.probability,
            trajectories: f.trajectories.iter().map(trajectory).collect(),
            controls: f.controls.iter().copied().map(Into::into).collect(),
            ..Default::default()
        };
        Self {
            step: prediction.step,
            futures: prediction.futures.iter().map(future).collect(),
            initial_controls: prediction.initial_controls.iter().copied().map(Into::into).collect(),
            cost_weights: prediction.cost_weights.clone(),
            error: String::new(),
        }
    }
}

impl From<Prediction> for proto::Prediction {
    fn from(prediction: Prediction) -> Self {
        (&prediction.into_unchecked()).into()
    }
}

impl TryFrom<proto::Prediction> for UncheckedPrediction {
    type Error = MessageError;

    fn try_from(message: proto::Prediction) -> Result<Self, MessageError> {
        refuse(&message.error)?;
        prediction(message).map_err(|e| e.of(proto::Prediction::NAME))
    }
}

fn prediction(message: proto::Prediction) -> Checked<UncheckedPrediction> {
    let proto::Prediction { step, futures, initial_controls, cost_weights, error: _ } = message;
    let parts = |future: proto::Future| (future.probability, future.trajectories, future.controls);
    let futures = futures.into_iter().map(parts).collect();
    assembled(step, futures, initial_controls, cost_weights, trajectory)
}

/// A prediction of these parts: each future has its probability, trajectories as they travel, and controls.
pub(super) fn assembled<T>(
    step: u32,
    futures: Vec<(f64, Vec<T>, Vec<proto::Control>)>,
    initial_controls: Vec<proto::Control>,
    cost_weights: Vec<f64>,
    trajectory: impl Fn(T) -> Checked<PredictedTrajectory>,
) -> Checked<UncheckedPrediction> {
    bounded("cost_weights", MAX_ENTRIES, cost_weights.len())?;
    Ok(UncheckedPrediction {
        step,
        futures: each("futures", MAX_ENTRIES, futures, |(probability, trajectories, controls)| {
            Ok(Future {
                probability: unsigned(probability),
                trajectories: each("trajectories", MAX_AGENTS, trajectories, &trajectory)?,
                controls: controls.into_iter().map(Into::into).collect(),
            })
        })?,
        initial_controls: initial_controls.into_iter().map(Into::into).collect(),
        cost_weights: cost_weights.into_iter().map(unsigned).collect(),
    })
}

fn trajectory(message: proto::PredictedTrajectory) -> Checked<PredictedTrajectory> {
    same_length("y", message.x.len(), message.y.len())?;
    same_length("heading", message.x.len(), message.heading.len())?;
    let poses = message.x.iter().zip(&message.y).zip(&message.heading);
    Ok(PredictedTrajectory {
        track: TrackId(message.track),
        poses: poses.map(|((&x, &y), &heading)| Pose::new(unsigned(x), unsigned(y), unsigned(heading))).collect(),
    })
}

pub(super) fn refuse(error: &str) -> Result<(), MessageError> {
    let told: String = error.chars().take(MAX_ERROR_CHARS).collect();
    if error.is_empty() { Ok(()) } else { Err(MessageError::Refused(shown(&told))) }
}
