//! What stays the same over an episode, laid out for its steps; and the reading of the AV against it, step by step.

use world::geometry::{Point, Pose, Segment};
use world::reference_line::SAMPLE_SPACING;
use world::route::Route;
use world::route::follow::{Followed, Follower};
use world::scene::bridged::Bridged;

use super::traffic::Traffic;
use crate::judges::Body;
use crate::judges::lanes::{Driven, LaneTracker, Lanes, WRONG_WAY};
use crate::judges::level::Level;
use crate::judges::red_light::{RedStop, RedStops};
use crate::judges::road::{RoadEdges, TOLERANCE, outermost};
use crate::metrics::nuplan::OVERSPEED;
use crate::protocol::StrictSettings;

/// The scene as the judges need it.
#[derive(Clone, Debug)]
pub struct Course {
    pub(super) route: Route,
    pub(super) traffic: Traffic,
    pub(super) level: Level,
    lanes: Lanes,
    edges: RoadEdges,
    red_stops: RedStops,
    off_route_distance: f64,
    /// Of the AV (m).
    wheelbase: f64,
}

/// What the judges read of the AV at one step, before netting.
#[derive(Clone, Copy, Debug)]
pub struct Reading {
    /// Nearest sample of the reference line.
    pub sample: usize,
    /// Arc length along the reference line (m), less what of it was passed over while the AV was off it.
    pub station: f64,
    /// Offset from the line, positive to the left (m).
    pub lateral_offset: f64,
    /// Distance of the AV's centre to the stretch of the line on which it came (m).
    pub route_distance: f64,
    /// What the lanes of its centre say.
    pub driven: Driven,
    /// How far the outermost corner is beyond the road's edge (m).
    pub road_edge_distance: Option<f64>,
    /// Which corners are off the road, and which are outside of the drivable area.
    pub corners: Corners,
    /// The way of the front bumper in this step; none where it was not seen a step before.
    pub front_way: Option<Segment>,
    /// Which rules are broken.
    pub faults: Faults,
}

/// What the corners of the box break, in their order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Corners {
    /// Beyond the road's edge.
    pub off_road: [bool; 4],
    /// Beyond it by nuPlan's tolerance, and outside of the AV's lanes.
    pub outside: [bool; 4],
}

/// Which of the rules without a memory of their own are broken.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[allow(missing_docs, reason = "the names say it all")]
pub struct Faults {
    pub off_route: bool,
    pub off_road: bool,
    pub outside_drivable_area: bool,
    pub wrong_way: bool,
    pub speeding: bool,
}

impl Course {
    /// The course of a scene along `route`, for an AV whose axles are `wheelbase` (m) apart.
    #[must_use]
    pub fn of(bridged: &Bridged, route: Route, settings: &StrictSettings, wheelbase: f64) -> Self {
        let scene = bridged.judged();
        let level = Level::of_line(&route.line, settings.off_route_distance);
        Self {
            traffic: Traffic::of(bridged),
            lanes: Lanes::of(scene.map(), &level),
            edges: RoadEdges::of(scene.map(), &level),
            red_stops: RedStops::of(bridged, &route.lanes),
            off_route_distance: settings.off_route_distance,
            wheelbase,
            level,
            route,
        }
    }

    /// The lanes that cars drive on, as the judges see them.
    #[must_use]
    pub fn lanes(&self) -> &Lanes {
        &self.lanes
    }

    /// The level of the route.
    #[must_use]
    pub fn level(&self) -> &Level {
        &self.level
    }

    /// Whether the rear axle of an AV that is so read is in an intersection.
    pub(super) fn is_in_intersection(&self, av: &Body, reading: &Reading) -> bool {
        self.lanes.is_intersection(av.rear_axle(self.wheelbase), self.route.line.z[reading.sample])
    }

    /// The stops that an AV so read crosses at red at `log_index`.
    pub(super) fn red_stops_crossed(&self, log_index: usize, reading: &Reading) -> impl Iterator<Item = &RedStop> {
        let ground = self.route.line.z[reading.sample];
        reading.front_way.into_iter().flat_map(move |way| self.red_stops.crossed(log_index, way, ground))
    }
}

/// Reads the AV step by step; remembers what a rule needs of the steps before.
#[derive(Clone, Debug, Default)]
pub struct Reader {
    lanes: LaneTracker,
    follower: Follower,
    front: Option<Point>,
}

impl Reader {
    /// A reader of an AV that was followed along the line so far.
    #[must_use]
    pub fn following(follower: Follower) -> Self {
        Self { follower, ..Self::default() }
    }

    /// How the AV was followed along the line so far.
    #[must_use]
    pub fn follower(&self) -> Follower {
        self.follower
    }

    /// The bumper was not seen at this step.
    pub fn miss(&mut self) {
        self.front = None;
    }

    /// Where on the line the AV is a step after the last one; `ground` is the height (m) below it.
    pub fn follow(&mut self, course: &Course, pose: Pose, ground: f64) -> Followed {
        self.follower.follow(&course.route, pose, ground, course.off_route_distance)
    }

    /// What the lanes alone say of the AV, which was followed to `sample` of the line.
    pub fn read_lanes(&mut self, course: &Course, av: &Body, sample: usize) -> Driven {
        self.lanes.read(&course.lanes, av, course.route.line.z[sample])
    }

    /// Whether the AV's box lies wholly in one lane now, or across ones that lead into each other.
    pub fn in_one_lane(&mut self, course: &Course) -> bool {
        self.lanes.in_one_lane(&course.lanes)
    }

    /// The reading of the AV, which was followed to `at`.
    pub fn read(&mut self, course: &Course, av: &Body, at: Followed) -> Reading {
        let center = av.outline.center;
        let line = &course.route.line;
        let Followed { sample, distance: route_distance, skipped } = at;
        let offset = center - line.point(sample);
        let forward = Point::unit(line.heading[sample]);
        let driven = self.read_lanes(course, av, sample);
        let beyond = course.edges.beyond(av, line.z[sample]);
        let front = av.outline.front();
        let front_way = self.front.replace(front).map(|start| Segment { start, end: front });
        let places = av.outline.corners();
        let outside = |corner: usize| {
            beyond[corner].is_some_and(|edge| edge >= TOLERANCE)
                && self.lanes.corner_outside(&course.lanes, corner, places[corner]) >= TOLERANCE
        };
        let off_road = |corner: usize| beyond[corner].is_some_and(|edge| edge > 0.0);
        let corners = Corners { off_road: std::array::from_fn(off_road), outside: std::array::from_fn(outside) };
        Reading {
            sample,
            station: sample as f64 * SAMPLE_SPACING + forward.dot(offset) - skipped,
            lateral_offset: forward.cross(offset),
            route_distance,
            driven,
            road_edge_distance: outermost(beyond),
            corners,
            front_way,
            faults: Faults {
                off_route: route_distance > course.off_route_distance,
                off_road: corners.off_road.contains(&true),
                outside_drivable_area: corners.outside.contains(&true),
                wrong_way: driven.backward_travel >= WRONG_WAY,
                speeding: driven.speed_limit > 0.0 && av.speed - driven.speed_limit > OVERSPEED,
            },
        }
    }
}

impl Reader {
    /// What the lanes say of all readings so far, the first included, now that it is known where the AV went.
    #[must_use]
    pub fn settle(&self, course: &Course) -> Vec<Driven> {
        self.lanes.settle(&course.lanes)
    }
}
