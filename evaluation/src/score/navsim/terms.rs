//! The terms of NAVSIM's scores, of a series of states at the steps from a drive's start on.

use std::collections::BTreeSet;

use episode::judges::collision::{classify, is_ahead, is_at_fault, is_behind};
use episode::judges::lanes::Lanes;
use episode::judges::time_to_collision::TrafficAgent;
use episode::judges::{Body, STOREY};
use episode::metrics::nuplan;
use world::geometry::{OrientedBox, Point, boxes_overlap};
use world::plan::STEP_SECONDS;
use world::scene::{AgentKind, AgentState, Judgement};
use world::vehicle::WHEELBASE;

use super::comfort;
use crate::score::convex;
use crate::score::drive::Drive;
use crate::score::ground::{Ground, Surface};

/// Steps ahead at which boxes are held against each other (`future_collision_horizon_window`).
const AHEAD: [usize; 4] = [0, 3, 6, 9];
/// Below this speed (m/s) there is no time to collision (`stopped_speed_threshold`).
const STANDING: f64 = 5e-3;
/// Farther than this (m) from the line is off the lane (`lane_keeping_deviation_limit`).
const OFF_LANE: f64 = 0.5;
/// Samples in a row that may not all be (`lane_keeping_horizon_window`, 2 s).
const OFF_LANE_SAMPLES: u32 = 20;
/// Samples of the second over which metres off the route's lanes are summed, both ends among them.
const SECOND: usize = 11;

/// The terms; none where the scene does not allow to judge.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Terms {
    pub no_collision: Option<f64>,
    pub drivable_area: Option<f64>,
    pub direction: Option<f64>,
    pub traffic_light: Option<f64>,
    /// Of v1.
    pub time_to_collision_1: Option<f64>,
    /// Of v2.
    pub time_to_collision_2: Option<f64>,
    pub lane_keeping: Option<f64>,
    /// Of v1.
    pub comfort: Option<f64>,
    pub history_comfort: Option<f64>,
    /// Metres along the line, at least 0.
    pub progress: f64,
}

impl Terms {
    /// Those of `states`, the first of which is at the drive's start.
    pub(super) fn of(drive: &Drive<'_>, ground: &Ground, states: &[AgentState]) -> Self {
        let bodies: Vec<Body> = states.iter().map(|state| Body::of(*state)).collect();
        let surface = ground.surface();
        let areas: Vec<Area> = bodies.iter().map(|body| Area::of(surface, body)).collect();
        let series = Series { drive, ground, bodies: &bodies, areas: &areas };
        let kept = |judgement: Judgement, value: f64| Some(value).filter(|_| drive.is_judged(judgement));
        // One that is broken is broken, whatever else cannot be judged.
        let unless_broken =
            |value: f64| Some(value).filter(|value| *value < 1.0 || drive.is_judged(Judgement::Collision));
        let flag = |is_so: bool| f64::from(u8::from(is_so));
        let late = series.first_late();
        let last_asked = (bodies.len() - 1).checked_sub(AHEAD[AHEAD.len() - 1]);
        let is_late_2 = late.zip(last_asked).is_some_and(|(late, last)| late <= last);
        let logged = &drive.scene.av().states[..drive.start];
        Self {
            no_collision: unless_broken(series.no_collision()),
            drivable_area: kept(Judgement::OffRoad, flag(!areas.iter().any(|area| area.outside))),
            direction: kept(Judgement::WrongWay, nuplan::direction(series.oncoming())),
            traffic_light: Some(flag(!series.meets_red())),
            time_to_collision_1: unless_broken(flag(late.is_none())),
            time_to_collision_2: unless_broken(flag(!is_late_2)),
            lane_keeping: Some(flag(series.keeps_lane())),
            comfort: comfort::comfort(states, logged.last().and_then(Option::as_ref)),
            history_comfort: comfort::history_comfort(states, logged),
            progress: series.progress(),
        }
    }
}

/// Where a body is at a sample.
#[derive(Clone, Copy, Debug, Default)]
struct Area {
    /// Several lanes hold corners of it, and none holds all.
    several_lanes: bool,
    /// A corner is off the road.
    outside: bool,
    /// No lane of the route, nor one beside it, holds its centre.
    oncoming: bool,
    /// Its centre is in an intersection.
    in_intersection: bool,
    /// Its rear axle is.
    axle_in_intersection: bool,
}

impl Area {
    fn of(surface: &Surface, body: &Body) -> Self {
        let floor = Ground::below(&body.state);
        let lanes = &surface.lanes;
        let corners = body.outline.corners().map(|corner| lanes.at(corner, floor));
        let all: BTreeSet<usize> = corners.iter().flatten().copied().collect();
        let holds_all = |lane: &usize| corners.iter().all(|corner| corner.contains(lane));
        let beyond = surface.edges.beyond(body, floor);
        let center = body.outline.center;
        Self {
            several_lanes: all.len() > 1 && !all.iter().any(holds_all),
            outside: (0..4).any(|at| corners[at].is_empty() && beyond[at].is_some_and(|beyond| beyond > 0.0)),
            oncoming: !lanes.at(center, floor).into_iter().any(|lane| surface.on_route[lane]),
            in_intersection: lanes.is_intersection(center, floor),
            axle_in_intersection: lanes.is_intersection(body.rear_axle(WHEELBASE), floor),
        }
    }

    fn is_astray(&self) -> bool {
        self.several_lanes || self.outside
    }
}

struct Series<'a> {
    drive: &'a Drive<'a>,
    ground: &'a Ground,
    bodies: &'a [Body],
    areas: &'a [Area],
}

impl Series<'_> {
    /// NC. A track's speed is that at which it is first seen: NAVSIM keeps the first of its states.
    fn no_collision(&self) -> f64 {
        let mut passed: BTreeSet<usize> = BTreeSet::new();
        let mut score: f64 = 1.0;
        for (step, (body, area)) in self.bodies.iter().zip(self.areas).enumerate() {
            let meeting = self.drive.others(step).filter(|(_, state)| meets(body, &body.outline, state));
            for (track, state) in meeting.collect::<Vec<_>>() {
                if passed.contains(&track) {
                    continue;
                }
                let agent = self.agent(track, &state);
                if is_at_fault(classify(body, WHEELBASE, &agent), !area.is_astray()) {
                    score = score.min(if agent.kind == AgentKind::Other { 0.5 } else { 0.0 });
                } else {
                    passed.insert(track);
                }
            }
        }
        score
    }

    fn agent(&self, track: usize, state: &AgentState) -> TrafficAgent {
        let logged = &self.drive.scene.tracks()[track];
        let first = logged.states.iter().skip(self.drive.start).flatten().next();
        TrafficAgent {
            track,
            kind: logged.kind,
            outline: state.oriented_box(),
            z: state.z,
            velocity: state.velocity(),
            speed: first.map_or_else(|| state.speed(), AgentState::speed),
            sudden: false,
        }
    }

    /// The first sample whose box, going on along its heading, meets somebody within 0.9 s where they then are.
    fn first_late(&self) -> Option<usize> {
        let mut passed: BTreeSet<usize> = BTreeSet::new();
        for (step, (body, area)) in self.bodies.iter().zip(self.areas).enumerate() {
            if body.speed < STANDING {
                continue;
            }
            for ahead in AHEAD {
                let way = body.velocity() * (ahead as f64 * STEP_SECONDS);
                let outline = OrientedBox { center: body.outline.center + way, ..body.outline };
                let meeting = self.drive.others(step + ahead).filter(|(_, state)| meets(body, &outline, state));
                for (track, state) in meeting.collect::<Vec<_>>() {
                    if passed.contains(&track) {
                        continue;
                    }
                    let place = state.position();
                    let beside_matters = area.is_astray() || area.axle_in_intersection;
                    if is_ahead(body, WHEELBASE, place) || beside_matters && !is_behind(body, WHEELBASE, place) {
                        return Some(step);
                    }
                    passed.insert(track);
                }
            }
        }
        None
    }

    /// The most metres in a second while off the route's lanes, intersections left out.
    fn oncoming(&self) -> f64 {
        let way = |step: usize| {
            let area = self.areas[step];
            if step == 0 || !area.oncoming || area.in_intersection {
                return 0.0;
            }
            self.bodies[step - 1].outline.center.distance(self.bodies[step].outline.center)
        };
        let ways: Vec<f64> = (0..self.bodies.len()).map(way).collect();
        let sum = |end: usize| ways[(end + 1).saturating_sub(SECOND)..=end].iter().sum::<f64>();
        (0..ways.len()).map(sum).fold(0.0, f64::max)
    }

    /// Whether the box is on a lane of the route, from its stop point on, while that is red.
    fn meets_red(&self) -> bool {
        self.bodies.iter().enumerate().any(|(step, body)| {
            let log_index = self.drive.start + step;
            if log_index >= self.drive.scene.steps() {
                return false;
            }
            let red = self.drive.scene.signals(log_index).iter().filter(|signal| signal.state.is_red());
            let Surface { lanes, on_route, .. } = self.ground.surface();
            let mut ruled = red.flat_map(|signal| {
                let of_signal = lanes.strips().iter().enumerate().filter(|(_, strip)| strip.id == signal.lane);
                of_signal.filter(|(lane, _)| on_route[*lane]).map(|(lane, _)| (lane, signal.stop_point))
            });
            let corners = body.outline.corners();
            let is_level = |height: f64| (height - Ground::below(&body.state)).abs() <= STOREY;
            ruled.any(|(lane, stop)| {
                is_level(stop.z)
                    && pieces(lanes, lane, stop.xy()).iter().any(|piece| {
                        piece[0].distance(body.outline.center) < 50.0 && convex::distance(piece, &corners) == 0.0
                    })
            })
        })
    }

    fn keeps_lane(&self) -> bool {
        let (mut off, mut line) = (0, self.ground.follow());
        for (body, area) in self.bodies.iter().zip(self.areas) {
            if area.in_intersection {
                continue;
            }
            off = if line.distance(body.outline.center) > OFF_LANE { off + 1 } else { 0 };
            if off >= OFF_LANE_SAMPLES {
                return false;
            }
        }
        true
    }

    fn progress(&self) -> f64 {
        let station =
            |body: Option<&Body>| body.map_or(0.0, |body| self.ground.line.project(body.outline.center).station);
        (station(self.bodies.last()) - station(self.bodies.first())).max(0.0)
    }
}

/// Whether a box of the AV meets somebody's, on one level.
fn meets(body: &Body, outline: &OrientedBox, other: &AgentState) -> bool {
    (body.state.z - other.z).abs() <= STOREY && boxes_overlap(outline, &other.oriented_box())
}

/// A lane in pieces of four corners, from where it is nearest to `stop` on.
fn pieces(lanes: &Lanes, lane: usize, stop: Point) -> Vec<[Point; 4]> {
    let points = &lanes.strips()[lane].points;
    let segment = |index: usize| world::geometry::Segment { start: points[index], end: points[index + 1] };
    let distance = |index: &usize| segment(*index).nearest_to(stop).distance_squared;
    let last = points.len() - 1;
    let first = (0..last).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(0);
    let piece = |index: usize| {
        let way = segment(index);
        let along = way.vector() * (1.0 / way.length());
        let left = Point::new(-along.y, along.x);
        let start = if index == first { way.nearest_to(stop).point } else { way.start };
        let [begin, end] = [index, index + 1].map(|point| lanes.widths(lane, point));
        [start + left * begin[0], way.end + left * end[0], way.end - left * end[1], start - left * begin[1]]
    };
    (first..last).map(piece).collect()
}
