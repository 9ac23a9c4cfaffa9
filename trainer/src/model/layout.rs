//! Where a parameter stands in the row of all.

use std::collections::BTreeMap;
use std::ops::Range;

use network::weights::Variant;

use crate::parameters::tensors;

/// All tensors of a variant by name, as matrices: a vector is one row.
#[derive(Clone, Debug)]
pub struct Layout {
    variant: Variant,
    places: BTreeMap<String, (usize, usize, Range<usize>)>,
    count: usize,
}

impl Layout {
    /// That of a variant.
    #[must_use]
    pub fn new(variant: Variant) -> Self {
        let places: BTreeMap<_, _> = tensors(variant)
            .map(|(name, shape, range)| {
                let columns = shape.last().copied().unwrap_or(1);
                (name, (range.len() / columns, columns, range))
            })
            .collect();
        let count = places.values().map(|(.., range)| range.end).max().unwrap_or(0);
        Self { variant, places, count }
    }

    /// Which network's.
    #[must_use]
    pub fn variant(&self) -> Variant {
        self.variant
    }

    /// How many numbers all tensors have.
    #[must_use]
    pub fn count(&self) -> usize {
        self.count
    }

    /// Rows, columns and place of a tensor, whose name must be one of the variant's.
    pub(super) fn place(&self, name: &str) -> (usize, usize, Range<usize>) {
        let place = self.places.get(name).cloned();
        debug_assert!(place.is_some(), "there is no tensor {name}");
        place.unwrap_or((0, 0, 0..0))
    }
}
