//! How near vehicles follow each other on their lanes.

use std::cmp::Reverse;
use std::collections::{BTreeSet, BinaryHeap};

use world::scene::{AgentKind, AgentState, Scene};

use super::quantity::Quantity;
use super::roadway::{OnLane, Roadway};
use super::samples::Samples;
use super::{MOVING, every};

/// Steps between two looks at followers: 1 s.
const STRIDE: usize = 10;

/// Steps between two looks at queues, which change little: 5 s.
const QUEUE_STRIDE: usize = 50;

/// A leader further ahead (m, centre to centre) is none.
const REACH: f64 = 80.0;

/// A wider gap (m) is free driving.
const FOLLOWING: f64 = 60.0;

/// A follower that is faster (m/s) has a headway.
const FOLLOWS: f64 = 2.0;

pub(super) fn measure(scene: &Scene, roadway: &Roadway, samples: &mut Samples) {
    for step in every(STRIDE, scene.steps()) {
        let lanes = Lanes::at(scene, roadway, step);
        for follower in &lanes.vehicles {
            let Some((leader, distance)) = lanes.leader(roadway, follower) else { continue };
            let gap = distance - 0.5 * (follower.state.length + leader.state.length);
            let speeds = (follower.state.speed(), leader.state.speed());
            take(samples, gap, speeds, step % QUEUE_STRIDE == 0);
            if follower.track == scene.av_index() && speeds.0 > FOLLOWS {
                samples.add(Quantity::AvGap, gap);
                samples.add(Quantity::AvHeadway, gap / speeds.0);
            }
        }
    }
}

fn take(samples: &mut Samples, gap: f64, (follower, leader): (f64, f64), queue: bool) {
    let mut both = |[of_gap, of_headway]: [Quantity; 2]| {
        samples.add(of_gap, gap);
        samples.add(of_headway, gap / follower);
    };
    if follower > FOLLOWS {
        both([Quantity::Gap, Quantity::Headway]);
        if gap < FOLLOWING {
            if leader > FOLLOWS {
                both([Quantity::GapBothMoving, Quantity::HeadwayBothMoving]);
            }
            both(match follower {
                ..5.0 => [Quantity::Gap2To5, Quantity::Headway2To5],
                ..10.0 => [Quantity::Gap5To10, Quantity::Headway5To10],
                ..15.0 => [Quantity::Gap10To15, Quantity::Headway10To15],
                _ => [Quantity::GapOver15, Quantity::HeadwayOver15],
            });
        }
    } else if queue && follower < MOVING && leader < MOVING {
        samples.add(Quantity::QueueGap, gap);
    }
}

/// A vehicle on a lane.
#[derive(Clone, Copy)]
struct Vehicle {
    track: usize,
    state: AgentState,
    on: OnLane,
}

/// Who is on which lane at one step, by lane and then along it.
struct Lanes {
    vehicles: Vec<Vehicle>,
}

impl Lanes {
    fn at(scene: &Scene, roadway: &Roadway, step: usize) -> Self {
        let vehicles = scene.tracks().iter().enumerate().filter(|(_, track)| track.kind == AgentKind::Vehicle);
        let on_lane = vehicles.filter_map(|(track, states)| {
            let state = states.states[step]?;
            Some(Vehicle { track, state, on: roadway.lane_of(state.pose())? })
        });
        let mut vehicles: Vec<Vehicle> = on_lane.collect();
        vehicles.sort_by(|a, b| a.on.lane.cmp(&b.on.lane).then(a.on.station.total_cmp(&b.on.station)));
        Self { vehicles }
    }

    /// The first vehicle on `lane` past `station`.
    fn next(&self, lane: usize, station: f64) -> Option<&Vehicle> {
        let past = |vehicle: &Vehicle| (vehicle.on.lane, vehicle.on.station) <= (lane, station);
        self.vehicles.get(self.vehicles.partition_point(past)).filter(|vehicle| vehicle.on.lane == lane)
    }

    /// The nearest vehicle ahead on the lane of `follower` or the lanes that it leads to, and the way to it (m).
    fn leader(&self, roadway: &Roadway, follower: &Vehicle) -> Option<(&Vehicle, f64)> {
        let OnLane { lane, station } = follower.on;
        if let Some(next) = self.next(lane, station) {
            let distance = next.on.station - station;
            return (distance <= REACH).then_some((next, distance));
        }
        let graph = roadway.graph();
        let mut open = BinaryHeap::new();
        let mut seen = BTreeSet::from([lane]);
        let mut best: Option<(&Vehicle, f64)> = None;
        let mut leave = |lane: usize, way: f64, open: &mut BinaryHeap<_>| {
            if way <= REACH {
                // Ways are never negative, so their bits sort as they do.
                let exits = graph.successors(lane).iter().filter(|exit| seen.insert(**exit));
                open.extend(exits.map(|exit| Reverse((way.to_bits(), *exit))));
            }
        };
        leave(lane, graph.length(lane) - station, &mut open);
        while let Some(Reverse((bits, lane))) = open.pop() {
            let way = f64::from_bits(bits);
            match self.next(lane, -1.0) {
                Some(next) => {
                    let distance = way + next.on.station;
                    if distance <= REACH && best.is_none_or(|(_, least)| distance < least) {
                        best = Some((next, distance));
                    }
                }
                None => leave(lane, way + graph.length(lane), &mut open),
            }
        }
        best
    }
}
