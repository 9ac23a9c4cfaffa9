//! The scene driven, seen and written down, unless a mishap says that it must be driven anew.

use world::geometry::{OrientedBox, Point, Pose, boxes_overlap, wrap_angle};
use world::scene::{AgentKind, SceneParts, Track};
use world::signal::{Signal, SignalState};

use super::mishap::Mishap;
use super::{AV, Stage};
use crate::generated::STEPS;
use crate::generated::draw::Draw;
use crate::generated::perception::{Actor, perceive};
use crate::generated::traffic::{Vehicle, Walker};

impl Stage<'_> {
    /// Drives all, and answers the scene, unless something happened that must not.
    pub(in crate::generated) fn play(mut self) -> Result<SceneParts, Mishap> {
        self.fill();
        self.traffic.run(watch)?;
        let (av, actors) = self.actors()?;
        if poses_apart(&av) < MOVES {
            return Err(Mishap::AvStands);
        }
        let mut draw = self.draw.stream(3);
        let ahead = self.ways_on();
        let clarity = draw.parameter("clarity");
        let (tracks, violators) = perceive(&actors, &av, &ahead, clarity, &mut draw);
        if let Some((one, other)) = touching(&tracks) {
            return Err(Mishap::Touch(one, other));
        }
        let signals = self.signals(&av, &mut draw);
        Ok(SceneParts {
            timestamps: (0..STEPS).map(|step| step as f64 / 10.0).collect(),
            av_index: tracks.len() - 1,
            tracks,
            objects_of_interest: violators,
            signals,
            map: self.roads.map.clone(),
            ..SceneParts::default()
        })
    }

    /// The AV, and the others: what they did, taken out of the traffic.
    fn actors(&mut self) -> Result<(Actor, Vec<Actor>), Mishap> {
        let jostled = jostled(&self.traffic.walkers);
        let mut vehicles = self.traffic.vehicles.iter_mut().enumerate().map(|(index, vehicle)| Actor {
            kind: vehicle.kind,
            size: vehicle.size,
            poses: std::mem::take(&mut vehicle.poses),
            matters: index == AV || self.vehicles_that_matter.contains(&index),
            violator: vehicle.violator,
        });
        let av = vehicles.next().ok_or(Mishap::AvLeaves)?;
        let walkers = self.traffic.walkers.iter_mut().enumerate().filter(|(index, _)| !jostled[*index]);
        let walkers = walkers.map(|(index, walker)| Actor {
            kind: AgentKind::Pedestrian,
            size: walker.size,
            poses: std::mem::take(&mut walker.poses),
            matters: self.walkers_that_matter.contains(&index),
            violator: walker.heedless,
        });
        let parked = self.parked.iter().map(|(pose, size)| Actor {
            kind: AgentKind::Vehicle,
            size: *size,
            poses: vec![Some(*pose)],
            matters: false,
            violator: false,
        });
        Ok((av, vehicles.chain(walkers).chain(parked).collect()))
    }

    /// Where the AV could go on from where the log ends, whichever way it turns.
    fn ways_on(&self) -> Vec<Point> {
        let av = &self.traffic.vehicles[AV];
        let mut points = Vec::new();
        let mut next = vec![(av.lane(), av.station, 0.0)];
        while let Some((lane, from, way)) = next.pop() {
            let here = &self.roads.lanes[lane];
            let (mut station, mut driven) = (from, way);
            while station < here.course.length() && driven < SEEN_TO_THE_RIM {
                points.push(here.course.pose(station).position());
                station += 4.0;
                driven += 4.0;
            }
            let end = way + here.course.length() - from;
            if end < SEEN_TO_THE_RIM && points.len() < 3000 {
                next.extend(here.exits.iter().map(|exit| (*exit, 0.0, end)));
            }
        }
        points
    }

    /// What the lights show, listed while the AV sees them; now and then one is not made out.
    fn signals(&self, av: &Actor, draw: &mut Draw) -> Vec<Vec<Signal>> {
        let mut all = vec![Vec::new(); STEPS];
        let own = &self.traffic.vehicles[AV].route.lanes;
        for (junction, programme) in self.roads.junctions.iter().zip(&self.traffic.programmes) {
            let Some(programme) = programme else { continue };
            let middle = self.place.town.nodes[junction.node].at;
            let sight = draw.between(75.0, 125.0);
            let dim: Vec<bool> = junction
                .ways
                .iter()
                .map(|way| {
                    // The light that the AV itself goes by is made out: without it nobody could be judged.
                    draw.chance(0.25) && !own.contains(way)
                })
                .collect();
            for (step, signals) in all.iter_mut().enumerate() {
                let Some(pose) = av.poses[step] else { continue };
                let ahead = (middle - pose.position()).dot(Point::unit(pose.heading));
                let distance = middle.distance(pose.position());
                if distance > sight || ahead < -22.0 {
                    continue;
                }
                for (index, lane) in junction.ways.iter().enumerate() {
                    let lane = &self.roads.lanes[*lane];
                    let Some(way) = lane.way.filter(|_| !lane.bike) else { continue };
                    let state = programme.shows(way, step as i32);
                    let state = if dim[index] && distance > 22.0 { SignalState::Unknown } else { state };
                    let start = lane.course.start();
                    let stop_point = world::geometry::Point3::new(start.x, start.y, 0.0);
                    signals.push(Signal { lane: lane.id, state, stop_point });
                }
            }
        }
        all
    }
}

/// Which of the people are not there after all: they do not mind one another as they walk along, and of two who would walk through each other one
/// is left out; never one who crosses.
fn jostled(walkers: &[Walker]) -> Vec<bool> {
    const APART: f64 = 1.25;
    let reaches: Vec<[Point; 2]> = walkers
        .iter()
        .map(|walker| {
            let points = walker.poses.iter().flatten().map(|pose| pose.position());
            points.fold(
                [Point::new(f64::INFINITY, f64::INFINITY), Point::new(f64::NEG_INFINITY, f64::NEG_INFINITY)],
                |[low, high], at| {
                    [Point::new(low.x.min(at.x), low.y.min(at.y)), Point::new(high.x.max(at.x), high.y.max(at.y))]
                },
            )
        })
        .collect();
    let may_meet = |[low, high]: &[Point; 2], [other_low, other_high]: &[Point; 2]| {
        low.x - APART < other_high.x
            && other_low.x - APART < high.x
            && low.y - APART < other_high.y
            && other_low.y - APART < high.y
    };
    let meet = |one: &Walker, other: &Walker| {
        one.poses.iter().zip(&other.poses).any(|poses| match poses {
            (Some(one), Some(other)) => one.position().distance(other.position()) < APART,
            _ => false,
        })
    };
    let is_jostled = |index: usize| {
        walkers[index].crossing.is_none()
            && walkers.iter().enumerate().any(|(other_index, other)| {
                (other.crossing.is_some() || other_index < index)
                    && may_meet(&reaches[index], &reaches[other_index])
                    && meet(&walkers[index], other)
            })
    };
    (0..walkers.len()).map(is_jostled).collect()
}

/// What must not happen at a step of the log, as far as it shows in the poses of those on wheels.
fn watch(vehicles: &[Vehicle], step: usize) -> Result<(), Mishap> {
    let av = &vehicles[AV].poses;
    let Some(here) = av[step] else { return Err(Mishap::AvLeaves) };
    let before = step.checked_sub(1);
    if before.and_then(|before| av[before]).is_some_and(|before| steers_too_far(&before, &here)) {
        return Err(Mishap::TooTight);
    }
    for vehicle in &vehicles[AV + 1..] {
        if is_hurled(vehicle, step) {
            return Err(Mishap::Hurled);
        }
        if before.is_some_and(|before| ends_before(vehicle, &vehicles[AV], before)) {
            return Err(Mishap::Rim);
        }
    }
    Ok(())
}

/// Whether the AV's bicycle would have had to steer by more than 0.47 rad (0.5 rad is the bound of a drive) with its wheelbase of 3.089 m.
fn steers_too_far(from: &Pose, to: &Pose) -> bool {
    let moved = from.position().distance(to.position());
    moved > 0.02 && wrap_angle(to.heading - from.heading).abs() * 3.089 > 0.47 * moved
}

/// Whether somebody on wheels has turned tighter or faster than wheels hold: over half a second, with a wheelbase of 0.6 times the length.
fn is_hurled(vehicle: &Vehicle, step: usize) -> bool {
    const WINDOW: usize = 5;
    let Some(from) = step.checked_sub(WINDOW).and_then(|from| vehicle.poses[from]) else { return false };
    let Some(to) = vehicle.poses[step] else { return false };
    let moved = from.position().distance(to.position());
    moved > 0.9 && {
        let turned = wrap_angle(to.heading - from.heading).abs();
        0.6 * vehicle.size[0] * turned > 0.85 * moved || turned * moved > 6.5 * 0.25
    }
}

/// Whether `last` was the last step of somebody on wheels, who came to the rim of the map in sight of the AV, ahead of it.
fn ends_before(vehicle: &Vehicle, av: &Vehicle, last: usize) -> bool {
    let (Some(pose), None, Some(av)) = (vehicle.poses[last], vehicle.poses[last + 1], av.poses[last]) else {
        return false;
    };
    let at = av.to_body(pose.position());
    at.x > 0.0 && at.norm() < SEEN_TO_THE_RIM && at.y.abs() < 12.0
}

/// How far somebody gets from where it began, at most (m).
fn poses_apart(actor: &Actor) -> f64 {
    let mut poses = actor.poses.iter().flatten().map(|pose| pose.position());
    let first = poses.next().unwrap_or_default();
    poses.map(|point| point.distance(first)).fold(0.0, f64::max)
}

/// The AV moves at least so far (m): otherwise there is nothing to drive.
const MOVES: f64 = 8.0;

/// The map goes on for so far (m) ahead of the AV, or it is another town's.
const SEEN_TO_THE_RIM: f64 = 65.0;

/// The first two whose boxes overlap.
fn touching(tracks: &[Track]) -> Option<(AgentKind, AgentKind)> {
    let mut boxes: Vec<(OrientedBox, f64, AgentKind)> = Vec::new();
    (0..STEPS).find_map(|step| {
        boxes.clear();
        boxes.extend(tracks.iter().filter_map(|track| {
            let body = track.states[step]?.oriented_box();
            Some((body, body.radius(), track.kind))
        }));
        boxes.iter().enumerate().find_map(|(index, (one, reach, kind))| {
            boxes[index + 1..].iter().find_map(|(other, other_reach, other_kind)| {
                let near = reach + other_reach;
                let apart = (one.center - other.center).norm_squared() > near * near || !boxes_overlap(one, other);
                (!apart).then_some((*kind, *other_kind))
            })
        })
    })
}
