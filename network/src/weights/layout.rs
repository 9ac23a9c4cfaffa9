//! The tensors of the network: names and shapes of the authors' state dict, in its order. 135 of them, 7,738,180 numbers.

use std::sync::OnceLock;

/// Width of every row that agents, lanes and crosswalks are encoded into.
pub const WIDTH: usize = 256;
/// Width within feed-forward blocks.
pub const HIDDEN: usize = 1024;

/// A tensor of the network.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tensor {
    /// Its name.
    pub name: String,
    /// Its shape.
    pub shape: Vec<usize>,
}

impl Tensor {
    /// How many numbers it has.
    #[must_use]
    pub fn len(&self) -> usize {
        self.shape.iter().product()
    }

    /// Whether it has none: no tensor is so.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Buffers that a state dict holds beside the tensors, all integers: the scale of the learned cost weights and the two constant ones.
pub const BUFFERS: [&str; 2] = ["plan.scale", "plan.constraint"];

/// All tensors.
#[must_use]
pub fn tensors() -> &'static [Tensor] {
    static TENSORS: OnceLock<Vec<Tensor>> = OnceLock::new();
    TENSORS.get_or_init(|| {
        let mut list = List::default();
        for net in ["vehicle_net", "pedestrian_net", "cyclist_net"] {
            list.lstm(&format!("{net}.motion"));
        }
        for line in ["self_line", "left_line", "right_line"] {
            list.linear(&format!("lane_net.{line}"), 128, 3);
        }
        list.linear("lane_net.speed_limit", 64, 1);
        for (table, rows) in [
            ("self_type", 4),
            ("left_type", 11),
            ("right_type", 11),
            ("traffic_light_type", 9),
            ("interpolating", 2),
            ("stop_sign", 2),
            ("stop_point", 2),
        ] {
            list.add(format!("lane_net.{table}.weight"), &[rows, 64]);
        }
        list.linear("lane_net.pointnet.0", 384, 512);
        list.linear("lane_net.pointnet.2", WIDTH, 384);
        list.linear("crosswalk_net.point_net.0", 64, 3);
        list.linear("crosswalk_net.point_net.2", 128, 64);
        list.linear("crosswalk_net.point_net.4", WIDTH, 128);
        for attention in ["lane_attention", "crosswalk_attention"] {
            list.attention(&format!("agent_map.{attention}.cross_attention"));
            list.block(&format!("agent_map.{attention}.transformer"));
        }
        for mode in 0..3 {
            list.attention(&format!("agent_map.map_attention.attention.{mode}"));
        }
        list.block("agent_map.map_attention.ffn");
        for layer in 0..2 {
            let layer = format!("agent_agent.interaction_net.layers.{layer}");
            list.attention(&format!("{layer}.self_attn"));
            list.linear(&format!("{layer}.linear1"), HIDDEN, WIDTH);
            list.linear(&format!("{layer}.linear2"), WIDTH, HIDDEN);
            list.norm(&format!("{layer}.norm1"));
            list.norm(&format!("{layer}.norm2"));
        }
        list.linear("plan.control.1", WIDTH, 2 * WIDTH);
        list.linear("plan.control.3", 100, WIDTH);
        list.linear("plan.cost.0", 128, 1);
        list.linear("plan.cost.2", 9, 128);
        list.linear("predict.decode.1", WIDTH, 2 * WIDTH);
        list.linear("predict.decode.3", 150, WIDTH);
        list.linear("score.reduce.1", WIDTH, 2 * WIDTH);
        list.linear("score.decode.1", 128, 2 * WIDTH);
        list.linear("score.decode.3", 1, 128);
        list.0
    })
}

#[derive(Default)]
struct List(Vec<Tensor>);

impl List {
    fn add(&mut self, name: String, shape: &[usize]) {
        self.0.push(Tensor { name, shape: shape.to_vec() });
    }

    fn linear(&mut self, name: &str, out: usize, inner: usize) {
        self.add(format!("{name}.weight"), &[out, inner]);
        self.add(format!("{name}.bias"), &[out]);
    }

    fn norm(&mut self, name: &str) {
        self.add(format!("{name}.weight"), &[WIDTH]);
        self.add(format!("{name}.bias"), &[WIDTH]);
    }

    fn lstm(&mut self, name: &str) {
        for (layer, inner) in [(0, 8), (1, WIDTH)] {
            self.add(format!("{name}.weight_ih_l{layer}"), &[4 * WIDTH, inner]);
            self.add(format!("{name}.weight_hh_l{layer}"), &[4 * WIDTH, WIDTH]);
            self.add(format!("{name}.bias_ih_l{layer}"), &[4 * WIDTH]);
            self.add(format!("{name}.bias_hh_l{layer}"), &[4 * WIDTH]);
        }
    }

    fn attention(&mut self, name: &str) {
        self.add(format!("{name}.in_proj_weight"), &[3 * WIDTH, WIDTH]);
        self.add(format!("{name}.in_proj_bias"), &[3 * WIDTH]);
        self.linear(&format!("{name}.out_proj"), WIDTH, WIDTH);
    }

    /// A norm, a feed-forward block and a norm; dropouts have the numbers between.
    fn block(&mut self, name: &str) {
        self.norm(&format!("{name}.0"));
        self.linear(&format!("{name}.1"), HIDDEN, WIDTH);
        self.linear(&format!("{name}.4"), WIDTH, HIDDEN);
        self.norm(&format!("{name}.5"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_network_has_as_many_numbers_as_the_authors() {
        assert_eq!(tensors().len(), 135);
        assert_eq!(tensors().iter().map(Tensor::len).sum::<usize>(), 7_738_180);
    }
}
