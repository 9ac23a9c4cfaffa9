//! Where on the roads somebody is put: counted from stop lines, from the AV, along streets.

use super::{Side, Stage};
use crate::generated::roads::{LaneIndex, Turn};
use crate::generated::traffic::AV;

impl<'r> Stage<'r> {
    /// The lane and station `before` (m) before the end of a street's lane (its stop line, if it has one), in driving direction; the lane's start
    /// if it is shorter.
    pub(in crate::generated) fn before_end(
        &self,
        street: usize,
        side: Side,
        slot: usize,
        before: f64,
    ) -> (LaneIndex, f64) {
        let lanes = self.lanes(street, side, slot);
        let mut left = before;
        for lane in lanes.iter().rev() {
            let length = self.roads.lanes[*lane].course.length();
            if left <= length {
                return (*lane, length - left);
            }
            left -= length;
        }
        (lanes[0], 3.0)
    }

    /// A street's lane by sections; the outermost one if `slot` is too large.
    pub(in crate::generated) fn lanes(&self, street: usize, side: Side, slot: usize) -> &'r [LaneIndex] {
        let laid = &self.roads.streets[street];
        let slots = if side == Side::Forward { &laid.forward } else { &laid.backward };
        &slots[slot.min(slots.len() - 1)]
    }

    pub(in crate::generated) fn slots(&self, street: usize, side: Side) -> usize {
        let laid = &self.roads.streets[street];
        if side == Side::Forward { laid.forward.len() } else { laid.backward.len() }
    }

    /// The place on the AV's route whose distance (m) from its centre is `ahead`; behind it where that is negative.
    pub(in crate::generated) fn place_ahead(&self, ahead: f64) -> Option<(LaneIndex, f64)> {
        let av = &self.traffic.vehicles[AV];
        let mut way = av.station + ahead;
        let mut lanes = av.route.lanes[av.at..].iter();
        let mut lane = *lanes.next()?;
        while way < 0.0 {
            lane = *self.roads.lanes[lane].entries.first()?;
            way += self.roads.lanes[lane].course.length();
        }
        while way > self.roads.lanes[lane].course.length() {
            way -= self.roads.lanes[lane].course.length();
            lane = *lanes.next()?;
        }
        Some((lane, way))
    }

    /// The place on another lane of the AV's street, `ahead` (m) of its centre.
    pub(in crate::generated) fn beside_av(
        &self,
        street: usize,
        side: Side,
        slot: usize,
        ahead: f64,
    ) -> Option<(LaneIndex, f64)> {
        let (lane, station) = self.place_ahead(ahead)?;
        let all = self.slots(street, side);
        let section = (0..all).find_map(|own| self.lanes(street, side, own).iter().position(|l| *l == lane))?;
        let beside = *self.lanes(street, side, slot).get(section)?;
        Some((beside, station * self.roads.lanes[beside].course.length() / self.roads.lanes[lane].course.length()))
    }

    /// The place `back` (m) before the end of a lane, straight back through junctions.
    pub(super) fn upstream(&self, lane: LaneIndex, back: f64) -> Option<(LaneIndex, f64)> {
        let (mut now, mut left) = (lane, back);
        loop {
            let here = &self.roads.lanes[now];
            if left < here.course.length() {
                // Nobody begins in a junction.
                return if here.way.is_some() {
                    Some((*here.entries.first()?, 0.1))
                } else {
                    Some((now, here.course.length() - left))
                };
            }
            left -= here.course.length();
            let straight =
                |entry: &&LaneIndex| self.roads.lanes[**entry].way.is_none_or(|way| way.turn == Turn::Straight);
            now = *here.entries.iter().find(straight)?;
        }
    }

    /// Whether a lane of the street leads to `turn`.
    pub(in crate::generated) fn leads(&self, street: usize, side: Side, turn: Turn) -> bool {
        (0..self.slots(street, side)).any(|slot| {
            self.lanes(street, side, slot)
                .last()
                .is_some_and(|lane| crate::generated::traffic::leads(self.roads, *lane, turn))
        })
    }

    /// The crosswalk over a street between its ends.
    pub(in crate::generated) fn crossing_on(&self, street: usize) -> Option<usize> {
        let lanes = self.lanes(street, Side::Forward, 0);
        let crosses = |lane: &&LaneIndex| self.roads.lanes[**lane].crossed.first().map(|(crossing, _, _)| *crossing);
        lanes.iter().find_map(|lane| crosses(&lane))
    }
}
