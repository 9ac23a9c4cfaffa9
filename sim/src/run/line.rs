//! The driver that is a planner, perhaps with a predictor, at the end of a line: on the bus, or in this process.

use std::sync::Arc;
use std::time::Duration;

use wire::hub::{Line, LineError};
use wire::proto::{AgentState, EpisodeEnd, Event, StepRecord};
use world::observation::{Briefing, Observation};
use world::plan::{Plan, Prediction};
use world::scene::{Scene, Track};
use world::traffic::{Taken, UncheckedMoves};

use super::drive::Driver;

/// One episode's driver.
pub struct LineDriver {
    line: Box<dyn Line>,
    scene: Arc<Scene>,
    /// Plans that are driven in place of the planner's, from step 0 on; most often none.
    lead: Vec<Plan>,
    /// How long an answer may take.
    deadline: Duration,
    /// How long the recorder may take to close the recording; none where nobody records.
    recorder: Option<Duration>,
    /// Whether the nodes know how it ended.
    dismissed: bool,
    /// What the predictor said at the last step.
    pub prediction: Option<Prediction>,
    /// Whether the recorder was gone at the end, or did not say in time that it is done.
    pub recorder_is_lost: bool,
}

impl LineDriver {
    /// The driver of `scene` at the end of `line`. `recorder` is how long the recorder may take to close the recording, if there is one.
    #[must_use]
    pub fn new(line: Box<dyn Line>, scene: &Arc<Scene>, deadline: Duration, recorder: Option<Duration>) -> Self {
        Self {
            line,
            scene: Arc::clone(scene),
            lead: Vec::new(),
            deadline,
            recorder,
            dismissed: false,
            prediction: None,
            recorder_is_lost: false,
        }
    }

    /// Has these plans driven before the planner's own. It is asked at their steps too, and must answer.
    pub fn lead_by(&mut self, plans: Vec<Plan>) {
        self.lead = plans;
    }
}

impl Driver for LineDriver {
    fn brief(&mut self, briefing: &Briefing) -> Result<(), String> {
        self.line.announce(briefing).map_err(|error| error.to_string())
    }

    fn answer(&mut self, observation: &Observation) -> Result<Plan, String> {
        let step = observation.step;
        let at = |what: &str, error: &dyn std::fmt::Display| format!("step {step}: {what}{error}");
        let led = self.lead.get(step as usize);
        let answers = match led {
            None => self.line.step(observation, self.deadline),
            Some(driven) => self.line.led_step(observation, driven, self.deadline),
        };
        let (plan, prediction) = answers.map_err(|error| at("", &error))?;
        let prediction = prediction.map(|prediction| prediction.check(step)).transpose();
        self.prediction = prediction.map_err(|error| at("the predictor's answer is refused: ", &error))?;
        let plan = plan.check(step).map_err(|error| at("the planner's answer is refused: ", &error))?;
        Ok(led.cloned().unwrap_or(plan))
    }

    fn moves(&mut self, observation: &Observation, taken: &[Taken]) -> Result<UncheckedMoves, String> {
        let moves = self.line.moves(observation, taken, self.deadline);
        moves.map_err(|error| format!("step {}: {error}", observation.step))
    }

    fn step_done(&mut self, record: &StepRecord, events: &[Event]) {
        // What pictures show beside the drive: where the log has the AV now, and whom the AV touches. Nobody answers any more.
        let logged = |track: &Track| {
            let state = track.states.get(record.log_index as usize).copied().flatten();
            state.as_ref().map(AgentState::from)
        };
        self.line.publish_record(&StepRecord { logged_av: logged(self.scene.av()), ..*record });
        for event in events {
            let other = self.scene.tracks().iter().find(|track| Some(track.id.0) == event.track);
            self.line.publish_event(&Event { other: other.and_then(logged), ..event.clone() });
        }
    }

    fn dismiss(&mut self, end: &EpisodeEnd) -> Result<(), String> {
        self.dismissed = true;
        self.line.dismiss(end, self.deadline).map_err(|error| format!("after the last step: {error}"))
    }

    fn end(&mut self, events: &[Event], end: &mut EpisodeEnd) -> Result<(), String> {
        if !self.dismissed {
            self.line.tell_end(end).map_err(|error| error.to_string())?;
        }
        events.iter().for_each(|event| self.line.publish_event(event));
        let told = self.line.publish_end(end.clone());
        // Results are those of the drive, however its messages were written.
        *end = EpisodeEnd { digest: Vec::new(), ..told };
        let Some(patience) = self.recorder else { return Ok(()) };
        let recorded = self.line.await_recorded(patience);
        self.recorder_is_lost = matches!(recorded, Err(LineError::NoAnswer { .. } | LineError::NodeLost { .. }));
        recorded.map_err(|error| error.to_string())
    }
}
