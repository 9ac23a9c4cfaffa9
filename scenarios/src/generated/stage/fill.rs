//! Everybody whom a family does not send in itself: traffic, parked vehicles, people and bicycles.

use world::geometry::{Point, Pose};
use world::scene::AgentKind;

use super::{Side, Stage};
use crate::generated::STEPS;
use crate::generated::draw::Draw;
use crate::generated::sizes;
use crate::generated::traffic::{Start, WARM_UP, Walker, somebody};

/// Nobody parks nearer (m) to where anybody drives, off the map.
const FREE: f64 = 7.5;

impl Stage<'_> {
    /// Everybody else: traffic, parked vehicles, people and bicycles.
    pub(super) fn fill(&mut self) {
        let mut draw = self.draw.stream(2);
        self.park(&mut draw);
        self.fill_lanes(&mut draw);
        self.fill_walks(&mut draw);
        self.traffic.inflow = 0.1 * self.density;
    }

    fn park(&mut self, draw: &mut Draw) {
        let share = draw.parameter("parked");
        for (index, bay) in self.roads.bays.iter().enumerate() {
            if draw.chance(share) && !self.free_bays.contains(&index) {
                let size = sizes::car(draw);
                let (along, across) = (0.5 * (bay.length - size[0]).max(0.0), 0.5 * (bay.width - size[1]).max(0.0));
                let at = Point::new(draw.between(-along, along) * 0.8, draw.between(-across, across) * 0.6);
                let at = bay.pose.to_world(at);
                let flip = if bay.beside.is_none() && draw.chance(0.4) { std::f64::consts::PI } else { 0.0 };
                let heading = bay.pose.heading + flip + draw.normal(0.0, 0.02).clamp(-0.05, 0.05);
                self.parked.push((Pose::new(at.x, at.y, heading), size));
            }
        }
        self.park_off_the_map(share, draw);
    }

    /// Rows of parked vehicles on grounds beside the streets, of which the map says nothing, as real ones do.
    fn park_off_the_map(&mut self, share: f64, draw: &mut Draw) {
        let ground: Vec<Point> = self
            .roads
            .lanes
            .iter()
            .flat_map(|lane| {
                let count = (lane.course.length() / 4.0).ceil().max(1.0);
                (0..=count as usize).map(move |k| lane.course.pose(lane.course.length() * k as f64 / count).position())
            })
            .collect();
        for street in 0..self.roads.streets.len() {
            for side in [Side::Forward, Side::Backward] {
                if self.slots(street, side) == 0 || !draw.chance(0.6) {
                    continue;
                }
                let lanes = self.lanes(street, side, usize::MAX);
                let lane = &self.roads.lanes[lanes[draw.below(lanes.len())]];
                let base = lane.course.pose(draw.between(0.0, lane.course.length()));
                let (rows, columns) = (1 + draw.below(4), 6 + draw.below(16));
                let away = draw.between(9.0, 20.0);
                // Of the ground that is driven on, what can be near.
                let reach = FREE + Point::new(1.4 * columns as f64, away + 6.5 * rows as f64 + 2.0).norm();
                let near: Vec<Point> =
                    ground.iter().copied().filter(|point| point.distance(base.position()) < reach).collect();
                for row in 0..rows {
                    // Two rows face each other across an aisle.
                    let left = -away - 5.4 * row as f64 - 6.5 * (row / 2) as f64;
                    for column in 0..columns {
                        let taken = draw.chance(0.8 * share);
                        let place =
                            Point::new(2.8 * column as f64 - 1.4 * columns as f64, left + draw.normal(0.0, 0.2));
                        let at = base.to_world(place);
                        let flip = if draw.chance(0.3) { -1.0 } else { 1.0 };
                        let heading = base.heading + flip * std::f64::consts::FRAC_PI_2 + draw.normal(0.0, 0.02);
                        let size = sizes::car(draw);
                        let is_free = |point: &Point| point.distance_squared(at) > FREE * FREE;
                        let clear = |(pose, _): &(Pose, [f64; 3])| {
                            let apart = pose.position().distance_squared(at);
                            apart > 5.3 * 5.3 || apart > 2.4 * 2.4 && libm::sin(pose.heading - heading).abs() < 0.2
                        };
                        if taken && near.iter().all(is_free) && self.parked.iter().all(clear) {
                            self.parked.push((Pose::new(at.x, at.y, heading), size));
                        }
                    }
                }
            }
        }
    }

    fn fill_lanes(&mut self, draw: &mut Draw) {
        let mut taken: Vec<(Point, f64)> =
            self.traffic.vehicles.iter().map(|v| (v.pose(self.roads).position(), v.speed)).collect();
        for lane in 0..self.roads.lanes.len() {
            let here = &self.roads.lanes[lane];
            if here.way.is_some() || here.course.length() < 6.0 {
                continue;
            }
            let mean = match (here.bike, here.lot) {
                (true, _) => 500.0,
                (_, true) => 200.0,
                _ => 26.0 / self.density.max(0.02),
            };
            let mut station = draw.between(3.0, 3.0 + mean);
            while station < here.course.length() - 3.0 {
                let pose = here.course.pose(station);
                let at = pose.position();
                let clear = |(other, speed): &(Point, f64)| {
                    let apart = other.distance(at);
                    apart > 8.0 + 1.0 * speed.min(here.limit) || apart > 3.0 && pose.to_body(*other).y.abs() > 2.4
                };
                if taken.iter().all(clear) {
                    if here.bike {
                        self.cyclist((lane, station), 0.0, false);
                    } else {
                        let mut newcomer = somebody(self.roads, lane, station, draw);
                        // Whoever is before a junction can still stop.
                        let stop = (newcomer.route.to_junction(self.roads, station) - 4.0).max(0.0);
                        newcomer.speed = newcomer.speed.min((2.0 * 1.3 * stop).sqrt());
                        self.traffic.vehicles.push(newcomer);
                    }
                    let speed = self.traffic.vehicles.last().map_or(0.0, |vehicle| vehicle.speed);
                    taken.push((at, speed));
                }
                // Exponential gaps, as where nobody minds anybody; the warm-up sorts them out.
                station += 7.0 - mean * libm::log(1.0 - draw.between(0.0, 0.999));
            }
        }
        let violators = draw.parameter("violators");
        for vehicle in self.traffic.vehicles.iter_mut().skip(1) {
            vehicle.violator |= draw.chance(violators) && vehicle.kind == AgentKind::Vehicle;
        }
    }

    fn fill_walks(&mut self, draw: &mut Draw) {
        for walk in &self.roads.walks {
            let mean = 130.0 / self.people.max(0.02);
            let mut station = draw.between(0.0, 2.0 * mean);
            while station < walk.length() {
                let stands = draw.chance(0.12);
                let starts = if stands { Start::Never } else { Start::Step(i32::MIN) };
                let walker = Walker::new(walk.clone(), None, starts, draw);
                let walked = if walker.back { walk.length() - station } else { station };
                let mut walker = walker.on_the_way(walked);
                if stands {
                    walker.stand();
                }
                self.traffic.walkers.push(walker);
                station -= mean * libm::log(1.0 - draw.between(0.0, 0.999)) - 1.5;
            }
        }
        for crossing in 0..self.roads.crossings.len() {
            let mut expected = 0.5 * self.people;
            while expected > 0.0 {
                if draw.chance(expected.min(1.0)) {
                    let course = self.roads.crossings[crossing].course.clone();
                    let starts = Start::Step(draw.below(WARM_UP + STEPS) as i32 - WARM_UP as i32);
                    let walker = self.in_line(Walker::new(course, Some(crossing), starts, draw));
                    self.traffic.walkers.push(walker);
                }
                expected -= 1.0;
            }
        }
    }

    /// Behind those who wait at the same end of the same crossing.
    pub(super) fn in_line(&self, walker: Walker) -> Walker {
        let with = |other: &&Walker| other.crossing == walker.crossing && other.back == walker.back;
        let nth = self.traffic.walkers.iter().filter(with).count();
        walker.in_line(nth)
    }
}
