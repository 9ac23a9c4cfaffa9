//! The logged AV, judged by the same rules as any other driver, and what others are not charged for because of it.
//!
//! Faults are netted **by place**: what the logged AV breaks anywhere in its log is no fault of a driver who breaks it at the same
//! place, whenever that is. The same place is within a metre of where it was: of its box for corners off the road, of its way for
//! its lane and its speed; for contacts, and for what leads to them, of where it was and of where it was beside the same track. A
//! contact with the same track at the same time is netted too, wherever it is. Steps at which the logged AV was not seen excuse
//! nothing.

use std::ops::Range;

use world::geometry::{OrientedBox, Point, Segment, boxes_overlap};
use world::plan::STEP_SECONDS;
use world::route::follow::Follower;
use world::scene::bridged::Bridged;

use super::course::{Course, Faults, Reader, Reading};
use crate::judges::collision::overlaps;
use crate::judges::lanes::{Driven, WRONG_WAY};
use crate::judges::red_light::RedStop;
use crate::judges::time_to_collision::{HORIZON_STEPS, LEAST_TIME_TO_COLLISION, TrafficAgent, time_to_collision};
use crate::judges::{Body, STOREY};
use crate::metrics::nuplan::OVERSPEED;

/// Within this distance (m) of where the logged AV was it is the same place.
pub const SAME_PLACE: f64 = 1.0;

/// An AV that is faster by less than this (m/s) is as fast.
const AS_FAST: f64 = 0.1;

/// Steps of the second over which driving against a lane is summed.
const SECOND: usize = 10;

/// The logged AV over the whole log.
#[derive(Clone, Debug)]
pub struct Human {
    /// How it was followed along the line up to where the drive starts.
    at_start: Follower,
    red_stops_crossed: Vec<RedStop>,
    /// Where it breaks a rule.
    places: Vec<Place>,
    /// Its box at each log index, and its height.
    bodies: Vec<Option<(OrientedBox, f64)>>,
    /// Where it meets tracks or nearly does, in ascending order of track.
    encounters: Vec<Encounter>,
    /// Where it is along the reference line (m), by log index, from the start of the drive to its end.
    stations: Vec<(usize, f64)>,
}

/// The logged AV where it breaks a rule.
#[derive(Clone, Copy, Debug)]
struct Place {
    outline: OrientedBox,
    z: f64,
    speed: f64,
    faults: Faults,
    /// It is above the speed limit, be it by less than counts as speeding.
    over_limit: bool,
}

/// What the lanes may say of the logged AV at a log index. They say different things, depending on where they begin to follow it:
/// the lane of the step before is kept while it holds the centre. So they are asked as they are of a drive too.
#[derive(Clone, Copy, Debug, Default)]
struct LaneFaults {
    wrong_way: bool,
    over_limit: bool,
}

impl LaneFaults {
    fn add(&mut self, speed: f64, told: Driven) {
        self.wrong_way |= told.backward_travel >= WRONG_WAY;
        self.over_limit |= told.speed_limit > 0.0 && speed > told.speed_limit;
    }
}

/// The logged AV beside a track, from one step to the next.
#[derive(Clone, Copy, Debug)]
struct Encounter {
    track: usize,
    way: Segment,
    /// The same in the track's frame (m, from centre to centre).
    beside: Segment,
    /// Their boxes overlap; else they would within less than the least time to collision.
    contact: bool,
}

impl Human {
    /// The logged AV of a scene, for a drive from log index `start` to before `end`.
    #[must_use]
    pub fn of(bridged: &Bridged, course: &Course, start: usize, end: usize) -> Self {
        let mut reader = Reader::default();
        let mut human = Self {
            at_start: Follower::default(),
            red_stops_crossed: Vec::new(),
            places: Vec::new(),
            bodies: Vec::new(),
            encounters: Vec::new(),
            stations: Vec::new(),
        };
        let mut readings: Vec<Option<(Body, Reading)>> = Vec::new();
        let scene = bridged.judged();
        for (log_index, state) in scene.av().states.iter().enumerate() {
            if log_index == start {
                human.at_start = reader.follower();
            }
            let Some(state) = state else {
                reader.miss();
                readings.push(None);
                continue;
            };
            let body = Body::of(*state);
            let at = reader.follow(course, state.pose(), state.z - 0.5 * state.height);
            if bridged.unseen(scene.av_index(), log_index) != Some(0) {
                reader.miss();
                readings.push(None);
                continue;
            }
            let reading = reader.read(course, &body, at);
            human.red_stops_crossed.extend(course.red_stops_crossed(log_index, &reading).copied());
            readings.push(Some((body, reading)));
        }
        human.places = places(&readings, &lane_faults(course, &reader, &readings, start..end.min(readings.len())));
        let outline = |at: &Option<(Body, Reading)>| at.as_ref().map(|(body, _)| (body.outline, body.state.z));
        human.bodies = readings.iter().map(outline).collect();
        human.encounters = encounters(course, &readings);
        human.stations = stations(&readings, start, end);
        human
    }

    /// How it was followed along the line up to where the drive starts.
    #[must_use]
    pub fn at_start(&self) -> Follower {
        self.at_start
    }

    /// Whether it crosses that stop point at red, at any step: turning right at red, or a signal that was read wrong.
    #[must_use]
    pub fn crosses_red(&self, stop: &RedStop) -> bool {
        self.red_stops_crossed.iter().any(|own| own.is_same_place(stop))
    }

    /// Where it is along the reference line (m), by the log indices at which it is there, from the start of the drive to its end.
    #[must_use]
    pub fn stations(&self) -> &[(usize, f64)] {
        &self.stations
    }

    /// Which of the faults of an AV that is so read the logged AV has at the same place.
    #[must_use]
    pub fn nets(&self, av: &Body, reading: &Reading) -> Faults {
        let own = reading.faults;
        if own == Faults::default() || self.places.is_empty() {
            return Faults::default();
        }
        let center = av.outline.center;
        let here = || self.places_at(av);
        let passes = |fault: fn(&Place) -> bool| here().any(|place| fault(place) && place.is_passed_at(center));
        let corners = av.outline.corners();
        let covers = |broken: [bool; 4], fault: fn(&Place) -> bool| {
            let covered = |corner: Point| here().any(|place| fault(place) && place.covers(corner));
            corners.into_iter().zip(broken).all(|(corner, broken)| !broken || covered(corner))
        };
        Faults {
            off_route: own.off_route && passes(|place| place.faults.off_route),
            off_road: own.off_road && covers(reading.corners.off_road, |place| place.faults.off_road),
            outside_drivable_area: own.outside_drivable_area
                && covers(reading.corners.outside, |place| place.faults.outside_drivable_area),
            wrong_way: own.wrong_way && self.goes_wrong_at(av),
            speeding: own.speeding
                && here().any(|place| {
                    place.faults.speeding && place.is_passed_at(center) && av.speed - place.speed <= OVERSPEED
                }),
        }
    }

    /// Whether the logged AV drives against its lane there.
    #[must_use]
    pub fn goes_wrong_at(&self, av: &Body) -> bool {
        self.places_at(av).any(|place| place.faults.wrong_way && place.is_passed_at(av.outline.center))
    }

    /// Whether the logged AV is above the limit there, and as fast.
    #[must_use]
    pub fn is_as_fast_at(&self, av: &Body) -> bool {
        let is_as_fast = |place: &Place| place.over_limit && av.speed <= place.speed + AS_FAST;
        self.places_at(av).any(|place| is_as_fast(place) && place.is_passed_at(av.outline.center))
    }

    /// Where it breaks a rule, on the AV's level.
    fn places_at(&self, av: &Body) -> impl Iterator<Item = &Place> {
        let z = av.state.z;
        self.places.iter().filter(move |place| (place.z - z).abs() <= STOREY)
    }

    /// Whether the logged AV overlaps that track too: where the AV does, or when it does.
    #[must_use]
    pub fn nets_contact(&self, log_index: usize, av: &Body, agent: &TrafficAgent) -> bool {
        let now = self.bodies.get(log_index).copied().flatten();
        now.is_some_and(|(outline, z)| (z - agent.z).abs() <= STOREY && boxes_overlap(&outline, &agent.outline))
            || self.comes_by(agent.track, Spot::now(av, agent), |encounter| encounter.contact)
    }

    /// Whether the logged AV comes as near to that track too, at the same place; or what would be hit in `time` (s) it hits too.
    #[must_use]
    pub fn nets_time(&self, av: &Body, agent: &TrafficAgent, time: f64) -> bool {
        self.comes_by(agent.track, Spot::now(av, agent), |_| true)
            || self.comes_by(agent.track, Spot::after(time, av, agent), |encounter| encounter.contact)
    }

    fn comes_by(&self, track: usize, at: Spot, which: impl Fn(&Encounter) -> bool) -> bool {
        let first = self.encounters.partition_point(|encounter| encounter.track < track);
        let own = self.encounters[first..].iter().take_while(|encounter| encounter.track == track);
        let is_near = |way: &Segment, point: Point| way.nearest_to(point).distance_squared <= SAME_PLACE * SAME_PLACE;
        own.filter(|encounter| which(encounter))
            .any(|encounter| is_near(&encounter.way, at.center) && is_near(&encounter.beside, at.beside))
    }
}

/// An AV's centre, and the same in the frame of a track.
#[derive(Clone, Copy, Debug)]
struct Spot {
    center: Point,
    beside: Point,
}

impl Spot {
    fn now(av: &Body, agent: &TrafficAgent) -> Self {
        Self::after(0.0, av, agent)
    }

    /// Where both will be if they go on as they do.
    fn after(time: f64, av: &Body, agent: &TrafficAgent) -> Self {
        let center = av.outline.center + av.velocity() * time;
        let track = agent.outline.center + agent.outline.forward * (agent.speed * time);
        let offset = center - track;
        Self { center, beside: Point::new(offset.dot(agent.outline.forward), offset.dot(agent.outline.left())) }
    }
}

impl Place {
    /// Whether a corner lies where the logged AV's box was, or within a metre of it.
    fn covers(&self, corner: Point) -> bool {
        let offset = corner - self.outline.center;
        offset.dot(self.outline.forward).abs() <= self.outline.half_length + SAME_PLACE
            && offset.dot(self.outline.left()).abs() <= self.outline.half_width + SAME_PLACE
    }

    /// Whether a centre lies within a metre beside the logged AV's way; along it the boxes of two steps always meet.
    fn is_passed_at(&self, center: Point) -> bool {
        let offset = center - self.outline.center;
        offset.dot(self.outline.forward).abs() <= self.outline.half_length + SAME_PLACE
            && offset.dot(self.outline.left()).abs() <= SAME_PLACE
    }
}

/// What the lanes say of each log index, followed from the log's begin as by `reader`, and from where a drive begins; as it is read on the
/// way, and as it is settled at the end.
fn lane_faults(
    course: &Course,
    reader: &Reader,
    readings: &[Option<(Body, Reading)>],
    drive: Range<usize>,
) -> Vec<LaneFaults> {
    let mut faults = vec![LaneFaults::default(); readings.len()];
    let present = || readings.iter().enumerate().filter_map(|(index, at)| Some((index, at.as_ref()?)));
    for ((index, (body, reading)), settled) in present().zip(reader.settle(course)) {
        faults[index].add(body.speed, reading.driven);
        faults[index].add(body.speed, settled);
    }
    let driven = || present().filter(|(index, _)| drive.contains(index));
    let mut reader = Reader::default();
    for (index, (body, reading)) in driven() {
        faults[index].add(body.speed, reader.read_lanes(course, body, reading.sample));
    }
    for ((index, (body, _)), settled) in driven().zip(reader.settle(course)) {
        faults[index].add(body.speed, settled);
    }
    faults
}

fn places(readings: &[Option<(Body, Reading)>], lanes: &[LaneFaults]) -> Vec<Place> {
    let backs = |step: usize| {
        // Who is told to have driven a second against the lane did so during that second.
        lanes[step..].iter().take(SECOND + 1).any(|lanes| lanes.wrong_way)
    };
    let place = |(step, at): (usize, &Option<(Body, Reading)>)| {
        let (body, reading) = at.as_ref()?;
        let faults = Faults { wrong_way: backs(step), ..reading.faults };
        let over_limit = lanes[step].over_limit;
        let place = Place { outline: body.outline, z: body.state.z, speed: body.speed, faults, over_limit };
        (over_limit || faults != Faults::default()).then_some(place)
    };
    readings.iter().enumerate().filter_map(place).collect()
}

fn encounters(course: &Course, readings: &[Option<(Body, Reading)>]) -> Vec<Encounter> {
    // Each track's place beside the AV at the last step at which it was near, that step, and how near it was.
    type Seen = (usize, Spot, Option<bool>);
    let mut before: Vec<Option<Seen>> = vec![None; course.traffic.tracks()];
    let mut encounters = Vec::new();
    for (log_index, at) in readings.iter().enumerate() {
        let Some((body, _)) = at else { continue };
        let reach = body.outline.radius() + body.speed * HORIZON_STEPS as f64 * STEP_SECONDS;
        course.traffic.for_each_near(log_index, body.outline.center, reach, |agent| {
            if (body.state.z - agent.z).abs() > STOREY {
                return;
            }
            let contact = if overlaps(body, agent) {
                Some(true)
            } else {
                time_to_collision(body, agent).filter(|time| *time < LEAST_TIME_TO_COLLISION).map(|_| false)
            };
            let here = Spot::now(body, agent);
            let last = before[agent.track].replace((log_index, here, contact));
            let last = last.filter(|(step, ..)| step + 1 == log_index);
            let start = last.map_or(here, |(_, spot, _)| spot);
            let way = Segment { start: start.center, end: here.center };
            let beside = Segment { start: start.beside, end: here.beside };
            // The step in which it begins and the one in which it ends belong to it.
            let told = [contact, last.and_then(|(.., contact)| contact)];
            for kind in [true, false] {
                if told.contains(&Some(kind)) {
                    encounters.push(Encounter { track: agent.track, way, beside, contact: kind });
                }
            }
        });
    }
    encounters.sort_by_key(|encounter| encounter.track);
    encounters
}

fn stations(readings: &[Option<(Body, Reading)>], start: usize, end: usize) -> Vec<(usize, f64)> {
    let driven = readings.iter().enumerate().take(end).skip(start);
    driven.filter_map(|(log_index, at)| Some((log_index, at.as_ref()?.1.station))).collect()
}
