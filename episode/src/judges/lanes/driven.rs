//! The lanes that the AV drives in: at each sample those that hold its centre, as nuPlan follows them
//! (`metrics/utils/route_extractor.py`, `get_route`), and what is read along them.
//!
//! Where several connectors hold the centre, all are kept until they part. Which of them it was is known when the AV has left them: at
//! the drive's end, [`DrivenLanes::settle`] reads once more with that in mind.

use world::geometry::Point;
use world::plan::STEP_SECONDS;

use super::held::Held;
use super::strip::Lanes;
use crate::judges::Body;

/// Samples of a second, both ends included.
const SECOND: usize = 1 + (1.0 / STEP_SECONDS) as usize;

/// So far (m) from its connectors the AV still follows them while nothing but other connectors hold its centre.
const CUTTING: f64 = 5.0;

/// Stations that are farther apart than this (m) and twice the way that was driven are of two passes of one lane.
const JUMP: f64 = 10.0;

/// What a sample says of the AV along its lanes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Driven {
    /// Metres driven against the lane's direction in the last second, never negative.
    pub backward_travel: f64,
    /// m/s, 0 where it is not known.
    pub speed_limit: f64,
}

/// Follows the AV's centre from lane to lane.
#[derive(Clone, Debug, Default)]
pub(super) struct DrivenLanes {
    /// A sample each: the centre, and the lanes that it is in.
    samples: Vec<(Point, Vec<usize>)>,
    travel: Travel,
    held: Held,
}

impl DrivenLanes {
    /// The next sample, of an AV on ground at the height `ground` (m).
    pub(super) fn read(&mut self, lanes: &Lanes, av: &Body, ground: f64) -> Driven {
        let center = av.outline.center;
        lanes.hold(&mut self.held, center, ground, av.outline.forward);
        let now = self.find(lanes, center);
        let driven = self.travel.read(lanes, center, &now);
        self.samples.push((center, now));
        driven
    }

    /// The lanes of the last sample.
    pub(super) fn now(&self) -> &[usize] {
        self.samples.last().map_or(&[], |(_, lanes)| lanes)
    }

    fn find(&self, lanes: &Lanes, center: Point) -> Vec<usize> {
        let before = self.now();
        let kept = lanes.follow(before, &self.held);
        if !kept.is_empty() {
            return kept;
        }
        let found = lanes.search(&self.held);
        let within_intersection = found.first().is_none_or(|lane| lanes.is_connector(*lane));
        // nuPlan asks this from its third sample on.
        if self.samples.len() > 1 && before.first().is_some_and(|lane| lanes.is_connector(*lane)) && within_intersection
        {
            let near = before.iter().copied().filter(|lane| lanes.distance(*lane, center) < CUTTING);
            let near: Vec<usize> = near.collect();
            if !near.is_empty() {
                return near;
            }
        }
        found
    }

    /// What each sample says when it is known which of several connectors the AV drove (nuPlan: `remove_extra_lane_connectors`).
    pub(super) fn settle(&self, lanes: &Lanes) -> Vec<Driven> {
        let mut route: Vec<&[usize]> = self.samples.iter().map(|(_, lanes)| lanes.as_slice()).collect();
        let mut links: Vec<Vec<usize>> = vec![Vec::new(); route.len()];
        for (index, kept) in links.iter_mut().enumerate().rev().skip(1) {
            let (own, next) = (route[index], route[index + 1]);
            if own.len() < 2 {
                continue;
            }
            if own.len() > next.len() && next.iter().all(|lane| own.contains(lane)) {
                route[index] = next;
            }
            if let Some(next) = next.first().filter(|next| !lanes.is_connector(**next)) {
                kept.extend(own.iter().copied().filter(|lane| lanes.entries(*next).contains(lane)));
            }
            if !kept.is_empty() {
                route[index] = kept;
            }
        }
        let mut travel = Travel::default();
        self.samples.iter().zip(route).map(|((center, _), driven)| travel.read(lanes, *center, driven)).collect()
    }
}

/// Measures travel along the first of the AV's lanes (nuPlan: `driving_direction_compliance.py`).
#[derive(Clone, Debug, Default)]
struct Travel {
    begun: bool,
    /// The lane that was last driven in.
    lane: Option<usize>,
    /// Where the AV was, and its station (m) in the lane, if the way from there counts.
    last: Option<(Point, f64)>,
    /// Travel (m) at each of the last samples.
    ways: [f64; SECOND],
    next: usize,
}

impl Travel {
    fn read(&mut self, lanes: &Lanes, center: Point, driven: &[usize]) -> Driven {
        self.ways[self.next] = driven.first().map_or(0.0, |lane| self.way(lanes, *lane, center));
        self.next = (self.next + 1) % SECOND;
        self.begun = true;
        Driven { backward_travel: (-self.ways.iter().sum::<f64>()).max(0.0), speed_limit: lanes.speed_limit(driven) }
    }

    /// None at the first two samples in a new lane, but for the very first of the drive; none to the lane's very start.
    fn way(&mut self, lanes: &Lanes, lane: usize, center: Point) -> f64 {
        if self.begun && self.lane != Some(lane) {
            (self.lane, self.last) = (Some(lane), None);
            return 0.0;
        }
        self.lane = Some(lane);
        let station = lanes.station(lane, center);
        let Some((from, before)) = self.last.replace((center, station)).filter(|_| station != 0.0) else { return 0.0 };
        let way = station - before;
        // A lane that passes a place twice, as a circle does where it closes: the other pass is the nearer one now.
        let moved = center - from;
        if way.abs() > JUMP + 2.0 * center.distance(from) { moved.dot(lanes.direction(lane, center)) } else { way }
    }
}
