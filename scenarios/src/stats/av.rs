//! How the AV drives.

use world::geometry::{Point, angle_difference};
use world::scene::{AgentState, Scene};

use super::every;
use super::quantity::Quantity;
use super::samples::Samples;

/// Length of a step (s), whatever the log's clock says.
const DT: f64 = 0.1;

/// Slower (m/s) is standing.
const STANDING: f64 = 0.3;

pub(super) fn measure(scene: &Scene, samples: &mut Samples) {
    let states: Vec<AgentState> = scene.av().states.iter().flatten().copied().collect();
    whole(&states, samples);
    smooth(&states, samples);
    per_step(&states, samples);
}

/// Path and speed. Speeds are those of the places: first differences.
fn whole(states: &[AgentState], samples: &mut Samples) {
    let steps: Vec<f64> = states.windows(2).map(|pair| pair[0].position().distance(pair[1].position())).collect();
    samples.add(Quantity::AvPath, steps.iter().sum());
    let speeds: Vec<f64> = states.iter().map(|state| state.speed()).collect();
    samples.add(Quantity::AvMaxSpeed, speeds.iter().copied().fold(0.0, f64::max));
    let standing = speeds.iter().filter(|speed| **speed < STANDING).count();
    samples.add(Quantity::AvStanding, standing as f64 / speeds.len() as f64);
    for step in every(5, steps.len()) {
        samples.add(Quantity::AvSpeed, steps[step] / DT);
    }
}

/// Of means over 0.5 s: the gain of speed in the second that follows, and speed by yaw rate.
fn smooth(states: &[AgentState], samples: &mut Samples) {
    let speeds: Vec<f64> = states.iter().map(|state| state.speed()).collect();
    let means: Vec<f64> = speeds.windows(5).map(|five| five.iter().sum::<f64>() / 5.0).collect();
    for step in every(5, means.len().saturating_sub(10)) {
        samples.add(Quantity::AvAcceleration, means[step + 10] - means[step]);
    }
    let lateral: Vec<f64> = states
        .windows(2)
        .map(|pair| pair[0].speed() * angle_difference(pair[0].heading, pair[1].heading) / DT)
        .collect();
    let means: Vec<f64> = lateral.windows(5).map(|five| five.iter().sum::<f64>() / 5.0).collect();
    for step in every(3, means.len()) {
        samples.add(Quantity::AvLateralAcceleration, means[step].abs());
    }
}

/// As the closed-loop test of DIPP's authors has it: from places, without smoothing, along and beside the heading that a step begins
/// with; lateral is the change of the velocity beside it.
fn per_step(states: &[AgentState], samples: &mut Samples) {
    let velocities: Vec<Point> = states
        .windows(2)
        .map(|pair| {
            let velocity = (pair[1].position() - pair[0].position()) * (1.0 / DT);
            let forward = Point::unit(pair[0].heading);
            Point::new(forward.dot(velocity), forward.cross(velocity))
        })
        .collect();
    let differences = |values: &[f64]| values.windows(2).map(|pair| (pair[1] - pair[0]) / DT).collect::<Vec<f64>>();
    let along: Vec<f64> = velocities.iter().map(|velocity| velocity.x).collect();
    let beside: Vec<f64> = velocities.iter().map(|velocity| velocity.y).collect();
    let acceleration = differences(&along);
    let jerk = differences(&acceleration);
    let lateral = differences(&beside);
    for (values, [signed, absolute, mean]) in [
        (&acceleration, [Quantity::AvStepAcceleration, Quantity::AvAbsAcceleration, Quantity::AvMeanAcceleration]),
        (&jerk, [Quantity::AvStepJerk, Quantity::AvAbsJerk, Quantity::AvMeanJerk]),
        (&lateral, [Quantity::AvStepLateral, Quantity::AvAbsLateral, Quantity::AvMeanLateral]),
    ] {
        for step in every(2, values.len()) {
            samples.add(signed, values[step]);
            samples.add(absolute, values[step].abs());
        }
        samples.add(mean, values.iter().map(|value| value.abs()).sum::<f64>() / values.len() as f64);
    }
}
