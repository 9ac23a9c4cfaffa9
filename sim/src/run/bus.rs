//! The driver that is a planner, perhaps with a predictor, on the bus.

use std::time::Duration;

use results::settings::Settings;
use wire::hub::{EpisodeLine, Hub};
use wire::keys::Worker;
use wire::proto::{EpisodeEnd, Event, StepRecord};
use world::observation::{Briefing, Observation};
use world::plan::Plan;
use world::scene::SceneId;

use super::drive::Driver;

/// One episode's driver.
pub struct BusDriver {
    line: EpisodeLine,
    /// How long an answer may take.
    deadline: Duration,
    /// How long the recorder may take to close the recording; none where nobody records.
    recorder: Option<Duration>,
}

impl BusDriver {
    /// The driver of `scene` at a worker.
    ///
    /// # Errors
    /// Why the bus has no line for it, as a sentence.
    pub fn new(
        hub: &Hub,
        worker: &Worker,
        scene: &SceneId,
        settings: &Settings,
        recorder: Option<Duration>,
    ) -> Result<Self, String> {
        let predicts = settings.predictor.is_some();
        let line = hub.episode(worker, scene, predicts).map_err(|error| error.to_string())?;
        Ok(Self { line, deadline: settings.deadline(), recorder })
    }
}

impl Driver for BusDriver {
    fn brief(&mut self, briefing: &Briefing) -> Result<(), String> {
        self.line.announce(briefing).map_err(|error| error.to_string())
    }

    fn answer(&mut self, observation: &Observation) -> Result<Plan, String> {
        let step = observation.step;
        let at = |what: &str, error: &dyn std::fmt::Display| format!("step {step}: {what}{error}");
        let (plan, prediction) = self.line.step(observation, self.deadline).map_err(|error| at("", &error))?;
        if let Some(prediction) = prediction {
            prediction.check(step).map_err(|error| at("the predictor's answer is refused: ", &error))?;
        }
        plan.check(step).map_err(|error| at("the planner's answer is refused: ", &error))
    }

    fn step_done(&mut self, record: &StepRecord, events: &[Event]) {
        self.line.publish_record(record);
        events.iter().for_each(|event| self.line.publish_event(event));
    }

    fn end(&mut self, events: &[Event], end: &mut EpisodeEnd) -> Result<(), String> {
        events.iter().for_each(|event| self.line.publish_event(event));
        *end = self.line.publish_end(end.clone()).map_err(|error| error.to_string())?;
        let recorded = self.recorder.map(|patience| self.line.await_recorded(patience));
        recorded.unwrap_or(Ok(())).map_err(|error| error.to_string())
    }
}
