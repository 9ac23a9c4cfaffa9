//! Who was touched, the same for every kind of file: from the contact on an agent has another colour and a label.

use std::collections::BTreeMap;

use wire::proto;

use crate::palette::{self, Rgba};
use crate::strokes;

/// The agents that the AV has touched so far.
#[derive(Default)]
pub struct Contacts {
    /// By track: its colour, and what is written beside it.
    marks: BTreeMap<i32, (Rgba, String)>,
    /// Those seen last.
    seen: Vec<proto::Agent>,
    /// Those touched since, where they were then.
    since: Vec<(i32, Option<proto::AgentState>)>,
}

impl Contacts {
    /// What is seen now.
    pub fn observe(&mut self, observation: &proto::Observation) {
        self.since.clear();
        self.seen.clone_from(&observation.agents);
    }

    /// What happens now; only contacts matter.
    pub fn happen(&mut self, event: &proto::Event) {
        let (proto::event::Kind::Collision, Some(track)) = (event.kind(), event.track) else { return };
        let (rgba, word) =
            if strokes::is_grave(event) { (palette::STRUCK, "struck") } else { (palette::TOUCHED, "touched") };
        let kind = self
            .seen
            .iter()
            .find(|agent| agent.track == track)
            .map_or("track", |agent| strokes::kind_name(agent.kind()));
        // What counts is not made less by a later touch.
        let mark = self.marks.entry(track).or_insert_with(|| (rgba, format!("{kind} {track}, {word}")));
        if rgba == palette::STRUCK {
            *mark = (rgba, format!("{kind} {track}, {word}"));
        }
        self.since.push((track, event.other));
    }

    /// The colour and the label of an agent that was touched.
    #[must_use]
    pub fn mark(&self, track: i32) -> Option<&(Rgba, String)> {
        self.marks.get(&track)
    }

    /// The agents as they are after the last step, which nobody observes any more: as they were seen, but for those touched in
    /// it. Nothing where none was.
    #[must_use]
    pub fn last_seen(&mut self) -> Option<Vec<proto::Agent>> {
        if self.since.is_empty() {
            return None;
        }
        let mut agents = std::mem::take(&mut self.seen);
        for (track, state) in self.since.drain(..) {
            if let (Some(agent), Some(state)) = (agents.iter_mut().find(|agent| agent.track == track), state) {
                agent.state = Some(state);
            }
        }
        Some(agents)
    }
}
