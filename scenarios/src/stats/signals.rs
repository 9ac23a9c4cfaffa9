//! What signals show, how long, and where they stand.

use std::collections::BTreeMap;

use world::geometry::Point;
use world::map::MapId;
use world::scene::Scene;
use world::signal::SignalState;

use super::quantity::{Quantity, Share};
use super::roadway::course;
use super::samples::Samples;

/// Stop points within this of each other (m), by way of others or not, belong to one junction.
const JUNCTION: f64 = 60.0;

/// Length of a step (s).
const DT: f64 = 0.1;

pub(super) fn measure(scene: &Scene, samples: &mut Samples) {
    let mut shown: BTreeMap<MapId, Vec<(usize, SignalState)>> = BTreeMap::new();
    let mut stops: BTreeMap<MapId, Point> = BTreeMap::new();
    let mut with = 0;
    for step in 0..scene.steps() {
        let signals = scene.signals(step);
        with += usize::from(!signals.is_empty());
        for signal in signals {
            entry(signal.state, samples);
            shown.entry(signal.lane).or_default().push((step, signal.state));
            stops.entry(signal.lane).or_insert_with(|| signal.stop_point.xy());
        }
    }
    samples.add_count(Quantity::SignalLanes, shown.len());
    samples.look(Share::WithSignals, with > 0);
    if with > 0 {
        samples.add(Quantity::SignalSteps, with as f64 / scene.steps() as f64);
    }
    for states in shown.values() {
        let changes = states.windows(2).filter(|pair| pair[0].1 != pair[1].1).count();
        samples.add_count(Quantity::SignalChanges, changes);
        yellow(states, samples);
    }
    for lane in scene.map().lanes.iter().filter(|lane| shown.contains_key(&lane.id)) {
        if let Some(course) = course(lane) {
            samples.add(Quantity::ControlledLength, course.length());
        }
    }
    junctions(&stops.into_values().collect::<Vec<_>>(), samples);
}

fn entry(state: SignalState, samples: &mut Samples) {
    let [red, yellow, green] = match state {
        SignalState::Stop | SignalState::ArrowStop | SignalState::FlashingStop => [true, false, false],
        SignalState::Caution | SignalState::ArrowCaution | SignalState::FlashingCaution => [false, true, false],
        SignalState::Go | SignalState::ArrowGo => [false, false, true],
        SignalState::Unknown => [false; 3],
    };
    let known = state != SignalState::Unknown;
    for (share, of_known, so) in [
        (Share::Red, Share::RedOfKnown, red),
        (Share::Yellow, Share::YellowOfKnown, yellow),
        (Share::Green, Share::GreenOfKnown, green),
    ] {
        samples.look(share, so);
        if known {
            samples.look(of_known, so);
        }
    }
    samples.look(Share::Unknown, !known);
}

/// How long yellow is shown, where its end is seen.
fn yellow(states: &[(usize, SignalState)], samples: &mut Samples) {
    let mut runs: Vec<_> = states.chunk_by(|before, after| before.1 == after.1).collect();
    runs.pop(); // the log's end cuts it off
    for run in runs {
        let quantity = match run[0].1 {
            SignalState::ArrowCaution => Quantity::ArrowCautionTime,
            SignalState::Caution => Quantity::CautionTime,
            _ => continue,
        };
        samples.add(quantity, run.len() as f64 * DT);
    }
}

/// Stop points that hang together, and how far the next such group is.
fn junctions(stops: &[Point], samples: &mut Samples) {
    let mut group: Vec<usize> = (0..stops.len()).collect();
    for (index, stop) in stops.iter().enumerate() {
        for other in 0..index {
            if stop.distance(stops[other]) <= JUNCTION && group[index] != group[other] {
                let (from, to) = (group[index], group[other]);
                group.iter_mut().filter(|group| **group == from).for_each(|group| *group = to);
            }
        }
    }
    let mut centers: BTreeMap<usize, (Point, f64)> = BTreeMap::new();
    for (stop, group) in stops.iter().zip(&group) {
        let (sum, number) = centers.entry(*group).or_default();
        (*sum, *number) = (*sum + *stop, *number + 1.0);
    }
    let centers: Vec<Point> = centers
        .into_values()
        .map(|(sum, number)| {
            samples.add(Quantity::LanesPerJunction, number);
            sum * (1.0 / number)
        })
        .collect();
    for (index, center) in centers.iter().enumerate() {
        let others = centers.iter().enumerate().filter(|(other, _)| *other != index);
        let next = others.map(|(_, other)| center.distance(*other)).fold(f64::INFINITY, f64::min);
        samples.add(Quantity::NextJunction, next);
    }
}
