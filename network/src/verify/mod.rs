//! Features and outputs against vectors: NumPy's files in which other implementations wrote down what they computed.
//!
//! | file | what is compared |
//! | --- | --- |
//! | `features` | the tensors of a step, and which lanes are in them |
//! | `outputs` | the network's answers to given frames |
//! | `drives` | a trained network's answers at each step of a drive |

mod drives;
mod features;
mod outputs;

pub use features::window;
pub use outputs::frame;

use std::path::Path;
use std::sync::Arc;

use thiserror::Error;
use vectors::{FolderError, Npz, NpzError, Report, npz_files};

use world::scene::Scene;

use crate::Prediction;
use crate::features::{SceneFeatures, Settings};
use crate::inference::{Network, Workspace};

/// What a file of vectors holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// The features of a step: [`verify_features`].
    Features,
    /// The outputs of a frame: [`verify_outputs`].
    Outputs,
    /// A drive of a trained network: [`verify_drives`].
    Drive,
}

impl Kind {
    /// What this file holds; none where it is nothing that can be compared.
    #[must_use]
    pub fn of(npz: &Npz) -> Option<Self> {
        let kinds = [("map_lanes", Self::Features), ("plans", Self::Outputs), ("av_state", Self::Drive)];
        kinds.into_iter().find(|(array, _)| npz.has(array)).map(|(_, kind)| kind)
    }
}

/// Why vectors cannot be compared.
#[derive(Debug, Error)]
pub enum VerifyError {
    /// The folder cannot be used.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// A file cannot be used.
    #[error(transparent)]
    File(#[from] NpzError),
}

/// Compares what `network` says with every file of `outputs`; the input of each is the file of the same name in `inputs`.
///
/// # Errors
/// [`VerifyError`]; a deviation is no error.
pub fn verify_outputs(network: &Network, inputs: &Path, outputs: &Path) -> Result<Report, VerifyError> {
    let mut report = Report::new(&["network"], &outputs::QUANTITIES);
    let (mut workspace, mut predictions) = (Workspace::new(1), [Prediction::empty()]);
    for path in npz_files(outputs)? {
        let name = path.file_name().unwrap_or_default();
        let frame = frame(&Npz::read(&inputs.join(name))?)?;
        network.forward(&[&frame], &mut workspace, &mut predictions);
        report.count_case();
        let place = path.file_stem().unwrap_or_default().to_string_lossy();
        for (quantity, deviation) in outputs::deviations(&Npz::read(&path)?, &predictions[0])? {
            report.add(0, quantity, deviation, &place);
        }
    }
    Ok(report)
}

/// Compares the features of each file's step with those that it has; `scene` finds the scene of a name. Files without a scene are
/// left out, and said to be.
///
/// # Errors
/// [`VerifyError`]; a deviation is no error.
pub fn verify_features(
    folder: &Path,
    mut scene: impl FnMut(&str) -> Option<Arc<Scene>>,
) -> Result<Report, VerifyError> {
    let mut report = Report::new(&["authors"], &features::QUANTITIES);
    let mut left_out = Vec::new();
    for path in npz_files(folder)? {
        let npz = Npz::read(&path)?;
        let place = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let Some(scene) = features::scene_of(&npz).and_then(|name| scene(&name)) else {
            left_out.push(place);
            continue;
        };
        report.count_case();
        let prepared = SceneFeatures::new(scene.map(), Settings::Authors);
        for (quantity, deviation) in features::deviations(&npz, &scene, &prepared)? {
            report.add(0, quantity, deviation, &place);
        }
    }
    if !left_out.is_empty() {
        report.note(format!("left out, for their scenes are not at hand: {}", left_out.join(", ")));
    }
    Ok(report)
}

/// Compares what `network` says at each step of the drives in `folder` whose names end in `model`, with the states of those drives fed
/// in; `scene` finds the scene of a name.
///
/// # Errors
/// [`VerifyError`]; a deviation is no error.
pub fn verify_drives(
    network: &Network,
    (folder, model): (&Path, &str),
    mut scene: impl FnMut(&str) -> Option<Arc<Scene>>,
) -> Result<Report, VerifyError> {
    let mut report = Report::new(&["network"], &drives::QUANTITIES);
    for path in npz_files(folder)? {
        let place = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let Some((name, of)) = place.split_once("__") else { continue };
        let Some(scene) = (of == model).then(|| scene(name)).flatten() else { continue };
        report.count_case();
        for (quantity, deviation, step) in drives::deviations(&Npz::read(&path)?, &scene, network)? {
            report.add(0, quantity, deviation, format_args!("{name} step {step}"));
        }
    }
    Ok(report)
}
