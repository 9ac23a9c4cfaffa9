//! The names of kinds.

use world::map::{LaneKind, RoadEdgeKind, RoadLineKind};
use world::scene::AgentKind;
use world::signal::SignalState;

use super::layout::Layout;
use super::pickle::{Class, Value};
use crate::womd::kinds::Numbered;

/// What a map feature is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Form {
    Lane {
        kind: LaneKind,
        interpolating: bool,
    },
    RoadLine(RoadLineKind),
    RoadEdge(RoadEdgeKind),
    StopSign,
    Crosswalk,
    SpeedBump,
    Driveway,
    /// What our maps have no place for: sidewalks, buildings ...
    Nothing,
}

/// In the order of WOMD's numbers, from 1.
const LINES: [&str; 8] = [
    "BROKEN_SINGLE_WHITE",
    "SOLID_SINGLE_WHITE",
    "SOLID_DOUBLE_WHITE",
    "BROKEN_SINGLE_YELLOW",
    "BROKEN_DOUBLE_YELLOW",
    "SOLID_SINGLE_YELLOW",
    "SOLID_DOUBLE_YELLOW",
    "PASSING_DOUBLE_YELLOW",
];

/// In the order of WOMD's numbers, from 0.
const SIGNALS: [&str; 9] = [
    "UNKNOWN",
    "ARROW_STOP",
    "ARROW_CAUTION",
    "ARROW_GO",
    "STOP",
    "CAUTION",
    "GO",
    "FLASHING_STOP",
    "FLASHING_CAUTION",
];

fn numbered<K: Numbered>(number: i64) -> K {
    K::from_number(i32::try_from(number).unwrap_or(0))
}

impl Form {
    pub fn of<'p>(layout: &Layout<'p>, feature: Value<'p>) -> Self {
        let Some(kind) = layout.find(feature, &["type"]) else {
            return if layout.text(feature, &["sign"]) == Some("cross_walk") { Self::Crosswalk } else { Self::Nothing };
        };
        match (layout.pickle.text(kind), layout.pickle.member(kind)) {
            (Some(name), _) => Self::named(name, layout.pickle.get(feature, "entry_lanes").is_some()),
            (_, Some((Class::RoadLineType, number))) => Self::RoadLine(numbered(number)),
            (_, Some((Class::RoadEdgeType, number))) => Self::RoadEdge(numbered(number)),
            // The first converters wrote a speed bump into its own type.
            _ if layout.pickle.dict(kind).is_some() => Self::SpeedBump,
            _ => Self::Nothing,
        }
    }

    /// `UNKNOWN` is a lane, a line or an edge: a lane can be told from the others.
    fn named(name: &str, has_entries: bool) -> Self {
        let lane = |kind| Self::Lane { kind, interpolating: false };
        match name {
            "LANE_SURFACE_STREET" => lane(LaneKind::SurfaceStreet),
            "LANE_SURFACE_UNSTRUCTURE" => Self::Lane { kind: LaneKind::SurfaceStreet, interpolating: true },
            "LANE_FREEWAY" => lane(LaneKind::Freeway),
            "LANE_BIKE_LANE" => lane(LaneKind::BikeLane),
            "center_lane" => lane(LaneKind::Undefined),
            "UNKNOWN" if has_entries => lane(LaneKind::Undefined),
            "STOP_SIGN" | "stop_sign" => Self::StopSign,
            "CROSSWALK" | "CROSS_WALK" | "cross_walk" => Self::Crosswalk,
            "SPEED_BUMP" | "speed_bump" => Self::SpeedBump,
            "DRIVEWAY" => Self::Driveway,
            "UNKNOWN" | "UNKNOWN_LINE" => Self::RoadLine(RoadLineKind::Unknown),
            "ROAD_EDGE_BOUNDARY" => Self::RoadEdge(RoadEdgeKind::Boundary),
            "ROAD_EDGE_MEDIAN" => Self::RoadEdge(RoadEdgeKind::Median),
            "ROAD_EDGE_SIDEWALK" => Self::Nothing,
            _ if name.starts_with("ROAD_EDGE_") => Self::RoadEdge(RoadEdgeKind::Unknown),
            _ if name.starts_with("ROAD_LINE_") => Self::RoadLine(line(name)),
            _ if name.starts_with("LANE_") => lane(LaneKind::Undefined),
            _ => Self::Nothing,
        }
    }
}

fn line(name: &str) -> RoadLineKind {
    let place = LINES.iter().position(|line| name.strip_prefix("ROAD_LINE_") == Some(line));
    numbered(place.map_or(0, |place| place as i64 + 1))
}

/// The kind of a line that a lane's boundary names: a name, a number, or a member of the enumeration.
pub(super) fn boundary<'p>(layout: &Layout<'p>, kind: Option<Value<'p>>) -> RoadLineKind {
    let Some(kind) = kind else { return RoadLineKind::Unknown };
    match layout.pickle.text(kind) {
        Some(name) if name.starts_with("ROAD_LINE_") => line(name),
        Some(name) => name.parse().map_or(RoadLineKind::Unknown, numbered),
        None => layout.pickle.int(kind).map_or(RoadLineKind::Unknown, numbered),
    }
}

/// The kind of a road user. Cones and barriers are of no kind of their own.
pub(super) fn agent<'p>(layout: &Layout<'p>, kind: Option<Value<'p>>) -> AgentKind {
    let Some(kind) = kind else { return AgentKind::Other };
    match layout.pickle.text(kind) {
        Some("VEHICLE") => AgentKind::Vehicle,
        Some("PEDESTRIAN") => AgentKind::Pedestrian,
        Some("CYCLIST") => AgentKind::Cyclist,
        Some(_) => AgentKind::Other,
        None => layout.pickle.int(kind).map_or(AgentKind::Other, numbered),
    }
}

/// What a signal shows; `None` where it was not seen.
pub(super) fn signal<'p>(layout: &Layout<'p>, state: Value<'p>) -> Option<SignalState> {
    if state == Value::None {
        return None;
    }
    let Some(name) = layout.pickle.text(state) else { return layout.pickle.int(state).map(numbered) };
    Some(match name {
        "TRAFFIC_LIGHT_GREEN" => SignalState::Go,
        "TRAFFIC_LIGHT_YELLOW" => SignalState::Caution,
        "TRAFFIC_LIGHT_RED" => SignalState::Stop,
        _ => {
            let name = name.strip_prefix("LANE_STATE_").unwrap_or_default();
            numbered(SIGNALS.iter().position(|signal| *signal == name).map_or(0, |place| place as i64))
        }
    })
}

/// What a number of WOMD's means for a signal.
pub(super) fn signal_number(number: f64) -> SignalState {
    numbered(if number.is_finite() { number as i64 } else { 0 })
}
