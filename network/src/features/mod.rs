//! What the network is shown at a step (`network.md` 1 to 4): tensors of the AV, its nearest agents, and the map around each.
//!
//! ```text
//! Scene, step ─────────▶ Window ─┐
//! Briefing ──▶ History ──▶ Window ├──▶ SceneFeatures::at ──▶ Features (Frame, and what is in it)
//! Map ──▶ SceneFeatures ─────────┘
//! ```
//!
//! The static part of a scene is prepared once, by [`SceneFeatures::new`]; there is one function for logged and for live steps.
//! Where [`Settings`] is matched, they differ.
//!
//! | file | what |
//! | --- | --- |
//! | `settings` | whose features: the authors', or with their bugs mended |
//! | `window` | what is known at a step, from a scene or from observations |
//! | `av_frame` | into the AV's frame, rounded |
//! | `agents` | rows of agents |
//! | `lane_search`, `sequences`, `lane_points` | lanes of an agent, those that follow, their points |
//! | `crosswalks` | crosswalks ahead |

mod agents;
mod av_frame;
mod crosswalks;
mod lane_points;
mod lane_search;
mod sequences;
mod settings;
mod window;

use std::collections::BTreeMap;
use std::sync::Arc;

use world::geometry::Pose;
use world::map::{Map, MapId};
use world::scene::{AgentKind, TrackId};

use crate::constants::{AGENTS, CROSSWALKS, LANES};
use crate::frame::{Frame, Presence};
use av_frame::AvFrame;
use crosswalks::Crosswalk;
use lane_points::{Light, PreparedLane};
use lane_search::{LaneSearch, beside};

pub use settings::Settings;
pub use window::{History, Neighbor, Window};

/// The static part of a scene.
#[derive(Clone, Debug)]
pub struct SceneFeatures {
    settings: Settings,
    map: Arc<Map>,
    indices: BTreeMap<MapId, usize>,
    lanes: Vec<PreparedLane>,
    search: LaneSearch,
    crosswalks: Vec<(usize, Crosswalk)>,
}

/// The features of a step.
#[derive(Clone, Debug, PartialEq)]
pub struct Features {
    /// The network's input.
    pub frame: Frame,
    /// The neighbours, in their order.
    pub tracks: Vec<TrackId>,
    /// What each agent that is there is shown of the map, the AV first.
    pub views: Vec<View>,
}

/// What an agent is shown of the map.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// Its lane sequences, in their slots.
    pub sequences: Vec<Sequence>,
    /// How many sequences there were to choose from; none where the agent is not there.
    pub candidates: Option<usize>,
    /// Its crosswalks, in their slots.
    pub crosswalks: Vec<MapId>,
}

/// Lanes one after another.
#[derive(Clone, Debug, PartialEq)]
pub struct Sequence {
    /// Each lane, and the point of it that the sequence begins with.
    pub lanes: Vec<(MapId, usize)>,
}

impl SceneFeatures {
    /// Prepares a map.
    #[must_use]
    pub fn new(map: &Arc<Map>, settings: Settings) -> Self {
        let indices = map.lane_indices();
        Self {
            settings,
            lanes: lane_points::prepare(map, &indices),
            search: LaneSearch::new(map),
            crosswalks: crosswalks::prepare(map),
            indices,
            map: Arc::clone(map),
        }
    }

    /// The features of a step.
    #[must_use]
    pub fn at(&self, window: &Window) -> Features {
        let authors = self.settings == Settings::Authors;
        let av_frame = AvFrame::new(window.av.pose(), self.settings);
        let lights = lane_points::lights(&window.signals, &self.lanes, &self.indices, self.settings);
        let mut frame = Frame::empty();
        frame.ego = agents::ego(window, &av_frame);
        let av = agents::pose_for_search(&window.av, authors && window.av_is_logged);
        let mut views = vec![self.view((0, av, false), &lights, &av_frame, &mut frame)];
        for (index, neighbor) in window.neighbors.iter().enumerate().take(AGENTS - 1) {
            frame.neighbors[index] = agents::neighbor(neighbor, &av_frame);
            let pose = agents::pose_for_search(&neighbor.now, authors);
            // To the authors an agent at x = 0 is none.
            views.push(if authors && pose.x == 0.0 {
                View { sequences: Vec::new(), candidates: None, crosswalks: Vec::new() }
            } else {
                let is_pedestrian = neighbor.kind == AgentKind::Pedestrian;
                self.view((index + 1, pose, is_pedestrian), &lights, &av_frame, &mut frame)
            });
        }
        frame.presence = if authors { frame.presence_by_zeros() } else { presence(&views) };
        Features { frame, tracks: window.neighbors.iter().map(|neighbor| neighbor.track).collect(), views }
    }

    /// Fills the slots of agent number `agent`.
    fn view(
        &self,
        (agent, pose, is_pedestrian): (usize, Pose, bool),
        lights: &BTreeMap<usize, Light>,
        av_frame: &AvFrame,
        frame: &mut Frame,
    ) -> View {
        let mut starts = self.search.current(pose, is_pedestrian, &self.lanes, self.settings);
        if !is_pedestrian {
            let beside = beside(&starts, pose, &self.lanes);
            starts.extend(beside);
        }
        if self.settings == Settings::Mended {
            starts.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        }
        let chains = sequences::follow(&starts, &self.lanes, self.settings);
        let slots = frame.lanes[agent * LANES..][..LANES].iter_mut();
        let sequences = chains.iter().zip(slots).map(|(chain, slot)| {
            let firsts = chain.starts(&starts);
            let points = chain.points(&firsts, &self.lanes);
            let (lane, point) = points[0];
            let is_normed = self.settings == Settings::Mended || self.lanes[lane].points[point].pose.x as f32 != 0.0;
            let mut last = None;
            for ((lane, point), row) in points.into_iter().zip(slot.iter_mut()) {
                *row = match last {
                    // Short sequences repeat their points.
                    Some((place, row)) if place == (lane, point) => row,
                    _ => self.lanes[lane].row(point, lights.get(&lane), av_frame, is_normed),
                };
                last = Some(((lane, point), *row));
            }
            let id = |lane: &usize| self.map.lanes[*lane].id;
            Sequence { lanes: chain.lanes.iter().map(id).zip(firsts).collect() }
        });
        let sequences = sequences.collect();
        let slots = frame.crosswalks[agent * CROSSWALKS..][..CROSSWALKS].iter_mut();
        let ahead = crosswalks::ahead(&self.crosswalks, pose).zip(slots).map(|((index, crosswalk), slot)| {
            *slot = crosswalk.rows(av_frame);
            self.map.crosswalks[*index].id
        });
        View { sequences, candidates: Some(chains.len()), crosswalks: ahead.collect() }
    }
}

fn presence(views: &[View]) -> Presence {
    let mut presence = Presence::default();
    for (agent, view) in views.iter().enumerate() {
        presence.agents[agent] = true;
        let (lanes, crosswalks) = presence.slots[agent].split_at_mut(LANES);
        lanes[..view.sequences.len()].fill(true);
        crosswalks[..view.crosswalks.len()].fill(true);
    }
    presence
}
