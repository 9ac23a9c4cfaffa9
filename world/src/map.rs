//! The static map of a scene: what is drawn on the ground and how lanes hang together.
//!
//! The kinds are those of the Waymo Open Motion Dataset; other sources are brought into them. Features keep the order
//! of their file within each kind: ties in map matching go to the first.

use std::collections::BTreeMap;

use crate::geometry::{Point, Point3, polygon_contains};

/// Metres a second in a mile an hour.
pub const METERS_PER_SECOND_PER_MPH: f64 = 0.44704;

/// What is taken for the limit where the map gives none: the usual one of residential streets in the United States (mph).
pub const USUAL_SPEED_LIMIT_MPH: f64 = 25.0;

/// The number of a map feature, unique in its scene; a space of its own beside [`crate::scene::TrackId`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct MapId(pub i64);

impl std::fmt::Display for MapId {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.fmt(f)
    }
}

/// What a lane is for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LaneKind {
    /// Not said.
    #[default]
    Undefined,
    /// Motorway.
    Freeway,
    /// Any other street.
    SurfaceStreet,
    /// For bicycles: never driven by the AV.
    BikeLane,
}

impl LaneKind {
    /// Whether cars drive here.
    #[must_use]
    pub fn is_drivable(self) -> bool {
        !matches!(self, Self::BikeLane)
    }
}

/// A stretch of a lane's side and what bounds it there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoundarySegment {
    /// First centerline index, inclusive.
    pub lane_start_index: i32,
    /// Last centerline index, inclusive.
    pub lane_end_index: i32,
    /// The road line or road edge; 0 where there is none.
    pub feature: MapId,
    /// The road line's type; [`RoadLineKind::Unknown`] where the boundary is a road edge.
    pub kind: RoadLineKind,
}

/// A lane beside a lane, in the same direction, over a stretch.
#[derive(Clone, Debug, PartialEq)]
pub struct LaneNeighbor {
    /// The other lane.
    pub lane: MapId,
    /// First index of the stretch on this lane, inclusive.
    pub self_start_index: i32,
    /// Last index of the stretch on this lane, inclusive.
    pub self_end_index: i32,
    /// First index of the stretch on the neighbour, inclusive.
    pub neighbor_start_index: i32,
    /// Last index of the stretch on the neighbour, inclusive.
    pub neighbor_end_index: i32,
    /// What lies between the two; indices of this lane.
    pub boundaries: Vec<BoundarySegment>,
}

/// A lane by its centerline.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lane {
    /// The feature's number.
    pub id: MapId,
    /// What it is for.
    pub kind: LaneKind,
    /// Speed limit (mph, as maps give it); 0 where it is not known.
    pub speed_limit_mph: f64,
    /// Laid between two others, as within an intersection.
    pub interpolating: bool,
    /// Center line in driving direction, about 0.5 m apart; at least one point.
    pub centerline: Vec<Point3>,
    /// Lanes that lead into this one.
    pub entries: Vec<MapId>,
    /// Lanes that this one leads to.
    pub exits: Vec<MapId>,
    /// Neighbours to the left.
    pub left_neighbors: Vec<LaneNeighbor>,
    /// Neighbours to the right.
    pub right_neighbors: Vec<LaneNeighbor>,
    /// What bounds the lane on its left.
    pub left_boundaries: Vec<BoundarySegment>,
    /// What bounds the lane on its right.
    pub right_boundaries: Vec<BoundarySegment>,
}

impl Lane {
    /// Speed limit (m/s), if it is known.
    #[must_use]
    pub fn speed_limit(&self) -> Option<f64> {
        (self.speed_limit_mph > 0.0).then_some(self.speed_limit_mph * METERS_PER_SECOND_PER_MPH)
    }
}

/// How a road line is painted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[allow(missing_docs, reason = "the names say it all")]
pub enum RoadLineKind {
    #[default]
    Unknown,
    BrokenSingleWhite,
    SolidSingleWhite,
    SolidDoubleWhite,
    BrokenSingleYellow,
    BrokenDoubleYellow,
    SolidSingleYellow,
    SolidDoubleYellow,
    PassingDoubleYellow,
}

/// A painted line.
#[derive(Clone, Debug, PartialEq)]
pub struct RoadLine {
    /// The feature's number.
    pub id: MapId,
    /// How it is painted.
    pub kind: RoadLineKind,
    /// Its course; at least one point.
    pub polyline: Vec<Point3>,
}

/// What kind of edge ends the road.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RoadEdgeKind {
    /// Not said.
    #[default]
    Unknown,
    /// A curb: the road ends.
    Boundary,
    /// A median: other traffic lies behind it.
    Median,
}

/// An edge of the road. The road lies on its left (WOMD's convention).
#[derive(Clone, Debug, PartialEq)]
pub struct RoadEdge {
    /// The feature's number.
    pub id: MapId,
    /// What kind of edge.
    pub kind: RoadEdgeKind,
    /// Its course; at least one point.
    pub polyline: Vec<Point3>,
}

/// A stop sign and the lanes that it rules; those begin at the sign.
#[derive(Clone, Debug, PartialEq)]
pub struct StopSign {
    /// The feature's number.
    pub id: MapId,
    /// The lanes that it rules.
    pub lanes: Vec<MapId>,
    /// Where it stands.
    pub position: Point3,
}

/// A flat area: crosswalk, speed bump or driveway. Closed by implication.
#[derive(Clone, Debug, PartialEq)]
pub struct Area {
    /// The feature's number.
    pub id: MapId,
    /// Its corners.
    pub polygon: Vec<Point3>,
}

impl Area {
    /// Whether `point` lies in it, seen from above.
    #[must_use]
    pub fn contains(&self, point: Point) -> bool {
        polygon_contains(self.polygon.iter().map(|corner| corner.xy()), point)
    }
}

/// The static map of a scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Map {
    /// Lanes.
    pub lanes: Vec<Lane>,
    /// Painted lines.
    pub road_lines: Vec<RoadLine>,
    /// Edges of the road.
    pub road_edges: Vec<RoadEdge>,
    /// Stop signs.
    pub stop_signs: Vec<StopSign>,
    /// Crosswalks.
    pub crosswalks: Vec<Area>,
    /// Speed bumps.
    pub speed_bumps: Vec<Area>,
    /// Driveways: to be driven on, though they lie beyond a road edge.
    pub driveways: Vec<Area>,
}

impl Map {
    /// For each lane its place in [`Map::lanes`].
    #[must_use]
    pub fn lane_indices(&self) -> BTreeMap<MapId, usize> {
        self.lanes.iter().enumerate().map(|(index, lane)| (lane.id, index)).collect()
    }
}
