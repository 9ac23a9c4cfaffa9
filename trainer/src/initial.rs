//! First weights, distributed as PyTorch's modules draw theirs.
//!
//! | module | weight | bias |
//! | --- | --- | --- |
//! | Linear | uniform within 1 / √inputs | the same |
//! | LSTM | uniform within 1 / √width | the same |
//! | Embedding | standard normal; a padding's row is 0 | |
//! | attention, in | uniform within √(6 / (inputs + outputs)) | 0 |
//! | attention, out | as Linear | 0 |
//! | LayerNorm | 1 | 0 |
//!
//! The second layer between agents begins as a copy of the first: `nn.TransformerEncoder` copies the layer that it is given.

use std::collections::BTreeMap;

use crate::cost;
use crate::draw::{Draw, Purpose};
use crate::parameters::{Parameters, tensors};
use crate::settings::{CostStart, Settings};

/// The first weights of a training.
#[must_use]
pub fn initial(settings: &Settings) -> Parameters {
    let mut parameters = Parameters::zeros(settings.variant());
    let shapes: BTreeMap<String, Vec<usize>> =
        tensors(settings.variant()).map(|(name, shape, _)| (name, shape)).collect();
    for (number, (name, shape, range)) in tensors(settings.variant()).enumerate() {
        if let Some(rest) = name.strip_prefix("agent_agent.interaction_net.layers.1.") {
            let first = format!("agent_agent.interaction_net.layers.0.{rest}");
            if let Some((_, _, source)) = tensors(settings.variant()).find(|(name, ..)| *name == first) {
                parameters.values_mut().copy_within(source, range.start);
            }
            continue;
        }
        let mut draw = Draw::new(settings.seed, Purpose::Weights, number as u64);
        let weight = format!("{}.weight", name.trim_end_matches(".bias"));
        let distribution = Distribution::of(&name, &shape, shapes.get(&weight).and_then(|shape| shape.get(1)));
        let values = &mut parameters.values_mut()[range];
        values.fill_with(|| match distribution {
            Distribution::Uniform(bound) => draw.within(bound) as f32,
            Distribution::Normal => draw.normal() as f32,
            Distribution::All(value) => value,
        });
        if matches!(distribution, Distribution::Normal) && PADDED.iter().any(|padded| name.contains(padded)) {
            values[..shape[1]].fill(0.0);
        }
    }
    if settings.cost.start == CostStart::HandTuned {
        cost::start_hand_tuned(&mut parameters, settings.cost.kind);
    }
    parameters
}

/// Embeddings whose first row stands for nothing.
const PADDED: [&str; 4] = ["self_type", "left_type", "right_type", "traffic_light_type"];

enum Distribution {
    Uniform(f64),
    Normal,
    All(f32),
}

impl Distribution {
    /// `inputs`: of the Linear that a bias is of.
    fn of(name: &str, shape: &[usize], inputs: Option<&usize>) -> Self {
        let root = |count: usize| 1.0 / (count as f64).sqrt();
        let is_norm = ["transformer.0.", "transformer.5.", "ffn.0.", "ffn.5.", "norm1.", "norm2."];
        if is_norm.iter().any(|norm| name.contains(norm)) {
            return Self::All(f32::from(u8::from(name.ends_with("weight"))));
        }
        if name.contains(".motion.") {
            // Four gates lie one upon the other.
            return Self::Uniform(root(shape[0] / 4));
        }
        match shape {
            [outputs, inputs] if name.ends_with("in_proj_weight") => {
                Self::Uniform((6.0 / (outputs + inputs) as f64).sqrt())
            }
            _ if name.ends_with("in_proj_bias") || name.ends_with("out_proj.bias") => Self::All(0.0),
            [_, 64] if EMBEDDINGS.iter().any(|embedding| name.contains(embedding)) => Self::Normal,
            [_, inputs] => Self::Uniform(root(*inputs)),
            _ => Self::Uniform(root(*inputs.unwrap_or(&1))),
        }
    }
}

const EMBEDDINGS: [&str; 7] =
    ["self_type", "left_type", "right_type", "traffic_light_type", "interpolating", "stop_sign", "stop_point"];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::{CostKind, Mode};

    fn values(parameters: &Parameters, wanted: &str) -> Vec<f64> {
        let (_, _, range) = tensors(parameters.variant()).find(|(name, ..)| name == wanted).unwrap();
        parameters.values()[range].iter().map(|value| f64::from(*value)).collect()
    }

    #[test]
    fn each_tensor_is_drawn_as_its_module_draws_it() {
        let parameters = initial(&Settings::default());
        let uniform = |name: &str, bound: f64| {
            let values = values(&parameters, name);
            let most = values.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
            let square = values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64;
            assert!(most <= bound && most > 0.9 * bound, "{name}: {most} {bound}");
            assert!(values.len() < 1000 || (3.0 * square / bound / bound - 1.0).abs() < 0.1, "{name}: {square}");
        };
        uniform("plan.control.1.weight", 1.0 / 512_f64.sqrt());
        uniform("plan.control.1.bias", 1.0 / 512_f64.sqrt());
        uniform("plan.cost.0.weight", 1.0);
        uniform("vehicle_net.motion.weight_ih_l0", 1.0 / 16.0);
        uniform("vehicle_net.motion.bias_hh_l1", 1.0 / 16.0);
        uniform("agent_map.map_attention.attention.2.in_proj_weight", (6.0 / 1024.0_f64).sqrt());
        uniform("agent_map.map_attention.attention.2.out_proj.weight", 1.0 / 16.0);
        uniform("lane_net.speed_limit.bias", 1.0);
        assert!(values(&parameters, "agent_map.map_attention.attention.2.out_proj.bias").iter().all(|v| *v == 0.0));
        assert!(values(&parameters, "agent_map.map_attention.ffn.0.weight").iter().all(|v| *v == 1.0));
        let embedding = values(&parameters, "lane_net.left_type.weight");
        assert!(embedding[..64].iter().all(|v| *v == 0.0) && embedding[64..].iter().any(|v| v.abs() > 1.5));
        assert!(values(&parameters, "lane_net.stop_sign.weight")[0] != 0.0);
        let layer =
            |number| values(&parameters, &format!("agent_agent.interaction_net.layers.{number}.linear1.weight"));
        assert_eq!(layer(0), layer(1));
    }

    #[test]
    fn a_seed_says_it_all() {
        let of = |seed| initial(&Settings { seed, mode: Mode::Il, ..Settings::default() });
        assert_eq!(of(1), of(1));
        assert_ne!(of(1), of(2));
    }

    #[test]
    fn the_cost_begins_where_it_is_told_to() {
        let mut settings = Settings::default();
        let random = cost::weights(&initial(&settings), CostKind::Softmax).unwrap();
        assert!(random[..5].iter().all(|weight| (0.03..0.4).contains(weight)), "{random:?}");
        settings.cost.start = CostStart::HandTuned;
        settings.cost.kind = CostKind::Exp;
        let tuned = cost::weights(&initial(&settings), CostKind::Exp).unwrap();
        assert!((tuned[5] - 0.5).abs() < 1e-5 && (tuned[6] - 5.0).abs() < 1e-4, "{tuned:?}");
    }
}
