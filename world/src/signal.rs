//! Traffic signals.

use crate::geometry::Point3;
use crate::map::MapId;

/// What a signal shows a lane.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[allow(missing_docs, reason = "the names say it all")]
pub enum SignalState {
    #[default]
    Unknown,
    ArrowStop,
    ArrowCaution,
    ArrowGo,
    Stop,
    Caution,
    Go,
    FlashingStop,
    FlashingCaution,
}

impl SignalState {
    /// Whether the lane must not be entered: stop or arrow stop. A flashing stop is a stop sign, not a red light.
    #[must_use]
    pub fn is_red(self) -> bool {
        matches!(self, Self::Stop | Self::ArrowStop)
    }
}

/// What one lane is shown at one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Signal {
    /// The lane that is ruled: the one *behind* the stop line. It may be missing from the map.
    pub lane: MapId,
    /// What is shown.
    pub state: SignalState,
    /// Where to stop.
    pub stop_point: Point3,
}
