//! What a recording says of an episode.

use episode::guidance::{Aged, Guidance, STEP_US};
use thiserror::Error;
use wire::convert::by_number;
use wire::{WIRE_VERSION, proto};
use world::plan::{Plan, UncheckedPlan};
use world::traffic::UncheckedMoves;

use crate::recorded::{RecordedError, messages};

/// What was recorded of a step, and cannot be driven.
#[derive(Debug, Error)]
#[error("the {what} of step {step} cannot be driven: {why}")]
pub struct PlanError {
    what: &'static str,
    step: u32,
    why: String,
}

/// Plans that were followed in a step, each with the steps since it was asked for.
pub(super) struct LatePlans {
    before: Option<(Plan, u32)>,
    now: Option<(Plan, u32)>,
    since_us: u32,
}

impl LatePlans {
    pub(super) fn guidance(&self) -> Guidance<'_> {
        let [before, now] =
            [&self.before, &self.now].map(|plan| plan.as_ref().map(|(plan, age)| Aged { plan, age: *age }));
        Guidance { before, now, since_us: self.since_us }
    }
}

/// All that the simulator said, and what predictor and planner answered, in their order.
#[derive(Clone, Debug)]
pub struct Recorded {
    pub(super) scene: proto::Scene,
    pub(super) observations: Vec<proto::Observation>,
    pub(super) predictions: Vec<proto::Prediction>,
    pub(super) plans: Vec<proto::Plan>,
    pub(super) moves: Vec<proto::TrafficMoves>,
    pub(super) records: Vec<proto::StepRecord>,
    pub(super) events: Vec<proto::Event>,
    pub(super) end: proto::EpisodeEnd,
}

impl Recorded {
    /// Steps that were driven.
    #[must_use]
    pub fn steps(&self) -> u32 {
        self.records.len() as u32
    }

    /// Whether the drive ended before `step`, other than by a driver that failed there.
    #[must_use]
    pub fn is_over_at(&self, step: u32) -> bool {
        self.observations.len() as u32 <= step
    }

    /// The plan that was driven at `step`.
    ///
    /// # Errors
    /// [`PlanError`].
    pub fn plan(&self, step: u32) -> Result<Plan, PlanError> {
        let error = |why: String| PlanError { what: "plan", step, why };
        let recorded = self.plans.get(step as usize).ok_or_else(|| error("it is not recorded".to_owned()))?;
        let unchecked = UncheckedPlan::try_from(recorded.clone()).map_err(|refused| error(refused.to_string()))?;
        unchecked.check(step).map_err(|refused| error(refused.to_string()))
    }

    /// Where the agents were after `step` that reacted.
    ///
    /// # Errors
    /// [`PlanError`].
    pub(super) fn moves(&self, step: u32) -> Result<UncheckedMoves, PlanError> {
        let error = |why: String| PlanError { what: "traffic", step, why };
        let recorded = self.moves.get(step as usize).ok_or_else(|| error("it is not recorded".to_owned()))?;
        UncheckedMoves::try_from(recorded.clone()).map_err(|refused| error(refused.to_string()))
    }

    /// The plans that were followed at `step` under a latency, as its record tells; none without one, where the plan of the step is driven.
    ///
    /// # Errors
    /// [`PlanError`] of one that cannot be driven, or was not asked for yet.
    pub(super) fn late_plans(&self, step: u32) -> Result<Option<LatePlans>, PlanError> {
        let record = |step: u32| self.records.get(step as usize);
        let Some((age, since_us)) = record(step).and_then(|record| Some((record.plan_age?, record.plan_taken_up_us)))
        else {
            return Ok(None);
        };
        let error = |why: &str| PlanError { what: "plan", step, why: why.to_owned() };
        let aged = |age: i32| -> Result<Option<(Plan, u32)>, PlanError> {
            let Ok(age) = u32::try_from(age) else { return Ok(None) };
            let asked = step.checked_sub(age).ok_or_else(|| error("its record tells of one before the drive"))?;
            Ok(Some((self.plan(asked)?, age)))
        };
        if since_us >= STEP_US {
            return Err(error("its record tells of one that took effect after the step"));
        }
        let before = step.checked_sub(1).and_then(record).and_then(|record| record.plan_age);
        let before = before.filter(|age| since_us > 0 && *age >= 0).map(|age| age.saturating_add(1));
        Ok(Some(LatePlans { before: before.map_or(Ok(None), aged)?, now: aged(age)?, since_us }))
    }

    /// The plans of the steps before `until`.
    ///
    /// # Errors
    /// [`PlanError`] of the first that cannot be driven.
    pub fn plans(&self, until: u32) -> Result<Vec<Plan>, PlanError> {
        (0..until).map(|step| self.plan(step)).collect()
    }

    /// The metrics of its end, by name.
    pub fn metrics(&self) -> impl Iterator<Item = (&str, Option<f64>)> {
        let value = |metric: &proto::Metric| metric.value.filter(|value| !value.is_nan());
        self.end.metrics.iter().map(move |metric| (metric.name.as_str(), value(metric)))
    }

    /// Reads the bytes of an MCAP file.
    ///
    /// # Errors
    /// [`RecordedError`].
    pub fn read(bytes: &[u8]) -> Result<Self, RecordedError> {
        let (mut scene, mut end) = (None, None);
        let (mut observations, mut predictions, mut plans, mut moves) =
            (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let (mut records, mut events) = (Vec::new(), Vec::new());
        messages(bytes, |channel, data| {
            match channel {
                "scene" => scene = Some(decoded(data)?),
                "observation" => observations.push(decoded(data)?),
                "prediction" => predictions.push(decoded(data)?),
                "plan" => plans.push(decoded(data)?),
                "moves" => moves.push(decoded(data)?),
                // What pictures show beside the drive is none of it.
                "record" => records.push(proto::StepRecord { logged_av: None, ..decoded(data)? }),
                "event" => events.push(proto::Event { other: None, ..decoded(data)? }),
                "end" => end = Some(decoded(data)?),
                _ => {}
            }
            Ok(())
        })?;
        let scene: proto::Scene = scene.ok_or(RecordedError::Missing("scene"))?;
        if let Some(line) = &scene.reference_line {
            observations = observations.into_iter().map(|observation| by_number(observation, line)).collect();
        }
        // What an earlier version said has been put into today's words.
        let scene = proto::Scene { wire_version: scene.wire_version.max(WIRE_VERSION), ..scene };
        Ok(Self {
            scene,
            end: end.ok_or(RecordedError::Missing("end"))?,
            observations,
            predictions,
            plans,
            moves,
            records,
            events,
        })
    }
}

fn decoded<M: prost::Message + Default>(data: &[u8]) -> Result<M, String> {
    M::decode(data).map_err(|error| error.to_string())
}

/// What counts messages is the bus's, and no matter of the drive.
pub(super) fn of_the_drive(end: &proto::EpisodeEnd) -> proto::EpisodeEnd {
    proto::EpisodeEnd {
        observations: 0,
        plans: 0,
        predictions: 0,
        records: 0,
        events: 0,
        moves: 0,
        digest: Vec::new(),
        ..end.clone()
    }
}
