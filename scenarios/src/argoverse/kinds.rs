//! Argoverse's kinds and ours.

use world::map::{LaneKind, RoadLineKind};
use world::scene::AgentKind;
use world::scene::bridged::usual_size;

/// The AV's name among tracks.
pub(super) const AV: &str = "AV";

/// Length, width, height (m) of the cars that logged it: Ford Fusion, without mirrors.
const AV_SIZE: [f64; 3] = [4.9, 1.9, 1.5];

/// What nothing tells the size of (m): a cube that can be driven into.
const SOMETHING: [f64; 3] = [1.0; 3];

/// What a track of this name and type is, and its length, width and height (m), which the data set does not tell: those of the AV's make,
/// those that are usual for its kind in real scenes, and else the means of nuScenes' labels.
pub(super) fn agent(track: &str, object_type: &str) -> (AgentKind, [f64; 3]) {
    let usual = |kind| (kind, usual_size(kind).unwrap_or(SOMETHING));
    match object_type {
        _ if track == AV => (AgentKind::Vehicle, AV_SIZE),
        "vehicle" => usual(AgentKind::Vehicle),
        "pedestrian" => usual(AgentKind::Pedestrian),
        "cyclist" => usual(AgentKind::Cyclist),
        "bus" => (AgentKind::Vehicle, [11.2, 2.9, 3.5]),
        "motorcyclist" => (AgentKind::Vehicle, [2.1, 0.8, 1.5]),
        "riderless_bicycle" => (AgentKind::Other, [1.7, 0.6, 1.3]),
        // Cones and barrels.
        "construction" => (AgentKind::Other, [0.4, 0.4, 1.1]),
        _ => usual(AgentKind::Other),
    }
}

/// Lanes for buses are driven by cars too, where these turn. Which streets are motorways is not told.
pub(super) fn lane(lane_type: &str) -> LaneKind {
    match lane_type {
        "VEHICLE" | "BUS" => LaneKind::SurfaceStreet,
        "BIKE" => LaneKind::BikeLane,
        _ => LaneKind::Undefined,
    }
}

/// What is painted; `None` where nothing is. A solid line beside a broken one counts as both solid if it is white: ours have no such.
pub(super) fn line(mark_type: &str) -> Option<RoadLineKind> {
    Some(match mark_type {
        "" | "NONE" => return None,
        "DASHED_WHITE" | "DOUBLE_DASH_WHITE" => RoadLineKind::BrokenSingleWhite,
        "SOLID_WHITE" => RoadLineKind::SolidSingleWhite,
        "DOUBLE_SOLID_WHITE" | "DASH_SOLID_WHITE" | "SOLID_DASH_WHITE" => RoadLineKind::SolidDoubleWhite,
        "DASHED_YELLOW" => RoadLineKind::BrokenSingleYellow,
        "DOUBLE_DASH_YELLOW" => RoadLineKind::BrokenDoubleYellow,
        "SOLID_YELLOW" => RoadLineKind::SolidSingleYellow,
        "DOUBLE_SOLID_YELLOW" => RoadLineKind::SolidDoubleYellow,
        "DASH_SOLID_YELLOW" | "SOLID_DASH_YELLOW" => RoadLineKind::PassingDoubleYellow,
        _ => RoadLineKind::Unknown,
    })
}
