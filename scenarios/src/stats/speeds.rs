//! How fast road users move, and how vehicles gain and lose speed.

use world::scene::{AgentKind, Scene, Track};

use super::quantity::Quantity;
use super::samples::Samples;
use super::{MOVING, every, others};

/// Steps between two looks: 0.5 s.
const STRIDE: usize = 5;

/// A pedestrian that is faster (m/s) moves.
const WALKING: f64 = 0.2;

/// A larger acceleration (m/s^2) is noise.
const OUTLIER: f64 = 10.0;

pub(super) fn measure(scene: &Scene, samples: &mut Samples) {
    for track in others(scene) {
        let (quantity, faster) = match track.kind {
            AgentKind::Vehicle => (Quantity::VehicleSpeed, MOVING),
            AgentKind::Pedestrian => (Quantity::PedestrianSpeed, WALKING),
            AgentKind::Cyclist => (Quantity::CyclistSpeed, MOVING),
            AgentKind::Other => continue,
        };
        for step in every(STRIDE, scene.steps()) {
            let Some(speed) = track.states[step].map(|state| state.speed()).filter(|speed| *speed > faster) else {
                continue;
            };
            samples.add(quantity, speed);
            if track.kind == AgentKind::Vehicle
                && let Some(acceleration) = acceleration(track, step).filter(|a| a.abs() <= OUTLIER)
            {
                samples.add(Quantity::VehicleAcceleration, acceleration);
            }
        }
    }
}

/// Gain of speed (m/s^2) over the last 0.5 s, of means of 0.3 s; none where a state of them is missing, as at a track's ends: means
/// that take what is not there for 0 would make every car jump off.
fn acceleration(track: &Track, step: usize) -> Option<f64> {
    Some((mean_speed(track, step)? - mean_speed(track, step.checked_sub(5)?)?) / 0.5)
}

/// The mean of three steps, of which this is the middle one.
fn mean_speed(track: &Track, step: usize) -> Option<f64> {
    let speed = |step: usize| track.states.get(step).copied().flatten().map(|state| state.speed());
    Some((speed(step.checked_sub(1)?)? + speed(step)? + speed(step + 1)?) / 3.0)
}
