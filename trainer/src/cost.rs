//! The planner's weights as the network holds them: four tensors that make nine numbers of the constant 1, and the two ways of making
//! weights of these (`network.md` 5.7, `training.md` 7).
//!
//! | kind | the first seven | the last two |
//! | --- | --- | --- |
//! | softmax | shares of nine, times 1, 1, 1, 1, 1, 10, 100 | 10, 10 |
//! | exp | exp of each | 10, 10 |

use gauss_newton::constants::{HAND_TUNED, TERMS};
use network::constants::COST_WEIGHTS;

use crate::parameters::{Parameters, tensors};
use crate::settings::CostKind;

/// What shares are multiplied by.
pub const SCALES: [f64; LEARNED] = [1.0, 1.0, 1.0, 1.0, 1.0, 10.0, 100.0];
/// The weights that are not learned.
pub const CONSTANT: f64 = 10.0;
/// How many are.
pub const LEARNED: usize = 7;
/// What each of the two spare shares begins with, where the others begin at the hand-tuned cost.
const SPARE: f64 = 0.005;

/// The planner's weights of these parameters; none where the network has none.
#[must_use]
pub fn weights(parameters: &Parameters, kind: CostKind) -> Option<[f64; COST_WEIGHTS]> {
    Some(of_outputs(&outputs(parameters)?, kind))
}

/// The nine numbers that weights are made of.
fn outputs(parameters: &Parameters) -> Option<[f64; COST_WEIGHTS]> {
    let tensor = |wanted: &str| {
        let found = tensors(parameters.variant()).find(|(name, ..)| name == wanted);
        found.map(|(_, _, range)| &parameters.values()[range])
    };
    let hidden = tensor("plan.cost.0.weight")?.iter().zip(tensor("plan.cost.0.bias")?);
    let hidden: Vec<f64> = hidden.map(|(weight, bias)| (f64::from(*weight) + f64::from(*bias)).max(0.0)).collect();
    let rows = tensor("plan.cost.2.weight")?.chunks_exact(hidden.len()).zip(tensor("plan.cost.2.bias")?);
    let mut outputs = [0.0; COST_WEIGHTS];
    for (output, (row, bias)) in outputs.iter_mut().zip(rows) {
        *output = f64::from(*bias) + row.iter().zip(&hidden).map(|(weight, h)| f64::from(*weight) * h).sum::<f64>();
    }
    Some(outputs)
}

/// The planner's weights of the nine numbers.
#[must_use]
pub fn of_outputs(outputs: &[f64; COST_WEIGHTS], kind: CostKind) -> [f64; COST_WEIGHTS] {
    let mut weights = [CONSTANT; COST_WEIGHTS];
    let shares = shares(outputs);
    for (term, (weight, scale)) in weights.iter_mut().zip(SCALES).enumerate() {
        *weight = match kind {
            CostKind::Softmax => shares[term] * scale,
            CostKind::Exp => libm::exp(outputs[term]),
        };
    }
    weights
}

/// The gradient by the nine numbers, from that by the weights they make.
#[must_use]
pub fn by_outputs(outputs: &[f64; COST_WEIGHTS], by_weights: &[f64; TERMS], kind: CostKind) -> [f64; COST_WEIGHTS] {
    let weights = of_outputs(outputs, kind);
    let term = |term: usize| SCALES.get(term).map_or((0.0, 1.0), |scale| (by_weights[term], *scale));
    match kind {
        CostKind::Exp => std::array::from_fn(|index| term(index).0 * weights[index]),
        CostKind::Softmax => {
            let shares = shares(outputs);
            let along: f64 = (0..COST_WEIGHTS).map(|index| term(index).0 * term(index).1 * shares[index]).sum();
            std::array::from_fn(|index| shares[index] * (term(index).0 * term(index).1 - along))
        }
    }
}

/// Shares that sum to 1.
fn shares(outputs: &[f64; COST_WEIGHTS]) -> [f64; COST_WEIGHTS] {
    let largest = outputs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let exponentials = outputs.map(|output| libm::exp(output - largest));
    let sum: f64 = exponentials.iter().sum();
    exponentials.map(|value| value / sum)
}

/// Sets the last bias so that the weights are those tuned by hand; as shares, 0.76 of the first seven.
pub fn start_hand_tuned(parameters: &mut Parameters, kind: CostKind) {
    let Some(outputs) = outputs(parameters) else { return };
    let shares: f64 = HAND_TUNED.iter().zip(SCALES).map(|(weight, scale)| weight / scale).sum();
    let Some((_, _, range)) = tensors(parameters.variant()).find(|(name, ..)| name == "plan.cost.2.bias") else {
        return;
    };
    for (term, bias) in parameters.values_mut()[range].iter_mut().enumerate() {
        let wanted = match (kind, SCALES.get(term)) {
            (CostKind::Softmax, Some(scale)) => HAND_TUNED[term] / scale / shares * (1.0 - 2.0 * SPARE),
            (CostKind::Softmax, None) => SPARE,
            (CostKind::Exp, Some(_)) => HAND_TUNED[term],
            (CostKind::Exp, None) => 1.0,
        };
        *bias += (libm::log(wanted) - outputs[term]) as f32;
    }
}

#[cfg(test)]
mod tests {
    use network::weights::{Variant, Weights};

    use super::*;

    #[test]
    fn they_begin_at_the_hand_tuned_cost() {
        let mut parameters = Parameters::of(&Weights::formula(Variant::Joint));
        start_hand_tuned(&mut parameters, CostKind::Exp);
        let got = weights(&parameters, CostKind::Exp).unwrap();
        assert!(got.iter().zip(HAND_TUNED).all(|(got, wanted)| (got / wanted - 1.0).abs() < 1e-5), "{got:?}");
        start_hand_tuned(&mut parameters, CostKind::Softmax);
        let got = weights(&parameters, CostKind::Softmax).unwrap();
        let share = got[0] / HAND_TUNED[0];
        assert!((share - 0.755).abs() < 2e-3, "{share}");
        assert!(got[..7].iter().zip(HAND_TUNED).all(|(got, wanted)| (got / wanted / share - 1.0).abs() < 1e-5));
        assert_eq!(got[7..], [10.0, 10.0]);
    }

    #[test]
    fn without_a_cost_there_are_no_weights() {
        let mut parameters = Parameters::zeros(Variant::Separate);
        start_hand_tuned(&mut parameters, CostKind::Exp);
        assert_eq!(weights(&parameters, CostKind::Softmax), None);
    }
}
