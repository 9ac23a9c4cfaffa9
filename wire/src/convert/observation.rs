//! Observations. The window of the reference line travels as numbers of samples: the line itself went out with the scene.

use std::sync::Arc;

use world::observation::Observation;
use world::plan::Control;
use world::reference_line::{ReferenceLine, ReferenceWindow, WINDOW_SAMPLES};

use super::agents::{agent, agent_state, signal};
use super::answers::control;
use super::scene::{MAX_AGENTS, line};
use super::{Checked, FieldError, Message, MessageError, Problem, Within, bounded, each, not_negative, required};
use crate::proto;

/// Signals at one step.
const MAX_SIGNALS: usize = 10_000;

impl From<&Observation> for proto::Observation {
    fn from(observation: &Observation) -> Self {
        let window = &observation.window;
        let number = |samples: usize| u32::try_from(samples).unwrap_or(u32::MAX);
        Self {
            step: observation.step,
            log_index: observation.log_index,
            av: Some((&observation.av).into()),
            control: Some(observation.control.into()),
            agents: observation.agents.iter().map(proto::Agent::from).collect(),
            signals: observation.signals.iter().map(proto::Signal::from).collect(),
            window: None,
            window_first_sample: number(window.start),
            window_samples: number(window.samples),
            red_stops: window.red_stops.clone(),
            window_speed_limit: window.speed_limit,
        }
    }
}

/// The observation that `message` is, in an episode whose reference line is `whole`. One of version 2 brings its window's samples along, and
/// they are what counts.
///
/// # Errors
/// [`MessageError::Field`].
pub fn observation(message: proto::Observation, whole: &Arc<ReferenceLine>) -> Result<Observation, MessageError> {
    checked(message, whole).map_err(|e| e.of(proto::Observation::NAME))
}

fn checked(message: proto::Observation, whole: &Arc<ReferenceLine>) -> Checked<Observation> {
    let first_sample = message.window_first_sample as usize;
    let (line, start, samples) = match message.window {
        Some(sent) => {
            let sent = line(sent).within("window")?;
            let samples = sent.len();
            (Arc::new(sent), 0, samples)
        }
        None => (Arc::clone(whole), first_sample, message.window_samples as usize),
    };
    let beyond = |index: u32, samples| Problem::OutOfRange { index, samples };
    if start > line.len() {
        let problem = beyond(message.window_first_sample, line.len());
        return Err(FieldError::new("window_first_sample", problem));
    }
    bounded("window_samples", WINDOW_SAMPLES.min(line.len() - start), samples)?;
    bounded("red_stops", samples, message.red_stops.len())?;
    if let Some((place, &index)) = message.red_stops.iter().enumerate().find(|(_, stop)| **stop as usize >= samples) {
        return Err(FieldError::new(&format!("red_stops[{place}]"), beyond(index, samples)));
    }
    let speed_limit = message.window_speed_limit.map(|limit| not_negative("window_speed_limit", limit)).transpose()?;
    Ok(Observation {
        step: message.step,
        log_index: message.log_index,
        av: agent_state(&required("av", message.av)?).within("av")?,
        control: message.control.map_or(Ok(Control::default()), |c| control(&c)).within("control")?,
        agents: each("agents", MAX_AGENTS, message.agents, |a| agent(&a))?,
        signals: each("signals", MAX_SIGNALS, message.signals, |s| signal(&s))?,
        window: ReferenceWindow { line, start, samples, first_sample, red_stops: message.red_stops, speed_limit },
    })
}

/// The same observation with its window by number, as it is sent since version 3: for recordings of before, in an episode whose
/// reference line is `whole`. One whose samples are not the line's is left as it is.
#[must_use]
pub fn by_number(message: proto::Observation, whole: &proto::ReferenceLine) -> proto::Observation {
    let Some(window) = &message.window else { return message };
    let (first, samples) = (message.window_first_sample as usize, window.x.len());
    let stretch = |column: &[f64]| column.get(first..first.saturating_add(samples)).map(<[f64]>::to_vec);
    let columns = [
        (&whole.x, &window.x),
        (&whole.y, &window.y),
        (&whole.z, &window.z),
        (&whole.heading, &window.heading),
        (&whole.curvature, &window.curvature),
    ];
    if columns.into_iter().any(|(whole, own)| stretch(whole).as_ref() != Some(own)) {
        return message;
    }
    let of_the_line = stretch(&whole.speed_limit).as_ref() == Some(&window.speed_limit);
    let window_speed_limit = window.speed_limit.first().copied().filter(|_| !of_the_line);
    proto::Observation { window: None, window_samples: samples as u32, window_speed_limit, ..message }
}
