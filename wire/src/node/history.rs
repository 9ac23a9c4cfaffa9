//! What was seen so far.

use std::collections::VecDeque;

use world::observation::{Briefing, HistoryStep, Observation};
use world::scene::{AgentState, TrackId};

/// The AV and the agents at the last steps, oldest first; the newest is the observation of now. As many steps are kept as
/// the briefing told, and one more.
#[derive(Clone, Debug, PartialEq)]
pub struct History {
    steps: VecDeque<HistoryStep>,
    keep: usize,
}

impl History {
    /// What was before the first step.
    #[must_use]
    pub fn new(briefing: &Briefing) -> Self {
        // Two steps at least, so that there is always a difference to take.
        Self { steps: briefing.history.iter().cloned().collect(), keep: (briefing.history.len() + 1).max(2) }
    }

    /// Adds what is seen now. [`crate::node`] does it before a planner is asked.
    pub fn push(&mut self, observation: &Observation) {
        // The first observation may repeat the last step of the briefing.
        while self.steps.back().is_some_and(|last| last.log_index >= observation.log_index) {
            self.steps.pop_back();
        }
        self.steps.push_back(HistoryStep {
            log_index: observation.log_index,
            av: observation.av,
            agents: observation.agents.clone(),
        });
        while self.steps.len() > self.keep {
            self.steps.pop_front();
        }
    }

    /// The steps, oldest first.
    pub fn steps(&self) -> impl DoubleEndedIterator<Item = &HistoryStep> + ExactSizeIterator {
        self.steps.iter()
    }

    /// The state of `track` at `log_index`; `None` where it was not seen, or is forgotten.
    #[must_use]
    pub fn state(&self, track: TrackId, log_index: u32) -> Option<&AgentState> {
        let step = self.steps.iter().find(|step| step.log_index == log_index)?;
        step.agents.iter().find(|agent| agent.track == track).map(|agent| &agent.state)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::node::desk::tests::{briefing, observation};

    #[test]
    fn it_keeps_as_many_steps_as_the_briefing_and_one_more() {
        let briefing = briefing(); // log indices 0 to 18
        let mut history = History::new(&briefing);
        for step in 0..30 {
            history.push(&observation(step));
            let newest = history.steps().next_back().unwrap();
            assert_eq!(newest.log_index, 19 + step);
            assert_eq!(history.steps().len(), 20);
        }
        let indices: Vec<u32> = history.steps().map(|step| step.log_index).collect();
        assert_eq!(indices, (29..49).collect::<Vec<_>>());
    }

    #[test]
    fn a_track_is_found_where_it_was_seen_and_not_elsewhere() {
        let mut history = History::new(&briefing());
        history.push(&observation(0));
        assert!(history.state(TrackId(7), 19).is_some());
        assert!(history.state(TrackId(8), 19).is_none());
        assert!(history.state(TrackId(7), 20).is_none());
    }
}
