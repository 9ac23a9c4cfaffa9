//! How large road users are: the median over each track's states.

use world::scene::{AgentKind, AgentState, Scene, Track};

use super::quantity::{Quantity, Share};
use super::samples::Samples;

pub(super) fn measure(scene: &Scene, samples: &mut Samples) {
    for track in scene.tracks() {
        let quantities = match track.kind {
            AgentKind::Vehicle => [Quantity::VehicleLength, Quantity::VehicleWidth, Quantity::VehicleHeight],
            AgentKind::Pedestrian => {
                [Quantity::PedestrianLength, Quantity::PedestrianWidth, Quantity::PedestrianHeight]
            }
            AgentKind::Cyclist => [Quantity::CyclistLength, Quantity::CyclistWidth, Quantity::CyclistHeight],
            AgentKind::Other => continue,
        };
        let measures: [fn(&AgentState) -> f64; 3] = [|state| state.length, |state| state.width, |state| state.height];
        for (quantity, measure) in quantities.into_iter().zip(measures) {
            if let Some(median) = median(track, measure) {
                samples.add(quantity, median);
            }
        }
        if track.kind == AgentKind::Vehicle
            && let Some(length) = median(track, |state| state.length)
        {
            samples.look(Share::LongerThan6, length > 6.5);
            samples.look(Share::LongerThan10, length > 10.0);
            samples.look(Share::ShorterThan3, length < 3.5);
        }
    }
}

fn median(track: &Track, measure: fn(&AgentState) -> f64) -> Option<f64> {
    let mut all: Vec<f64> = track.states.iter().flatten().map(measure).collect();
    all.sort_unstable_by(f64::total_cmp);
    let upper = *all.get(all.len() / 2)?;
    Some(if all.len() % 2 == 1 { upper } else { 0.5 * (all[all.len() / 2 - 1] + upper) })
}
