//! What a trained network says at each step of a drive against what another implementation's said there.

use vectors::{Npz, NpzError, Quantity, absolute, worst_deviation};
use world::scene::{AgentState, Scene};

use crate::constants::{FUTURES, HISTORY, NEIGHBORS, STEPS};
use crate::features::{SceneFeatures, Settings, Window};
use crate::frame::Prediction;
use crate::inference::{Network, Workspace};

const TRACKS: Quantity = Quantity::exact("neighbours");
const MODE: Quantity = Quantity::exact("most probable future");
const SCORES: Quantity = Quantity::within("scores", 1e-3, "abs");
const CONTROLS: Quantity = Quantity::within("controls", 1e-4, "abs");
const POSES: Quantity = Quantity::within("predictions", 1e-3, "abs");

/// What is compared, with the tolerances of the drives' README.
pub(super) const QUANTITIES: [Quantity; 5] = [TRACKS, MODE, SCORES, CONTROLS, POSES];

/// Scores nearer to each other than this may change places.
const EQUAL_SCORES: f64 = 1e-4;
/// The log index of the first step.
const START: usize = HISTORY - 1;
/// Predictions are written down at every tenth step.
const EVERY: usize = 10;

/// Deviations, each with its step.
pub(super) fn deviations(npz: &Npz, scene: &Scene, network: &Network) -> Result<Vec<(Quantity, f64, usize)>, NpzError> {
    let states = npz.rows::<8>("av_state", &[None, Some(8)])?;
    let steps = states.len().saturating_sub(1);
    let tracks = npz.rows::<NEIGHBORS>("neighbor_tracks", &[Some(steps), Some(NEIGHBORS)])?;
    let modes = npz.array("mode", &[Some(steps)])?;
    let scores = npz.rows::<FUTURES>("scores", &[Some(steps), Some(FUTURES)])?;
    let controls = if npz.has("network_controls") {
        npz.array("network_controls", &[Some(steps), Some(STEPS), Some(2)])?
    } else {
        &[]
    };
    let shape = [Some(steps.div_ceil(EVERY)), Some(NEIGHBORS), Some(STEPS), Some(3)];
    let poses = if npz.has("every10_prediction") { npz.array("every10_prediction", &shape)? } else { &[] };

    let prepared = SceneFeatures::new(scene.map(), Settings::Authors);
    let (mut workspace, mut prediction) = (Workspace::new(1), [Prediction::empty()]);
    let mut found = Vec::new();
    for step in 0..steps {
        let features = prepared.at(&window(scene, states, step));
        network.forward(&[&features.frame], &mut workspace, &mut prediction);
        let [prediction] = &prediction;
        let off = |got: &[f32], wanted: &[f64]| worst_deviation(got.iter().map(|v| f64::from(*v)), wanted, absolute);
        let own: Vec<f64> = features.tracks.iter().map(|track| f64::from(track.0)).collect();
        let named = tracks[step].iter().map(|index| {
            let track = usize::try_from(*index as i64).ok().and_then(|index| scene.tracks().get(index));
            track.map_or(-1.0, |track| f64::from(track.id.0))
        });
        let named: Vec<f64> = named.filter(|id| *id >= 0.0).collect();
        found.push((TRACKS, f64::from(u8::from(own != named)), step));
        let mode = modes[step] as usize;
        let best = prediction.most_probable();
        let is_other = mode != best && (scores[step][best] - scores[step][mode]).abs() > EQUAL_SCORES;
        found.push((MODE, f64::from(u8::from(is_other)), step));
        found.push((SCORES, off(&prediction.scores, &scores[step]), step));
        if let Some(wanted) = controls.chunks_exact(2 * STEPS).nth(step) {
            found.push((CONTROLS, off(prediction.controls[mode].as_flattened(), wanted), step));
        }
        let size = NEIGHBORS * STEPS * 3;
        if let Some(wanted) = poses.chunks_exact(size).nth(step / EVERY).filter(|_| step % EVERY == 0) {
            found.push((POSES, off(prediction.poses[mode].as_flattened().as_flattened(), wanted), step));
        }
    }
    Ok(found)
}

/// What was known at a step: the log until the drive began, the driven states from then on.
fn window(scene: &Scene, driven: &[[f64; 8]], step: usize) -> Window {
    let state = |index: usize| {
        let [x, y, heading, velocity_x, velocity_y, length, width, height] = driven[index];
        AgentState { x, y, z: 0.0, heading, velocity_x, velocity_y, length, width, height }
    };
    let before = std::array::from_fn(|index| match (step + index).checked_sub(START) {
        Some(index) => Some(state(index)),
        None => scene.av().states.get(step + index).copied().flatten(),
    });
    Window::driven(scene, START + step, state(step), before, step == 0)
}
