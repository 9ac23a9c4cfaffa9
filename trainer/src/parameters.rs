//! Everything that is learned, in one row of numbers: so the optimiser, checkpoints and sums of gradients need not know the network.

use std::ops::Range;

use network::weights::{Variant, Weights, WeightsError, layout};

/// All tensors of a variant one after another, in the order of its layout.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameters {
    variant: Variant,
    values: Vec<f32>,
}

impl Parameters {
    /// All zero.
    #[must_use]
    pub fn zeros(variant: Variant) -> Self {
        let count = tensors(variant).last().map_or(0, |(_, _, range)| range.end);
        Self { variant, values: vec![0.0; count] }
    }

    /// Those of a weights file.
    #[must_use]
    pub fn of(weights: &Weights) -> Self {
        let values = weights.tensors().flat_map(|(_, _, values)| values.iter().copied()).collect();
        Self { variant: weights.variant(), values }
    }

    /// As a weights file holds them.
    ///
    /// # Errors
    /// [`WeightsError`] where a value is not finite.
    pub fn weights(&self) -> Result<Weights, WeightsError> {
        Weights::from_tensors(self.variant, tensors(self.variant).map(|(_, _, range)| self.values[range].to_vec()))
    }

    /// Which network's they are.
    #[must_use]
    pub fn variant(&self) -> Variant {
        self.variant
    }

    /// The numbers.
    #[must_use]
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// The numbers, to be changed.
    pub fn values_mut(&mut self) -> &mut [f32] {
        &mut self.values
    }
}

/// Each tensor's name, shape, and place in the row.
pub fn tensors(variant: Variant) -> impl ExactSizeIterator<Item = (String, Vec<usize>, Range<usize>)> {
    let mut end = 0;
    layout(variant).into_iter().map(move |tensor| {
        let start = end;
        end += tensor.shape.iter().product::<usize>();
        (tensor.name, tensor.shape, start..end)
    })
}
