//! What a person should know of a scene before believing what was driven in it.
//!
//! The reader's own findings ([`world::scene::Finding`]) tell what was odd and mended; those here look at the whole:
//! does the logged AV touch others, leave the road, stand still; is the map or are the signals incomplete.

mod av;
mod gaps;
mod lanes;
mod log;
mod signals;
#[cfg(test)]
mod tests;
mod way;

use std::sync::Arc;

use thiserror::Error;
use world::map::MapId;
use world::route::{Route, RouteError, RouteStyle};
use world::scene::bridged::{Bridged, MendedSize, SPARSE, SizeSource};
use world::scene::{AgentKind, Finding, Judgement, Scene, TrackId, Unjudged};

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
    AvOverlap { track: TrackId, kind: AgentKind, steps: Steps },
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
    #[error("the map has no drivable lane")]
    NoDrivableLane,
    #[error(transparent)]
    Unjudged(#[from] Unjudged),
    #[error(
        "the logged AV is not there at {steps}: {}",
        if *drivable { "gaps of 3 s at most are filled in, and nothing is compared with it elsewhere" } else { "a drive begins there" }
    )]
    AvMissing { steps: Steps, drivable: bool },
    #[error("the logged AV goes against its lane at {steps}")]
    AvAgainstLane { steps: Steps },
    #[error("the logged AV is up to {worst:.1} m/s above the speed limit at {steps}")]
    AvSpeeding { worst: f64, steps: Steps },
    #[error(
        "{kind} {track} drops out near the AV's way at {steps}, for {longest} steps at most: {}",
        if *bridged { "filled in" } else { "too long or too far to be filled in" }
    )]
    TrackDropsOut { track: TrackId, kind: AgentKind, steps: Steps, longest: usize, bridged: bool },
    #[error(
        "{kind} {track} is listed right before the AV from step {step} on, and not before: what it was, nobody knows"
    )]
    TrackAppears { track: TrackId, kind: AgentKind, step: usize },
    #[error("{kind} {track} is right before the AV at step {step}, and listed no more: where it went, nobody knows")]
    TrackVanishes { track: TrackId, kind: AgentKind, step: usize },
    #[error("{}", size_text(.0))]
    Size(MendedSize),
    #[error(
        "the signal of lane {lane} drops out near the AV's way at {steps}, for {longest} steps at most: {}",
        if *bridged { "it shows the same before and after" } else { "what it showed cannot be told" }
    )]
    SignalDropsOut { lane: MapId, steps: Steps, longest: usize, bridged: bool },
    #[error("the signal of lane {lane} seems out of step: {}", out_of_step_text(starts, waits))]
    SignalOutOfStep { lane: MapId, starts: Vec<TrackId>, waits: Vec<TrackId> },
    #[error(
        "{lanes} lanes have points more than {SPARSE} m apart, lane {first} the first: `strict` puts points in; `paper` takes them as \
         they are, and may find no lane"
    )]
    SparseLanes { lanes: usize, first: MapId },
}

fn size_text(size: &MendedSize) -> String {
    let MendedSize { id, kind, steps, size: [length, width, height], .. } = size;
    let measures = format!("{length:.1} x {width:.1} x {height:.1} m");
    match size.source {
        SizeSource::Median => {
            format!("the size of {kind} {id} is none or jumps at {steps}: taken as {measures}, its median")
        }
        SizeSource::Kind => format!("{kind} {id} has no size at {steps}: taken as {measures}, as a {kind} has"),
        SizeSource::Nothing => format!("track {id} has neither kind nor size at {steps}: taken as {measures}"),
    }
}

fn out_of_step_text(starts: &[TrackId], waits: &[TrackId]) -> String {
    let list = |tracks: &[TrackId]| tracks.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
    match (starts, waits) {
        (starts, []) => format!("vehicles start at its red ({})", list(starts)),
        ([], waits) => format!("vehicles stand at its green ({})", list(waits)),
        (starts, waits) => {
            format!("vehicles start at its red ({}) and stand at its green ({})", list(starts), list(waits))
        }
    }
}

impl Lint {
    /// How much it matters.
    #[must_use]
    pub fn severity(&self) -> Severity {
        match self {
            Self::NoDrivableLane | Self::NoRoute(_) | Self::AvMissing { drivable: false, .. } => Severity::Error,
            Self::TrackDropsOut { longest, bridged, .. } if *bridged && *longest < TOLD_STEPS => Severity::Note,
            Self::SignalDropsOut { longest, bridged, .. } if *bridged && *longest < TOLD_STEPS => Severity::Note,
            Self::AvOverlap { .. }
            | Self::AvOffRoad { .. }
            | Self::AvFarFromLane { .. }
            | Self::AvOffRoute { .. }
            | Self::AvRunsRed { .. }
            | Self::AvParked { .. }
            | Self::AvMissing { .. }
            | Self::AvAgainstLane { .. }
            | Self::AvSpeeding { .. }
            | Self::Teleport { .. }
            | Self::TrackDropsOut { .. }
            | Self::TrackAppears { .. }
            | Self::TrackVanishes { .. }
            | Self::Size(_)
            | Self::SignalDropsOut { .. }
            | Self::SignalOutOfStep { .. }
            | Self::SparseLanes { .. }
            | Self::Unjudged(_)
            | Self::Reader(
                Finding::BadState { .. }
                | Finding::BadFeature(_)
                | Finding::DuplicateFeature(_)
                | Finding::AssumedSizes { .. }
                | Finding::AssumedSpeedLimits { .. }
                | Finding::LinkedByPlace { .. }
                | Finding::Full { .. },
            ) => Severity::Warning,
            Self::IrregularTime { longest, .. } if *longest > 0.15 => Severity::Warning,
            _ => Severity::Note,
        }
    }

    /// A short name of its kind, for columns: `track-drops-out`.
    #[must_use]
    pub fn code(&self) -> &'static str {
        match self {
            Self::Reader(Finding::AssumedSizes { .. }) => "sizes-assumed",
            Self::Reader(Finding::AssumedSpeedLimits { .. }) => "limits-assumed",
            Self::Reader(Finding::LinkedByPlace { .. }) => "links-by-place",
            Self::Reader(Finding::Full { .. }) => "file-full",
            Self::Reader(_) => "mended",
            Self::AvOverlap { .. } => "av-overlaps",
            Self::AvOffRoad { .. } => "av-off-road",
            Self::AvFarFromLane { .. } => "av-far-from-lane",
            Self::NoRoute(_) => "no-route",
            Self::AvOffRoute { .. } => "av-off-route",
            Self::AvRunsRed { .. } => "av-runs-red",
            Self::AvParked { .. } => "av-parked",
            Self::AvMissing { .. } => "av-missing",
            Self::AvAgainstLane { .. } => "av-against-lane",
            Self::AvSpeeding { .. } => "av-speeding",
            Self::Teleport { .. } => "track-jumps",
            Self::TrackDropsOut { .. } => "track-drops-out",
            Self::TrackAppears { .. } => "track-appears",
            Self::TrackVanishes { .. } => "track-vanishes",
            Self::Size(_) => "size-mended",
            Self::IrregularTime { .. } => "irregular-time",
            Self::Short { .. } => "short",
            Self::NoSignals => "no-signals",
            Self::PartialSignals { .. } => "partial-signals",
            Self::SignalDropsOut { .. } => "signal-drops-out",
            Self::SignalOutOfStep { .. } => "signal-out-of-step",
            Self::SparseLanes { .. } => "sparse-lanes",
            Self::NoDrivableLane => "no-drivable-lane",
            Self::Unjudged(Unjudged::NoRoadEdges) => "no-road-edges",
            Self::Unjudged(Unjudged::ReversedEdges { .. }) => "reversed-edges",
            Self::Unjudged(Unjudged::NoLanes) => "no-lanes",
            Self::Unjudged(Unjudged::NoSpeedLimits) => "no-speed-limits",
            Self::Unjudged(Unjudged::NoSize { .. }) => "no-size",
        }
    }
}

/// What is filled in and shorter than this (steps) is good to know, no more.
const TOLD_STEPS: usize = 10;

/// All that is found in `scene`, the gravest first; `findings` are those that its reader made.
#[must_use]
pub fn lint(scene: &Arc<Scene>, findings: &[Finding]) -> Vec<Lint> {
    lint_bridged(&Bridged::of(scene), findings)
}

/// As [`lint()`], for a scene whose gaps are filled in already.
#[must_use]
pub fn lint_bridged(bridged: &Bridged, findings: &[Finding]) -> Vec<Lint> {
    // The AV's gaps are told with what follows from them, by `av`.
    let told = findings.iter().filter(|finding| !matches!(finding, Finding::AvGaps { .. }));
    let mut lints: Vec<Lint> = told.cloned().map(Lint::Reader).collect();
    let unjudged = bridged.unjudged();
    let edges = !unjudged.iter().any(|reason| reason.judgement() == Judgement::OffRoad);
    lints.extend(unjudged.into_iter().map(Lint::Unjudged));
    let route = Route::of_log(bridged.judged(), RouteStyle::Strict);
    let way = way::Way::of(bridged.judged(), route.as_ref().ok());
    av::lint(bridged, route, edges, &mut lints);
    gaps::lint(bridged, &way, &mut lints);
    signals::lint(bridged, &way, &mut lints);
    log::lint(bridged.logged(), &mut lints);
    if let [first, ..] = bridged.sparse_lanes() {
        lints.push(Lint::SparseLanes { lanes: bridged.sparse_lanes().len(), first: *first });
    }
    lints.sort_by_key(|lint| std::cmp::Reverse(lint.severity()));
    lints
}

/// What a run says of a scene beside its results.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Summary {
    /// The codes of its warnings and errors, each once, the gravest first.
    pub codes: Vec<&'static str>,
    /// How many of its findings are warnings.
    pub warnings: usize,
    /// How many are errors.
    pub errors: usize,
    /// What cannot be judged in it.
    pub unjudged: Vec<Judgement>,
}

impl Summary {
    /// The summary of what [`lint()`] found in a scene.
    #[must_use]
    pub fn of(lints: &[Lint]) -> Self {
        let mut summary = Self::default();
        for lint in lints.iter().filter(|lint| lint.severity() >= Severity::Warning) {
            match lint.severity() {
                Severity::Error => summary.errors += 1,
                _ => summary.warnings += 1,
            }
            if !summary.codes.contains(&lint.code()) {
                summary.codes.push(lint.code());
            }
            if let Lint::Unjudged(reason) = lint {
                summary.unjudged.push(reason.judgement());
            }
        }
        summary.unjudged.sort_unstable();
        summary.unjudged.dedup();
        summary
    }
}
