//! What the metrics are computed from: a drive's records and events, and the human's drive beside it.

use wire::proto;
use wire::proto::event::Kind;
use world::geometry::Pose;
use world::scene::AgentKind;

use super::{comfort, nuplan, paper};
use crate::judges::time_to_collision::LEAST_TIME_TO_COLLISION;

/// A drive, and the human's beside it.
#[derive(Clone, Copy, Debug)]
pub struct Drive<'a> {
    /// A record a step.
    pub records: &'a [proto::StepRecord],
    /// What happened.
    pub events: &'a [proto::Event],
    /// What the AV hit at fault.
    pub at_fault: &'a [AgentKind],
    /// The logged AV at each record's log index, if it is there.
    pub human: &'a [Option<Pose>],
    /// Arc length along the reference line at the start (m).
    pub start_station: f64,
    /// The logged AV's progress along the reference line (m), and the log index where it was last there, up to the horizon.
    pub human_route_progress: Option<(f64, usize)>,
}

impl Drive<'_> {
    /// Progress along the reference line (m), no longer than the logged AV is there to compare with.
    fn compared_progress(&self) -> Option<f64> {
        let (_, last) = self.human_route_progress?;
        let compared = self.records.iter().rev().find(|record| record.log_index as usize <= last);
        Some(compared.map_or(0.0, |record| record.station - self.start_station))
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
    pub terms: Option<nuplan::Terms>,
}

impl Facts {
    /// The facts of `drive`.
    #[must_use]
    pub fn of(drive: &Drive<'_>) -> Self {
        let records = drive.records;
        let any = |rule: fn(&proto::StepRecord) -> bool| records.iter().any(rule);
        let collisions = || drive.events.iter().filter(|event| event.kind() == Kind::Collision);
        let counted = || collisions().filter(|event| !event.netted);
        let poses: Vec<Pose> = records.iter().map(pose).collect();
        let human: Option<Vec<Pose>> = drive.human.iter().copied().collect();
        // 3 s after the start is the state after step 29.
        let position_error = |seconds: usize| records.get(seconds * 10 - 1).and_then(|record| record.position_error);
        let mut facts = Self {
            contacts: counted().count(),
            netted_contacts: collisions().count() - counted().count(),
            at_fault: drive.at_fault.len(),
            relative_speed: counted().map(|event| event.relative_speed).reduce(f64::max),
            off_route: any(|record| record.off_route),
            off_road: any(|record| record.off_road),
            red_light: any(|record| record.red_light),
            wrong_way: any(|record| record.wrong_way),
            speeding: any(|record| record.speeding),
            progress: paper::progress(&poses),
            comfort: paper::comfort(&poses),
            human_comfort: human.map(|human| paper::comfort(&human)).unwrap_or_default(),
            position_errors: [3, 5, 10].map(position_error),
            route_progress: records.last().map(|record| record.station - drive.start_station),
            human_route_progress: drive.human_route_progress.map(|(progress, _)| progress),
            compared_progress: drive.compared_progress(),
            speed_limit_compliance: speed_limit_compliance(records),
            time_to_collision: records.iter().filter_map(|record| record.time_to_collision).reduce(f64::min),
            extremes: comfort::Extremes::of(&records.iter().map(sample).collect::<Vec<_>>()),
            terms: None,
        };
        facts.terms = facts.terms_of(drive);
        facts
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
        let score = if self.off_route { 0.0 } else { self.terms?.score() };
        (self.extremes.is_some() || score == 0.0).then_some(score)
    }

    fn terms_of(&self, drive: &Drive<'_>) -> Option<nuplan::Terms> {
        // Without a human's route nuPlan gives the term away.
        let progress = match self.human_route_progress {
            Some(human) => nuplan::progress(self.compared_progress?, human),
            None => 1.0,
        };
        let records = drive.records;
        let backward = records.iter().filter(|record| record.wrong_way).map(|record| record.backward_travel);
        let overspeed: Vec<f64> = records.iter().map(overspeed).collect();
        let score = |is_kept: bool| f64::from(u8::from(is_kept));
        Some(nuplan::Terms {
            no_collision: nuplan::no_collision(drive.at_fault.iter().copied()),
            drivable_area: score(!records.iter().any(|record| record.outside_drivable_area)),
            direction: nuplan::direction(backward.fold(0.0, f64::max)),
            making_progress: score(progress >= nuplan::MAKING_PROGRESS),
            progress,
            time_to_collision: score(self.time_to_collision.is_none_or(|time| time >= LEAST_TIME_TO_COLLISION)),
            speed_limit: nuplan::speed_limit(&overspeed),
            // Too short a drive to filter has none, and no score.
            comfort: score(self.extremes.is_none_or(|extremes| extremes.are_comfortable())),
        })
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
fn overspeed(record: &proto::StepRecord) -> f64 {
    if record.speed_limit > 0.0 { (speed(record) - record.speed_limit).max(0.0) } else { 0.0 }
}

fn speed_limit_compliance(records: &[proto::StepRecord]) -> Option<f64> {
    let known: Vec<_> = records.iter().filter(|record| record.speed_limit > 0.0).collect();
    let kept = known.iter().filter(|record| overspeed(record) == 0.0).count();
    (!known.is_empty()).then(|| kept as f64 / known.len() as f64)
}

fn sample(record: &proto::StepRecord) -> comfort::Sample {
    comfort::Sample {
        acceleration: record.control.unwrap_or_default().acceleration,
        lateral_acceleration: speed(record) * record.yaw_rate,
        heading: pose(record).heading,
    }
}
