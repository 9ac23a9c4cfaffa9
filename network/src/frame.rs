//! What the network is asked about: one step, around the AV, in its frame.
//!
//! Agent 0 is the AV, 1 to 10 are its neighbors by distance. Many agents look at the same lanes, so a frame holds each point once, and
//! lanes as the numbers of their points: that is what makes encoding them cheap. [`Frame::of_tensors`] finds the same in the paper's
//! tensors.

use std::collections::BTreeMap;

/// Agents, the AV included.
pub const AGENTS: usize = 11;
/// Agents without the AV.
pub const NEIGHBORS: usize = AGENTS - 1;
/// Rows of an agent's history: 2 s, the last one now.
pub const HISTORY: usize = 20;
/// Lane sequences of an agent.
pub const LANES: usize = 6;
/// Crosswalks of an agent.
pub const CROSSWALKS: usize = 4;
/// Lanes and crosswalks of an agent.
pub const SLOTS: usize = LANES + CROSSWALKS;
/// Points of a lane sequence or crosswalk.
pub const POINTS: usize = 100;

/// x, y, heading, velocity x and y, length, width, height.
pub type AgentRow = [f32; 8];
/// Center x, y, heading; the same of the left and the right boundary; speed limit; seven codes.
pub type LanePoint = [f32; 17];
/// x, y, heading.
pub type CrosswalkPoint = [f32; 3];

/// The kind that decides which network encodes an agent's motion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Motion {
    /// Vehicles, and whatever is neither of the others.
    #[default]
    Vehicle,
    /// On foot.
    Pedestrian,
    /// On a bicycle.
    Cyclist,
}

impl Motion {
    /// The kind by the code of the authors' tensors.
    #[must_use]
    pub fn of_code(code: f32) -> Self {
        match code as i32 {
            2 => Self::Pedestrian,
            3 => Self::Cyclist,
            _ => Self::Vehicle,
        }
    }
}

/// Points of a lane or a crosswalk in the order in which they are passed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sequence {
    /// Numbers of the frame's points.
    pub points: [u16; POINTS],
    /// Nobody attends to it: in the authors' tensors, its first point lies at x = 0.
    pub masked: bool,
}

/// An agent.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Agent {
    /// Its history, oldest row first.
    pub history: [AgentRow; HISTORY],
    /// How it moves.
    pub motion: Motion,
    /// Nobody attends to it: in the authors' tensors, its height is 0 now.
    pub masked: bool,
    /// Its lane sequences; none where a slot is empty.
    pub lanes: [Option<Sequence>; LANES],
    /// Its crosswalks.
    pub crosswalks: [Option<Sequence>; CROSSWALKS],
}

impl Agent {
    /// A slot that stands for nobody: all that is known of it is the same in every frame.
    #[must_use]
    pub fn is_blank(&self) -> bool {
        let nothing = |slots: &[Option<Sequence>]| slots.iter().all(Option::is_none);
        self.masked
            && self.motion == Motion::Vehicle
            && self.history == [[0.0; 8]; HISTORY]
            && nothing(&self.lanes)
            && nothing(&self.crosswalks)
    }
}

/// A step as the network sees it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Frame {
    /// The AV, then its neighbors.
    pub agents: [Agent; AGENTS],
    /// Points of lanes, each once.
    pub lane_points: Vec<LanePoint>,
    /// Points of crosswalks, each once.
    pub crosswalk_points: Vec<CrosswalkPoint>,
}

/// The paper's tensors, row by row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tensors {
    /// 20 x 8.
    pub ego: Vec<f32>,
    /// 10 x 20 x 9; the last column is the kind's code.
    pub neighbors: Vec<f32>,
    /// 11 x 6 x 100 x 17.
    pub map_lanes: Vec<f32>,
    /// 11 x 4 x 100 x 3.
    pub map_crosswalks: Vec<f32>,
}

impl Frame {
    /// The frame in the paper's tensors; none where their lengths are not theirs.
    #[must_use]
    pub fn of_tensors(tensors: &Tensors) -> Option<Self> {
        let Tensors { ego, neighbors, map_lanes, map_crosswalks } = tensors;
        let lengths = [ego.len(), neighbors.len(), map_lanes.len(), map_crosswalks.len()];
        let wanted =
            [HISTORY * 8, NEIGHBORS * HISTORY * 9, AGENTS * LANES * POINTS * 17, AGENTS * CROSSWALKS * POINTS * 3];
        if lengths != wanted {
            return None;
        }
        let mut frame = Self::default();
        let av = &mut frame.agents[0];
        av.history.as_flattened_mut().copy_from_slice(ego);
        av.masked = av.history[HISTORY - 1][7] == 0.0;
        for (agent, rows) in frame.agents[1..].iter_mut().zip(neighbors.chunks_exact(HISTORY * 9)) {
            for (to, row) in agent.history.iter_mut().zip(rows.chunks_exact(9)) {
                to.copy_from_slice(&row[..8]);
            }
            agent.motion = Motion::of_code(rows[HISTORY * 9 - 1]);
            agent.masked = agent.history[HISTORY - 1][7] == 0.0;
        }
        let mut lanes = Distinct { points: &mut frame.lane_points, numbers: BTreeMap::new() };
        for (agent, rows) in frame.agents.iter_mut().zip(map_lanes.chunks_exact(LANES * POINTS * 17)) {
            for (slot, rows) in agent.lanes.iter_mut().zip(rows.chunks_exact(POINTS * 17)) {
                *slot = lanes.sequence(rows);
            }
        }
        let mut crosswalks = Distinct { points: &mut frame.crosswalk_points, numbers: BTreeMap::new() };
        for (agent, rows) in frame.agents.iter_mut().zip(map_crosswalks.chunks_exact(CROSSWALKS * POINTS * 3)) {
            for (slot, rows) in agent.crosswalks.iter_mut().zip(rows.chunks_exact(POINTS * 3)) {
                *slot = crosswalks.sequence(rows);
            }
        }
        Some(frame)
    }
}

impl From<&Frame> for Tensors {
    fn from(frame: &Frame) -> Self {
        let code = |agent: &Agent| match agent.motion {
            _ if agent.is_blank() => 0.0,
            Motion::Vehicle => 1.0,
            Motion::Pedestrian => 2.0,
            Motion::Cyclist => 3.0,
        };
        let row = |agent: &Agent, row: &AgentRow| row.iter().copied().chain([code(agent)]).collect::<Vec<_>>();
        let neighbors = frame.agents[1..].iter();
        let rows = neighbors.flat_map(|agent| agent.history.iter().flat_map(move |history| row(agent, history)));
        let lanes = frame.agents.iter().flat_map(|agent| &agent.lanes);
        let crosswalks = frame.agents.iter().flat_map(|agent| &agent.crosswalks);
        Self {
            ego: frame.agents[0].history.as_flattened().to_vec(),
            neighbors: rows.collect(),
            map_lanes: lanes.flat_map(|slot| expanded(slot.as_ref(), &frame.lane_points)).flatten().collect(),
            map_crosswalks: crosswalks
                .flat_map(|slot| expanded(slot.as_ref(), &frame.crosswalk_points))
                .flatten()
                .collect(),
        }
    }
}

/// The points of a slot, one by one.
fn expanded<const COLUMNS: usize>(sequence: Option<&Sequence>, points: &[[f32; COLUMNS]]) -> [[f32; COLUMNS]; POINTS] {
    sequence.map_or([[0.0; COLUMNS]; POINTS], |sequence| sequence.points.map(|number| points[usize::from(number)]))
}

/// Finds points that are there already.
struct Distinct<'a, const COLUMNS: usize> {
    points: &'a mut Vec<[f32; COLUMNS]>,
    numbers: BTreeMap<[u32; COLUMNS], u16>,
}

impl<const COLUMNS: usize> Distinct<'_, COLUMNS> {
    fn sequence(&mut self, rows: &[f32]) -> Option<Sequence> {
        if rows.iter().all(|value| *value == 0.0) {
            return None;
        }
        let mut points = [0; POINTS];
        for (number, row) in points.iter_mut().zip(rows.as_chunks::<COLUMNS>().0) {
            *number = *self.numbers.entry(row.map(f32::to_bits)).or_insert_with(|| {
                self.points.push(*row);
                // At most 66 x 100.
                (self.points.len() - 1) as u16
            });
        }
        Some(Sequence { points, masked: rows[0] == 0.0 })
    }
}
