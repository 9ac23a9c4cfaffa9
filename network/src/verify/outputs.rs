//! The network's outputs against those of another implementation, from the same inputs.

use vectors::{Npz, NpzError, Quantity, absolute, worst_deviation};

use crate::constants::{
    AGENTS, COST_WEIGHTS, CROSSWALK_ROW, CROSSWALKS, FUTURES, HISTORY, LANE_ROW, LANES, NEIGHBOR_ROW, NEIGHBORS,
    POINTS, STATE, STEPS,
};
use crate::frame::{Frame, Prediction};

const CONTROLS: Quantity = Quantity::within("controls", 1e-5, "abs");
const POSES: Quantity = Quantity::within("predictions", 1e-4, "abs");
const SCORES: Quantity = Quantity::within("scores", 2e-5, "abs");
const COST: Quantity = Quantity::within("cost weights", 1e-6, "abs");

/// What is compared, with the tolerances that single precision is asked for.
pub(super) const QUANTITIES: [Quantity; 4] = [CONTROLS, POSES, SCORES, COST];

/// The frame whose four tensors a file has; what is there shows in their zeros.
///
/// # Errors
/// [`NpzError`] where a tensor is missing or of another shape.
pub fn frame(npz: &Npz) -> Result<Frame, NpzError> {
    let mut frame = Frame::empty();
    fill(npz, "ego", &[HISTORY, STATE], frame.ego.as_flattened_mut())?;
    let neighbors = frame.neighbors.as_flattened_mut().as_flattened_mut();
    fill(npz, "neighbors", &[NEIGHBORS, HISTORY, NEIGHBOR_ROW], neighbors)?;
    let lanes = frame.lanes.as_flattened_mut().as_flattened_mut();
    fill(npz, "map_lanes", &[AGENTS, LANES, POINTS, LANE_ROW], lanes)?;
    let crosswalks = frame.crosswalks.as_flattened_mut().as_flattened_mut();
    fill(npz, "map_crosswalks", &[AGENTS, CROSSWALKS, POINTS, CROSSWALK_ROW], crosswalks)?;
    frame.presence = frame.presence_by_zeros();
    Ok(frame)
}

fn fill(npz: &Npz, name: &str, shape: &[usize], tensor: &mut [f32]) -> Result<(), NpzError> {
    let shape: Vec<Option<usize>> = shape.iter().map(|axis| Some(*axis)).collect();
    for (own, value) in tensor.iter_mut().zip(npz.array(name, &shape)?) {
        *own = *value as f32;
    }
    Ok(())
}

/// How far an answer is from the one that a file has, in double precision where it has that.
pub(super) fn deviations(npz: &Npz, prediction: &Prediction) -> Result<Vec<(Quantity, f64)>, NpzError> {
    let array = |name: &str, shape: &[usize]| {
        let shape: Vec<Option<usize>> = shape.iter().map(|axis| Some(*axis)).collect();
        let double = format!("{name}_f64");
        npz.array(if npz.has(&double) { &double } else { name }, &shape)
    };
    let off =
        |got: &[f32], wanted: &[f64]| worst_deviation(got.iter().map(|value| f64::from(*value)), wanted, absolute);
    let poses = prediction.poses.as_flattened().as_flattened().as_flattened();
    let mut found = vec![
        (CONTROLS, off(prediction.controls.as_flattened().as_flattened(), array("plans", &[FUTURES, STEPS, 2])?)),
        (POSES, off(poses, array("predictions", &[FUTURES, NEIGHBORS, STEPS, 3])?)),
        (SCORES, off(&prediction.scores, array("scores", &[FUTURES])?)),
    ];
    if let Some(weights) = &prediction.cost_weights {
        found.push((COST, off(weights, array("cost_weights", &[COST_WEIGHTS])?)));
    }
    Ok(found)
}
