//! WOMD's numbered kinds and ours, each pair in one table. A number that is not in its table means "unknown".

use world::map::{LaneKind, RoadEdgeKind, RoadLineKind};
use world::scene::AgentKind;
use world::signal::SignalState;

/// `Track.object_type`; 0 is "unset".
const AGENTS: [AgentKind; 5] =
    [AgentKind::Other, AgentKind::Vehicle, AgentKind::Pedestrian, AgentKind::Cyclist, AgentKind::Other];

const LANES: [LaneKind; 4] = [LaneKind::Undefined, LaneKind::Freeway, LaneKind::SurfaceStreet, LaneKind::BikeLane];

const LINES: [RoadLineKind; 9] = [
    RoadLineKind::Unknown,
    RoadLineKind::BrokenSingleWhite,
    RoadLineKind::SolidSingleWhite,
    RoadLineKind::SolidDoubleWhite,
    RoadLineKind::BrokenSingleYellow,
    RoadLineKind::BrokenDoubleYellow,
    RoadLineKind::SolidSingleYellow,
    RoadLineKind::SolidDoubleYellow,
    RoadLineKind::PassingDoubleYellow,
];

const EDGES: [RoadEdgeKind; 3] = [RoadEdgeKind::Unknown, RoadEdgeKind::Boundary, RoadEdgeKind::Median];

const SIGNALS: [SignalState; 9] = [
    SignalState::Unknown,
    SignalState::ArrowStop,
    SignalState::ArrowCaution,
    SignalState::ArrowGo,
    SignalState::Stop,
    SignalState::Caution,
    SignalState::Go,
    SignalState::FlashingStop,
    SignalState::FlashingCaution,
];

/// A kind that WOMD numbers.
pub(crate) trait Numbered: Copy + PartialEq + 'static {
    const TABLE: &'static [Self];

    fn from_number(number: i32) -> Self {
        usize::try_from(number).ok().and_then(|n| Self::TABLE.get(n)).copied().unwrap_or(Self::TABLE[0])
    }

    /// The last number of the kind: "other" is 4, not the 0 of "unset".
    fn number(self) -> i32 {
        Self::TABLE.iter().rposition(|kind| *kind == self).map_or(0, |n| n as i32)
    }
}

impl Numbered for AgentKind {
    const TABLE: &'static [Self] = &AGENTS;
}
impl Numbered for LaneKind {
    const TABLE: &'static [Self] = &LANES;
}
impl Numbered for RoadLineKind {
    const TABLE: &'static [Self] = &LINES;
}
impl Numbered for RoadEdgeKind {
    const TABLE: &'static [Self] = &EDGES;
}
impl Numbered for SignalState {
    const TABLE: &'static [Self] = &SIGNALS;
}
