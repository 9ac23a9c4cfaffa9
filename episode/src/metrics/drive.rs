//! What the metrics are computed from: a drive's records and events, and the human's drive beside it.

use std::collections::BTreeSet;

use wire::proto;
use wire::proto::event::Kind;
use world::geometry::Pose;
use world::scene::{AgentKind, Judgement};

use super::comfort::{self, Ride};
use super::feasibility::{self, Pace};
use super::{Counted, nuplan, paper};
use crate::judges::lanes::Driven;
use crate::judges::rear_axle_to_center;
use crate::judges::time_to_collision::LEAST_TIME_TO_COLLISION;

/// A drive, and the human's beside it.
#[derive(Clone, Copy, Debug)]
pub struct Drive<'a> {
    /// A record a step.
    pub records: &'a [proto::StepRecord],
    /// What happened.
    pub events: &'a [proto::Event],
    /// Which of its steps count.
    pub counted: Counted<'a>,
    /// What the AV hit at fault, and at which step.
    pub at_fault: &'a [(u32, AgentKind)],
    /// The logged AV at each record's log index, if it is there.
    pub human: &'a [Option<Pose>],
    /// How it began.
    pub start: Start,
    /// Distance between the AV's axles (m).
    pub wheelbase: f64,
    /// What the lanes say, looking back: at the start, then after each record.
    pub driven: &'a [Driven],
    /// Where the logged AV was along the reference line (m), by the log indices at which it was there, from the drive's start to the
    /// horizon.
    pub human_stations: &'a [(usize, f64)],
    /// The log index after the last step that there is to drive.
    pub horizon: usize,
    /// What the scene does not allow to judge.
    pub unjudged: &'a BTreeSet<Judgement>,
    /// For each record what is no fault of the AV's.
    pub netted: &'a [NettedStep],
}

/// What the logged AV does too where the AV is after a step, so that it does not count in the score.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NettedStep {
    /// It is above the limit, and as fast.
    pub overspeed: bool,
    /// It drives against its lane.
    pub backward_travel: bool,
}

/// The AV where a drive starts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Start {
    /// Arc length along the reference line (m).
    pub station: f64,
    /// m/s.
    pub speed: f64,
    /// rad.
    pub heading: f64,
    /// rad/s.
    pub yaw_rate: f64,
}

impl Drive<'_> {
    /// Progress along the reference line (m), no longer than the logged AV is there to compare with; none where it is there for less
    /// than half of the steps that there are to drive, or ends behind where it began.
    fn compared_progress(&self) -> Option<f64> {
        let (start, last) = (self.human_stations.first()?, self.human_stations.last()?);
        // Who backs all the way goes by another route than the one that was made of it.
        let last = Some(last).filter(|last| last.1 - start.1 >= -nuplan::LEAST_PROGRESS)?.0;
        let first = self.records.first().map_or(self.horizon, |record| record.log_index as usize);
        if 2 * (last + 1).saturating_sub(first) < self.horizon.saturating_sub(first) {
            return None;
        }
        let compared = self.records.iter().take_while(|record| record.log_index as usize <= last).count();
        Some(self.travelled(compared).unwrap_or_default())
    }

    /// The way along the reference line (m) over the first `steps`; none without any.
    fn travelled(&self, steps: usize) -> Option<f64> {
        let stations = || self.records[..steps].iter().map(|record| record.station);
        let way = stations().next_back()? - self.start.station;
        if self.counted.is_all() {
            return Some(way);
        }
        let before = std::iter::once(self.start.station).chain(stations());
        Some(self.counted.of(0, stations().zip(before).map(|(now, before)| now - before)).sum())
    }

    /// The logged AV's way along it (m).
    fn human_travelled(&self) -> Option<f64> {
        let (first, last) = (self.human_stations.first()?, self.human_stations.last()?);
        if self.counted.is_all() {
            return Some(last.1 - first.1);
        }
        // Step 0 leads to the log index after the start's.
        let begin = self.records.first().map_or(first.0 + 1, |record| record.log_index as usize);
        let steps = self.human_stations.windows(2).filter(|pair| self.counted.has(pair[1].0.saturating_sub(begin)));
        Some(steps.map(|pair| pair[1].1 - pair[0].1).sum())
    }

    fn rides(&self) -> Vec<Ride> {
        let ride = |record: &proto::StepRecord| {
            let control = record.control.unwrap_or_default();
            let speed = speed(record);
            Ride {
                acceleration: control.acceleration,
                speed,
                heading: pose(record).heading,
                turning: record.yaw_rate,
                yaw_rate: speed * libm::tan(control.steering) / self.wheelbase,
            }
        };
        self.records.iter().map(ride).collect()
    }

    fn is_infeasible(&self) -> bool {
        let start = Pace { speed: self.start.speed, heading: self.start.heading };
        let pace = |record| Pace { speed: speed(record), heading: pose(record).heading };
        let mut before = start;
        let steps = self.records.iter().map(pace).map(|after| (std::mem::replace(&mut before, after), after));
        self.counted.of(0, steps).any(|(before, after)| feasibility::is_infeasible(before, after))
    }
}

/// What the metrics say of a drive, before it is put into the table.
#[derive(Clone, Debug)]
#[allow(missing_docs, reason = "the table of metrics says it")]
pub struct Facts {
    pub contacts: usize,
    pub netted_contacts: usize,
    pub at_fault: usize,
    pub relative_speed: Option<f64>,
    pub off_route: bool,
    pub off_road: bool,
    pub red_light: bool,
    pub wrong_way: bool,
    pub speeding: bool,
    pub progress: Option<f64>,
    pub comfort: paper::Comfort,
    pub human_comfort: paper::Comfort,
    pub position_errors: [Option<f64>; 3],
    pub route_progress: Option<f64>,
    pub human_route_progress: Option<f64>,
    /// Route progress as long as the human was there too.
    pub compared_progress: Option<f64>,
    pub speed_limit_compliance: Option<f64>,
    pub time_to_collision: Option<f64>,
    pub extremes: Option<comfort::Extremes>,
    /// As nuPlan's code reads them.
    pub nuplan_extremes: Option<comfort::Extremes>,
    pub infeasible: bool,
    /// What there was no way to judge.
    pub unjudged: BTreeSet<Judgement>,
    pub terms: nuplan::Terms,
}

impl Facts {
    /// The facts of `drive`.
    #[must_use]
    pub fn of(drive: &Drive<'_>) -> Self {
        let (records, counted_steps) = (drive.records, drive.counted);
        let steps = || counted_steps.of(0, records);
        let any = |rule: fn(&proto::StepRecord) -> bool| steps().any(rule);
        let is_counted = |step: u32| counted_steps.has(step as usize);
        let collisions =
            || drive.events.iter().filter(|event| event.kind() == Kind::Collision && is_counted(event.step));
        let counted = || collisions().filter(|event| !event.netted);
        let poses: Vec<Pose> = records.iter().map(pose).collect();
        let human: Option<Vec<Pose>> = drive.human.iter().copied().collect();
        // 3 s after the start is the state after step 29.
        let position_error = |seconds: usize| {
            let step = seconds * 10 - 1;
            records.get(step).filter(|_| counted_steps.has(step)).and_then(|record| record.position_error)
        };
        let rides = drive.rides();
        let before = std::iter::once(drive.start.yaw_rate).chain(rides.iter().map(|ride| ride.yaw_rate));
        let ahead = rear_axle_to_center(drive.wheelbase);
        let read: Vec<_> = rides.iter().zip(before).map(|(ride, before)| ride.nuplan(before, ahead)).collect();
        let mut facts = Self {
            contacts: counted().count(),
            netted_contacts: collisions().count() - counted().count(),
            at_fault: drive.at_fault.iter().filter(|(step, _)| is_counted(*step)).count(),
            relative_speed: counted().map(|event| event.relative_speed).reduce(f64::max),
            off_route: any(|record| record.off_route),
            off_road: any(|record| record.off_road),
            red_light: any(|record| record.red_light),
            wrong_way: any(|record| record.wrong_way),
            speeding: any(|record| record.speeding),
            progress: paper::progress(&poses, counted_steps),
            comfort: paper::comfort(&poses, counted_steps),
            human_comfort: human.map(|human| paper::comfort(&human, counted_steps)).unwrap_or_default(),
            position_errors: [3, 5, 10].map(position_error),
            route_progress: drive.travelled(records.len()),
            human_route_progress: drive.human_travelled(),
            compared_progress: drive.compared_progress(),
            speed_limit_compliance: speed_limit_compliance(steps()),
            time_to_collision: steps().filter_map(|record| record.time_to_collision).reduce(f64::min),
            extremes: comfort::Extremes::of(&rides.iter().map(Ride::felt).collect::<Vec<_>>(), counted_steps),
            nuplan_extremes: comfort::Extremes::of(&read, counted_steps),
            infeasible: drive.is_infeasible(),
            unjudged: drive.unjudged.clone(),
            terms: nuplan::Terms::default(),
        };
        facts.terms = facts.terms_of(drive);
        facts
    }

    /// A value of what can be judged.
    #[must_use]
    pub fn judged(&self, judgement: Judgement, value: Option<f64>) -> Option<f64> {
        value.filter(|_| !self.unjudged.contains(&judgement))
    }

    /// Whether there was such a contact. One that there was is told, whatever else cannot be judged.
    #[must_use]
    pub fn collision(&self, is_so: bool) -> Option<f64> {
        let value = Some(f64::from(u8::from(is_so)));
        if is_so { value } else { self.judged(Judgement::Collision, value) }
    }

    /// Route progress over the human's, where the human moved.
    #[must_use]
    pub fn progress_ratio(&self) -> Option<f64> {
        let human = self.human_route_progress.filter(|human| *human >= nuplan::LEAST_PROGRESS)?;
        self.compared_progress.map(|progress| progress / human)
    }

    /// nuPlan's composite score. A drive that left the route has none of it: what it would have done on its way is not driven.
    /// One too short to be felt has no score, unless it already lost it.
    #[must_use]
    pub fn score(&self) -> Option<f64> {
        let score = if self.off_route { 0.0 } else { self.terms.score()? };
        (self.nuplan_extremes.is_some() || score == 0.0).then_some(score)
    }

    fn terms_of(&self, drive: &Drive<'_>) -> nuplan::Terms {
        let progress = self.compared_progress.zip(self.human_route_progress);
        let progress = progress.map(|(own, human)| nuplan::progress(own, human));
        let netted = || drive.netted.iter().copied().chain(std::iter::repeat(NettedStep::default()));
        let driven = || drive.counted.of(0, drive.records.iter().zip(drive.driven.iter().skip(1)).zip(netted()));
        let backward = driven().filter(|(_, netted)| !netted.backward_travel);
        let backward = backward.map(|((_, driven), _)| driven.backward_travel);
        let over = |((record, driven), netted): ((&proto::StepRecord, &Driven), NettedStep)| {
            if netted.overspeed { 0.0 } else { overspeed(speed(record), driven.speed_limit) }
        };
        let over: Vec<f64> = driven().map(over).collect();
        let score = |is_kept: bool| Some(f64::from(u8::from(is_kept)));
        let at_fault = drive.at_fault.iter().filter(|(step, _)| drive.counted.has(*step as usize));
        let no_collision = nuplan::no_collision(at_fault.map(|(_, kind)| *kind));
        let in_time = self.time_to_collision.is_none_or(|time| time >= LEAST_TIME_TO_COLLISION);
        // One that is broken is broken, whatever else cannot be judged.
        let unless_broken = |judgement: Judgement, term: Option<f64>| match term {
            Some(term) if term < 1.0 => Some(term),
            term => self.judged(judgement, term),
        };
        nuplan::Terms {
            no_collision: unless_broken(Judgement::Collision, Some(no_collision)),
            drivable_area: self
                .judged(Judgement::OffRoad, score(!driven().any(|((record, _), _)| record.outside_drivable_area))),
            direction: self.judged(Judgement::WrongWay, Some(nuplan::direction(backward.fold(0.0, f64::max)))),
            making_progress: progress.and_then(|progress| score(progress >= nuplan::MAKING_PROGRESS)),
            progress,
            time_to_collision: unless_broken(Judgement::Collision, score(in_time)),
            speed_limit: self.judged(Judgement::Speeding, Some(nuplan::speed_limit(&over))),
            comfort: self.nuplan_extremes.and_then(|extremes| score(extremes.are_comfortable())),
        }
    }
}

/// The AV after a step.
pub(super) fn pose(record: &proto::StepRecord) -> Pose {
    let av = record.av.unwrap_or_default();
    Pose::new(av.x, av.y, av.heading)
}

fn speed(record: &proto::StepRecord) -> f64 {
    let av = record.av.unwrap_or_default();
    (av.velocity_x * av.velocity_x + av.velocity_y * av.velocity_y).sqrt()
}

/// Speed above a known limit (m/s), at least 0.
fn overspeed(speed: f64, limit: f64) -> f64 {
    if limit > 0.0 { (speed - limit).max(0.0) } else { 0.0 }
}

fn speed_limit_compliance<'a>(records: impl Iterator<Item = &'a proto::StepRecord>) -> Option<f64> {
    let known: Vec<_> = records.filter(|record| record.speed_limit > 0.0).collect();
    let kept = known.iter().filter(|record| overspeed(speed(record), record.speed_limit) == 0.0).count();
    (!known.is_empty()).then(|| kept as f64 / known.len() as f64)
}
