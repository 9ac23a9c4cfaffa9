//! What a driver may know: the briefing before an episode and an observation at each step.
//!
//! Neither holds a logged state later than its step.

use std::sync::Arc;

use crate::map::Map;
use crate::plan::Control;
use crate::reference_line::{ReferenceLine, ReferenceWindow};
use crate::scene::bridged::SeenSignal;
use crate::scene::{AgentKind, AgentState, SceneId, TrackId};

/// An agent as it is seen at a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObservedAgent {
    /// Which track.
    pub track: TrackId,
    /// What it is.
    pub kind: AgentKind,
    /// Its state at this step: as logged, or as supposed from the past alone.
    pub state: AgentState,
    /// Steps since it was last seen: 0 where it is logged at this very step.
    pub unseen: u32,
}

/// All that is told once, before the first step.
#[derive(Clone, Debug, PartialEq)]
pub struct Briefing {
    /// The scene.
    pub scene: SceneId,
    /// `paper` or `strict`.
    pub protocol: String,
    /// The log index of step 0.
    pub start: u32,
    /// The most steps that will be driven.
    pub horizon: u32,
    /// The AV's distance between axles (m), as the simulator's vehicle model has it.
    pub wheelbase: f64,
    /// The map.
    pub map: Arc<Map>,
    /// The lanes that the AV is to follow, in order.
    pub route: Vec<crate::map::MapId>,
    /// The smooth line along the route, whole.
    pub reference_line: Arc<ReferenceLine>,
    /// What was before, up to log index `start` - 1, oldest first: from log index 0 on, or the two seconds before where a single plan is
    /// asked for.
    pub history: Vec<HistoryStep>,
}

/// The AV and the agents at one step of the history.
#[derive(Clone, Debug, PartialEq)]
pub struct HistoryStep {
    /// Log index.
    pub log_index: u32,
    /// The AV.
    pub av: AgentState,
    /// Every other agent that is valid then, in the log's order.
    pub agents: Vec<ObservedAgent>,
}

/// What is to be seen at a step, before it is driven.
#[derive(Clone, Debug, PartialEq)]
pub struct Observation {
    /// The step, from 0.
    pub step: u32,
    /// `start + step`.
    pub log_index: u32,
    /// The simulated AV.
    pub av: AgentState,
    /// The control that brought it here; zero at step 0.
    pub control: Control,
    /// Every other agent that is seen now or was within the last 3 s (`strict`), in the log's order.
    pub agents: Vec<ObservedAgent>,
    /// Signals that are listed now, or were within the last 3 s (`strict`).
    pub signals: Vec<SeenSignal>,
    /// The reference line around the AV.
    pub window: ReferenceWindow,
}
