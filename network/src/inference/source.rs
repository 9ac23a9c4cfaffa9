//! Layers out of the weights.

use super::functions::Norm;
use super::product::{Kernel, Linear};
use crate::constants::WIDTH;
use crate::weights::{Weights, WeightsError};

/// Where layers come from.
#[derive(Clone, Copy)]
pub(super) struct Source<'a> {
    pub weights: &'a Weights,
    pub kernel: Kernel,
}

impl<'a> Source<'a> {
    pub fn tensor(self, name: &str) -> Result<&'a [f32], WeightsError> {
        self.weights.tensor(name)
    }

    /// The layer `name.weight`, `name.bias`.
    pub fn linear(self, name: &str) -> Result<Linear, WeightsError> {
        let (weight, bias) = (self.tensor(&format!("{name}.weight"))?, self.tensor(&format!("{name}.bias"))?);
        Ok(self.layer(weight, bias))
    }

    /// The layer of this weight and bias.
    pub fn layer(self, weight: &[f32], bias: &[f32]) -> Linear {
        let inputs = weight.len() / bias.len();
        Linear::new(self.kernel, (bias.len(), inputs), |n, k| weight[n * inputs + k], |n| bias[n])
    }

    pub fn norm(self, name: &str) -> Result<Norm, WeightsError> {
        let row = |part: &str| -> Result<[f32; WIDTH], WeightsError> {
            let values = self.tensor(&format!("{name}.{part}"))?;
            Ok(std::array::from_fn(|index| values[index]))
        };
        Ok(Norm { weight: row("weight")?, bias: row("bias")? })
    }
}
