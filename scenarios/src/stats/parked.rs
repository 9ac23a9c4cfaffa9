//! Vehicles that stay where they are, and how far beside the lanes.

use std::f64::consts::PI;

use world::geometry::{Point, Pose};
use world::map_matching::LanePoints;
use world::scene::{AgentKind, Scene};

use super::quantity::{Quantity, Share};
use super::roadway::Roadway;
use super::samples::Samples;
use super::{every, others};

/// A vehicle seen at fewer steps tells nothing of whether it is parked: 5 s.
const SEEN: usize = 50;

/// What stays within this (m) of where it was first seen does not move.
const STAYS: f64 = 1.0;

/// Steps between two looks at who is on a lane: 1 s.
const STRIDE: usize = 10;

/// How far (m) from the AV that is looked at.
const NEAR: f64 = 60.0;

pub(super) fn measure(scene: &Scene, roadway: &Roadway, samples: &mut Samples) {
    let points = LanePoints::new(scene.map(), |_| true);
    for track in others(scene).filter(|track| track.kind == AgentKind::Vehicle) {
        let mut states = track.states.iter().flatten();
        let Some(first) = states.next().map(|state| state.position()) else { continue };
        if states.clone().count() + 1 < SEEN {
            continue;
        }
        let stays = states.all(|state| state.position().distance(first) < STAYS);
        samples.look(Share::Parked, stays);
        if let Some(distance) = distance_to_lane(&points, first) {
            samples.add(if stays { Quantity::ParkedToLane } else { Quantity::MovingToLane }, distance);
        }
    }
    for step in every(STRIDE, scene.steps()) {
        let Some(av) = scene.av().states[step].map(|state| state.position()) else { continue };
        let vehicles = others(scene).filter(|track| track.kind == AgentKind::Vehicle);
        for state in vehicles.filter_map(|track| track.states[step]) {
            if state.position().distance(av) <= NEAR {
                samples.look(Share::OnLane, roadway.lane_of(state.pose()).is_some());
            }
        }
    }
}

/// Distance (m) to the nearest point of any lane, one for bicycles or of another direction too; none where there is no lane.
fn distance_to_lane(points: &LanePoints, place: Point) -> Option<f64> {
    points.nearest(Pose::new(place.x, place.y, 0.0), f64::INFINITY, PI).map(|nearest| nearest.distance)
}
