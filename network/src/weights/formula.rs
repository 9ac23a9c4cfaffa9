//! Weights by a formula: the same on every machine, and far from degenerate, so that two implementations can be held to each other
//! without a file. The formula is that of the vectors which this project is tested against; it has no meaning beyond.

use std::convert::Infallible;

use super::Weights;
use super::layout::Tensor;

/// The weights.
#[must_use]
pub fn weights() -> Weights {
    let values = |tensor: &Tensor| Ok::<_, Infallible>(values(tensor));
    match Weights::try_of(values) {
        Ok(weights) => weights,
        Err(never) => match never {},
    }
}

fn values(tensor: &Tensor) -> Vec<f32> {
    let (offset, scale) = distribution(tensor);
    let hash = fnv1a64(tensor.name.as_bytes());
    let value = |index: usize| (offset + scale * (2.0 * uniform(hash.wrapping_add(index as u64)) - 1.0)) as f32;
    let mut values: Vec<f32> = (0..tensor.len()).map(value).collect();
    if PADDED.contains(&tensor.name.as_str()) {
        values[..tensor.shape[1]].fill(0.0);
    }
    values
}

/// Tables whose first row stands for nothing.
const PADDED: [&str; 4] = [
    "lane_net.self_type.weight",
    "lane_net.left_type.weight",
    "lane_net.right_type.weight",
    "lane_net.traffic_light_type.weight",
];

/// Where the values of a tensor lie, and how far about.
fn distribution(tensor: &Tensor) -> (f64, f64) {
    let name = tensor.name.as_str();
    let is_norm = [".transformer.0.", ".transformer.5.", ".ffn.0.", ".ffn.5.", ".norm1.", ".norm2."];
    if is_norm.iter().any(|part| name.contains(part)) {
        return (if name.ends_with("weight") { 1.0 } else { 0.0 }, 0.25);
    }
    let tables = ["_type.weight", "interpolating.weight", "stop_sign.weight", "stop_point.weight"];
    if tables.iter().any(|table| name.ends_with(table)) {
        return (0.0, 0.5);
    }
    if name.contains(".motion.") {
        return (0.0, 1.0 / 16.0);
    }
    let &[_, columns] = tensor.shape.as_slice() else { return (0.0, 0.1) };
    let gain = match name {
        "agent_map.crosswalk_attention.cross_attention.in_proj_weight" => 4.0,
        "plan.control.3.weight" => 0.75,
        "predict.decode.3.weight" => 6.0,
        "score.decode.3.weight" => 3.0,
        name if name.ends_with("in_proj_weight") => 2.5,
        _ => 1.75,
    };
    (0.0, gain / (columns as f64).sqrt())
}

/// Fowler, Noll and Vo's hash, variant 1a.
fn fnv1a64(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3))
}

/// A number from 0 to below 1 (the finalizer of SplitMix64).
fn uniform(seed: u64) -> f64 {
    let z = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 40) as f64 / f64::from(1_u32 << 24)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_formula_gives_its_check_values() {
        assert_eq!(fnv1a64(b""), 0xcbf2_9ce4_8422_2325);
        assert_eq!(fnv1a64(b"a"), 0xaf63_dc4c_8601_ec8c);
        assert_eq!(weights().get("score.decode.3.bias"), [0.081_547_834]);
        let first = weights().get("vehicle_net.motion.weight_ih_l0")[0];
        assert!((first + 0.051_835_813).abs() < 1e-9, "{first}");
        assert_eq!(weights().get("lane_net.self_type.weight")[..64], [0.0; 64]);
    }
}
