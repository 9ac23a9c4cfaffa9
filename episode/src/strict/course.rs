//! What stays the same over an episode, laid out for its steps; and the reading of the AV against it, step by step.

use world::geometry::{Point, Point3, Segment};
use world::reference_line::SAMPLE_SPACING;
use world::route::Route;
use world::scene::Scene;

use super::traffic::Traffic;
use crate::judges::Body;
use crate::judges::lanes::{Driven, LaneReading, LaneTracker, Lanes, WRONG_WAY};
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
    /// Arc length along the reference line (m).
    pub station: f64,
    /// Offset from the line, positive to the left (m).
    pub lateral_offset: f64,
    /// Distance of the AV's centre to the line (m).
    pub route_distance: f64,
    /// What the lanes say.
    pub lane: LaneReading,
    /// How far the outermost corner is beyond the road's edge (m).
    pub road_edge_distance: Option<f64>,
    /// The way of the front bumper in this step; none where it was not seen a step before.
    pub front_way: Option<Segment>,
    /// Which rules are broken.
    pub faults: Faults,
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
    /// The course of `scene` along `route`, for an AV whose axles are `wheelbase` (m) apart.
    #[must_use]
    pub fn of(scene: &Scene, route: Route, settings: &StrictSettings, wheelbase: f64) -> Self {
        let line = &route.line;
        let every_metre = (0..line.len()).step_by(10);
        let points: Vec<Point3> = every_metre.map(|at| Point3::new(line.x[at], line.y[at], line.z[at])).collect();
        let level = Level::along(&points, settings.off_route_distance);
        Self {
            traffic: Traffic::of(scene),
            lanes: Lanes::of(scene.map(), &level),
            edges: RoadEdges::of(scene.map(), &level),
            red_stops: RedStops::of(scene, &route.lanes),
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

    /// The stops that an AV so read crosses at red at `log_index`.
    pub(super) fn red_stops_crossed(&self, log_index: usize, reading: &Reading) -> impl Iterator<Item = &RedStop> {
        reading.front_way.into_iter().flat_map(move |way| self.red_stops.crossed(log_index, way))
    }
}

/// Reads the AV step by step; remembers what a rule needs of the steps before.
#[derive(Clone, Debug, Default)]
pub struct Reader {
    lanes: LaneTracker,
    sample: Option<usize>,
    front: Option<Point>,
}

impl Reader {
    /// The reading of the AV a step after the last one.
    pub fn read(&mut self, course: &Course, av: &Body) -> Reading {
        let center = av.outline.center;
        let line = &course.route.line;
        let (sample, route_distance) = match self.sample {
            Some(before) => course.route.nearest_sample_from(center, before),
            None => course.route.nearest_sample(center),
        };
        self.sample = Some(sample);
        let offset = center - line.point(sample);
        let forward = Point::unit(line.heading[sample]);
        let lane = self.lanes.read(&course.lanes, av, course.wheelbase);
        let beyond = course.edges.beyond(av);
        let front = av.outline.front();
        let front_way = self.front.replace(front).map(|start| Segment { start, end: front });
        let outside = |(edge, lanes): (Option<f64>, f64)| edge.is_some_and(|edge| edge.min(lanes) >= TOLERANCE);
        let road_edge_distance = outermost(beyond);
        Reading {
            sample,
            station: sample as f64 * SAMPLE_SPACING + forward.dot(offset),
            lateral_offset: forward.cross(offset),
            route_distance,
            lane,
            road_edge_distance,
            front_way,
            faults: Faults {
                off_route: route_distance > course.off_route_distance,
                off_road: road_edge_distance.is_some_and(|distance| distance > 0.0),
                outside_drivable_area: beyond.into_iter().zip(lane.corners_outside).any(outside),
                wrong_way: lane.backward_travel >= WRONG_WAY,
                speeding: lane.speed_limit > 0.0 && av.speed - lane.speed_limit > OVERSPEED,
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

/// The logged AV, judged by the same rules.
#[derive(Clone, Debug)]
pub struct Human {
    /// Log index of the first entry.
    start: usize,
    steps: Vec<Option<(Body, Reading)>>,
    red_stops_crossed: Vec<RedStop>,
}

impl Human {
    /// The logged AV of `scene` from `start` to before `end`.
    #[must_use]
    pub fn of(scene: &Scene, course: &Course, start: usize, end: usize) -> Self {
        let mut reader = Reader::default();
        let mut red_stops_crossed = Vec::new();
        let steps = (start..end).map(|log_index| {
            let Some(state) = scene.av().states[log_index] else {
                reader.front = None;
                return None;
            };
            let body = Body::of(state);
            let reading = reader.read(course, &body);
            red_stops_crossed.extend(course.red_stops_crossed(log_index, &reading).copied());
            Some((body, reading))
        });
        Self { start, steps: steps.collect(), red_stops_crossed }
    }

    fn at(&self, log_index: usize) -> Option<&(Body, Reading)> {
        self.steps.get(log_index.checked_sub(self.start)?)?.as_ref()
    }

    /// Its body at `log_index`, if it is there.
    #[must_use]
    pub fn body(&self, log_index: usize) -> Option<&Body> {
        self.at(log_index).map(|(body, _)| body)
    }

    /// The rules that it breaks at `log_index`.
    #[must_use]
    pub fn faults(&self, log_index: usize) -> Faults {
        self.at(log_index).map(|(_, reading)| reading.faults).unwrap_or_default()
    }

    /// Whether it crosses that stop point at red, at any step. A planner crosses it at another step than the human, for the
    /// same reason: turning right at red, or a signal that was read wrong.
    #[must_use]
    pub fn crosses_red(&self, stop: &RedStop) -> bool {
        self.red_stops_crossed.iter().any(|own| own.is_same_place(stop))
    }

    /// Its progress along the reference line from the start to the last step at which it is there (m), and that log index.
    #[must_use]
    pub fn route_progress(&self) -> Option<(f64, usize)> {
        let mut present = self.steps.iter().enumerate().filter_map(|(step, at)| Some((step, at.as_ref()?.1.station)));
        let first = present.next()?;
        let last = present.next_back().unwrap_or(first);
        Some((last.1 - first.1, self.start + last.0))
    }
}
