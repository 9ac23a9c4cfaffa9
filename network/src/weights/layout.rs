//! Which tensors a network has: their names and shapes as PyTorch lists them (`network.md` 6).

use std::fmt;

use crate::constants::{COST_WEIGHTS, FEED_FORWARD, FUTURES, LANE_HIDDEN, STATE, STEPS, WIDTH};

/// Which of the system's networks it is; they differ in their heads.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Variant {
    /// Three futures of all agents, and the weights of the planner's cost: `dipp`, and what the authors' code saves for `sep` and
    /// `il-pred` too, where the cost's tensors stay as they began.
    Joint,
    /// The same without the cost: `sep`, `il-pred`.
    Separate,
    /// One future of the AV alone: `il`.
    Imitation,
}

impl Variant {
    /// How many futures come out.
    #[must_use]
    pub fn futures(self) -> usize {
        if self == Self::Imitation { 1 } else { FUTURES }
    }

    /// Whether neighbours are predicted, and futures scored.
    #[must_use]
    pub fn predicts(self) -> bool {
        self != Self::Imitation
    }

    /// Whether it has weights for the planner's cost.
    #[must_use]
    pub fn has_cost(self) -> bool {
        self == Self::Joint
    }
}

impl fmt::Display for Variant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Joint => "joint",
            Self::Separate => "separate",
            Self::Imitation => "imitation",
        })
    }
}

/// How nine numbers become the weights of the planner's cost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CostForm {
    /// The authors': shares of one, of which two are thrown away, times constants (`network.md` 5.7). Seven weights that would need more than
    /// one share cannot be said.
    #[default]
    Shares,
    /// The exponential of each of the first seven. In a file the scales of the shares are 0, which no reader of shares takes.
    Exponentials,
}

/// A tensor's name and shape.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TensorLayout {
    /// Its name in the state dict.
    pub name: String,
    /// Length along each axis.
    pub shape: Vec<usize>,
}

/// The tensors of a variant in the order of the authors' state dict.
#[must_use]
pub fn layout(variant: Variant) -> Vec<TensorLayout> {
    let mut list = List(Vec::new());
    for kind in ["vehicle", "pedestrian", "cyclist"] {
        for (layer, input) in [(0, STATE), (1, WIDTH)] {
            let name = |part: &str| format!("{kind}_net.motion.{part}_l{layer}");
            list.add(&name("weight_ih"), &[4 * WIDTH, input]);
            list.add(&name("weight_hh"), &[4 * WIDTH, WIDTH]);
            list.add(&name("bias_ih"), &[4 * WIDTH]);
            list.add(&name("bias_hh"), &[4 * WIDTH]);
        }
    }
    list.lane_encoder();
    for (index, [outputs, inputs]) in [(0, [64, 3]), (2, [128, 64]), (4, [WIDTH, 128])] {
        list.linear(&format!("crosswalk_net.point_net.{index}"), outputs, inputs);
    }
    for kind in ["lane", "crosswalk"] {
        list.attention(&format!("agent_map.{kind}_attention.cross_attention"));
        list.feed_forward(&format!("agent_map.{kind}_attention.transformer"));
    }
    for mode in 0..variant.futures() {
        list.attention(&format!("agent_map.map_attention.attention.{mode}"));
    }
    list.feed_forward("agent_map.map_attention.ffn");
    for layer in 0..2 {
        let prefix = format!("agent_agent.interaction_net.layers.{layer}");
        list.attention(&format!("{prefix}.self_attn"));
        list.linear(&format!("{prefix}.linear1"), FEED_FORWARD, WIDTH);
        list.linear(&format!("{prefix}.linear2"), WIDTH, FEED_FORWARD);
        list.norm(&format!("{prefix}.norm1"));
        list.norm(&format!("{prefix}.norm2"));
    }
    list.linear("plan.control.1", WIDTH, 2 * WIDTH);
    list.linear("plan.control.3", 2 * STEPS, WIDTH);
    if variant.has_cost() {
        list.linear("plan.cost.0", 128, 1);
        list.linear("plan.cost.2", COST_WEIGHTS, 128);
    }
    if variant.predicts() {
        list.linear("predict.decode.1", WIDTH, 2 * WIDTH);
        list.linear("predict.decode.3", 3 * STEPS, WIDTH);
        list.linear("score.reduce.1", WIDTH, 2 * WIDTH);
        list.linear("score.decode.1", 128, 2 * WIDTH);
        list.linear("score.decode.3", 1, 128);
    }
    list.0
}

/// Constants that PyTorch's state dict holds beside the weights; a file may leave them out.
pub(super) const BUFFERS: [(&str, &[usize], &[i64]); 2] =
    [("plan.scale", &[7], &[1, 1, 1, 1, 1, 10, 100]), ("plan.constraint", &[1, 2], &[10, 10])];

/// The embeddings of a lane point's codes: name, rows, column of the lane tensor.
pub(crate) const EMBEDDINGS: [(&str, usize, usize); 7] = [
    ("self_type", 4, 10),
    ("left_type", 11, 11),
    ("right_type", 11, 12),
    ("traffic_light_type", 9, 13),
    ("interpolating", 2, 15),
    ("stop_sign", 2, 16),
    ("stop_point", 2, 14),
];

struct List(Vec<TensorLayout>);

impl List {
    fn add(&mut self, name: &str, shape: &[usize]) {
        self.0.push(TensorLayout { name: name.to_owned(), shape: shape.to_vec() });
    }

    fn linear(&mut self, name: &str, outputs: usize, inputs: usize) {
        self.add(&format!("{name}.weight"), &[outputs, inputs]);
        self.add(&format!("{name}.bias"), &[outputs]);
    }

    fn norm(&mut self, name: &str) {
        self.add(&format!("{name}.weight"), &[WIDTH]);
        self.add(&format!("{name}.bias"), &[WIDTH]);
    }

    fn attention(&mut self, name: &str) {
        self.add(&format!("{name}.in_proj_weight"), &[3 * WIDTH, WIDTH]);
        self.add(&format!("{name}.in_proj_bias"), &[3 * WIDTH]);
        self.linear(&format!("{name}.out_proj"), WIDTH, WIDTH);
    }

    fn feed_forward(&mut self, name: &str) {
        self.norm(&format!("{name}.0"));
        self.linear(&format!("{name}.1"), FEED_FORWARD, WIDTH);
        self.linear(&format!("{name}.4"), WIDTH, FEED_FORWARD);
        self.norm(&format!("{name}.5"));
    }

    fn lane_encoder(&mut self) {
        for line in ["self_line", "left_line", "right_line"] {
            self.linear(&format!("lane_net.{line}"), 128, 3);
        }
        self.linear("lane_net.speed_limit", 64, 1);
        for (name, rows, _) in EMBEDDINGS {
            self.add(&format!("lane_net.{name}.weight"), &[rows, 64]);
        }
        self.linear("lane_net.pointnet.0", LANE_HIDDEN, 512);
        self.linear("lane_net.pointnet.2", WIDTH, LANE_HIDDEN);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(variant: Variant) -> (usize, usize) {
        let layout = layout(variant);
        (layout.len(), layout.iter().map(|tensor| tensor.shape.iter().product::<usize>()).sum())
    }

    #[test]
    fn the_authors_network_has_135_tensors_of_7_738_180_numbers() {
        assert_eq!(numbers(Variant::Joint), (135, 7_738_180));
    }

    #[test]
    fn without_a_cost_four_tensors_fewer_and_of_the_av_alone_the_heads_of_others_too() {
        assert_eq!(numbers(Variant::Separate), (131, 7_738_180 - (128 + 128 + 9 * 128 + 9)));
        assert_eq!(numbers(Variant::Imitation).0, 131 - 10 - 2 * 4);
    }
}
