//! Turns readings into a step's record and events: nets them against the human's, remembers who was hit, and says each
//! thing once.

use std::cell::LazyCell;

use wire::proto;
use wire::proto::event::{Contact, Kind};
use world::plan::STEP_SECONDS;
use world::scene::{AgentKind, Scene, TrackId};

use super::course::{Course, Faults, Reading};
use super::human::Human;
use super::traffic::Traffic;
use crate::advance::Advance;
use crate::judges::collision::{classify, is_ahead, is_at_fault, is_behind, overlaps};
use crate::judges::time_to_collision::{
    HORIZON_STEPS, LEAST_TIME_TO_COLLISION, STANDING_SPEED, TrafficAgent, time_to_collision,
};
use crate::judges::{Body, STOREY};
use crate::metrics::NettedStep;

/// How a rule stands at a step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Standing {
    #[default]
    Kept,
    /// Broken, but by the logged AV too.
    Netted,
    Broken,
}

impl Standing {
    fn of(broken: bool, human_breaks_it: bool) -> Self {
        match (broken, human_breaks_it) {
            (false, _) => Self::Kept,
            (true, true) => Self::Netted,
            (true, false) => Self::Broken,
        }
    }
}

/// What there is to judge at a step.
#[derive(Clone, Copy)]
pub(super) struct Moment<'a> {
    pub course: &'a Course,
    pub human: &'a Human,
    pub log_index: usize,
    pub av: &'a Body,
    pub reading: &'a Reading,
    /// Whether the AV's box lies wholly in one lane, or across ones that lead into each other.
    pub in_one_lane: bool,
}

/// The judge of one drive.
#[derive(Clone, Debug)]
pub struct Referee {
    wheelbase: f64,
    tracks: Vec<(TrackId, AgentKind)>,
    /// Tracks that were hit: they count once, and are judged no more.
    hit: Vec<bool>,
    /// Tracks whose contact with the AV is netted, and goes on.
    netted: Vec<bool>,
    /// Steps since the AV last was where the logged AV drives the wrong way.
    since_wrong_way: u32,
    /// Agents that overlap the AV at this step; kept to spare an allocation.
    overlapping: Vec<TrafficAgent>,
    at_fault: Vec<(u32, AgentKind)>,
    /// For each step what of it the logged AV does there too.
    netted_steps: Vec<NettedStep>,
    off_route: Standing,
    off_road: Standing,
    wrong_way: Standing,
    speeding: Standing,
    low_time_to_collision: Standing,
}

impl Referee {
    pub(super) fn new(scene: &Scene, traffic: &Traffic, wheelbase: f64, steps: usize) -> Self {
        let tracks: Vec<_> = scene.tracks().iter().map(|track| (track.id, track.kind)).collect();
        Self {
            wheelbase,
            hit: vec![false; tracks.len()],
            netted: vec![false; tracks.len()],
            since_wrong_way: u32::MAX,
            overlapping: Vec::with_capacity(traffic.most_agents()),
            at_fault: Vec::new(),
            netted_steps: Vec::with_capacity(steps),
            off_route: Standing::Kept,
            off_road: Standing::Kept,
            wrong_way: Standing::Kept,
            speeding: Standing::Kept,
            low_time_to_collision: Standing::Kept,
            tracks,
        }
    }

    /// What was hit at fault so far, and at which step.
    pub(super) fn at_fault(&self) -> &[(u32, AgentKind)] {
        &self.at_fault
    }

    /// For each step what of it the logged AV does there too.
    pub(super) fn netted_steps(&self) -> &[NettedStep] {
        &self.netted_steps
    }

    /// Fills in the record and the events of a step.
    pub(super) fn judge(&mut self, moment: &Moment<'_>, advance: &mut Advance) {
        let (record, reading) = (&mut advance.record, moment.reading);
        record.station = reading.station;
        record.lateral_offset = reading.lateral_offset;
        record.route_distance = reading.route_distance;
        record.road_edge_distance = reading.road_edge_distance;
        record.speed_limit = reading.driven.speed_limit;
        record.backward_travel = reading.driven.backward_travel;
        record.in_one_lane = moment.in_one_lane;
        self.judge_traffic(moment, advance);
        self.judge_rules(moment, advance);
    }

    fn judge_traffic(&mut self, moment: &Moment<'_>, advance: &mut Advance) {
        let Moment { course, human, log_index, av, reading, in_one_lane } = *moment;
        let beside_matters = LazyCell::new(|| !in_one_lane || course.is_in_intersection(av, reading));
        let reach = av.outline.radius() + av.speed * HORIZON_STEPS as f64 * STEP_SECONDS;
        let mut least: Option<f64> = None;
        self.overlapping.clear();
        course.traffic.for_each_near(log_index, av.outline.center, reach, |agent| {
            if self.hit[agent.track] || (av.state.z - agent.z).abs() > STOREY {
                return;
            }
            if overlaps(av, agent) {
                self.overlapping.push(*agent);
                return;
            }
            self.netted[agent.track] = false;
            let center = agent.outline.center;
            let matters =
                || is_ahead(av, self.wheelbase, center) || (!is_behind(av, self.wheelbase, center) && *beside_matters);
            if av.speed > STANDING_SPEED && matters() {
                let time = time_to_collision(av, agent).filter(|time| {
                    *time >= LEAST_TIME_TO_COLLISION || !(agent.sudden || human.nets_time(av, agent, *time))
                });
                least = time.into_iter().chain(least).reduce(f64::min);
            }
        });
        for index in 0..self.overlapping.len() {
            let agent = self.overlapping[index];
            self.judge_contact(moment, &agent, advance);
        }
        let record = &mut advance.record;
        record.time_to_collision = if record.at_fault_collision { Some(0.0) } else { least };
    }

    fn judge_contact(&mut self, moment: &Moment<'_>, agent: &TrafficAgent, advance: &mut Advance) {
        let Moment { course, human, log_index, av, .. } = *moment;
        let Advance { record, events, .. } = advance;
        let contact = classify(av, self.wheelbase, agent);
        let at_fault = is_at_fault(contact, record.in_one_lane) && !agent.sudden;
        let netted = human.nets_contact(log_index, av, agent);
        let said = std::mem::replace(&mut self.netted[agent.track], netted);
        if netted && said {
            return;
        }
        let (track, kind) = self.tracks[agent.track];
        let relative_speed = (agent.velocity - av.velocity()).norm();
        if !netted {
            self.hit[agent.track] = true;
            record.collision = true;
            record.at_fault_collision |= at_fault;
            if at_fault {
                self.at_fault.push((record.step, kind));
            }
        }
        let whose = match (at_fault, agent.sudden) {
            (true, _) => "at fault",
            (false, true) => "not at fault: it was not to be seen a second ago",
            (false, false) => "not at fault",
        };
        let what = describe(contact);
        let which = if course.traffic.reacts(agent.track) { " (it reacts)" } else { "" };
        events.push(proto::Event {
            text: format!("{what} {kind} {track}{which} at {relative_speed:.1} m/s, {whose}{}", aside(netted)),
            track: Some(track.0),
            contact: contact.into(),
            at_fault,
            netted,
            relative_speed,
            ..event(record.step, Kind::Collision)
        });
    }

    fn judge_rules(&mut self, moment: &Moment<'_>, advance: &mut Advance) {
        let Moment { course, human, log_index, av, reading, .. } = *moment;
        let Advance { record, events, .. } = advance;
        let (own, log) = (reading.faults, self.netted_faults(human, av, reading));
        let step = record.step;
        let off_route = Standing::of(own.off_route, log.off_route);
        let off_road = Standing::of(own.off_road, log.off_road);
        let wrong_way = Standing::of(own.wrong_way, log.wrong_way);
        let speeding = Standing::of(own.speeding, log.speeding);
        self.netted_steps.push(NettedStep {
            overspeed: speeding == Standing::Netted || speeding == Standing::Kept && human.is_as_fast_at(av),
            backward_travel: self.since_wrong_way <= SECOND,
        });
        let low_time = record.time_to_collision.is_some_and(|time| time < LEAST_TIME_TO_COLLISION);
        record.off_route = off_route == Standing::Broken;
        record.off_road = off_road == Standing::Broken;
        record.wrong_way = wrong_way == Standing::Broken;
        record.speeding = speeding == Standing::Broken;
        record.outside_drivable_area = own.outside_drivable_area && !log.outside_drivable_area;

        let mut say = |now: Standing, before: &mut Standing, kind: Kind, text: &dyn Fn() -> String| {
            if now != *before && now != Standing::Kept {
                let netted = now == Standing::Netted;
                events.push(proto::Event { text: text() + aside(netted), netted, ..event(step, kind) });
            }
            *before = now;
        };
        say(off_route, &mut self.off_route, Kind::OffRoute, &|| {
            format!("{:.1} m from the route", reading.route_distance)
        });
        say(off_road, &mut self.off_road, Kind::OffRoad, &|| {
            format!("a corner is {:.2} m beyond the road's edge", reading.road_edge_distance.unwrap_or(0.0))
        });
        say(wrong_way, &mut self.wrong_way, Kind::WrongWay, &|| {
            format!("{:.1} m against the lane within a second", reading.driven.backward_travel)
        });
        say(speeding, &mut self.speeding, Kind::Speeding, &|| {
            format!("{:.1} m/s where {:.1} m/s are allowed", av.speed, reading.driven.speed_limit)
        });
        say(Standing::of(low_time, false), &mut self.low_time_to_collision, Kind::LowTimeToCollision, &|| {
            format!("{:.1} s to collision", record.time_to_collision.unwrap_or(0.0))
        });
        for stop in course.red_stops_crossed(log_index, reading) {
            let now = Standing::of(true, !stop.known || human.crosses_red(stop));
            record.red_light |= now == Standing::Broken;
            let unknown = if stop.known { "" } else { ", which was not to be seen a second ago" };
            say(now, &mut Standing::Kept, Kind::RedLight, &|| {
                format!("crossed the stop point of lane {} at red{unknown}", stop.lane)
            });
        }
    }
}

impl Referee {
    /// Which faults the logged AV has at the same place. Metres against a lane are summed over a second: they are netted where they
    /// were driven, not only where the sum is read.
    fn netted_faults(&mut self, human: &Human, av: &Body, reading: &Reading) -> Faults {
        let log = human.nets(av, reading);
        self.since_wrong_way = if human.goes_wrong_at(av) { 0 } else { self.since_wrong_way.saturating_add(1) };
        Faults { wrong_way: reading.faults.wrong_way && self.since_wrong_way <= SECOND, ..log }
    }
}

/// Steps of the second over which driving against a lane is summed.
const SECOND: u32 = 10;

fn event(step: u32, kind: Kind) -> proto::Event {
    proto::Event { step, kind: kind.into(), ..proto::Event::default() }
}

fn aside(netted: bool) -> &'static str {
    if netted { " (the logged AV too: not counted)" } else { "" }
}

fn describe(contact: Contact) -> &'static str {
    match contact {
        Contact::Front => "the AV's front struck",
        Contact::StoppedTrack => "the AV struck the standing",
        Contact::Rear => "from behind struck by",
        Contact::Lateral => "side to side with",
        Contact::Standing | Contact::Unspecified => "struck while standing by",
    }
}
