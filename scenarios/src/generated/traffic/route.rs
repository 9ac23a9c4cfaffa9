//! The lanes that somebody is going to drive, and how fast they can be driven.

use std::iter::Peekable;

use crate::generated::draw::Draw;
use crate::generated::roads::{LaneIndex, Roads, Turn, Way};

use super::driver::Driver;

/// Speed caps are kept for every so many metres of a route.
const SPACING: f64 = 2.0;

/// Routes are planned this far (m).
const REACH: f64 = 700.0;

/// A way through the lanes.
#[derive(Clone, Debug)]
pub(in crate::generated) struct Route {
    pub(in crate::generated) lanes: Vec<LaneIndex>,
    /// Where each begins along the route (m).
    pub(in crate::generated) starts: Vec<f64>,
    caps: Vec<f64>,
}

impl Route {
    /// From `lane` on. At each junction the first of `turns` that is left is taken if the lane allows it; after those, chance decides.
    pub(in crate::generated) fn new(
        roads: &Roads,
        lane: LaneIndex,
        turns: &[Turn],
        driver: &Driver,
        draw: &mut Draw,
    ) -> Self {
        let mut turns = turns.iter().copied().peekable();
        let (mut lanes, mut starts, mut length) = (vec![lane], vec![0.0], roads.lanes[lane].course.length());
        let mut now = lane;
        while length < REACH {
            let exits = &roads.lanes[now].exits;
            let Some(next) = choose(roads, exits, &mut turns, driver.parks, draw) else { break };
            starts.push(length);
            lanes.push(next);
            length += roads.lanes[next].course.length();
            now = next;
        }
        let caps = caps(roads, &lanes, length, driver);
        Self { lanes, starts, caps }
    }

    /// The way (m) from `way` on to the first junction of more than two arms; infinite if there is none.
    pub(in crate::generated) fn to_junction(&self, roads: &Roads, way: f64) -> f64 {
        let junction = |lane: &LaneIndex| roads.lanes[*lane].way.is_some_and(|way| is_junction(roads, way));
        let first = self.lanes.iter().zip(&self.starts).find(|(lane, start)| **start > way && junction(lane));
        first.map_or(f64::INFINITY, |(_, start)| start - way)
    }

    /// The largest curvature (1/m) within `reach` (m).
    pub(in crate::generated) fn tightest(&self, roads: &Roads, reach: f64) -> f64 {
        let near = self.lanes.iter().zip(&self.starts).filter(|(_, start)| **start < reach);
        let of = |lane: &LaneIndex| {
            let course = &roads.lanes[*lane].course;
            (0..=course.length() as usize).map(|k| course.curvature(k as f64).abs()).fold(0.0, f64::max)
        };
        near.map(|(lane, _)| of(lane)).fold(0.0, f64::max)
    }

    /// Nowhere faster than `pace` (m/s).
    pub(in crate::generated) fn keep_below(&mut self, pace: f64) {
        self.caps.iter_mut().for_each(|cap| *cap = cap.min(pace));
    }

    /// The speed (m/s) to aim at, `way` (m) along the route: the limit and the bends ahead.
    pub(in crate::generated) fn cap(&self, way: f64) -> f64 {
        let last = self.caps.len() - 1;
        self.caps[((way / SPACING).max(0.0) as usize).min(last)]
    }
}

fn choose(
    roads: &Roads,
    exits: &[LaneIndex],
    turns: &mut Peekable<impl Iterator<Item = Turn>>,
    parks: f64,
    draw: &mut Draw,
) -> Option<LaneIndex> {
    if exits.len() < 2 {
        if let Some(only) = exits.first() {
            // A junction that leaves no choice takes its turn off the list all the same.
            if roads.lanes[*only].way.is_some_and(|way| roads.junctions[way.junction].arms.len() > 2) {
                turns.next();
            }
        }
        return exits.first().copied();
    }
    let turn_of = |exit: LaneIndex| roads.lanes[exit].way.map(|way| way.turn);
    if exits.iter().any(|exit| roads.lanes[*exit].way.is_some()) {
        let wanted = turns.next();
        if let Some(found) = exits.iter().find(|exit| wanted.is_some() && turn_of(**exit) == wanted) {
            return Some(*found);
        }
    }
    if let Some(wanted) = turns.peek().copied()
        && let Some(found) = exits.iter().find(|exit| turn_of(**exit).is_none() && leads(roads, **exit, wanted))
    {
        return Some(*found);
    }
    let weight = |exit: LaneIndex| match (roads.lanes[exit].lot, turn_of(exit)) {
        (true, _) if !exits.iter().all(|exit| roads.lanes[*exit].lot) => parks,
        (_, Some(Turn::Left)) => 0.22,
        (_, Some(Turn::Right)) => 0.25,
        _ => 0.6,
    };
    let whole: f64 = exits.iter().map(|exit| weight(*exit)).sum();
    let mut left = draw.between(0.0, whole);
    for exit in exits {
        left -= weight(*exit);
        if left < 0.0 {
            return Some(*exit);
        }
    }
    exits.last().copied()
}

/// Whether `lane` leads to a junction at which it allows `turn`, without a choice before.
pub(in crate::generated) fn leads(roads: &Roads, lane: LaneIndex, turn: Turn) -> bool {
    let mut now = lane;
    for _ in 0..40 {
        let exits = &roads.lanes[now].exits;
        if exits
            .iter()
            .any(|exit| roads.lanes[*exit].way.is_some_and(|way| way.turn == turn && is_junction(roads, way)))
        {
            return true;
        }
        let [only] = exits[..] else {
            return exits.iter().any(|exit| roads.lanes[*exit].way.is_none() && leads(roads, *exit, turn));
        };
        if roads.lanes[only].way.is_some_and(|way| is_junction(roads, way)) {
            return false;
        }
        now = only;
    }
    false
}

fn is_junction(roads: &Roads, way: Way) -> bool {
    roads.junctions[way.junction].arms.len() > 2
}

/// For every [`SPACING`] the speed from which all that follows can be met, braking softly.
fn caps(roads: &Roads, lanes: &[LaneIndex], length: f64, driver: &Driver) -> Vec<f64> {
    let mut caps = vec![f64::INFINITY; (length / SPACING) as usize + 2];
    let mut start = 0.0;
    for lane in lanes {
        let lane = &roads.lanes[*lane];
        let limit = lane.limit * driver.eagerness;
        let (first, last) = ((start / SPACING) as usize, ((start + lane.course.length()) / SPACING) as usize);
        let bends = no_faster(limit, driver.lateral / lane.sharpest.max(1e-4)) < limit;
        for (index, cap) in caps.iter_mut().enumerate().take(last + 1).skip(first) {
            *cap = cap.min(limit);
            if !bends {
                continue;
            }
            let bend = lane.course.curvature(index as f64 * SPACING - start).abs().max(1e-4);
            *cap = no_faster(*cap, driver.lateral / bend);
        }
        start += lane.course.length();
    }
    let slowing = 2.0 * SPACING * 0.6 * driver.braking;
    for index in (0..caps.len() - 1).rev() {
        caps[index] = no_faster(caps[index], caps[index + 1] * caps[index + 1] + slowing);
    }
    caps
}

/// The smaller of `cap` and the root of `squared`, which is seldom the smaller and so seldom drawn.
fn no_faster(cap: f64, squared: f64) -> f64 {
    if cap * cap > squared { squared.sqrt() } else { cap }
}
