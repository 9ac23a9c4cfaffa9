//! Observations.

use std::sync::Arc;

use world::observation::Observation;
use world::plan::Control;
use world::reference_line::ReferenceWindow;

use super::agents::{agent, agent_state, signal};
use super::answers::control;
use super::scene::{MAX_AGENTS, line, line_message};
use super::{Checked, FieldError, Message, MessageError, Problem, Within, bounded, each, required};
use crate::proto;

/// Signals at one step.
const MAX_SIGNALS: usize = 10_000;

impl From<&Observation> for proto::Observation {
    fn from(observation: &Observation) -> Self {
        let window = &observation.window;
        Self {
            step: observation.step,
            log_index: observation.log_index,
            av: Some((&observation.av).into()),
            control: Some(observation.control.into()),
            agents: observation.agents.iter().map(proto::Agent::from).collect(),
            signals: observation.signals.iter().map(proto::Signal::from).collect(),
            window: Some(window_message(window)),
            window_first_sample: u32::try_from(window.first_sample).unwrap_or(u32::MAX),
            red_stops: window.red_stops.clone(),
        }
    }
}

/// The stretch of the line, with the limits that hold at this step.
fn window_message(window: &ReferenceWindow) -> proto::ReferenceLine {
    let mut message = line_message(&window.line, window.start..window.start.saturating_add(window.samples));
    if let Some(limit) = window.speed_limit {
        message.speed_limit.fill(limit);
    }
    message
}

impl TryFrom<proto::Observation> for Observation {
    type Error = MessageError;

    fn try_from(message: proto::Observation) -> Result<Self, MessageError> {
        observation(message).map_err(|e| e.of(proto::Observation::NAME))
    }
}

fn observation(message: proto::Observation) -> Checked<Observation> {
    let line = line(required("window", message.window)?).within("window")?;
    let samples = line.x.len();
    bounded("red_stops", samples, message.red_stops.len())?;
    if let Some((place, &index)) = message.red_stops.iter().enumerate().find(|(_, stop)| **stop as usize >= samples) {
        return Err(FieldError::new(&format!("red_stops[{place}]"), Problem::OutOfRange { index, samples }));
    }
    Ok(Observation {
        step: message.step,
        log_index: message.log_index,
        av: agent_state(&required("av", message.av)?).within("av")?,
        control: message.control.map_or(Ok(Control::default()), |c| control(&c)).within("control")?,
        agents: each("agents", MAX_AGENTS, message.agents, |a| agent(&a))?,
        signals: each("signals", MAX_SIGNALS, message.signals, |s| signal(&s))?,
        window: ReferenceWindow {
            line: Arc::new(line),
            start: 0,
            samples,
            first_sample: message.window_first_sample as usize,
            red_stops: message.red_stops,
            speed_limit: None,
        },
    })
}
