//! Who may enter a junction: lights, stop signs, giving way, and gaps in cross traffic that are long enough.
//!
//! A way through a junction is *granted* before it is driven. Those who go first ask early, from far away; those who give way ask when they would
//! have to brake otherwise. It is granted if nobody to whom a crossing way is granted would be there at the same time. So the one rule keeps
//! vehicles apart, and when one asks makes who goes first.

use world::plan::STEP_SECONDS;
use world::signal::SignalState;

use crate::generated::roads::{Control, LaneIndex, Turn};

use super::vehicle::Vehicle;
use super::{Grant, Traffic};

/// How a way is entered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Rank {
    /// Everybody else waits.
    First,
    /// After those who go first.
    GivesWay,
    /// After a full stop.
    AfterStop,
    /// After a full stop, and after those who stopped before.
    InTurn,
    /// Not now.
    Closed,
}

impl Traffic<'_> {
    fn rank(&self, lane: LaneIndex) -> Rank {
        let Some(way) = self.roads.lanes[lane].way else { return Rank::First };
        let junction = &self.roads.junctions[way.junction];
        let major = junction.arms.get(way.from).is_some_and(|arm| arm.major);
        let from_inside = self.roads.lanes[lane]
            .entries
            .iter()
            .any(|entry| self.roads.lanes[*entry].way.is_some_and(|before| before.junction == way.junction));
        match junction.control {
            Control::Free => Rank::First,
            Control::Signals => {
                let Some(programme) = &self.programmes[way.junction] else { return Rank::First };
                match programme.shows(way, self.step) {
                    SignalState::Go | SignalState::ArrowGo if programme.is_permissive(way) => Rank::GivesWay,
                    SignalState::Go | SignalState::ArrowGo => Rank::First,
                    _ => Rank::Closed,
                }
            }
            Control::AllWayStop => Rank::InTurn,
            _ if from_inside => Rank::First,
            Control::Roundabout { .. } => Rank::GivesWay,
            _ if major && way.turn != Turn::Left => Rank::First,
            _ if major => Rank::GivesWay,
            Control::MinorStop => Rank::AfterStop,
            Control::MinorYield | Control::Merge => Rank::GivesWay,
        }
    }

    /// Sees to the ways ahead of vehicle `me`, and answers the distance (m) from its front to the line that it must not pass now.
    pub(super) fn ask_for_way(&mut self, me: usize) -> Option<f64> {
        let vehicle = &self.vehicles[me];
        let mut index = vehicle.at + 1;
        loop {
            let vehicle = &self.vehicles[me];
            let lane = *vehicle.route.lanes.get(index)?;
            let line = vehicle.route.starts[index] - vehicle.way() - 0.5 * vehicle.size[0];
            if line > 90.0 {
                return None;
            }
            if self.roads.lanes[lane].way.is_some() {
                let granted = index < vehicle.granted;
                if granted && line > 0.3 && self.is_revoked(vehicle, lane, line) {
                    self.take_back(me, index);
                    return Some(line);
                }
                if !granted {
                    if line < -1.0 && index > vehicle.at + 1 {
                        return Some(line.max(0.1)); // its front is over the line of a way that is not its own: it waits
                    }
                    if !self.asks(me, lane, index, line) {
                        return Some(line);
                    }
                    self.vehicles[me].granted = index + 1;
                    self.vehicles[me].stopped = None;
                    self.grants[lane].push(Grant { vehicle: me, order: self.order });
                    self.order += 1;
                }
            }
            index += 1;
        }
    }

    /// The light has changed, and one can still stop.
    fn is_revoked(&self, vehicle: &Vehicle, lane: LaneIndex, line: f64) -> bool {
        let stops_within = vehicle.speed * vehicle.speed / (2.0 * 3.3) + 0.3 * vehicle.speed;
        !vehicle.violator && self.rank(lane) == Rank::Closed && line > stops_within
    }

    pub(super) fn take_back(&mut self, me: usize, from: usize) {
        let vehicle = &mut self.vehicles[me];
        for lane in &vehicle.route.lanes[from..vehicle.granted.max(from)] {
            self.grants[*lane].retain(|grant| grant.vehicle != me);
        }
        vehicle.granted = from;
    }

    fn asks(&mut self, me: usize, lane: LaneIndex, index: usize, line: f64) -> bool {
        let rank = self.rank(lane);
        let vehicle = &self.vehicles[me];
        let runs = vehicle.violator && !matches!(rank, Rank::First);
        let brakes_within = vehicle.speed * vehicle.speed / (2.0 * vehicle.driver.braking) + 3.0 + 0.8 * vehicle.speed;
        let horizon = match rank {
            _ if runs => brakes_within,
            Rank::Closed => return false,
            Rank::First => (5.5 * vehicle.speed).max(30.0),
            Rank::GivesWay => brakes_within + 4.0,
            Rank::AfterStop | Rank::InTurn => 4.0,
        };
        if line > horizon || !self.is_first_in_line(me, index) {
            return false;
        }
        if matches!(rank, Rank::AfterStop | Rank::InTurn) && !runs {
            let step = self.step;
            let vehicle = &mut self.vehicles[me];
            if vehicle.speed < 0.25 && line < 4.0 && vehicle.stopped.is_none() {
                vehicle.stopped = Some(step);
            }
            let Some(since) = vehicle.stopped else { return false };
            // One looks before one goes.
            if step - since < 8 || (rank == Rank::InTurn && !self.is_longest_waiting(me, lane, since)) {
                return false;
            }
        }
        if !self.has_room_behind(me, index) {
            return false;
        }
        let vehicle = &self.vehicles[me];
        let margin = match rank {
            _ if runs => 0.3,
            Rank::First => 0.3,
            _ => vehicle.driver.margin,
        };
        self.is_clear(me, lane, index, margin)
    }

    /// Whoever is before it on its lane has been granted its way.
    fn is_first_in_line(&self, me: usize, index: usize) -> bool {
        let vehicle = &self.vehicles[me];
        let entry = vehicle.route.lanes[index - 1];
        let own = if index - 1 == vehicle.at { vehicle.station } else { f64::NEG_INFINITY };
        self.on[entry].iter().filter(|place| place.vehicle != me && place.station > own && !place.beside).all(|place| {
            let other = &self.vehicles[place.vehicle];
            other.at + 1 < other.granted || other.route.lanes.len() == other.at + 1
        })
    }

    /// At an all-way stop nobody who can go has stopped before.
    fn is_longest_waiting(&self, me: usize, lane: LaneIndex, since: i32) -> bool {
        let Some(way) = self.roads.lanes[lane].way else { return true };
        self.roads.junctions[way.junction].arms.iter().flat_map(|arm| &arm.inbound).all(|inbound| {
            self.on[*inbound].iter().all(|place| {
                let other = &self.vehicles[place.vehicle];
                // One who has waited for 5 s more than is polite has lost its turn.
                other.stopped.is_none_or(|before| {
                    place.vehicle == me || (since, me) < (before, place.vehicle) || self.step - before > 80
                })
            })
        })
    }

    /// It would not come to stand in the junction.
    fn has_room_behind(&self, me: usize, index: usize) -> bool {
        let vehicle = &self.vehicles[me];
        let Some(out) = vehicle.route.lanes.get(index + 1) else { return true };
        if self.roads.lanes[*out].way.is_some() {
            return true;
        }
        let last = self.on[*out].iter().filter(|place| !place.beside).min_by(|a, b| a.station.total_cmp(&b.station));
        last.is_none_or(|place| {
            let other = &self.vehicles[place.vehicle];
            let free = place.station - 0.5 * other.size[0];
            other.speed > 2.5 || free > vehicle.size[0] + 4.0
        })
    }

    /// Nobody to whom a crossing way is granted is in its conflict with this one within `margin` (s) of the time that `me` is.
    fn is_clear(&self, me: usize, lane: LaneIndex, index: usize, margin: f64) -> bool {
        let vehicle = &self.vehicles[me];
        self.conflicts[lane].iter().all(|conflict| {
            self.grants[conflict.other].iter().all(|grant| {
                let other = &self.vehicles[grant.vehicle];
                let Some(theirs) = times(other, conflict.other, conflict.other_span) else { return true };
                let start = vehicle.route.starts[index] - vehicle.way();
                let mine = crossing_times(vehicle, start, conflict.own_span);
                mine.1 + margin < theirs.0 || (!conflict.merging && theirs.1 + margin < mine.0) || {
                    // Into the same lane one follows whoever is well ahead.
                    conflict.merging && theirs.0 + 0.7 * margin + 0.6 < mine.0
                }
            })
        })
    }

    /// Whoever was granted a crossing way before, or stands in it, is let pass: the distance (m) from the front to where to wait. In a merge the
    /// other is followed instead: gap and speed.
    pub(super) fn minds_others(&self, me: usize) -> (Option<f64>, Option<(f64, f64)>) {
        let vehicle = &self.vehicles[me];
        let (mut line, mut leader): (Option<f64>, Option<(f64, f64)>) = (None, None);
        for index in vehicle.at..vehicle.granted {
            let lane = vehicle.route.lanes[index];
            if self.conflicts[lane].is_empty() {
                continue;
            }
            let start = vehicle.route.starts[index] - vehicle.way();
            let order =
                self.grants[lane].iter().find(|grant| grant.vehicle == me).map_or(u32::MAX, |grant| grant.order);
            for conflict in &self.conflicts[lane] {
                let to_zone = start + conflict.own_span.0 - 0.5 * vehicle.size[0];
                let past_zone = start + conflict.own_span.1 + 0.5 * vehicle.size[0] < 0.0;
                if past_zone {
                    continue;
                }
                for grant in &self.grants[conflict.other] {
                    let other = &self.vehicles[grant.vehicle];
                    let Some(theirs) = times(other, conflict.other, conflict.other_span) else { continue };
                    let mine = crossing_times(vehicle, start, conflict.own_span);
                    if conflict.merging {
                        let end = |v: &Vehicle, lane: LaneIndex| {
                            let index = v.route.lanes.iter().position(|l| *l == lane).unwrap_or(v.at);
                            v.route.starts[index] + self.roads.lanes[lane].course.length() - v.way()
                        };
                        let (own, their) = (end(vehicle, lane), end(other, conflict.other));
                        let behind = (their, grant.vehicle) < (own, me);
                        if behind {
                            let gap = own - their - 0.5 * (vehicle.size[0] + other.size[0]);
                            if leader.is_none_or(|(before, _)| gap < before) {
                                leader = Some((gap, other.speed));
                            }
                        }
                        continue;
                    }
                    let inside = theirs.0 <= 0.0;
                    let first = mine.1 + 0.2 < theirs.0;
                    let after = theirs.1 + 0.2 < mine.0;
                    let yields = inside || order > grant.order;
                    if to_zone > -0.5 && yields && !first && !after {
                        line = Some(line.map_or(to_zone, |before| before.min(to_zone)));
                    }
                }
            }
        }
        (line, leader)
    }
}

/// When `vehicle` is within `span` of `lane` (s from now): from, until; `None` if it is past it.
fn times(vehicle: &Vehicle, lane: LaneIndex, span: (f64, f64)) -> Option<(f64, f64)> {
    let index = vehicle.route.lanes[vehicle.at..].iter().position(|l| *l == lane).map(|index| index + vehicle.at);
    let start = match index {
        Some(index) => vehicle.route.starts[index] - vehicle.way(),
        // It has left the lane, but its rear may be there.
        None => {
            let index = vehicle.route.lanes[..vehicle.at].iter().rposition(|l| *l == lane)?;
            vehicle.route.starts[index] - vehicle.way()
        }
    };
    (start + span.1 + 0.5 * vehicle.size[0] > 0.0).then(|| crossing_times(vehicle, start, span))
}

/// When the vehicle's box is within a span of a lane that begins `start` (m) ahead of its centre.
fn crossing_times(vehicle: &Vehicle, start: f64, span: (f64, f64)) -> (f64, f64) {
    let half = 0.5 * vehicle.size[0];
    let cap = vehicle.route.cap(vehicle.way() + start + span.0).max(2.0);
    (time_to(vehicle, start + span.0 - half, cap), time_to(vehicle, start + span.1 + half, cap))
}

/// Time (s) for `distance` (m) on, speeding up or slowing down towards `cap` (m/s).
fn time_to(vehicle: &Vehicle, distance: f64, cap: f64) -> f64 {
    if distance <= 0.0 {
        return 0.0;
    }
    let speed = vehicle.speed;
    if speed >= cap {
        return distance / (0.5 * (speed + cap));
    }
    let acceleration = 0.8 * vehicle.driver.acceleration;
    // A driver that stands needs its reaction time.
    let idle = if speed < 0.5 { vehicle.driver.delay as f64 * STEP_SECONDS } else { 0.0 };
    let ramp = (cap * cap - speed * speed) / (2.0 * acceleration);
    idle + if distance < ramp {
        ((speed * speed + 2.0 * acceleration * distance).sqrt() - speed) / acceleration
    } else {
        (cap - speed) / acceleration + (distance - ramp) / cap
    }
}
