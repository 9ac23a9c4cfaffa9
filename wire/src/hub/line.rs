//! What the simulator says to whoever drives an episode, and hears from it.

use std::time::Duration;

use world::observation::{Briefing, Observation};
use world::plan::{Plan, UncheckedPlan, UncheckedPrediction};
use world::traffic::{Taken, UncheckedMoves};

use super::line_error::LineError;
use crate::proto;

/// A plan, and a prediction where the driver has a predictor. Both are unchecked: whether they are for the step and whole is for who asked to see.
pub type Answers = (UncheckedPlan, Option<UncheckedPrediction>);

/// The line to whoever drives an episode.
pub trait Line {
    /// Tells the nodes what they may know before the first step.
    ///
    /// # Errors
    /// [`LineError::Bus`].
    fn announce(&mut self, briefing: &Briefing) -> Result<(), LineError>;

    /// Sends `observation` and waits until it is answered, at most `deadline`. The answers are unchecked: whether they are
    /// for this step and whole is for the caller to see.
    ///
    /// # Errors
    /// [`LineError`]: no answer, a dead node, an answer that is none, more than an answer.
    fn step(&mut self, observation: &Observation, deadline: Duration) -> Result<Answers, LineError>;

    /// As [`Line::step`], at a step at which the AV is led: the nodes are asked as ever, so that they have seen all that happened
    /// when they are to drive, but `driven` is what is driven, and whoever listens hears it in place of the planner's plan.
    ///
    /// # Errors
    /// As [`Line::step`].
    fn led_step(&mut self, observation: &Observation, driven: &Plan, deadline: Duration) -> Result<Answers, LineError>;

    /// Tells who drives the agents that react what is seen, and who is taken over, and waits until it says where they are next, at most
    /// `deadline`. Before [`Line::step`], at each step of a drive whose agents react, be it that nobody is taken over yet.
    ///
    /// # Errors
    /// As [`Line::step`].
    fn moves(
        &mut self,
        observation: &Observation,
        taken: &[Taken],
        deadline: Duration,
    ) -> Result<UncheckedMoves, LineError>;

    /// Tells the nodes how the episode ended, and waits until each has said that it is done: with that, all that it ever said
    /// is here.
    ///
    /// # Errors
    /// [`LineError`] where one does not say so before the deadline, or says anything else.
    fn dismiss(&mut self, end: &proto::EpisodeEnd, deadline: Duration) -> Result<(), LineError>;

    /// Tells the nodes that the episode is over, and waits for nobody: for a drive that failed.
    ///
    /// # Errors
    /// [`LineError::Bus`].
    fn tell_end(&self, end: &proto::EpisodeEnd) -> Result<(), LineError>;

    /// Tells how a step went.
    fn publish_record(&mut self, record: &proto::StepRecord);

    /// Tells what happened.
    fn publish_event(&mut self, event: &proto::Event);

    /// Tells whoever listens in how the episode ended, how many messages of each kind there were, and their digest. Gives back what
    /// was told.
    fn publish_end(&mut self, end: proto::EpisodeEnd) -> proto::EpisodeEnd;

    /// Waits until the recorder has closed the episode's recording, at most `deadline`, and compares what it has with what
    /// was told.
    ///
    /// # Errors
    /// [`LineError`] where there is no recording, or not a whole one.
    fn await_recorded(&mut self, deadline: Duration) -> Result<(), LineError>;
}

/// An episode's end with these counts of messages.
pub(super) fn counted(end: proto::EpisodeEnd, counts: &proto::Recorded) -> proto::EpisodeEnd {
    proto::EpisodeEnd {
        observations: counts.observations,
        plans: counts.plans,
        predictions: counts.predictions,
        records: counts.records,
        events: counts.events,
        moves: counts.moves,
        ..end
    }
}
