//! What enters the network at a step, and what comes out.

use crate::constants::{
    AGENTS, COST_WEIGHTS, CROSSWALK_ROW, CROSSWALKS, FUTURES, HISTORY, LANE_ROW, LANES, NEIGHBOR_ROW, NEIGHBORS,
    POINTS, SLOTS, STATE, STEPS,
};

/// One input of the network (`network.md` 1): metres, radians and metres a second in the AV's frame of the present step.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// The AV: x, y, heading, velocity x and y, length, width, height; oldest row first, the last is now.
    pub ego: [[f32; STATE]; HISTORY],
    /// The nearest agents: the same and their type: 1 vehicle, 2 pedestrian, 3 cyclist, 4 other.
    pub neighbors: [[[f32; NEIGHBOR_ROW]; HISTORY]; NEIGHBORS],
    /// Lane sequences: six of each agent, those of the AV first.
    pub lanes: Vec<[[f32; LANE_ROW]; POINTS]>,
    /// Crosswalks: four of each agent.
    pub crosswalks: Vec<[[f32; CROSSWALK_ROW]; POINTS]>,
    /// What of that is there.
    pub presence: Presence,
}

/// Which agents, lanes and crosswalks of a frame are there; the others are masked.
#[derive(Clone, Debug, PartialEq, Eq, Default)]
pub struct Presence {
    /// The AV and its neighbours.
    pub agents: [bool; AGENTS],
    /// Lanes of each agent, then crosswalks.
    pub slots: [[bool; SLOTS]; AGENTS],
}

impl Frame {
    /// Nothing is there.
    #[must_use]
    pub fn empty() -> Self {
        Self {
            ego: [[0.0; STATE]; HISTORY],
            neighbors: [[[0.0; NEIGHBOR_ROW]; HISTORY]; NEIGHBORS],
            lanes: vec![[[0.0; LANE_ROW]; POINTS]; AGENTS * LANES],
            crosswalks: vec![[[0.0; CROSSWALK_ROW]; POINTS]; AGENTS * CROSSWALKS],
            presence: Presence::default(),
        }
    }

    /// What the authors' network takes for present (`network.md` 4.4): an agent of any height, a lane or crosswalk whose first point
    /// does not have x = 0.
    #[must_use]
    pub fn presence_by_zeros(&self) -> Presence {
        let mut presence = Presence::default();
        let heights = self.neighbors.iter().map(|rows| rows[HISTORY - 1][7]);
        for (agent, height) in std::iter::once(self.ego[HISTORY - 1][7]).chain(heights).enumerate() {
            presence.agents[agent] = height != 0.0;
            for lane in 0..LANES {
                presence.slots[agent][lane] = self.lanes[agent * LANES + lane][0][0] != 0.0;
            }
            for crosswalk in 0..CROSSWALKS {
                presence.slots[agent][LANES + crosswalk] = self.crosswalks[agent * CROSSWALKS + crosswalk][0][0] != 0.0;
            }
        }
        presence
    }
}

/// What the network says of a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Prediction {
    /// How many futures there are; what is past them is 0.
    pub futures: usize,
    /// The AV's controls in each future: acceleration (m/s^2) and steering angle (rad), without limits.
    pub controls: [[[f32; 2]; STEPS]; FUTURES],
    /// The neighbours' poses in each future: x, y, heading in the AV's frame; heading not wrapped. 0 where neighbours are not
    /// predicted.
    pub poses: [[[[f32; 3]; STEPS]; NEIGHBORS]; FUTURES],
    /// Each future's score: the greater, the more probable. 0 where futures are not scored.
    pub scores: [f32; FUTURES],
    /// Each future's probability.
    pub probabilities: [f32; FUTURES],
    /// The weights of the planner's cost, if the network has learned them.
    pub cost_weights: Option<[f32; COST_WEIGHTS]>,
    /// What was looked at.
    pub attention: Attention,
}

/// Shares of attention, means over the heads; each row sums to 1.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Attention {
    /// Of each agent to each agent, in the first and the second layer.
    pub agents: [[[f32; AGENTS]; AGENTS]; 2],
    /// Of each agent to its lanes and crosswalks, in each future.
    pub map: [[[f32; SLOTS]; AGENTS]; FUTURES],
}

impl Prediction {
    /// Room for an answer.
    #[must_use]
    pub fn empty() -> Self {
        Self {
            futures: 0,
            controls: [[[0.0; 2]; STEPS]; FUTURES],
            poses: [[[[0.0; 3]; STEPS]; NEIGHBORS]; FUTURES],
            scores: [0.0; FUTURES],
            probabilities: [0.0; FUTURES],
            cost_weights: None,
            attention: Attention::default(),
        }
    }

    /// The future of the greatest score, the first of equals.
    #[must_use]
    pub fn most_probable(&self) -> usize {
        let scores = &self.scores[..self.futures.clamp(1, FUTURES)];
        scores.iter().enumerate().fold(0, |best, (index, score)| if *score > scores[best] { index } else { best })
    }
}
