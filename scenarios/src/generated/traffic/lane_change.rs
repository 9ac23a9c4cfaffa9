//! Lane changes by MOBIL (Kesting, Treiber, Helbing, 2007): one goes over if it gains more than it costs those behind, and nobody has to brake hard.

use crate::generated::roads::LaneIndex;

use super::vehicle::{Script, Vehicle};
use super::{AV, Route, Traffic};

/// What others' loss counts.
const POLITENESS: f64 = 0.3;
/// Nobody behind must brake harder (m/s^2).
const SAFE: f64 = 2.0;

/// Room (m), and whose vehicle ends it.
type Gap = (f64, usize);

impl Traffic<'_> {
    /// Lets vehicle `me` think about changing lanes now and then.
    pub(super) fn consider_lanes(&mut self, me: usize) {
        let vehicle = &self.vehicles[me];
        let thinks = (self.step + 3 * me as i32) % 8 == 0 && self.step - vehicle.changed > 60;
        if !thinks
            || !vehicle.driver.lane_change_threshold.is_finite()
            || vehicle.speed < 4.0
            || vehicle.script != Script::None
        {
            return;
        }
        let (leader, _) = self.leader(me);
        let Some(leader) = leader.filter(|leader| leader.gap < 60.0) else { return };
        let lane = &self.roads.lanes[vehicle.lane()];
        let desired = vehicle.route.cap(vehicle.way());
        let accelerate = |v: &Vehicle, gap: f64, speed: f64| {
            let free = v.driver.free(v.speed, desired);
            free.min(v.driver.follow(v.speed, gap, speed, v.driver.standstill_gap, v.driver.headway))
        };
        let now = accelerate(vehicle, leader.gap, leader.speed);
        for (side, is_left) in [(lane.left, true), (lane.right, false)] {
            let Some(beside) = side.filter(|beside| self.may_be_changed_to(me, *beside)) else { continue };
            let station = vehicle.station * self.roads.lanes[beside].course.length() / lane.course.length();
            let [front, rear] = self.gaps(me, beside, station);
            let then = front.map_or_else(
                || vehicle.driver.free(vehicle.speed, desired),
                |(gap, other)| accelerate(vehicle, gap, self.vehicles[other].speed),
            );
            let cost = rear.map_or(0.0, |(gap, other)| {
                let other = &self.vehicles[other];
                -other.driver.follow(other.speed, gap, vehicle.speed, other.driver.standstill_gap, other.driver.headway)
            });
            let room = front.is_none_or(|(gap, _)| gap > 3.0 + 0.4 * vehicle.speed)
                && rear.is_none_or(|(gap, other)| gap > 3.0 + 0.6 * self.vehicles[other].speed);
            let gain = then - now - POLITENESS * cost.max(0.0);
            if room && cost < SAFE && gain > vehicle.driver.lane_change_threshold {
                self.go_over(me, is_left);
                return;
            }
        }
    }

    /// The lane is for cars, and there is way enough before the next line.
    fn may_be_changed_to(&self, me: usize, beside: LaneIndex) -> bool {
        let vehicle = &self.vehicles[me];
        let lane = &self.roads.lanes[beside];
        let here = &self.roads.lanes[vehicle.lane()];
        let next = vehicle.route.lanes.get(vehicle.at + 1).map(|next| &self.roads.lanes[*next]);
        !lane.bike && !lane.solid && !here.solid && here.way.is_none() && next.is_some_and(|next| next.way.is_none())
    }

    /// Room on a lane beside vehicle `me`: to whom is ahead and to whom is behind (m, who).
    fn gaps(&self, me: usize, lane: LaneIndex, station: f64) -> [Option<Gap>; 2] {
        let vehicle = &self.vehicles[me];
        let (mut front, mut rear): (Option<Gap>, Option<Gap>) = (None, None);
        let mut see = |away: f64, other: usize| {
            let gap = away.abs() - 0.5 * (vehicle.size[0] + self.vehicles[other].size[0]);
            let side = if away >= 0.0 { &mut front } else { &mut rear };
            if side.is_none_or(|(before, _)| gap < before) {
                *side = Some((gap, other));
            }
        };
        let (mut now, mut base) = (lane, -station);
        for _ in 0..6 {
            self.on[now]
                .iter()
                .filter(|place| place.vehicle != me)
                .for_each(|place| see(base + place.station, place.vehicle));
            base += self.roads.lanes[now].course.length();
            let Some(next) = self.roads.lanes[now].exits.first() else { break };
            now = *next;
        }
        let (mut now, mut base) = (lane, -station);
        for _ in 0..4 {
            let Some(before) = self.roads.lanes[now].entries.first() else { break };
            now = *before;
            base -= self.roads.lanes[now].course.length();
            self.on[now]
                .iter()
                .filter(|place| place.vehicle != me)
                .for_each(|place| see(base + place.station, place.vehicle));
        }
        [front, rear]
    }

    /// Begins to move to the lane beside; answers whether there is one.
    pub(super) fn go_over(&mut self, me: usize, left: bool) -> bool {
        let vehicle = &self.vehicles[me];
        let here = &self.roads.lanes[vehicle.lane()];
        let Some(beside) = (if left { here.left } else { here.right }) else { return false };
        let there = &self.roads.lanes[beside];
        if there.bike || me == AV && there.solid {
            return false;
        }
        let apart = 0.5 * (here.width + there.width) * if left { 1.0 } else { -1.0 };
        let station = vehicle.station * there.course.length() / here.course.length();
        self.take_back(me, vehicle.at + 1);
        let vehicle = &mut self.vehicles[me];
        vehicle.route = Route::new(self.roads, beside, &[], &vehicle.driver, &mut self.draw);
        vehicle.at = 0;
        vehicle.granted = 0;
        vehicle.station = station;
        vehicle.lateral.offset -= apart;
        vehicle.lateral.target = 0.0;
        vehicle.settle();
        vehicle.changed = self.step;
        true
    }
}
