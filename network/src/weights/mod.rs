//! The weights of the network, under the names and shapes of the authors' PyTorch code, so that their checkpoints load.
//!
//! | module | what |
//! | --- | --- |
//! | [`layout`] | every tensor's name and shape |
//! | [`mod@file`] | safetensors, read and written |
//! | [`formula`] | weights by a formula, for tests |

pub mod file;
pub mod formula;
pub mod layout;

use std::collections::BTreeMap;
use std::sync::OnceLock;

use self::layout::Tensor;

/// All weights of a network, in f32.
#[derive(Clone, Debug, PartialEq)]
pub struct Weights {
    /// In the order of [`layout::tensors`].
    values: Vec<Vec<f32>>,
}

impl Weights {
    /// Weights whose tensors are told one by one, in the order of [`layout::tensors`].
    ///
    /// # Errors
    /// What `tensor` returns.
    pub fn try_of<E>(tensor: impl FnMut(&Tensor) -> Result<Vec<f32>, E>) -> Result<Self, E> {
        Ok(Self { values: layout::tensors().iter().map(tensor).collect::<Result<_, E>>()? })
    }

    /// The tensor of that name, row by row; empty where the layout has none.
    #[must_use]
    pub fn get(&self, name: &str) -> &[f32] {
        static PLACES: OnceLock<BTreeMap<&'static str, usize>> = OnceLock::new();
        let places = PLACES.get_or_init(|| layout::tensors().iter().map(|t| t.name.as_str()).zip(0..).collect());
        places.get(name).map_or(&[], |place| &self.values[*place])
    }

    /// Every tensor with its values, in the order of [`layout::tensors`].
    pub fn iter(&self) -> impl Iterator<Item = (&'static Tensor, &[f32])> {
        layout::tensors().iter().zip(self.values.iter().map(Vec::as_slice))
    }
}
