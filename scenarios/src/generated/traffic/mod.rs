//! Traffic on laid roads, step by step: everybody watches what is ahead, asks for the right of way, and moves on.
//!
//! | module | what |
//! | --- | --- |
//! | `driver` | how somebody follows, and misjudges |
//! | `route` | the lanes ahead, and how fast they can be driven |
//! | `signals`, `right_of_way` | who may enter a junction |
//! | `lane_change` | who goes over to the lane beside |
//! | `vehicle`, `walker` | those who move |
//! | `ahead` | what somebody on wheels minds |

mod ahead;
mod driver;
mod lane_change;
mod right_of_way;
mod route;
mod signals;
mod vehicle;
mod walker;

use world::geometry::{OrientedBox, Point, boxes_overlap};
use world::scene::AgentKind;

use super::STEPS;
use super::curve::Curve;
use super::draw::Draw;
use super::roads::{Control, Crossing, LaneIndex, Roads, Turn};

pub(super) use driver::{Driver, Wander};
pub(super) use route::{Route, leads};
pub(super) use signals::Programme;
pub(super) use vehicle::{Lateral, Script, Vehicle};
pub(super) use walker::{Start, Walker};

/// Steps that are driven before the log begins, so that it begins in traffic that has settled.
pub(super) const WARM_UP: usize = 60;

/// The AV is the first of the vehicles.
pub(super) const AV: usize = 0;

/// The traffic of one scene.
#[derive(Debug)]
pub(super) struct Traffic<'r> {
    pub(super) roads: &'r Roads,
    /// For each junction with lights what they show.
    pub(super) programmes: Vec<Option<Programme>>,
    pub(super) vehicles: Vec<Vehicle>,
    pub(super) walkers: Vec<Walker>,
    /// Those of the roads, and those that are on no map.
    pub(super) crossings: Vec<Crossing>,
    /// The step; those before the log are negative.
    step: i32,
    draw: Draw,
    /// Who is on each lane, or reaches into it.
    on: Vec<Vec<Place>>,
    /// Where each vehicle was at most [`ROUGHLY`] steps ago: enough to tell who is far away.
    whereabouts: Vec<Point>,
    /// Who has been granted each way through a junction.
    grants: Vec<Vec<Grant>>,
    /// How many grants there have been.
    order: u32,
    conflicts: Vec<Vec<Crosses>>,
    /// For each crossing the lanes that it crosses.
    crossed: Vec<Vec<Crossed>>,
    /// For each lane those crossings.
    crossed_by: Vec<Vec<Crossed>>,
    /// Lanes at the rim where vehicles come in, and how many a second.
    sources: Vec<LaneIndex>,
    pub(super) inflow: f64,
}

/// Steps after which it is looked again where vehicles roughly are.
const ROUGHLY: i32 = 4;

/// Somebody on a lane.
#[derive(Clone, Copy, Debug)]
struct Place {
    vehicle: usize,
    station: f64,
    /// From this lane's centre line (m).
    offset: f64,
    /// Reaches in from the lane beside.
    beside: bool,
}

#[derive(Clone, Copy, Debug)]
struct Grant {
    vehicle: usize,
    order: u32,
}

/// A conflict seen from one of its lanes.
#[derive(Clone, Copy, Debug)]
struct Crosses {
    other: LaneIndex,
    own_span: (f64, f64),
    other_span: (f64, f64),
    merging: bool,
}

/// Where a lane is crossed by people.
#[derive(Clone, Copy, Debug)]
struct Crossed {
    lane: LaneIndex,
    crossing: usize,
    /// Stations of the lane between which one is in their way.
    span: (f64, f64),
    /// The station of the crossing there.
    at: f64,
}

impl<'r> Traffic<'r> {
    /// Nobody yet.
    pub(super) fn new(roads: &'r Roads, mut draw: Draw) -> Self {
        let lanes = roads.lanes.len();
        let mut conflicts = vec![Vec::new(); lanes];
        for conflict in roads.junctions.iter().flat_map(|junction| &junction.conflicts) {
            let (one, other, merging) = (conflict.one, conflict.other, conflict.merging);
            let (a, b) = (conflict.one_span, conflict.other_span);
            conflicts[one].push(Crosses { other, own_span: a, other_span: b, merging });
            conflicts[other].push(Crosses { other: one, own_span: b, other_span: a, merging });
        }
        let programmes = roads
            .junctions
            .iter()
            .map(|junction| {
                let arrows = draw.chance(0.4);
                (junction.control == Control::Signals).then(|| Programme::new(junction, roads, arrows, &mut draw))
            })
            .collect();
        let sources = (0..lanes)
            .filter(|lane| {
                let lane = &roads.lanes[*lane];
                lane.entries.is_empty() && !lane.bike && !lane.lot
            })
            .collect();
        let mut traffic = Self {
            roads,
            programmes,
            vehicles: Vec::new(),
            walkers: Vec::new(),
            crossings: roads.crossings.clone(),
            step: -(WARM_UP as i32),
            draw,
            on: vec![Vec::new(); lanes],
            whereabouts: Vec::new(),
            grants: vec![Vec::new(); lanes],
            order: 0,
            conflicts,
            crossed: vec![Vec::new(); roads.crossings.len()],
            crossed_by: vec![Vec::new(); lanes],
            sources,
            inflow: 0.0,
        };
        for (index, lane) in roads.lanes.iter().enumerate() {
            for (crossing, from, to) in &lane.crossed {
                traffic.cross(*crossing, index, (*from, *to));
            }
        }
        traffic
    }

    /// Lets a crossing cross a lane between two of its stations.
    fn cross(&mut self, crossing: usize, lane: LaneIndex, span: (f64, f64)) {
        let middle = self.roads.lanes[lane].course.pose(0.5 * (span.0 + span.1)).position();
        let course = &self.crossings[crossing].course;
        let crossed = Crossed { lane, crossing, span, at: course.nearest(middle) };
        self.crossed[crossing].push(crossed);
        self.crossed_by[lane].push(crossed);
    }

    /// Adds a crossing that is on no map, over `lanes` at these stations.
    pub(super) fn add_crossing(&mut self, course: Curve, lanes: &[(LaneIndex, f64)]) -> usize {
        let crossing = self.crossings.len();
        self.crossings.push(Crossing { course: course.into(), arm: None });
        self.crossed.push(Vec::new());
        for (lane, station) in lanes {
            self.cross(crossing, *lane, (station - 0.8, station + 0.8));
        }
        crossing
    }

    /// Drives the warm-up and the log. After each step of the log `watch` looks at the vehicles; an error ends the drive.
    pub(super) fn run<E>(&mut self, watch: impl Fn(&[Vehicle], usize) -> Result<(), E>) -> Result<(), E> {
        self.vehicles.iter_mut().for_each(Vehicle::settle);
        while self.step < STEPS as i32 {
            if self.step == 0 {
                self.disentangle();
            }
            if let Ok(step) = usize::try_from(self.step) {
                self.record(step);
                watch(&self.vehicles, step)?;
            }
            self.advance();
        }
        Ok(())
    }

    /// Takes away whoever began too close to another for the warm-up to sort it out: not those that the family sent in, who came first.
    fn disentangle(&mut self) {
        let body = |vehicle: &Vehicle| {
            OrientedBox::new(vehicle.pose(self.roads), vehicle.size[0] + 0.6, vehicle.size[1] + 0.2)
        };
        let bodies: Vec<Option<OrientedBox>> =
            self.vehicles.iter().map(|vehicle| vehicle.present.then(|| body(vehicle))).collect();
        let mut kept: Vec<usize> = Vec::new();
        for (index, own) in bodies.iter().enumerate() {
            let Some(own) = own else { continue };
            let hits = |other: &usize| {
                bodies[*other].as_ref().is_some_and(|other| {
                    own.center.distance(other.center) < own.radius() + other.radius() && boxes_overlap(own, other)
                })
            };
            if kept.iter().any(hits) {
                self.take_back(index, 0);
                self.vehicles[index].present = false;
            } else {
                kept.push(index);
            }
        }
    }

    fn record(&mut self, step: usize) {
        for vehicle in self.vehicles.iter_mut().filter(|vehicle| vehicle.present) {
            let same = step.checked_sub(1).filter(|_| vehicle.rests).and_then(|before| vehicle.poses[before]);
            vehicle.poses[step] = Some(same.unwrap_or_else(|| vehicle.pose(self.roads)));
        }
        for walker in self.walkers.iter_mut().filter(|walker| walker.crossing.is_some() || !walker.has_arrived()) {
            let same = step.checked_sub(1).filter(|_| walker.rests()).and_then(|before| walker.poses[before]);
            walker.poses[step] = Some(same.unwrap_or_else(|| walker.pose()));
        }
    }

    fn advance(&mut self) {
        self.let_in();
        self.find_places();
        for me in 0..self.vehicles.len() {
            if self.vehicles[me].present {
                self.follow_script(me);
                self.consider_lanes(me);
            }
        }
        for me in 0..self.vehicles.len() {
            if self.vehicles[me].present {
                let wish = self.wish(me);
                let vehicle = &mut self.vehicles[me];
                vehicle.acceleration =
                    vehicle.mind.react(&vehicle.driver, &mut self.draw, wish, vehicle.acceleration, vehicle.speed);
            }
        }
        for me in 0..self.vehicles.len() {
            let vehicle = &mut self.vehicles[me];
            if !vehicle.present || matches!(vehicle.script, Script::PullOut { .. }) {
                continue;
            }
            vehicle.advance(self.roads);
            self.leave_ways(me);
        }
        for index in 0..self.walkers.len() {
            if !self.walkers[index].walking && self.begins_to_walk(index) {
                self.walkers[index].walking = true;
            }
            let slowest = self.slowest_ahead(&self.walkers[index]);
            self.walkers[index].advance(slowest);
        }
        self.step += 1;
    }

    /// How fast (m/s) somebody who crosses can walk for whoever is right before them; nothing slows those on sidewalks.
    fn slowest_ahead(&self, walker: &Walker) -> f64 {
        if walker.crossing.is_none() || !walker.is_on_the_way() {
            f64::INFINITY
        } else if self.is_shut(walker) {
            0.0
        } else {
            let ahead = self.walkers.iter().filter(|other| walker.is_behind(other));
            ahead.map(|other| other.speed).fold(f64::INFINITY, f64::min)
        }
    }

    /// Whether a vehicle stands or passes right before somebody who crosses.
    fn is_shut(&self, walker: &Walker) -> bool {
        let at = walker.pose();
        let next = at.to_world(Point::new(1.1, 0.0));
        let near =
            self.vehicles.iter().zip(&self.whereabouts).filter(|(_, place)| place.distance_squared(next) < 400.0);
        near.filter(|(vehicle, _)| vehicle.present).any(|(vehicle, _)| {
            let centre = self.roads.lanes[vehicle.lane()].course.pose(vehicle.station);
            if centre.position().distance_squared(next) > 64.0 {
                return false;
            }
            let seen = vehicle.pose(self.roads).to_body(next);
            let (front, rear) = (0.5 * vehicle.size[0] + 0.3 + 0.3 * vehicle.speed, -0.5 * vehicle.size[0] - 0.3);
            (rear..front).contains(&seen.x) && seen.y.abs() < 0.5 * vehicle.size[1] + 0.55
        })
    }

    /// Grants end where the rear has left the way by a vehicle's length.
    fn leave_ways(&mut self, me: usize) {
        let vehicle = &self.vehicles[me];
        let rear = vehicle.way() - 0.5 * vehicle.size[0];
        for index in (0..vehicle.at).rev() {
            let end = vehicle.route.starts[index + 1];
            let lane = vehicle.route.lanes[index];
            if rear > end + 1.0 || !vehicle.present {
                if !self.grants[lane].is_empty() {
                    self.grants[lane].retain(|grant| grant.vehicle != me);
                }
                if rear > end + 40.0 {
                    break;
                }
            }
        }
        if !vehicle.present {
            self.grants.iter_mut().for_each(|grants| grants.retain(|grant| grant.vehicle != me));
        }
    }

    fn find_places(&mut self) {
        let known = if self.step.rem_euclid(ROUGHLY) == 0 { 0 } else { self.whereabouts.len() };
        self.whereabouts.truncate(known);
        let place = |vehicle: &Vehicle| self.roads.lanes[vehicle.lane()].course.pose(vehicle.station).position();
        self.whereabouts.extend(self.vehicles[known..].iter().map(place));
        self.on.iter_mut().for_each(Vec::clear);
        for (index, vehicle) in self.vehicles.iter().enumerate().filter(|(_, vehicle)| vehicle.present) {
            let (lane, station) = (vehicle.lane(), vehicle.station);
            let offset = vehicle.across().0;
            self.on[lane].push(Place { vehicle: index, station, offset, beside: false });
            let here = &self.roads.lanes[lane];
            let reach = offset.abs() + 0.5 * vehicle.size[1] - 0.5 * here.width;
            if reach < 0.1 || vehicle.kind != AgentKind::Vehicle {
                continue;
            }
            let side = if offset > 0.0 { here.left } else { here.right };
            if let Some(beside) = side {
                let apart = 0.5 * (here.width + self.roads.lanes[beside].width) * offset.signum();
                let share = self.roads.lanes[beside].course.length() / here.course.length();
                self.on[beside].push(Place {
                    vehicle: index,
                    station: station * share,
                    offset: offset - apart,
                    beside: true,
                });
            }
        }
    }

    /// Vehicles come in at the rim, where there is room.
    fn let_in(&mut self) {
        for index in 0..self.sources.len() {
            let lane = self.sources[index];
            if !self.draw.chance(self.inflow * 0.1) || self.vehicles.len() > 220 {
                continue;
            }
            let last =
                self.on[lane].iter().map(|place| (place.station, place.vehicle)).min_by(|a, b| a.0.total_cmp(&b.0));
            let speed = last.map_or(f64::INFINITY, |(_, vehicle)| self.vehicles[vehicle].speed);
            let speed = speed.min(0.95 * self.roads.lanes[lane].limit);
            if last.is_some_and(|(station, _)| station < 12.0 + 1.6 * speed) {
                continue;
            }
            let mut newcomer = somebody(self.roads, lane, 3.0, &mut self.draw);
            newcomer.speed = speed.min(newcomer.route.cap(3.0));
            newcomer.settle();
            self.vehicles.push(newcomer);
        }
    }
}

/// A vehicle of the traffic, somewhere on a lane.
pub(super) fn somebody(roads: &Roads, lane: LaneIndex, station: f64, draw: &mut Draw) -> Vehicle {
    let driver = Driver::anybody(draw);
    let size = super::sizes::vehicle(draw);
    // What is long goes straight on where it can: it would not get round the corner in its lane.
    let turns: &[Turn] = if size[0] > 6.5 { &[Turn::Straight; 8] } else { &[] };
    let route = Route::new(roads, lane, turns, &driver, draw);
    let speed = 0.9 * route.cap(station);
    Vehicle::new(AgentKind::Vehicle, size, driver, route, station, speed)
}
