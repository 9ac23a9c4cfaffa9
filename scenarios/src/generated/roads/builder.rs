//! Roads as they grow: every lane of traffic beside the map's, which has the same index.

use world::map::{
    Area, BoundarySegment, Lane as MapLane, LaneKind, LaneNeighbor, METERS_PER_SECOND_PER_MPH, MapId, RoadEdge,
    RoadEdgeKind, RoadLine, RoadLineKind, StopSign,
};

use super::super::curve::Curve;
use super::{Lane, LaneIndex, Roads, Way};
use world::geometry::Point3;

/// What cyclists keep to (m/s).
const CYCLING: f64 = 5.5;

#[derive(Debug, Default)]
pub(super) struct Builder {
    pub(super) roads: Roads,
    last_id: i64,
}

/// What bounds a lane on one side.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bound {
    pub(super) feature: MapId,
    pub(super) kind: RoadLineKind,
}

/// A lane to be laid.
#[derive(Clone, Debug)]
pub(super) struct NewLane {
    pub(super) course: Curve,
    pub(super) width: f64,
    pub(super) limit_mph: f64,
    pub(super) bike: bool,
    pub(super) way: Option<Way>,
    pub(super) solid: bool,
    pub(super) lot: bool,
}

impl Builder {
    fn id(&mut self) -> MapId {
        self.last_id += 1;
        MapId(self.last_id)
    }

    pub(super) fn lane(&mut self, new: NewLane) -> LaneIndex {
        let id = self.id();
        let (kind, speed_limit_mph, limit) = if new.bike {
            (LaneKind::BikeLane, 0.0, CYCLING)
        } else {
            (LaneKind::SurfaceStreet, new.limit_mph, new.limit_mph * METERS_PER_SECOND_PER_MPH)
        };
        self.roads.map.lanes.push(MapLane {
            id,
            kind,
            speed_limit_mph,
            interpolating: new.way.is_some(),
            centerline: new.course.polyline(),
            ..MapLane::default()
        });
        self.roads.lanes.push(Lane {
            id,
            sharpest: new.course.sharpest(),
            course: new.course,
            width: new.width,
            limit,
            bike: new.bike,
            exits: Vec::new(),
            entries: Vec::new(),
            left: None,
            right: None,
            way: new.way,
            solid: new.solid,
            lot: new.lot,
            crossed: Vec::new(),
        });
        self.roads.lanes.len() - 1
    }

    pub(super) fn link(&mut self, from: LaneIndex, to: LaneIndex) {
        let (from_id, to_id) = (self.roads.lanes[from].id, self.roads.lanes[to].id);
        self.roads.lanes[from].exits.push(to);
        self.roads.lanes[to].entries.push(from);
        self.roads.map.lanes[from].exits.push(to_id);
        self.roads.map.lanes[to].entries.push(from_id);
    }

    pub(super) fn line(&mut self, kind: RoadLineKind, course: &Curve) -> Bound {
        let feature = self.id();
        self.roads.map.road_lines.push(RoadLine { id: feature, kind, polyline: course.polyline() });
        Bound { feature, kind }
    }

    /// An edge; the road lies on the left of `course`.
    pub(super) fn edge(&mut self, kind: RoadEdgeKind, polyline: Vec<Point3>) -> Bound {
        let feature = self.id();
        self.roads.map.road_edges.push(RoadEdge { id: feature, kind, polyline });
        Bound { feature, kind: RoadLineKind::Unknown }
    }

    pub(super) fn crosswalk(&mut self, polygon: Vec<Point3>) {
        let id = self.id();
        self.roads.map.crosswalks.push(Area { id, polygon });
    }

    pub(super) fn driveway(&mut self, polygon: Vec<Point3>) {
        let id = self.id();
        self.roads.map.driveways.push(Area { id, polygon });
    }

    pub(super) fn stop_sign(&mut self, lanes: &[LaneIndex], position: Point3) {
        let id = self.id();
        let lanes = lanes.iter().map(|lane| self.roads.lanes[*lane].id).collect();
        self.roads.map.stop_signs.push(StopSign { id, lanes, position });
    }

    /// Says what bounds a lane, on the left and on the right.
    pub(super) fn bound(&mut self, lane: LaneIndex, left: Option<Bound>, right: Option<Bound>) {
        let lane = &mut self.roads.map.lanes[lane];
        let lane_end_index = lane.centerline.len() as i32 - 1;
        let segment = |bound: Bound| BoundarySegment {
            lane_start_index: 0,
            lane_end_index,
            feature: bound.feature,
            kind: bound.kind,
        };
        lane.left_boundaries = left.map(segment).into_iter().collect();
        lane.right_boundaries = right.map(segment).into_iter().collect();
    }

    /// Says that two lanes lie side by side; call it when their bounds are known.
    pub(super) fn beside(&mut self, left: LaneIndex, right: LaneIndex) {
        let lanes = &mut self.roads.map.lanes;
        let (left_id, left_last) = (lanes[left].id, lanes[left].centerline.len() as i32 - 1);
        let (right_id, right_last) = (lanes[right].id, lanes[right].centerline.len() as i32 - 1);
        let neighbor = |lane, own, other, boundaries: &[BoundarySegment]| LaneNeighbor {
            lane,
            self_start_index: 0,
            self_end_index: own,
            neighbor_start_index: 0,
            neighbor_end_index: other,
            boundaries: boundaries.to_vec(),
        };
        let between = neighbor(right_id, left_last, right_last, &lanes[left].right_boundaries);
        lanes[left].right_neighbors.push(between);
        let between = neighbor(left_id, right_last, left_last, &lanes[right].left_boundaries);
        lanes[right].left_neighbors.push(between);
        let lanes = &mut self.roads.lanes;
        if !lanes[left].bike && !lanes[right].bike {
            lanes[left].right = Some(right);
            lanes[right].left = Some(left);
        }
    }
}
