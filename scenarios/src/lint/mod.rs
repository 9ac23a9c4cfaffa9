//! What a person should know of a scene before believing what was driven in it.
//!
//! The reader's own findings ([`world::scene::Finding`]) tell what was odd and mended; those here look at the whole:
//! does the logged AV touch others, leave the road, stand still; is the map or are the signals incomplete.

mod av;
mod log;
#[cfg(test)]
mod tests;

use thiserror::Error;
use world::map::MapId;
use world::route::RouteError;
use world::scene::{Finding, Scene, TrackId};

pub use world::scene::Steps;

/// How much a finding matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// Good to know; results stand.
    Note,
    /// It may explain a result.
    Warning,
    /// The scene cannot be judged: leave it out.
    Error,
}

impl std::fmt::Display for Severity {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(match self {
            Self::Note => "note",
            Self::Warning => "warning",
            Self::Error => "error",
        })
    }
}

/// Something that a person should know of a scene.
#[derive(Clone, Debug, PartialEq, Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum Lint {
    #[error(transparent)]
    Reader(Finding),
    #[error("the logged AV overlaps {kind} {track} at {steps}: the log's own fault, not the driver's")]
    AvOverlap { track: TrackId, kind: world::scene::AgentKind, steps: Steps },
    #[error("a corner of the logged AV is up to {worst:.1} m beyond a road edge at {steps}")]
    AvOffRoad { worst: f64, steps: Steps },
    #[error("the logged AV is up to {worst:.1} m from the nearest drivable lane at {steps}")]
    AvFarFromLane { worst: f64, steps: Steps },
    #[error("no route can be made of the log: {0}")]
    NoRoute(RouteError),
    #[error("the logged AV is up to {worst:.1} m from its own route at {steps}")]
    AvOffRoute { worst: f64, steps: Steps },
    #[error("the logged AV crosses the stop point of lane {lane} at step {step}, while its signal is red")]
    AvRunsRed { lane: MapId, step: usize },
    #[error("the logged AV is parked: it moves {meters:.1} m in all")]
    AvParked { meters: f64 },
    #[error("track {track} jumps at {steps}, {meters:.1} m at most")]
    Teleport { track: TrackId, steps: Steps, meters: f64 },
    #[error("steps are {shortest:.3} to {longest:.3} s long, not 0.1 s (longest before step {step})")]
    IrregularTime { shortest: f64, longest: f64, step: usize },
    #[error("it has {steps} steps: a whole drive, 150 steps from step 19, needs 170")]
    Short { steps: usize },
    #[error("no signal is given at any step, though there are junctions: there were none, or a converter lost them")]
    NoSignals,
    #[error("signals are given at {with} of {steps} steps")]
    PartialSignals { with: usize, steps: usize },
    #[error("no lane has a speed limit: a converter lost them")]
    NoSpeedLimits,
    #[error("the map has no drivable lane")]
    NoDrivableLane,
    #[error("the map has no road edge: off road cannot be judged")]
    NoRoadEdges,
}

impl Lint {
    /// How much it matters.
    #[must_use]
    pub fn severity(&self) -> Severity {
        match self {
            Self::NoDrivableLane | Self::NoRoute(_) | Self::Reader(Finding::AvGaps { .. }) => Severity::Error,
            Self::AvOverlap { .. }
            | Self::AvOffRoad { .. }
            | Self::AvFarFromLane { .. }
            | Self::AvOffRoute { .. }
            | Self::AvRunsRed { .. }
            | Self::AvParked { .. }
            | Self::Teleport { .. }
            | Self::NoSpeedLimits
            | Self::NoRoadEdges
            | Self::Reader(Finding::BadState { .. } | Finding::BadFeature(_) | Finding::DuplicateFeature(_)) => {
                Severity::Warning
            }
            Self::IrregularTime { longest, .. } if *longest > 0.15 => Severity::Warning,
            _ => Severity::Note,
        }
    }
}

/// All that is found in `scene`, the gravest first; `findings` are those that its reader made.
#[must_use]
pub fn lint(scene: &Scene, findings: &[Finding]) -> Vec<Lint> {
    let mut lints: Vec<Lint> = findings.iter().cloned().map(Lint::Reader).collect();
    av::lint(scene, &mut lints);
    log::lint(scene, &mut lints);
    lints.sort_by_key(|lint| std::cmp::Reverse(lint.severity()));
    lints
}
