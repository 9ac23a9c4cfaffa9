//! Sizes of the network's inputs, layers and outputs (`network.md` 1 and 5).

/// Neighbours of the AV that are looked at.
pub const NEIGHBORS: usize = 10;
/// Those and the AV, which is the first.
pub const AGENTS: usize = 1 + NEIGHBORS;
/// Steps of history, the present one among them.
pub const HISTORY: usize = 20;
/// Numbers of an agent's state: x, y, heading, velocity x and y, length, width, height.
pub const STATE: usize = 8;
/// Numbers of a neighbour's row: its state and its type.
pub const NEIGHBOR_ROW: usize = STATE + 1;
/// Lane sequences of an agent.
pub const LANES: usize = 6;
/// Crosswalks of an agent.
pub const CROSSWALKS: usize = 4;
/// Lanes and crosswalks of an agent.
pub const SLOTS: usize = LANES + CROSSWALKS;
/// Points of a lane sequence or a crosswalk.
pub const POINTS: usize = 100;
/// Numbers of a lane point.
pub const LANE_ROW: usize = 17;
/// Numbers of a crosswalk point: x, y, heading.
pub const CROSSWALK_ROW: usize = 3;

/// Futures that are predicted.
pub const FUTURES: usize = 3;
/// Steps of a future: 0.1 s each.
pub const STEPS: usize = 50;
/// Weights of the planner's cost.
pub const COST_WEIGHTS: usize = 9;

/// Width of the network.
pub const WIDTH: usize = 256;
/// Width within a feed-forward block.
pub const FEED_FORWARD: usize = 1024;
/// Hidden width of a lane point's encoder.
pub const LANE_HIDDEN: usize = 384;
/// Numbers of a lane point that enter as numbers; the other seven are codes.
pub const LANE_NUMBERS: usize = 10;
/// Heads of the attention between agents and of that to points of the map.
pub const HEADS: usize = 8;
/// Heads of the attention to lanes and crosswalks.
pub const MAP_HEADS: usize = 4;
/// Added to the variance in a layer norm.
pub const NORM_EPSILON: f32 = 1e-5;
