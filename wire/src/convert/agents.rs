//! Agents, their kinds and states, and signals.

use world::geometry::Point3;
use world::map::{self, MapId};
use world::observation::ObservedAgent;
use world::scene::bridged::SeenSignal;
use world::scene::{self, TrackId};
use world::signal;

use super::{Checked, FieldError, Problem, Within, finite, not_negative, required};
use crate::proto;

/// Both directions of an enumeration whose names are the same on both sides.
macro_rules! same_names {
    ($function:ident: $proto:ident, $world:path { $($name:ident),* $(,)? }) => {
        impl From<$world> for proto::$proto {
            fn from(value: $world) -> Self {
                match value { $(<$world>::$name => Self::$name),* }
            }
        }

        pub(super) fn $function(field: &str, value: i32) -> Checked<$world> {
            match proto::$proto::try_from(value) {
                $(Ok(proto::$proto::$name) => Ok(<$world>::$name),)*
                Err(_) => Err(FieldError::new(field, Problem::UnknownValue(value))),
            }
        }
    };
}

same_names!(agent_kind: AgentKind, scene::AgentKind { Other, Vehicle, Pedestrian, Cyclist });
same_names!(lane_kind: LaneKind, map::LaneKind { Undefined, Freeway, SurfaceStreet, BikeLane });
same_names!(road_edge_kind: RoadEdgeKind, map::RoadEdgeKind { Unknown, Boundary, Median });
same_names!(road_line_kind: RoadLineKind, map::RoadLineKind {
    Unknown, BrokenSingleWhite, SolidSingleWhite, SolidDoubleWhite, BrokenSingleYellow, BrokenDoubleYellow,
    SolidSingleYellow, SolidDoubleYellow, PassingDoubleYellow,
});
same_names!(signal_state: SignalState, signal::SignalState {
    Unknown, ArrowStop, ArrowCaution, ArrowGo, Stop, Caution, Go, FlashingStop, FlashingCaution,
});

impl From<&scene::AgentState> for proto::AgentState {
    fn from(s: &scene::AgentState) -> Self {
        Self {
            x: s.x,
            y: s.y,
            z: s.z,
            heading: s.heading,
            velocity_x: s.velocity_x,
            velocity_y: s.velocity_y,
            length: s.length,
            width: s.width,
            height: s.height,
        }
    }
}

pub(super) fn agent_state(s: &proto::AgentState) -> Checked<scene::AgentState> {
    Ok(scene::AgentState {
        x: finite("x", s.x)?,
        y: finite("y", s.y)?,
        z: finite("z", s.z)?,
        heading: finite("heading", s.heading)?,
        velocity_x: finite("velocity_x", s.velocity_x)?,
        velocity_y: finite("velocity_y", s.velocity_y)?,
        length: not_negative("length", s.length)?,
        width: not_negative("width", s.width)?,
        height: not_negative("height", s.height)?,
    })
}

impl From<&ObservedAgent> for proto::Agent {
    fn from(agent: &ObservedAgent) -> Self {
        Self {
            track: agent.track.0,
            kind: proto::AgentKind::from(agent.kind).into(),
            state: Some((&agent.state).into()),
            unseen: agent.unseen,
        }
    }
}

pub(super) fn agent(agent: &proto::Agent) -> Checked<ObservedAgent> {
    Ok(ObservedAgent {
        track: TrackId(agent.track),
        kind: agent_kind("kind", agent.kind)?,
        state: agent_state(&required("state", agent.state)?).within("state")?,
        unseen: agent.unseen,
    })
}

impl From<&SeenSignal> for proto::Signal {
    fn from(SeenSignal { signal, unseen }: &SeenSignal) -> Self {
        Self {
            lane: signal.lane.0,
            state: proto::SignalState::from(signal.state).into(),
            stop_x: signal.stop_point.x,
            stop_y: signal.stop_point.y,
            stop_z: signal.stop_point.z,
            unseen: *unseen,
        }
    }
}

pub(super) fn signal(signal: &proto::Signal) -> Checked<SeenSignal> {
    let shown = signal::Signal {
        lane: MapId(signal.lane),
        state: signal_state("state", signal.state)?,
        stop_point: Point3 {
            x: finite("stop_x", signal.stop_x)?,
            y: finite("stop_y", signal.stop_y)?,
            z: finite("stop_z", signal.stop_z)?,
        },
    };
    Ok(SeenSignal { signal: shown, unseen: signal.unseen })
}
