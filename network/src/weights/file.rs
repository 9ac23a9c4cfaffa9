//! Weights in files: safetensors, f32 or f16, under the authors' names.
//!
//! A checkpoint of theirs becomes one so:
//!
//! ```python
//! import torch, safetensors.torch
//! weights = torch.load("model.pth", map_location="cpu")
//! safetensors.torch.save_file({name: tensor.contiguous() for name, tensor in weights.items()}, "model.safetensors")
//! ```
//!
//! The same weights are the same bytes at each save: there is no metadata, and tensors stand in the order of their names.

use half::f16;
use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensorError, SafeTensors};
use thiserror::Error;

use super::Weights;
use super::layout::{self, BUFFERS, Tensor};

/// How numbers stand in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Precision {
    /// Four bytes each.
    Single,
    /// Two bytes each.
    Half,
}

/// A file that holds no weights of this network.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum WeightsError {
    #[error("no safetensors file: {0}\nhint: export a checkpoint's state dict with safetensors.torch.save_file")]
    Format(#[from] SafeTensorError),
    #[error("tensor {name} is missing")]
    Missing { name: String },
    #[error("tensor {name} is none of this network's\nhint: the layout is that of the authors' predictor, 135 tensors")]
    Unknown { name: String },
    #[error("tensor {name} has the shape {got:?}, expected {expected:?}")]
    Shape { name: String, expected: Vec<usize>, got: Vec<usize> },
    #[error("tensor {name} has numbers of type {got:?}, expected F32 or F16")]
    Type { name: String, got: Dtype },
    #[error("tensor {name} holds {value} at place {index}")]
    NotFinite { name: String, index: usize, value: f32 },
}

impl Weights {
    /// The weights in the bytes of a file.
    ///
    /// # Errors
    /// [`WeightsError`] names the tensor that is not as it must be.
    pub fn from_safetensors(bytes: &[u8]) -> Result<Self, WeightsError> {
        let file = SafeTensors::deserialize(bytes)?;
        let is_known = |name: &str| BUFFERS.contains(&name) || layout::tensors().iter().any(|t| t.name == name);
        if let Some(name) = file.names().into_iter().filter(|name| !is_known(name)).min() {
            return Err(WeightsError::Unknown { name: name.to_owned() });
        }
        Self::try_of(|tensor| {
            let name = || tensor.name.clone();
            let view = file.tensor(&tensor.name).map_err(|_| WeightsError::Missing { name: name() })?;
            if view.shape() != tensor.shape {
                let (expected, got) = (tensor.shape.clone(), view.shape().to_vec());
                return Err(WeightsError::Shape { name: name(), expected, got });
            }
            let values: Vec<f32> = match view.dtype() {
                Dtype::F32 => view.data().as_chunks().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect(),
                Dtype::F16 => view.data().as_chunks().0.iter().map(|b| f16::from_le_bytes(*b).to_f32()).collect(),
                got => return Err(WeightsError::Type { name: name(), got }),
            };
            match values.iter().position(|value| !value.is_finite()) {
                Some(index) => Err(WeightsError::NotFinite { name: name(), index, value: values[index] }),
                None => Ok(values),
            }
        })
    }

    /// The bytes of a file that holds them.
    ///
    /// # Errors
    /// [`SafeTensorError`] where the library refuses: a bug.
    pub fn to_safetensors(&self, precision: Precision) -> Result<Vec<u8>, SafeTensorError> {
        let bytes = |values: &[f32]| -> Vec<u8> {
            match precision {
                Precision::Single => values.iter().flat_map(|value| value.to_le_bytes()).collect(),
                Precision::Half => values.iter().flat_map(|value| f16::from_f32(*value).to_le_bytes()).collect(),
            }
        };
        let data: Vec<(&Tensor, Vec<u8>)> = self.iter().map(|(tensor, values)| (tensor, bytes(values))).collect();
        let kind = if precision == Precision::Single { Dtype::F32 } else { Dtype::F16 };
        let mut views = Vec::new();
        for (tensor, bytes) in &data {
            views.push((tensor.name.as_str(), TensorView::new(kind, tensor.shape.clone(), bytes)?));
        }
        safetensors::serialize(views, None)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may panic")]
mod tests {
    use super::*;
    use crate::weights::formula;

    fn changed(change: impl Fn(&str, &mut Dtype, &mut Vec<usize>, &mut Vec<u8>) -> bool) -> WeightsError {
        let weights = formula::weights();
        let mut rows: Vec<(String, Dtype, Vec<usize>, Vec<u8>)> = Vec::new();
        for (tensor, values) in weights.iter() {
            let mut bytes = values.iter().flat_map(|value| value.to_le_bytes()).collect();
            let (mut kind, mut shape) = (Dtype::F32, tensor.shape.clone());
            if change(&tensor.name, &mut kind, &mut shape, &mut bytes) {
                rows.push((tensor.name.clone(), kind, shape, bytes));
            }
        }
        let views = rows.iter().map(|(name, kind, shape, b)| (name, TensorView::new(*kind, shape.clone(), b).unwrap()));
        Weights::from_safetensors(&safetensors::serialize(views, None).unwrap()).unwrap_err()
    }

    #[test]
    fn what_is_written_is_read_and_is_the_same_bytes_each_time() {
        let weights = formula::weights();
        let bytes = weights.to_safetensors(Precision::Single).unwrap();
        assert_eq!(bytes, weights.to_safetensors(Precision::Single).unwrap());
        assert_eq!(Weights::from_safetensors(&bytes).unwrap(), weights);
        let half = weights.to_safetensors(Precision::Half).unwrap();
        assert!(half.len() < bytes.len() / 2 + 20_000);
        let again = Weights::from_safetensors(&half).unwrap();
        assert_eq!(again.to_safetensors(Precision::Half).unwrap(), half, "halves are read as they are");
    }

    #[test]
    fn a_tensor_that_is_not_as_it_must_be_is_named() {
        const NAME: &str = "plan.cost.2.bias";
        let missing = changed(|name, _, _, _| name != NAME);
        assert_eq!(missing.to_string(), "tensor plan.cost.2.bias is missing");
        let shape = changed(|name, _, shape, _| {
            if name == NAME {
                *shape = vec![3, 3];
            }
            true
        });
        assert_eq!(shape.to_string(), "tensor plan.cost.2.bias has the shape [3, 3], expected [9]");
        let kind = changed(|name, kind, _, _| {
            if name == NAME {
                *kind = Dtype::I32;
            }
            true
        });
        assert_eq!(kind.to_string(), "tensor plan.cost.2.bias has numbers of type I32, expected F32 or F16");
        let number = changed(|name, _, _, bytes| {
            if name == NAME {
                bytes[8..12].copy_from_slice(&f32::NAN.to_le_bytes());
            }
            true
        });
        assert_eq!(number.to_string(), "tensor plan.cost.2.bias holds NaN at place 2");
        assert!(Weights::from_safetensors(b"PK\x03\x04").unwrap_err().to_string().contains("hint: export"));
    }
}
