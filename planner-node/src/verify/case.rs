//! One case of the vectors: its inputs.

use gauss_newton::constants::{NEIGHBORS, STEPS, TERMS};
use gauss_newton::{Controls, InfoColumn, Inputs, Neighbor, Problem, ProblemError, Vehicle};
use vectors::{Npz, NpzError};
use world::vehicle::VehicleState;

/// Sample of the authors' reference line at which they take the AV to be.
const OWN_SAMPLE: usize = 200;

/// Reads the situation of a case.
///
/// # Errors
/// [`CaseError`].
pub fn problem(npz: &Npz) -> Result<Problem, CaseError> {
    let line = npz.array("ref_line", &[None, Some(5)])?;
    let column = |c: usize| -> Vec<f64> { line.iter().skip(c).step_by(5).copied().collect() };
    let (x, y, heading) = (column(0), column(1), column(2));
    let info = InfoColumn::read(&column(4), OWN_SAMPLE);
    let agents = npz.array("current_state", &[Some(NEIGHBORS + 1), Some(8)])?;
    let agents: Vec<&[f64; 8]> = agents.as_chunks::<8>().0.iter().collect();
    let av = agents[0];
    let predictions = npz.array("predictions", &[Some(NEIGHBORS), Some(STEPS), Some(3)])?;
    let positions: Vec<(f64, f64)> = predictions.as_chunks::<3>().0.iter().map(|p| (p[0], p[1])).collect();
    let neighbors: Vec<Option<Neighbor<'_>>> = (0..NEIGHBORS)
        .map(|j| {
            let agent = agents[j + 1];
            let positions = &positions[j * STEPS..(j + 1) * STEPS];
            // The authors' sign of presence: the height.
            (agent[7] != 0.0).then_some(Neighbor {
                length: agent[5],
                width: agent[6],
                positions,
                headings: &[],
                deviations: &[],
            })
        })
        .collect();
    let mut weights = [0.0; TERMS];
    weights.copy_from_slice(npz.array("weights", &[Some(TERMS)])?);
    Ok(Problem::new(&Inputs {
        line_x: &x,
        line_y: &y,
        line_heading: &heading,
        speed_target: info.speed_target,
        speed_targets: None,
        stop_distance: info.stop_distance,
        av: Vehicle {
            state: VehicleState { x: av[0], y: av[1], heading: av[2], speed: libm::hypot(av[3], av[4]) },
            length: av[5],
            width: av[6],
        },
        present: None,
        neighbors: &neighbors,
        weights,
    })?)
}

/// Reads an array of controls, 50 x 2.
///
/// # Errors
/// [`NpzError::Array`].
pub fn controls(npz: &Npz, name: &str) -> Result<Controls, NpzError> {
    Ok(from_interleaved(npz.array(name, &[Some(STEPS), Some(2)])?))
}

/// From a hundred numbers: acceleration, steering angle, acceleration ...
#[must_use]
pub fn from_interleaved(values: &[f64]) -> Controls {
    let mut controls = Controls::ZERO;
    for (t, pair) in values.as_chunks::<2>().0.iter().enumerate().take(STEPS) {
        [controls.acceleration[t], controls.steering[t]] = *pair;
    }
    controls
}

/// Why a case cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum CaseError {
    /// Its file.
    #[error(transparent)]
    Npz(#[from] NpzError),
    /// Its situation.
    #[error("the inputs make no problem: {0}")]
    Problem(#[from] ProblemError),
}
