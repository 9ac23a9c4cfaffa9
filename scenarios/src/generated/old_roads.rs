//! Maps of generated scenes: roads of several lanes, with all that a real map says of them.

use world::map::{
    Area, BoundarySegment, Lane, LaneKind, LaneNeighbor, Map, MapId, RoadEdge, RoadEdgeKind, RoadLine, RoadLineKind,
};

use super::old_curve::Curve;

/// Width of a lane (m).
pub(super) const LANE_WIDTH: f64 = 3.7;

/// From the outer side of a lane to the curb (m).
pub(super) const GUTTER: f64 = 0.4;

/// A road is cut into sections of about this length (m), as real maps are.
const SECTION: f64 = 80.0;

/// A road: lanes on both sides of a line in its middle.
#[derive(Clone, Debug)]
pub(super) struct Road {
    /// The middle, in the direction of the forward lanes.
    pub(super) middle: Curve,
    /// Lanes that go forward, to the right of the middle.
    pub(super) forward: usize,
    /// Lanes that go back, to the left of the middle.
    pub(super) backward: usize,
    /// Speed limit (mph).
    pub(super) speed_limit_mph: f64,
    /// Whether it has curbs; a junction lays its own.
    pub(super) curbs: bool,
}

impl Road {
    /// The course of forward lane `slot`, counted from the middle.
    pub(super) fn forward_lane(&self, slot: usize) -> Curve {
        self.middle.shifted(-(slot as f64 + 0.5) * LANE_WIDTH)
    }

    /// The course of backward lane `slot`, counted from the middle, in its own direction.
    pub(super) fn backward_lane(&self, slot: usize) -> Curve {
        self.middle.shifted((slot as f64 + 0.5) * LANE_WIDTH).reversed()
    }
}

/// The first and last lane of each slot of a road, in their own directions.
#[derive(Clone, Debug, Default)]
pub(super) struct RoadLanes {
    pub(super) forward: Vec<(MapId, MapId)>,
    pub(super) backward: Vec<(MapId, MapId)>,
}

/// Builds a map feature by feature.
#[derive(Debug, Default)]
pub(super) struct MapBuilder {
    map: Map,
    last_id: i64,
}

impl MapBuilder {
    pub(super) fn finish(self) -> Map {
        self.map
    }

    pub(super) fn next_id(&mut self) -> MapId {
        self.last_id += 1;
        MapId(self.last_id)
    }

    /// A lane by itself.
    pub(super) fn lane(&mut self, course: &Curve, speed_limit_mph: f64, interpolating: bool) -> MapId {
        let id = self.next_id();
        self.map.lanes.push(Lane {
            id,
            kind: LaneKind::SurfaceStreet,
            speed_limit_mph,
            interpolating,
            centerline: course.polyline(),
            ..Lane::default()
        });
        id
    }

    pub(super) fn link(&mut self, from: MapId, to: MapId) {
        for lane in &mut self.map.lanes {
            if lane.id == from {
                lane.exits.push(to);
            }
            if lane.id == to {
                lane.entries.push(from);
            }
        }
    }

    pub(super) fn line(&mut self, course: &Curve, kind: RoadLineKind) -> MapId {
        let id = self.next_id();
        self.map.road_lines.push(RoadLine { id, kind, polyline: course.polyline() });
        id
    }

    /// An edge; the road lies on the left of `course`.
    pub(super) fn edge(&mut self, course: &Curve) -> MapId {
        let id = self.next_id();
        self.map.road_edges.push(RoadEdge { id, kind: RoadEdgeKind::Boundary, polyline: course.polyline() });
        id
    }

    pub(super) fn crosswalk(&mut self, polygon: Vec<world::geometry::Point3>) {
        let id = self.next_id();
        self.map.crosswalks.push(Area { id, polygon });
    }

    pub(super) fn stop_sign(&mut self, lanes: Vec<MapId>, position: world::geometry::Point3) {
        let id = self.next_id();
        self.map.stop_signs.push(world::map::StopSign { id, lanes, position });
    }

    /// A road, section by section.
    pub(super) fn road(&mut self, road: &Road) -> RoadLanes {
        let length = road.middle.length();
        let sections = (length / SECTION).round().max(1.0) as usize;
        let mut whole = RoadLanes::default();
        for section in 0..sections {
            let at = |k: usize| length * k as f64 / sections as f64;
            let part = Road { middle: road.middle.slice(at(section), at(section + 1)), ..road.clone() };
            let (forward, backward) = self.section(&part);
            if section == 0 {
                whole.forward = forward.iter().map(|id| (*id, *id)).collect();
                whole.backward = backward.iter().map(|id| (*id, *id)).collect();
                continue;
            }
            for (ends, id) in whole.forward.iter_mut().zip(forward) {
                self.link(ends.1, id);
                ends.1 = id;
            }
            for (ends, id) in whole.backward.iter_mut().zip(backward) {
                self.link(id, ends.0);
                ends.0 = id;
            }
        }
        whole
    }

    fn section(&mut self, road: &Road) -> (Vec<MapId>, Vec<MapId>) {
        let reversed =
            Road { middle: road.middle.reversed(), forward: road.backward, backward: road.forward, ..road.clone() };
        let middle = match (road.forward, road.backward) {
            (0, _) | (_, 0) if road.curbs => {
                // The curb beside the only direction's first lane; it runs with the road on its left.
                let course = if road.backward == 0 { &reversed.middle } else { &road.middle };
                Some((self.edge(&course.shifted(-GUTTER)), RoadLineKind::Unknown))
            }
            (0, _) | (_, 0) => None,
            _ => Some((self.line(&road.middle, RoadLineKind::SolidDoubleYellow), RoadLineKind::SolidDoubleYellow)),
        };
        (self.side(road, middle), self.side(&reversed, middle))
    }

    /// The forward lanes of a section, with the lines between them and the curb beside them.
    fn side(&mut self, road: &Road, middle: Option<(MapId, RoadLineKind)>) -> Vec<MapId> {
        let lanes: Vec<MapId> =
            (0..road.forward).map(|slot| self.lane(&road.forward_lane(slot), road.speed_limit_mph, false)).collect();
        let mut left = middle;
        for (slot, id) in lanes.iter().enumerate() {
            let outer = (slot as f64 + 1.0) * LANE_WIDTH;
            let is_last = slot + 1 == lanes.len();
            let right = if !is_last {
                let kind = RoadLineKind::BrokenSingleWhite;
                Some((self.line(&road.middle.shifted(-outer), kind), kind))
            } else if road.curbs {
                Some((self.edge(&road.middle.shifted(-outer - GUTTER)), RoadLineKind::Unknown))
            } else {
                None
            };
            self.bound(*id, left, right);
            left = right;
        }
        for pair in lanes.windows(2) {
            self.neighbors(pair[0], pair[1]);
        }
        lanes
    }

    fn lane_mut(&mut self, id: MapId) -> Option<&mut Lane> {
        self.map.lanes.iter_mut().find(|lane| lane.id == id)
    }

    fn points(&mut self, id: MapId) -> i32 {
        self.lane_mut(id).map_or(0, |lane| lane.centerline.len() as i32)
    }

    fn bound(&mut self, id: MapId, left: Option<(MapId, RoadLineKind)>, right: Option<(MapId, RoadLineKind)>) {
        let Some(lane) = self.lane_mut(id) else { return };
        let lane_end_index = lane.centerline.len() as i32 - 1;
        let segment = |(feature, kind)| vec![BoundarySegment { lane_start_index: 0, lane_end_index, feature, kind }];
        lane.left_boundaries = left.map(segment).unwrap_or_default();
        lane.right_boundaries = right.map(segment).unwrap_or_default();
    }

    fn neighbors(&mut self, left: MapId, right: MapId) {
        let (left_points, right_points) = (self.points(left), self.points(right));
        let neighbor = |lane, own: i32, other: i32, boundaries: &[BoundarySegment]| LaneNeighbor {
            lane,
            self_start_index: 0,
            self_end_index: own - 1,
            neighbor_start_index: 0,
            neighbor_end_index: other - 1,
            boundaries: boundaries.to_vec(),
        };
        if let Some(lane) = self.lane_mut(left) {
            let between = neighbor(right, left_points, right_points, &lane.right_boundaries);
            lane.right_neighbors.push(between);
        }
        if let Some(lane) = self.lane_mut(right) {
            let between = neighbor(left, right_points, left_points, &lane.left_boundaries);
            lane.left_neighbors.push(between);
        }
    }
}
