//! `verify`: the network beside numbers of the authors' code.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use network::inference::Network as Model;
use network::verify::{VerifyError, verify_drives, verify_features, verify_outputs};
use network::weights::{Variant, Weights, WeightsError};
use scenarios::{SceneSet, SetError};
use thiserror::Error;
use vectors::Report;
use world::scene::Scene;

use crate::network::{FeatureStyle, NetworkError};

/// What is typed for weights that are made by a formula.
const FORMULA: &str = "formula";

/// Why nothing can be compared.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum VerifyNetworkError {
    #[error(transparent)]
    Network(#[from] NetworkError),
    #[error(transparent)]
    Formula(#[from] WeightsError),
    #[error("cannot open the scenes: {0}\nhint: {hint}", hint = .0.hint())]
    Scenes(#[from] SetError),
    #[error(transparent)]
    Vectors(#[from] VerifyError),
    #[error(
        "{} holds nothing to compare these weights with\nhint: give the folder that holds feature-vectors, network-vectors and \
         trained; features and drives need --scenarios, outputs the weights formula",
        .0.display()
    )]
    Nothing(PathBuf),
}

/// Compares all that `folder` holds for these weights; a title and a report each.
///
/// # Errors
/// [`VerifyNetworkError`]; a deviation is no error.
pub fn verify(
    weights: &Path,
    folder: &Path,
    scenarios: &[String],
) -> Result<Vec<(&'static str, Report)>, VerifyNetworkError> {
    let is_formula = weights.as_os_str() == FORMULA;
    let model = if is_formula {
        Model::new(&Weights::formula(Variant::Joint))?
    } else {
        crate::network::model(Some(weights), Some(FeatureStyle::Authors))?.0
    };
    let set = if scenarios.is_empty() { None } else { Some(SceneSet::open(scenarios)?) };
    let scene = |name: &str| -> Option<Arc<Scene>> {
        let set = set.as_ref()?;
        let index = set.entries().iter().position(|entry| entry.id.as_str() == name)?;
        set.load(index).ok().map(|(scene, _)| scene)
    };
    let [inputs, outputs, drives] = ["feature-vectors", "network-vectors", "trained/drives"].map(|of| folder.join(of));
    let mut reports = Vec::new();
    if set.is_some() && inputs.is_dir() {
        reports.push(("features", verify_features(&inputs, scene)?));
    }
    if is_formula && outputs.is_dir() {
        reports.push(("outputs", verify_outputs(&model, &inputs, &outputs)?));
    }
    if set.is_some() && !is_formula && drives.is_dir() {
        let name = weights.file_name().unwrap_or_default().to_string_lossy();
        let name = name.split('.').next().unwrap_or_default();
        reports.push(("steps of drives", verify_drives(&model, (&drives, name), scene)?));
    }
    if reports.is_empty() { Err(VerifyNetworkError::Nothing(folder.to_owned())) } else { Ok(reports) }
}
