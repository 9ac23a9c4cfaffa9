//! The lanes that cars drive on, so that the lane of a pose is found without looking at all of them.

use world::geometry::{Point, Polyline, Pose, SegmentGrid};
use world::lane_graph::LaneGraph;
use world::map::{Lane, Map};

/// How far (m) beside a lane's centre line a vehicle is still on it.
const HALF_WIDTH: f64 = 1.75;

/// The cosine of how much its heading may differ from the lane's: 0.5 rad.
const COSINE: f64 = 0.877_582_561_890_372_8;

/// Cells about as large as a lane is wide: most queries look at a few.
const CELL: f64 = 4.0;

/// Lanes for cars with a direction: at least two points.
pub(super) struct Roadway {
    grid: SegmentGrid,
    /// For each segment of the grid its direction, and how far along its lane it begins (m).
    segments: Vec<(Point, f64)>,
    graph: LaneGraph,
}

/// Where on a lane a vehicle is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct OnLane {
    /// The lane, by its index in [`Map::lanes`].
    pub(super) lane: usize,
    /// Distance along it (m).
    pub(super) station: f64,
}

/// Whether a lane counts: not for bicycles, and of more than one point.
pub(super) fn counts(lane: &Lane) -> bool {
    lane.kind.is_drivable() && lane.centerline.len() > 1
}

/// The course of a lane, seen from above; none of a lane without points, which no checked map has.
pub(super) fn course(lane: &Lane) -> Option<Polyline> {
    Polyline::new(lane.centerline.iter().map(|point| point.xy()).collect())
}

impl Roadway {
    pub(super) fn new(map: &Map) -> Self {
        let counted = map.lanes.iter().enumerate().filter(|(_, lane)| counts(lane));
        let chains = counted.map(|(index, lane)| (index as u32, lane.centerline.iter().map(|point| point.xy())));
        let grid = SegmentGrid::new(chains, CELL);
        let (mut segments, mut lane, mut station) = (Vec::with_capacity(grid.len()), None, 0.0);
        for index in 0..grid.len() {
            if lane.replace(grid.payload(index)) != Some(grid.payload(index)) {
                station = 0.0;
            }
            let (along, length) = (grid.segment(index).vector(), grid.segment(index).length());
            let direction = if length > 0.0 { along * (1.0 / length) } else { Point::default() };
            segments.push((direction, station));
            station += length;
        }
        Self { grid, segments, graph: LaneGraph::new(map) }
    }

    /// How lanes hang together.
    pub(super) fn graph(&self) -> &LaneGraph {
        &self.graph
    }

    /// The nearest lane that a vehicle at `pose` is on, if it is on one.
    pub(super) fn lane_of(&self, pose: Pose) -> Option<OnLane> {
        let forward = Point::unit(pose.heading);
        let accept = |index: usize| self.segments[index].0.dot(forward) >= COSINE;
        let nearest = self.grid.nearest_where(pose.position(), HALF_WIDTH, accept)?;
        let segment = self.grid.segment(nearest.segment);
        let station = self.segments[nearest.segment].1 + segment.length() * nearest.fraction;
        Some(OnLane { lane: nearest.payload as usize, station })
    }
}
