//! What a step gives, what a scene without a drive gives, and the control between two states: what both protocols share.

use thiserror::Error;
use wire::proto::{self, EndReason};
use world::geometry::angle_difference;
use world::plan::{Control, STEP_SECONDS};
use world::route::RouteError;
use world::scene::Scene;
use world::vehicle::VehicleState;

use crate::metrics;
use crate::protocol::{Protocol, SettingError};

/// Why a scene cannot be driven under a protocol.
#[derive(Debug, Error)]
pub enum Undrivable {
    /// The log ends before there is a step to drive.
    #[error("it has {steps} logged steps, but the first step driven needs log index {needed}")]
    TooShort {
        /// Steps of the log.
        steps: usize,
        /// The log index that is needed.
        needed: usize,
    },
    /// The AV is not where the drive starts.
    #[error("the AV is not valid at log index {start}, where the drive starts")]
    AvMissing {
        /// The log index.
        start: usize,
    },
    /// No route follows the logged AV.
    #[error(transparent)]
    Route(#[from] RouteError),
    /// A setting of the protocol makes no sense.
    #[error(transparent)]
    Setting(#[from] SettingError),
}

impl Undrivable {
    /// The end of the episode that never began.
    #[must_use]
    pub fn end(&self, scene: &Scene, protocol: &Protocol) -> proto::EpisodeEnd {
        let metrics = named(metrics::nothing_measured());
        proto::EpisodeEnd {
            scene: scene.id().to_string(),
            protocol: protocol.name().to_owned(),
            reason: EndReason::Undrivable.into(),
            detail: self.to_string(),
            metrics,
            ..proto::EpisodeEnd::default()
        }
    }
}

/// What came of one step.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Advance {
    /// The AV after the step, and what the judges say.
    pub record: proto::StepRecord,
    /// What happened in the step.
    pub events: Vec<proto::Event>,
    /// Where the agents are that reacted in the step; nobody in replay.
    pub moved: proto::TrafficMoves,
    /// Why the episode is over, if it is.
    pub ended: Option<EndReason>,
}

/// The values of [`metrics::METRICS`] with their names.
pub(crate) fn named(values: Vec<Option<f64>>) -> Vec<proto::Metric> {
    let metric =
        |(metric, value): (&metrics::Metric, Option<f64>)| proto::Metric { name: metric.name.to_owned(), value };
    metrics::METRICS.iter().zip(values).map(metric).collect()
}

/// The control that leads from one state to the next.
pub(crate) fn control_between(now: &VehicleState, next: &VehicleState, wheelbase: f64) -> Control {
    let yaw_rate = angle_difference(now.heading, next.heading) / STEP_SECONDS;
    Control {
        acceleration: (next.speed - now.speed) / STEP_SECONDS,
        steering: steering_of(yaw_rate, next.speed, wheelbase),
    }
}

/// The steering angle (rad) at which a vehicle at `speed` (m/s) turns at `yaw_rate` (rad/s); 0 for one that hardly moves.
pub(crate) fn steering_of(yaw_rate: f64, speed: f64, wheelbase: f64) -> f64 {
    if speed < 0.5 { 0.0 } else { libm::atan(wheelbase * yaw_rate / speed) }
}
