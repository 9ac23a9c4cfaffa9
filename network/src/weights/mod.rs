//! The network's weights: one type for files, for inference and for learning, under the names and shapes of the authors' PyTorch
//! modules. Their checkpoints load after a plain export of the state dict:
//!
//! ```text
//! import torch, safetensors.torch
//! weights = torch.load("model.pth", map_location="cpu")
//! safetensors.torch.save_file({k: v.contiguous() for k, v in weights.items()}, "model.safetensors")
//! ```
//!
//! | file | what |
//! | --- | --- |
//! | `layout` | which tensors a network has |
//! | `file` | safetensors in and out |
//! | `formula` | weights for tests, by a formula |

mod error;
pub(crate) mod file;
mod formula;
pub(crate) mod layout;
#[cfg(test)]
mod tests;

pub use error::WeightsError;
pub use file::{Precision, features_of};
pub use formula::formula_numbers;
pub use layout::{CostForm, TensorLayout, Variant, layout};

use crate::features;

/// A tensor: numbers row by row.
#[derive(Clone, Debug, PartialEq)]
struct Tensor {
    shape: Vec<usize>,
    values: Vec<f32>,
}

/// All weights of a network; each tensor of its variant is there in its shape, and every number is finite.
#[derive(Clone, Debug, PartialEq)]
pub struct Weights {
    variant: Variant,
    cost_form: CostForm,
    features: Option<features::Settings>,
    /// In the order of [`layout`].
    tensors: Vec<(String, Tensor)>,
}

impl Weights {
    /// Which network they are of.
    #[must_use]
    pub fn variant(&self) -> Variant {
        self.variant
    }

    /// How the weights of the planner's cost are made.
    #[must_use]
    pub fn cost_form(&self) -> CostForm {
        self.cost_form
    }

    /// The same with the cost's weights made so.
    #[must_use]
    pub fn with_cost_form(self, cost_form: CostForm) -> Self {
        Self { cost_form, ..self }
    }

    /// On whose features they were trained, if they say so: those of the authors do not.
    #[must_use]
    pub fn features(&self) -> Option<features::Settings> {
        self.features
    }

    /// The same, trained on these features.
    #[must_use]
    pub fn with_features(self, features: features::Settings) -> Self {
        Self { features: Some(features), ..self }
    }

    /// Each tensor's name, shape and numbers, in the order of [`layout`].
    pub fn tensors(&self) -> impl ExactSizeIterator<Item = (&str, &[usize], &[f32])> {
        self.tensors.iter().map(|(name, tensor)| (name.as_str(), tensor.shape.as_slice(), tensor.values.as_slice()))
    }

    /// The weights of a network of `variant` with these numbers, a tensor each, in the order of [`layout`]: what training ends with.
    ///
    /// # Errors
    /// [`WeightsError`] where a tensor is missing, has another number of numbers, or one that is not finite.
    pub fn from_tensors(variant: Variant, values: impl IntoIterator<Item = Vec<f32>>) -> Result<Self, WeightsError> {
        let mut values = values.into_iter();
        let mut tensors = Vec::new();
        for TensorLayout { name, shape } in layout(variant) {
            let Some(values) = values.next() else { return Err(WeightsError::Missing { name, shape }) };
            if values.len() != shape.iter().product::<usize>() {
                return Err(WeightsError::Shape { name, expected: shape, got: vec![values.len()] });
            }
            if let Some(place) = values.iter().position(|value| !value.is_finite()) {
                return Err(WeightsError::NotFinite { name, place, value: values[place] });
            }
            tensors.push((name, Tensor { shape, values }));
        }
        Ok(Self { variant, cost_form: CostForm::default(), features: None, tensors })
    }

    /// The numbers of a tensor, row by row.
    ///
    /// # Errors
    /// [`WeightsError::Unknown`] where this variant has none of that name.
    pub fn tensor(&self, name: &str) -> Result<&[f32], WeightsError> {
        let found = self.tensors.iter().find(|(own, _)| own == name);
        found.map(|(_, tensor)| tensor.values.as_slice()).ok_or_else(|| WeightsError::Unknown { name: name.to_owned() })
    }
}
