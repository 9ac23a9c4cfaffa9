//! Where a training begins: with weights as PyTorch draws them, or with those of a file.

use std::fs;
use std::io;
use std::path::PathBuf;

use network::weights::{Weights, WeightsError};
use thiserror::Error;

use crate::cost;
use crate::initial::initial;
use crate::optimiser::is_cost;
use crate::parameters::{Parameters, tensors};
use crate::settings::{CostStart, Settings};

/// Weights that cannot be begun with.
#[derive(Debug, Error)]
pub enum StartError {
    /// The file cannot be read.
    #[error("{}: {source}\nhint: the setting `start` names a weights file, relative to the folder of the command", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// It is no weights file.
    #[error("{}: {source}", path.display())]
    Weights {
        /// The file.
        path: PathBuf,
        /// Why.
        source: WeightsError,
    },
}

/// The first weights: those of the seed, and over them the file's, if the settings name one. What the file lacks is the seed's, so a network
/// of one mode can begin another. Its cost is taken where it is of the settings' kind and they ask for no other.
///
/// # Errors
/// [`StartError`].
pub fn first(settings: &Settings) -> Result<Parameters, StartError> {
    let mut parameters = initial(settings);
    let Some(path) = &settings.start else { return Ok(parameters) };
    let bytes = fs::read(path).map_err(|source| StartError::Read { path: path.clone(), source })?;
    let weights = Weights::read(&bytes).map_err(|source| StartError::Weights { path: path.clone(), source })?;
    let takes_cost = weights.cost_form() == settings.cost.kind.form() && settings.cost.start == CostStart::Random;
    for (name, shape, place) in tensors(settings.variant()).filter(|(name, ..)| takes_cost || !is_cost(name)) {
        // The variants' tensors of one name have one shape.
        if let Some((.., values)) = weights.tensors().find(|(other, of, _)| **other == name && **of == shape) {
            parameters.values_mut()[place].copy_from_slice(values);
        }
    }
    Ok(parameters)
}

/// The planner's weights at the beginning.
///
/// # Errors
/// [`StartError`].
pub fn first_cost(settings: &Settings) -> Result<Option<[f64; gauss_newton::constants::TERMS]>, StartError> {
    Ok(cost::weights(&first(settings)?, settings.cost.kind))
}

#[cfg(test)]
mod tests {
    use network::weights::{Precision, Variant};

    use super::*;
    use crate::settings::{CostKind, Mode};

    #[test]
    fn what_a_file_has_is_taken_and_the_rest_is_the_seeds() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("start.safetensors");
        let formula = Weights::formula(Variant::Separate);
        fs::write(&path, formula.write(Precision::Single).unwrap()).unwrap();
        let settings = Settings { start: Some(path.clone()), ..Settings::default() };
        let (begun, drawn) = (first(&settings).unwrap(), initial(&settings));
        for (name, _, place) in tensors(settings.variant()) {
            let of_the_file = formula.tensor(&name).ok();
            assert_eq!(of_the_file.is_some(), !is_cost(&name));
            assert_eq!(begun.values()[place.clone()], *of_the_file.unwrap_or(&drawn.values()[place]), "{name}");
        }
        // A cost of shares says nothing to one of exponentials.
        fs::write(&path, Weights::formula(Variant::Joint).write(Precision::Single).unwrap()).unwrap();
        let shares = first_cost(&settings).unwrap();
        assert_ne!(shares, cost::weights(&drawn, CostKind::Softmax));
        let mut other = settings.clone();
        other.cost.kind = CostKind::Exp;
        assert_eq!(first_cost(&other).unwrap(), cost::weights(&initial(&other), CostKind::Exp));
        // Nobody is predicted: the other tensors are as they are.
        let il = first(&Settings { mode: Mode::Il, ..settings.clone() }).unwrap();
        assert_eq!(il.variant(), Variant::Imitation);
        fs::write(&path, b"no weights").unwrap();
        assert!(first(&settings).unwrap_err().to_string().starts_with(&path.display().to_string()));
    }
}
