//! Weights in the safetensors format, in single or half precision.

use std::collections::HashMap;

use half::f16;
use safetensors::tensor::{Dtype, SafeTensors, TensorView};

use super::error::WeightsError;
use super::layout::{BUFFERS, CostForm, Variant, layout};
use super::{Tensor, Weights};
use crate::features::Settings;

/// The buffer of the shares' scales.
const SCALE: &str = "plan.scale";

/// The metadata's only key: on whose features they were trained.
const FEATURES: &str = "features";

/// How numbers are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Precision {
    /// 32 bits: as they are.
    Single,
    /// 16 bits: half the file, rounded to eleven binary digits.
    Half,
}

impl Weights {
    /// Reads the bytes of a file; which variant it is shows in the heads that it has.
    ///
    /// # Errors
    /// [`WeightsError`] names the tensor, what is expected and what is there.
    pub fn read(bytes: &[u8]) -> Result<Self, WeightsError> {
        let file = SafeTensors::deserialize(bytes).map_err(|error| WeightsError::Format(error.to_string()))?;
        let has = |start: &str| file.iter().any(|(name, _)| name.starts_with(start));
        let variant = match (has("predict.") || has("score."), has("plan.cost.")) {
            (true, true) => Variant::Joint,
            (true, false) => Variant::Separate,
            (false, _) => Variant::Imitation,
        };
        let layout = layout(variant);
        let mut tensors = Vec::with_capacity(layout.len());
        for expected in layout {
            let Ok(view) = file.tensor(&expected.name) else {
                return Err(WeightsError::Missing { name: expected.name, shape: expected.shape });
            };
            check_shape(&expected.name, &expected.shape, &view)?;
            let values = numbers(&expected.name, &view)?;
            tensors.push((expected.name, Tensor { shape: expected.shape, values }));
        }
        let features = match word(bytes) {
            Some(word) => Some(Settings::named(&word).ok_or(WeightsError::Features(word))?),
            None => None,
        };
        let mut weights = Self { variant, cost_form: CostForm::Shares, features, tensors };
        let mut names: Vec<String> = file.names().into_iter().map(ToString::to_string).collect();
        names.sort();
        for name in names {
            if let Some((_, shape, constant)) = BUFFERS.iter().find(|(buffer, ..)| *buffer == name) {
                if let Ok(view) = file.tensor(&name) {
                    check_shape(&name, shape, &view)?;
                    if name == SCALE && check_constant(&name, &[0; 7], &view).is_ok() {
                        weights.cost_form = CostForm::Exponentials;
                        continue;
                    }
                    check_constant(&name, constant, &view)?;
                }
            } else if weights.tensor(&name).is_err() {
                return Err(WeightsError::Unknown { name });
            }
        }
        Ok(weights)
    }

    /// The bytes of a file. The same weights give the same bytes.
    ///
    /// # Errors
    /// [`WeightsError::TooLarge`] where half precision has no such number.
    pub fn write(&self, precision: Precision) -> Result<Vec<u8>, WeightsError> {
        let mut parts = Vec::new();
        for (name, tensor) in &self.tensors {
            parts.push(part(name, &tensor.shape, &tensor.values, precision)?);
        }
        if self.variant.has_cost() {
            for (name, shape, constant) in BUFFERS {
                let constant = match self.cost_form {
                    CostForm::Exponentials if name == SCALE => &[0; 7],
                    _ => constant,
                };
                parts.push((name, Dtype::I64, shape, constant.iter().flat_map(|value| value.to_le_bytes()).collect()));
            }
        }
        // One key: more would be written in the order of a hash.
        let metadata = self.features.map(|features| HashMap::from([(FEATURES.to_owned(), features.name().to_owned())]));
        serialize(&parts, metadata)
    }
}

/// A tensor as a file has it: name, type, shape, bytes.
pub(crate) type Part<'a> = (&'a str, Dtype, &'a [usize], Vec<u8>);

/// The tensor `name` of these numbers.
pub(crate) fn part<'a>(
    name: &'a str,
    shape: &'a [usize],
    values: &[f32],
    precision: Precision,
) -> Result<Part<'a>, WeightsError> {
    Ok(match precision {
        Precision::Single => (name, Dtype::F32, shape, values.iter().flat_map(|value| value.to_le_bytes()).collect()),
        Precision::Half => (name, Dtype::F16, shape, halves(name, values)?),
    })
}

/// A file of these tensors, which the library sorts by type and name.
pub(crate) fn serialize(
    parts: &[Part<'_>],
    metadata: Option<HashMap<String, String>>,
) -> Result<Vec<u8>, WeightsError> {
    let mut views = Vec::new();
    for (name, dtype, shape, bytes) in parts {
        let view = TensorView::new(*dtype, shape.to_vec(), bytes);
        views.push((*name, view.map_err(|error| WeightsError::Format(error.to_string()))?));
    }
    safetensors::serialize(views, metadata).map_err(|error| WeightsError::Format(error.to_string()))
}

/// On whose features the weights in a file were trained, if it says so and is read that far.
#[must_use]
pub fn features_of(bytes: &[u8]) -> Option<Settings> {
    Settings::named(&word(bytes)?)
}

fn word(bytes: &[u8]) -> Option<String> {
    let (_, head) = SafeTensors::read_metadata(bytes).ok()?;
    head.metadata().as_ref()?.get(FEATURES).cloned()
}

pub(crate) fn check_shape(name: &str, expected: &[usize], view: &TensorView<'_>) -> Result<(), WeightsError> {
    if view.shape() == expected {
        return Ok(());
    }
    Err(WeightsError::Shape { name: name.to_owned(), expected: expected.to_vec(), got: view.shape().to_vec() })
}

fn wrong_type(name: &str, expected: &'static str, view: &TensorView<'_>) -> WeightsError {
    WeightsError::Type { name: name.to_owned(), expected, got: format!("{:?}", view.dtype()) }
}

pub(crate) fn numbers(name: &str, view: &TensorView<'_>) -> Result<Vec<f32>, WeightsError> {
    let values: Vec<f32> = match view.dtype() {
        Dtype::F32 => view.data().as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect(),
        Dtype::F16 => view.data().as_chunks::<2>().0.iter().map(|bytes| f16::from_le_bytes(*bytes).to_f32()).collect(),
        _ => return Err(wrong_type(name, "F32 or F16", view)),
    };
    match values.iter().position(|value| !value.is_finite()) {
        Some(place) => Err(WeightsError::NotFinite { name: name.to_owned(), place, value: values[place] }),
        None => Ok(values),
    }
}

fn halves(name: &str, values: &[f32]) -> Result<Vec<u8>, WeightsError> {
    let mut bytes = Vec::with_capacity(2 * values.len());
    for (place, value) in values.iter().enumerate() {
        let half = f16::from_f32(*value);
        if !half.is_finite() {
            return Err(WeightsError::TooLarge { name: name.to_owned(), place, value: *value });
        }
        bytes.extend(half.to_le_bytes());
    }
    Ok(bytes)
}

fn check_constant(name: &str, expected: &[i64], view: &TensorView<'_>) -> Result<(), WeightsError> {
    let got: Vec<i64> = match view.dtype() {
        Dtype::I64 => view.data().as_chunks::<8>().0.iter().map(|bytes| i64::from_le_bytes(*bytes)).collect(),
        Dtype::I32 => view.data().as_chunks::<4>().0.iter().map(|bytes| i32::from_le_bytes(*bytes).into()).collect(),
        _ => return Err(wrong_type(name, "I64 or I32", view)),
    };
    if got == expected {
        return Ok(());
    }
    Err(WeightsError::Constant { name: name.to_owned(), expected: expected.to_vec(), got })
}
