//! What somebody on wheels minds ahead: the next vehicle, lines that must not be passed now, people who cross.

use world::geometry::Point;
use world::scene::AgentKind;

use super::vehicle::{Script, Vehicle};
use super::walker::Start;
use super::{AV, Crossed, Traffic};

/// How far somebody looks (m).
const SIGHT: f64 = 110.0;

/// Space (m) that is left to somebody at the edge of the lane while passing, and with which one passes at all.
const PASSING: f64 = 0.9;
const SQUEEZING: f64 = 0.4;

/// What is followed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Leader {
    pub(super) gap: f64,
    pub(super) speed: f64,
}

impl Traffic<'_> {
    /// The acceleration (m/s^2) that vehicle `me` wishes for.
    pub(super) fn wish(&mut self, me: usize) -> f64 {
        let line = self.ask_for_way(me);
        let (zone, merging) = self.minds_others(me);
        let (leader, room) = self.leader(me);
        let crossing = self.people_ahead(me);
        let step = self.step;
        let vehicle = &mut self.vehicles[me];
        let in_change = vehicle.lateral.target != vehicle.lateral.offset && step - vehicle.changed < 60;
        if !in_change || vehicle.kind == AgentKind::Cyclist {
            if let Some(target) = room {
                vehicle.lateral.target = target - vehicle.wandered();
            } else if vehicle.kind != AgentKind::Cyclist && !matches!(vehicle.script, Script::PullOut { .. }) {
                vehicle.lateral.target = 0.0;
            }
        }
        let vehicle = &self.vehicles[me];
        let driver = &vehicle.driver;
        let (here, soon) = (vehicle.way(), vehicle.way() + 0.8 * vehicle.speed);
        let (mut desired, mut braking) = (vehicle.route.cap(here).min(vehicle.route.cap(soon)), None);
        if let Script::Slow { from, until, speed, braking: hard } = vehicle.script
            && (from..until).contains(&step)
        {
            desired = desired.min(speed);
            braking = Some(hard);
        }
        let mut wish = driver.free(vehicle.speed, desired);
        if let Some(hard) = braking.filter(|_| vehicle.speed > desired) {
            wish = -hard.min(2.0 * (vehicle.speed - desired) + 0.5);
        }
        let follow = |gap: f64, other: f64, standstill: f64, headway: f64| {
            driver.follow(vehicle.speed, vehicle.mind.seen(gap), other, standstill, headway)
        };
        if let Some(leader) = leader {
            wish = wish.min(follow(leader.gap, leader.speed, driver.standstill_gap, driver.headway));
        }
        if let Some((gap, speed)) = merging {
            wish = wish.min(follow(gap, speed, driver.standstill_gap, 0.7 * driver.headway).max(-4.0));
        }
        for (line, rest) in [(line, 0.8), (zone, 1.0), (crossing, 1.2)] {
            if let Some(line) = line {
                // Towards a fixed line one brakes evenly, as late as is comfortable.
                wish = wish.min(stop_before(vehicle, vehicle.mind.seen(line) - rest));
            }
        }
        wish
    }

    /// The next on the route that is in the way; and where to move across the lane to pass somebody at its edge.
    pub(super) fn leader(&self, me: usize) -> (Option<Leader>, Option<f64>) {
        let vehicle = &self.vehicles[me];
        let offset = vehicle.across().0;
        let mut room: Option<f64> = None;
        let mut best: Option<Leader> = None;
        let mut consider =
            |base: f64, other_index: usize, station: f64, other_offset: f64, best: &mut Option<Leader>| {
                let other = &self.vehicles[other_index];
                let centre = base + station;
                if centre <= 0.0 || (centre < 1.0 && other_index > me) {
                    return;
                }
                let gap = centre - 0.5 * (vehicle.size[0] + other.size[0]);
                let wide = 0.5 * (vehicle.size[1] + other.size[1]);
                let is_at_edge = other.kind == AgentKind::Cyclist || matches!(other.script, Script::PullOut { .. });
                if is_at_edge && vehicle.kind != AgentKind::Cyclist && gap < 35.0 && other_offset < -0.4 {
                    let limit = 0.5 * (self.roads.lanes[vehicle.lane()].width - vehicle.size[1]) + 0.1;
                    let wanted = (other_offset + wide + PASSING).min(limit);
                    if wanted > 0.0 {
                        room = Some(room.map_or(wanted, |before: f64| before.max(wanted)));
                    }
                }
                let spare = if is_at_edge { SQUEEZING } else { 0.25 };
                // Whoever begins to pull out is let in by those who can still stop.
                let pulls_out = other.lateral.target == 0.0
                    && self.step - other.changed < 50
                    && other.speed < 5.0
                    && gap > vehicle.speed * vehicle.speed / 11.0;
                if (other_offset - offset).abs() > wide + spare && !pulls_out {
                    return;
                }
                if best.is_none_or(|before| gap < before.gap) {
                    *best = Some(Leader { gap, speed: other.speed });
                }
            };
        let mut base = -vehicle.station;
        for index in vehicle.at..vehicle.route.lanes.len() {
            let lane = vehicle.route.lanes[index];
            for place in self.on[lane].iter().filter(|place| place.vehicle != me) {
                consider(base, place.vehicle, place.station, place.offset, &mut best);
            }
            // Those who have just turned off to another way still have their rear here.
            let parts = if self.roads.lanes[lane].way.is_some() { 5.0 } else { 16.0 };
            let before = self.roads.lanes[lane].entries.first().copied();
            if let Some(entry) = index.checked_sub(1).map(|before| vehicle.route.lanes[before]).or(before) {
                for sibling in self.roads.lanes[entry].exits.iter().filter(|exit| **exit != lane) {
                    for place in self.on[*sibling].iter().filter(|place| place.vehicle != me) {
                        if place.station - 0.5 * self.vehicles[place.vehicle].size[0] < parts {
                            consider(base, place.vehicle, place.station, place.offset, &mut best);
                        }
                    }
                }
            }
            base += self.roads.lanes[lane].course.length();
            if best.is_some() || base > SIGHT {
                break;
            }
        }
        (best, room)
    }

    /// The distance (m) from the front to the first crossing where somebody walks whom the vehicle lets pass.
    fn people_ahead(&self, me: usize) -> Option<f64> {
        if self.walkers.is_empty() {
            return None;
        }
        let vehicle = &self.vehicles[me];
        let half = 0.5 * vehicle.size[0];
        let first = vehicle.at.saturating_sub(1);
        for index in first..vehicle.route.lanes.len() {
            let start = vehicle.route.starts[index] - vehicle.way();
            if start > 70.0 {
                return None;
            }
            for crossed in &self.crossed_by[vehicle.route.lanes[index]] {
                let (near, far) = (start + crossed.span.0 - half, start + crossed.span.1 + half);
                if near > -1.0 && near < 70.0 && self.yields_to_people(vehicle, crossed, near, far) {
                    return Some(near);
                }
            }
        }
        None
    }

    fn yields_to_people(&self, vehicle: &Vehicle, crossed: &Crossed, near: f64, far: f64) -> bool {
        let speed = vehicle.speed.max(1.5);
        let (there, gone) = ((near / speed).max(0.0), far / speed);
        self.walkers.iter().filter(|walker| walker.crossing == Some(crossed.crossing) && walker.walking).any(|walker| {
            let Some((from, until)) = walker.span_at(crossed.at, 0.5 * vehicle.size[1] + 0.9) else { return false };
            // One goes on if one is well past before they come, or if they are gone when one arrives; else one waits while they are near.
            gone + 1.0 > from && until + 0.3 > there && from < 5.0
        })
    }

    /// Whether somebody who waits may go now.
    pub(super) fn begins_to_walk(&self, index: usize) -> bool {
        let walker = &self.walkers[index];
        match walker.starts {
            Start::Never => false,
            Start::BeforeAv(seconds) => {
                let (Some(crossing), true) = (walker.crossing, self.step >= 0) else { return false };
                let av = &self.vehicles[AV];
                self.crossed[crossing].iter().any(|crossed| {
                    let Some(index) = av.route.lanes.iter().position(|lane| *lane == crossed.lane) else {
                        return false;
                    };
                    let near = av.route.starts[index] + crossed.span.0 - av.way() - 0.5 * av.size[0];
                    // It arrives in the AV's way as the AV does, had it gone on.
                    let walk = walker.span_at(crossed.at, 0.0).map_or(0.0, |(from, _)| from);
                    near > 0.0 && near < (walk + seconds) * av.speed
                })
            }
            Start::Step(step) => {
                let Some(crossing) = walker.crossing else { return self.step >= step };
                let place = self.crossings.get(crossing).and_then(|crossing| crossing.arm);
                let lit = place.and_then(|(junction, arm)| Some((self.programmes[junction].as_ref()?, arm)));
                self.step >= step
                    && lit.map_or_else(
                        || self.is_free_to_cross(index, crossing),
                        |(lights, arm)| lights.walk(arm, self.step),
                    )
            }
        }
    }

    /// Everybody who comes can still stop, or is past before.
    fn is_free_to_cross(&self, index: usize, crossing: usize) -> bool {
        let walker = &self.walkers[index];
        self.crossed[crossing].iter().all(|crossed| {
            let Some((from, _)) = walker.span_at(crossed.at, 1.5) else { return true };
            self.vehicles.iter().filter(|vehicle| vehicle.present).all(|vehicle| {
                let ahead = &vehicle.route.lanes[vehicle.at..];
                let Some(index) = ahead.iter().take(5).position(|lane| *lane == crossed.lane) else { return true };
                let index = index + vehicle.at;
                let start = vehicle.route.starts[index] - vehicle.way();
                let near = start + crossed.span.0 - 0.5 * vehicle.size[0];
                let far = start + crossed.span.1 + 0.5 * vehicle.size[0];
                let stops_within = vehicle.speed * vehicle.speed / (2.0 * 1.8) + 0.8 * vehicle.speed + 1.0;
                // Whoever has been let into the junction is about to go.
                let goes = index < vehicle.granted && near < 6.0 && near > -0.5 && vehicle.acceleration > 0.1;
                far < 0.0 || near > stops_within && !goes || far / vehicle.speed.max(0.1) + 0.5 < from
            })
        })
    }

    /// Nobody but the AV is beside vehicle `me`, or about to be.
    fn has_lane_to_itself(&self, me: usize) -> bool {
        let (lane, station) = (self.vehicles[me].lane(), self.vehicles[me].station);
        let here = self.on[lane].iter().filter(|place| place.vehicle != me && place.vehicle != AV);
        here.filter(|place| place.offset.abs() < 1.6).all(|place| !(-18.0..9.0).contains(&(place.station - station)))
    }

    /// What the vehicle's script says now.
    pub(super) fn follow_script(&mut self, me: usize) {
        if !matches!(self.vehicles[me].script, Script::PullOut { .. } | Script::CutIn { .. }) {
            return;
        }
        let av = self.vehicles[AV].pose(self.roads);
        let half = 0.5 * (self.vehicles[AV].size[0] + self.vehicles[me].size[0]);
        let at = self.vehicles[me].pose(self.roads).position() - av.position();
        let ahead = at.dot(Point::unit(av.heading)) - half;
        match self.vehicles[me].script {
            Script::PullOut { gap }
                if self.step >= 0 && (0.7 * gap..gap).contains(&ahead) && self.has_lane_to_itself(me) =>
            {
                let vehicle = &mut self.vehicles[me];
                vehicle.script = Script::None;
                vehicle.lateral.target = 0.0;
                vehicle.changed = self.step;
            }
            Script::CutIn { left, gap, latest, then } if self.step >= 10 => {
                let ripe = (0.8 * gap..1.2 * gap).contains(&ahead) || (self.step >= latest && ahead > 1.0);
                if ripe && self.go_over(me, left) {
                    let (from, until) = (self.step + 8, self.step + 90);
                    self.vehicles[me].script = Script::Slow { from, until, speed: then, braking: 2.0 };
                }
            }
            _ => {}
        }
    }
}

/// The acceleration with which a vehicle comes to rest within `distance` (m): none while that would need less than comfortable braking.
fn stop_before(vehicle: &Vehicle, distance: f64) -> f64 {
    let (speed, driver) = (vehicle.speed, &vehicle.driver);
    let needed = speed * speed / (2.0 * distance.max(0.1));
    if distance < 0.3 {
        return if speed > 0.0 { -(needed.clamp(1.0, 6.0)) } else { -0.5 };
    }
    let late = 0.1 * driver.delay as f64 * speed;
    let needed = speed * speed / (2.0 * (distance - late).max(0.3));
    let comfortable = 0.75 * driver.braking;
    if needed > comfortable {
        -needed
    } else if speed < 1.2 {
        // Creeps up to the line.
        (0.5 * (distance - 0.3)).min(driver.acceleration) - 0.3 * speed
    } else {
        // Off the pedal as the line comes near.
        let share = needed / comfortable;
        driver.acceleration * (1.0 - share) - comfortable * share * share
    }
}
