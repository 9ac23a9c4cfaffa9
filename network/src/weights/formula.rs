//! Weights by a formula (`network.md` 7): no training, but outputs far from degenerate, the same in every implementation.

use super::layout::{CostForm, TensorLayout, Variant, layout};
use super::{Tensor, Weights};

impl Weights {
    /// The formula's weights for a network of this variant.
    #[must_use]
    pub fn formula(variant: Variant) -> Self {
        let tensors = layout(variant).into_iter().map(|TensorLayout { name, shape }| {
            let values = values(&name, &shape);
            (name, Tensor { shape, values })
        });
        Self { variant, cost_form: CostForm::default(), features: None, tensors: tensors.collect() }
    }
}

/// The formula's numbers of a name before they are scaled, in [-1, 1): other implementations project gradients on those of `NAME#dot`.
pub fn formula_numbers(name: &str) -> impl Iterator<Item = f64> + use<> {
    let hash = fnv1a64(name);
    (0_u64..).map(move |index| 2.0 * uniform(hash.wrapping_add(index)) - 1.0)
}

fn fnv1a64(name: &str) -> u64 {
    name.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

/// The number that follows `seed`, in [0, 1): SplitMix64's, of 24 bits.
fn uniform(seed: u64) -> f64 {
    let mut z = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^= z >> 31;
    (z >> 40) as f64 / f64::from(1 << 24)
}

fn values(name: &str, shape: &[usize]) -> Vec<f32> {
    let (offset, scale) = offset_and_scale(name, shape);
    let hash = fnv1a64(name);
    let number = |index: usize| (offset + scale * (2.0 * uniform(hash.wrapping_add(index as u64)) - 1.0)) as f32;
    let mut values: Vec<f32> = (0..shape.iter().product()).map(number).collect();
    // The first row of these is the padding's.
    if ["self_type", "left_type", "right_type", "traffic_light_type"].iter().any(|padded| name.contains(padded)) {
        values[..shape[1]].fill(0.0);
    }
    values
}

fn offset_and_scale(name: &str, shape: &[usize]) -> (f64, f64) {
    let norms = ["transformer.0.", "transformer.5.", "ffn.0.", "ffn.5.", "norm1.", "norm2."];
    if norms.iter().any(|norm| name.contains(norm)) {
        return (f64::from(name.ends_with("weight")), 0.25);
    }
    let is_embedding =
        super::layout::EMBEDDINGS.iter().any(|(embedding, ..)| name == format!("lane_net.{embedding}.weight"));
    let scale = match shape {
        _ if is_embedding => 0.5,
        _ if name.contains(".motion.") => 1.0 / 16.0,
        [_] => 0.1,
        _ => gain(name) / (shape[shape.len() - 1] as f64).sqrt(),
    };
    (0.0, scale)
}

fn gain(name: &str) -> f64 {
    match name {
        "agent_map.crosswalk_attention.cross_attention.in_proj_weight" => 4.0,
        "plan.control.3.weight" => 0.75,
        "predict.decode.3.weight" => 6.0,
        "score.decode.3.weight" => 3.0,
        _ if name.ends_with("in_proj_weight") => 2.5,
        _ => 1.75,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_formula_gives_the_numbers_that_its_definition_names() {
        assert_eq!((fnv1a64(""), fnv1a64("a")), (0xcbf2_9ce4_8422_2325, 0xaf63_dc4c_8601_ec8c));
        assert_eq!(uniform(fnv1a64("score.decode.3.bias")), 0.907_739_162_445_068_4);
        let weights = Weights::formula(Variant::Joint);
        assert_eq!(weights.tensor("score.decode.3.bias").unwrap(), [0.081_547_834_f32]);
        assert!(weights.tensor("lane_net.left_type.weight").unwrap()[..64].iter().all(|value| *value == 0.0));
        assert!(weights.tensor("lane_net.stop_sign.weight").unwrap()[..64].iter().any(|value| *value != 0.0));
    }

    #[test]
    fn every_tensor_sums_to_what_another_implementation_of_the_formula_has() {
        let Some(folder) = vectors::shared("dipp/network-vectors") else { return };
        let text = std::fs::read_to_string(folder.join("weights_check.tsv")).unwrap();
        let weights = Weights::formula(Variant::Joint);
        let rows: Vec<Vec<&str>> = text.lines().skip(1).map(|line| line.split('\t').collect()).collect();
        let names: Vec<&str> = weights.tensors.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(rows.iter().map(|row| row[0]).collect::<Vec<_>>(), names, "in the state dict's order");
        for (row, (name, tensor)) in rows.iter().zip(&weights.tensors) {
            let shape: Vec<String> = tensor.shape.iter().map(usize::to_string).collect();
            assert_eq!(row[1], shape.join("x"), "{name}");
            let number = |column: usize| row[column].parse::<f64>().unwrap();
            let sums = tensor.values.iter().fold((0.0, 0.0), |(sum, absolute), value| {
                (sum + f64::from(*value), absolute + f64::from(value.abs()))
            });
            assert!(
                (sums.0 - number(5)).abs() < 1e-9 * number(6).max(1.0) && (sums.1 / number(6) - 1.0).abs() < 1e-11,
                "{name}"
            );
            let first = row[7].split(' ').map(|value| value.parse::<f32>().unwrap());
            assert!(first.zip(&tensor.values).all(|(wanted, got)| wanted == *got), "{name}");
        }
    }
}
