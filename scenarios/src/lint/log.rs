//! What is odd in the log: time, jumps, signals, speed limits.

use world::plan::STEP_SECONDS;
use world::scene::Scene;

use super::{Lint, Steps};

/// Farther than this in a step nobody goes (m): 144 km/h.
const TELEPORT: f64 = 4.0;
/// Steps that differ from 0.1 s by less are regular (s).
const TIME_TOLERANCE: f64 = 0.025;
/// The strict protocol's last log index, and one.
const STEPS_OF_A_DRIVE: usize = 170;

pub(super) fn lint(scene: &Scene, lints: &mut Vec<Lint>) {
    teleports(scene, lints);
    time(scene, lints);
    let steps = scene.steps();
    if steps < STEPS_OF_A_DRIVE {
        lints.push(Lint::Short { steps });
    }
    match (0..steps).filter(|step| !scene.signals(*step).is_empty()).count() {
        // Lanes are interpolated where roads meet.
        0 if scene.map().lanes.iter().any(|lane| lane.interpolating) => lints.push(Lint::NoSignals),
        with if 0 < with && with < steps => lints.push(Lint::PartialSignals { with, steps }),
        _ => {}
    }
}

/// A dropped frame makes a longer step: what counts is the way in 0.1 s.
fn teleports(scene: &Scene, lints: &mut Vec<Lint>) {
    let times = scene.timestamps();
    for track in scene.tracks() {
        let (mut steps, mut farthest) = (Steps::default(), 0.0_f64);
        for step in 1..track.states.len() {
            let (Some(before), Some(now)) = (track.states[step - 1], track.states[step]) else { continue };
            let meters = before.position().distance(now.position());
            let tenths = ((times[step] - times[step - 1]) / STEP_SECONDS).max(1.0);
            if meters > TELEPORT * tenths {
                steps.push(step);
                farthest = farthest.max(meters);
            }
        }
        if !steps.is_empty() {
            lints.push(Lint::Teleport { track: track.id, steps, meters: farthest });
        }
    }
}

fn time(scene: &Scene, lints: &mut Vec<Lint>) {
    let steps = || scene.timestamps().windows(2).map(|pair| pair[1] - pair[0]).enumerate();
    let shortest = steps().map(|(_, seconds)| seconds).fold(f64::INFINITY, f64::min);
    let (index, longest) = steps().fold((0, 0.0), |best, step| if step.1 > best.1 { step } else { best });
    if longest > STEP_SECONDS + TIME_TOLERANCE || shortest < STEP_SECONDS - TIME_TOLERANCE {
        lints.push(Lint::IrregularTime { shortest, longest, step: index + 1 });
    }
}
