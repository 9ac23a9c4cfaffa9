//! How many there are: in the scene, at one step, near the AV.

use world::scene::{AgentKind, Scene};

use super::quantity::Quantity;
use super::samples::Samples;
use super::{MOVING, every, others};

/// Steps between two looks: 1 s.
const STRIDE: usize = 10;

pub(super) fn measure(scene: &Scene, samples: &mut Samples) {
    let tracks = scene.tracks();
    let of = |kind: AgentKind| tracks.iter().filter(|track| track.kind == kind).count();
    samples.add_count(Quantity::Vehicles, of(AgentKind::Vehicle));
    samples.add_count(Quantity::Pedestrians, of(AgentKind::Pedestrian));
    samples.add_count(Quantity::Cyclists, of(AgentKind::Cyclist));
    samples.add_count(Quantity::Tracks, tracks.len());
    for track in tracks {
        let valid = track.states.iter().flatten().count();
        if valid > 0 {
            samples.add(Quantity::ShareValid, valid as f64 / scene.steps() as f64);
        }
    }
    for step in every(STRIDE, scene.steps()) {
        samples.add_count(Quantity::TracksValid, tracks.iter().filter(|track| track.states[step].is_some()).count());
        near_av(scene, step, samples);
    }
}

fn near_av(scene: &Scene, step: usize, samples: &mut Samples) {
    let Some(av) = scene.av().states[step].map(|state| state.position()) else { return };
    let near = |kind: AgentKind, radius: f64, faster: f64| {
        let states = others(scene).filter(|track| track.kind == kind).filter_map(|track| track.states[step]);
        states.filter(|state| state.position().distance(av) <= radius && state.speed() > faster).count()
    };
    samples.add_count(Quantity::VehiclesWithin50, near(AgentKind::Vehicle, 50.0, -1.0));
    samples.add_count(Quantity::MovingWithin50, near(AgentKind::Vehicle, 50.0, MOVING));
    samples.add_count(Quantity::PedestriansWithin50, near(AgentKind::Pedestrian, 50.0, -1.0));
    samples.add_count(Quantity::CyclistsWithin50, near(AgentKind::Cyclist, 50.0, -1.0));
    samples.add_count(Quantity::VehiclesWithin100, near(AgentKind::Vehicle, 100.0, -1.0));
}
