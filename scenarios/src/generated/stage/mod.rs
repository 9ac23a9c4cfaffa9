//! A scene being set: roads, the AV, whoever the family sends in, and all the others; then it is driven and logged.
//!
//! | module | what |
//! | --- | --- |
//! | `places` | where somebody is put |
//! | `fill` | everybody whom the family does not send in |
//! | `play`, `mishap` | the scene driven, seen and written down; what must not happen in it |

mod fill;
mod mishap;
mod places;
mod play;

use world::geometry::{Point, Pose};
use world::scene::AgentKind;

use super::STEPS;
use super::curve::Curve;
use super::draw::Draw;
use super::roads::{LaneIndex, Roads, Turn};
use super::sizes;
use super::towns::{FROM, Place};
use super::traffic::{AV, Driver, Lateral, Programme, Route, Script, Start, Traffic, Vehicle, WARM_UP, Walker, Wander};

pub use mishap::Mishap;

/// Seconds of the warm-up.
pub(super) const WARM_UP_SECONDS: f64 = WARM_UP as f64 / 10.0;

/// The scene while it is set.
#[derive(Debug)]
pub(super) struct Stage<'r> {
    pub(super) place: &'r Place,
    pub(super) roads: &'r Roads,
    pub(super) traffic: Traffic<'r>,
    pub(super) draw: Draw,
    parked: Vec<(Pose, [f64; 3])>,
    /// Vehicles (by index) and walkers that the scene is about.
    vehicles_that_matter: Vec<usize>,
    walkers_that_matter: Vec<usize>,
    /// Bays that stay free.
    free_bays: Vec<usize>,
    /// How the traffic is: shares of what is usual.
    pub(super) density: f64,
    pub(super) people: f64,
}

/// A direction of a street.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    /// From its first node to its second.
    Forward,
    Backward,
}

impl<'r> Stage<'r> {
    pub(super) fn new(place: &'r Place, roads: &'r Roads, draw: Draw) -> Self {
        let traffic = Traffic::new(roads, draw.stream(1));
        let (density, people) = (draw.parameter("traffic"), draw.parameter("people"));
        Self {
            place,
            roads,
            traffic,
            draw,
            parked: Vec::new(),
            vehicles_that_matter: Vec::new(),
            walkers_that_matter: Vec::new(),
            free_bays: Vec::new(),
            density,
            people,
        }
    }

    /// Puts the AV on the road: at the log's first step about `before` (m) before the end of the street if it goes on at `speed` (m/s).
    pub(super) fn av(&mut self, street: usize, side: Side, slot: usize, before: f64, speed: f64, turns: &[Turn]) {
        let driver = Driver::of_the_av(&mut self.draw);
        let (lane, station) = self.before_end(street, side, slot, before + speed * WARM_UP_SECONDS);
        let route = Route::new(self.roads, lane, turns, &driver, &mut self.draw);
        let speed = speed.min(route.cap(station));
        let av = Vehicle::new(AgentKind::Vehicle, sizes::AV, driver, route, station, speed);
        self.traffic.vehicles.insert(AV, av);
    }

    /// Adds a vehicle of the family's own; the others keep clear of it.
    pub(super) fn vehicle(&mut self, place: (LaneIndex, f64), speed: f64, turns: &[Turn]) -> usize {
        self.vehicle_by(place, speed, turns, |_| {})
    }

    /// As [`Stage::vehicle`], with a driver who is somebody special.
    pub(super) fn vehicle_by(
        &mut self,
        place: (LaneIndex, f64),
        speed: f64,
        turns: &[Turn],
        special: impl FnOnce(&mut Driver),
    ) -> usize {
        let mut driver = Driver::anybody(&mut self.draw);
        special(&mut driver);
        let straight = turns.iter().all(|turn| *turn == Turn::Straight) && !turns.is_empty();
        let size = if straight { sizes::vehicle(&mut self.draw) } else { sizes::car(&mut self.draw) };
        let route = Route::new(self.roads, place.0, turns, &driver, &mut self.draw);
        let speed = speed.min(route.cap(place.1));
        self.traffic.vehicles.push(Vehicle::new(AgentKind::Vehicle, size, driver, route, place.1, speed));
        let index = self.traffic.vehicles.len() - 1;
        self.vehicles_that_matter.push(index);
        index
    }

    /// Adds a vehicle ahead of the AV on its route, `gap` (m) from bumper to bumper.
    pub(super) fn vehicle_ahead(&mut self, gap: f64, speed: f64, turns: &[Turn]) -> Option<usize> {
        let place = self.place_ahead(gap + 0.5 * (sizes::AV[0] + 4.6))?;
        Some(self.vehicle(place, speed, turns))
    }

    /// A stream of vehicles along an arm of the crossroads towards it, `gap` (s) apart in the mean, on each of its lanes.
    pub(super) fn stream(&mut self, arm: usize, gap: f64, turns: &[Turn]) {
        let Some(street) = self.place.arms[arm] else { return };
        let side = Side::Backward;
        for slot in 0..self.slots(street, side) {
            self.flow(street, side, slot, gap * self.slots(street, side) as f64, turns);
        }
    }

    /// A stream of vehicles along a street's lane, from its end back as far as it takes to last for the scene.
    pub(super) fn flow(&mut self, street: usize, side: Side, slot: usize, gap: f64, turns: &[Turn]) {
        let lanes = self.lanes(street, side, slot);
        let Some(last) = lanes.last() else { return };
        let speed = 0.85 * self.roads.lanes[*last].limit;
        let mut seconds = self.draw.between(0.3, gap);
        while seconds < WARM_UP_SECONDS + 19.0 {
            let Some((lane, station)) = self.upstream(*last, seconds * speed) else { break };
            let mut way = vec![Turn::Straight; usize::from(!lanes.contains(&lane))];
            way.extend_from_slice(turns);
            self.vehicle((lane, station), speed, &way);
            seconds += 1.6 - (gap - 1.6).max(0.1) * libm::log(1.0 - self.draw.between(0.0, 0.98));
        }
    }

    /// Lets the lights of the crossroads have arrows for those who turn left.
    pub(super) fn give_arrows(&mut self) {
        for (junction, lights) in self.roads.junctions.iter().zip(&mut self.traffic.programmes) {
            if junction.node == 0 && lights.is_some() {
                *lights = Some(Programme::new(junction, self.roads, true, &mut self.draw));
            }
        }
    }

    /// Sets the lights of the crossroads so that `turn` from the AV's arm becomes green `seconds` after the log's first step.
    pub(super) fn green_at(&mut self, turn: Turn, seconds: f64) {
        let Some(junction) = self.roads.junctions.iter().position(|junction| junction.node == 0) else { return };
        let street = self.place.arms[FROM];
        let arm = self.roads.junctions[junction].arms.iter().position(|arm| Some(arm.street) == street);
        if let (Some(arm), Some(lights)) = (arm, &mut self.traffic.programmes[junction]) {
            lights.green_at(arm, turn, seconds);
        }
    }

    /// A way over a street that is on no map, at a share of its length, from the curb on its right to the one on its left.
    pub(super) fn unmarked_crossing(&mut self, street: usize, along: f64) -> usize {
        let outer = self.lanes(street, Side::Forward, usize::MAX);
        let length: f64 = outer.iter().map(|lane| self.roads.lanes[*lane].course.length()).sum();
        let (lane, station) = self.before_end(street, Side::Forward, usize::MAX, (1.0 - along) * length);
        self.crossing_over(lane, station)
    }

    /// A way across whatever lanes lie beside a lane's station.
    pub(super) fn crossing_over(&mut self, lane: LaneIndex, station: f64) -> usize {
        let base = self.roads.lanes[lane].course.pose(station);
        let mut crossed = Vec::new();
        let (mut right, mut left) = (0.0_f64, 0.0_f64);
        for (index, other) in self.roads.lanes.iter().enumerate() {
            if other.way.is_some() || other.course.start().position().distance(base.position()) > 150.0 {
                continue;
            }
            let at = other.course.nearest(base.position());
            let place = base.to_body(other.course.pose(at).position());
            if place.x.abs() < 0.5 && place.y.abs() < 26.0 && at > 1.0 && at < other.course.length() - 1.0 {
                crossed.push((index, at));
                right = right.max(0.5 * other.width - place.y);
                left = left.max(place.y + 0.5 * other.width);
            }
        }
        let course =
            Curve::line(base.to_world(Point::new(0.0, -right - 1.6)), base.to_world(Point::new(0.0, left + 1.6)));
        for (index, bay) in self.roads.bays.iter().enumerate() {
            let place = base.to_body(bay.pose.position());
            if place.x.abs() < 0.5 * bay.length + 1.2 && place.y > -right - 6.0 && place.y < left + 6.0 {
                self.free_bays.push(index);
            }
        }
        self.traffic.add_crossing(course, &crossed)
    }

    /// Puts the AV into a parking lot, and people on foot before it.
    pub(super) fn av_in_the_lot(&mut self) {
        let aisles: Vec<LaneIndex> = (0..self.roads.lanes.len())
            .filter(|lane| {
                let lane = &self.roads.lanes[*lane];
                lane.lot && lane.way.is_none() && lane.course.length() > 20.0
            })
            .collect();
        if aisles.is_empty() {
            return;
        }
        let driver = Driver { parks: 1.0, ..Driver::of_the_av(&mut self.draw) };
        let mut way = || {
            let lane = self.draw.pick(&aisles);
            Route::new(self.roads, lane, &[], &driver, &mut self.draw)
        };
        // A way with bends that it gets round.
        let mut route = way();
        for _ in 0..20 {
            if route.tightest(self.roads, 120.0) < 0.14 {
                break;
            }
            route = way();
        }
        let speed = self.draw.between(2.0, 4.0);
        let mut av = Vehicle::new(AgentKind::Vehicle, sizes::AV, driver, route, 3.0, speed);
        av.route.keep_below(self.draw.between(4.5, 6.5));
        self.traffic.vehicles.insert(AV, av);
        for _ in 0..self.draw.parameter("walkers").round() as usize {
            let ahead = self.draw.between(25.0, 110.0);
            if let Some((lane, station)) =
                self.place_ahead(ahead).filter(|(lane, _)| self.roads.lanes[*lane].way.is_none())
            {
                let crossing = self.crossing_over(lane, station);
                let start = self.draw.below(STEPS + WARM_UP) as i32 - WARM_UP as i32;
                self.walker(crossing, Start::Step(start));
            }
        }
    }

    /// Somebody on a bicycle at the right edge of a lane, `inside` (m) of it.
    pub(super) fn cyclist(&mut self, place: (LaneIndex, f64), inside: f64, matters: bool) -> usize {
        let driver = Driver::on_a_bicycle(&mut self.draw);
        let size = sizes::bicycle(&mut self.draw);
        let mut route = Route::new(self.roads, place.0, &[Turn::Straight; 6], &driver, &mut self.draw);
        let pace = self.draw.between(3.0, 6.2);
        route.keep_below(pace);
        let mut cyclist = Vehicle::new(AgentKind::Cyclist, size, driver, route, place.1, pace);
        let lane = &self.roads.lanes[place.0];
        if !lane.bike {
            let offset = inside - 0.5 * lane.width;
            cyclist.lateral = Lateral { offset, slope: 0.0, target: offset };
        }
        self.traffic.vehicles.push(cyclist);
        let index = self.traffic.vehicles.len() - 1;
        if matters {
            self.vehicles_that_matter.push(index);
        }
        index
    }

    /// Somebody on foot who crosses at `crossing`, and of whom the scene tells.
    pub(super) fn walker(&mut self, crossing: usize, starts: Start) -> usize {
        let course = self.traffic.crossings[crossing].course.clone();
        let walker = Walker::new(course, Some(crossing), starts, &mut self.draw);
        let walker = self.in_line(walker);
        self.traffic.walkers.push(walker);
        self.walkers_that_matter.push(self.traffic.walkers.len() - 1);
        self.traffic.walkers.len() - 1
    }

    /// A vehicle in the bay pulls out when the AV's front is `gap` (m) away.
    pub(super) fn pulls_out(&mut self, bay: usize, gap: f64) -> Option<usize> {
        let place = self.roads.bays[bay];
        let (lane, station) = place.beside?;
        let size = sizes::car(&mut self.draw);
        let mut driver = Driver::anybody(&mut self.draw);
        driver.wander = Wander::none();
        let route = Route::new(self.roads, lane, &[], &driver, &mut self.draw);
        let mut vehicle = Vehicle::new(AgentKind::Vehicle, size, driver, route, station, 0.0);
        let base = self.roads.lanes[lane].course.pose(station);
        let offset = base.to_body(place.pose.position()).y;
        vehicle.lateral = Lateral { offset, slope: 0.0, target: offset };
        vehicle.script = Script::PullOut { gap };
        self.traffic.vehicles.push(vehicle);
        let index = self.traffic.vehicles.len() - 1;
        self.vehicles_that_matter.push(index);
        // It has room to get out.
        let near = |other: &usize| {
            let at = place.pose.to_body(self.roads.bays[*other].pose.position());
            at.y.abs() < 2.5 && at.x > -1.0 && at.x < 24.0
        };
        let free: Vec<usize> = (0..self.roads.bays.len()).filter(near).collect();
        self.free_bays.extend(free);
        Some(index)
    }
}
