//! Waymax's metrics (waymo-research/waymax, `waymax/metrics/*.py`, commit 48b33d71), step by step and over the episode.
//!
//! `sdc_paths`, along which three of them are measured, are in no scenario file: the reference line and the lanes stand for them, and
//! those figures have names of their own. `docs/scores/waymax.md` defines each.

use episode::metrics::feasibility::{Pace, is_infeasible};
use world::geometry::{Point, Point3, boxes_overlap};
use world::scene::AgentState;

use super::Judged;
use super::drive::Drive;
use super::edges::EdgePoints;
use super::figure::Figure;
use super::ground::{Ground, Paths};

/// A step of height counts as so many on the ground (`roadgraph.py`).
const HEIGHT_STRETCH: f64 = 2.0;
/// Nearer than this (m) to a path nobody is on the wrong way (`roadgraph.py`).
const WRONG_WAY: f64 = 3.5;
/// Farther than this (m) from the paths of the route is off it (`route.py`).
const OFF_ROUTE: f64 = 5.0;
/// So is farther from them by this (m) than from another path.
const OFF_ROUTE_RELATIVE: f64 = 2.0;
/// Above this speed (m/s) the velocity tells the heading (`bicycle_model.py`).
const SLOW: f64 = 0.6;

/// What a step is told by, in this order.
pub const STEP_FIGURES: [(&str, &str); 7] = [
    ("waymax_log_divergence_m", "m"),
    ("waymax_overlap", "0/1"),
    ("waymax_offroad", "0/1"),
    ("waymax_kinematic_infeasibility", "0/1"),
    ("waymax_lanes_wrong_way_m", "m"),
    ("waymax_lanes_off_route_m", "m"),
    ("waymax_line_progression", ""),
];

/// The figures of an episode.
#[must_use]
pub fn figures() -> Vec<Figure> {
    vec![
        Figure::new(
            "waymax_log_divergence_ade_m",
            "m",
            "mean distance to the logged AV over the steps at which it is there",
        )
        .mean(&["log", "ADE", "m"], 2),
        Figure::new("waymax_log_divergence_fde_m", "m", "the same at the last of these steps")
            .mean(&["log", "FDE", "m"], 2),
        Figure::new("waymax_overlap", "0/1", "at some step the AV's box overlapped another, whoever's fault")
            .percent(&["over-", "lap", "%"]),
        Figure::new("waymax_offroad", "0/1", "at some step a corner was beyond the nearest point of a road edge")
            .percent(&["off", "road", "%"]),
        Figure::new("waymax_kinematic_infeasibility", "0/1", "some step asks for more than 10.4 m/s^2 or 0.3 1/m")
            .percent(&["infea-", "sible", "%"]),
        Figure::new(
            "waymax_lanes_wrong_way_m",
            "m",
            "greatest distance to all lanes that lead away from the start, 0 below 3.5 m (stand-in for sdc_wrongway)",
        )
        .mean(&["wrong", "way*", "m"], 2),
        Figure::new(
            "waymax_lanes_off_route_m",
            "m",
            "greatest distance to the route while off it, else 0 (stand-in for sdc_off_route)",
        )
        .mean(&["off", "route*", "m"], 2),
        Figure::new(
            "waymax_line_progression",
            "",
            "share of the logged way along the reference line, at the end (stand-in for sdc_progression)",
        )
        .mean(&["pro-", "gression*", ""], 3),
    ]
}

/// Each step's figures, in the order of [`STEP_FIGURES`].
pub type Steps = Vec<[Option<f64>; STEP_FIGURES.len()]>;

/// The figures of a drive, and of each of its steps.
pub fn judge(drive: &Drive<'_>) -> (Judged, Steps) {
    let edges = EdgePoints::of(drive.scene.map());
    let (paths, reason) = match drive.ground() {
        Ok(ground) => (Some(Along::of(drive, ground)), None),
        Err(reason) => (None, Some(reason)),
    };
    let flag = |is_so: bool| Some(f64::from(u8::from(is_so)));
    let step = |index: usize| {
        let (before, now) = (&drive.states[index - 1], &drive.states[index]);
        let logged = drive.scene.av().states.get(drive.start + index).copied().flatten();
        let [wrong_way, off_route, progression] = paths.as_ref().map_or([None; 3], |paths| paths.at(now.position()));
        [
            logged.map(|logged| logged.position().distance(now.position())),
            flag(overlaps(drive, index)),
            is_offroad(&edges, now).and_then(flag),
            flag(is_infeasible(pace(before, before), pace(before, now))),
            wrong_way,
            off_route,
            progression,
        ]
    };
    let steps: Steps = (1..drive.states.len()).map(step).collect();
    (Judged { values: of_episode(&steps), reason }, steps)
}

fn of_episode(steps: &Steps) -> Vec<Option<f64>> {
    let column = |index: usize| steps.iter().filter_map(move |step| step[index]);
    let mean = |index: usize| {
        let (count, sum) = column(index).fold((0_u32, 0.0), |(count, sum), value| (count + 1, sum + value));
        (count > 0).then(|| sum / f64::from(count))
    };
    let most = |index: usize| column(index).reduce(|most, next| if next > most { next } else { most });
    let last = |index: usize| column(index).next_back();
    vec![mean(0), last(0), most(1), most(2), most(3), most(4), most(5), last(6)]
}

/// Boxes overlap in the plane, whatever their heights (`overlap.py`).
fn overlaps(drive: &Drive<'_>, index: usize) -> bool {
    let own = drive.states[index].oriented_box();
    drive.others(index).any(|(_, other)| boxes_overlap(&own, &other.oriented_box()))
}

fn is_offroad(edges: &EdgePoints, av: &AgentState) -> Option<bool> {
    let beyond =
        av.oriented_box().corners().map(|corner| edges.beyond(Point3::new(corner.x, corner.y, av.z), HEIGHT_STRETCH));
    beyond.iter().any(Option::is_some).then(|| beyond.into_iter().flatten().any(|beyond| beyond > 0.0))
}

/// Speed, and heading: by the velocity, where that is not slow; the heading of the state before is believed as it is.
fn pace(before: &AgentState, now: &AgentState) -> Pace {
    let speed = now.speed();
    let is_first = std::ptr::eq(before, now);
    let heading = if is_first || speed <= SLOW { now.heading } else { now.velocity().heading() };
    Pace { speed, heading }
}

/// What stands for `sdc_paths`.
struct Along<'a> {
    ground: &'a Ground,
    paths: Paths,
    /// Stations of the log's first and last state.
    logged: Option<(f64, f64)>,
}

impl<'a> Along<'a> {
    fn of(drive: &Drive<'_>, ground: &'a Ground) -> Self {
        let mut logged = drive.scene.av().states.iter().flatten();
        let first = logged.next();
        let last = logged.next_back().or(first);
        let station = |state: &AgentState| station(ground, state.position());
        Self { ground, paths: ground.paths(), logged: first.zip(last).map(|(a, b)| (station(a), station(b))) }
    }

    /// To the line and the lanes beside the route (m).
    fn to_route(&self, place: Point) -> f64 {
        let line = nearest_sample(self.ground, place).1;
        let beside = self.paths.beside.nearest(place).map_or(f64::INFINITY, |(_, distance)| distance);
        if beside < line { beside } else { line }
    }

    fn to_others(&self, place: Point) -> f64 {
        self.paths.others.nearest(place).map_or(f64::INFINITY, |(_, distance)| distance)
    }

    /// The last three of [`STEP_FIGURES`].
    fn at(&self, place: Point) -> [Option<f64>; 3] {
        let (route, others) = (self.to_route(place), self.to_others(place));
        let least = if others < route { others } else { route };
        let is_off = route > OFF_ROUTE || route - others > OFF_ROUTE_RELATIVE;
        let told = |is_so: bool, distance: f64| Some(if is_so { distance } else { 0.0 });
        [told(least >= WRONG_WAY, least), told(is_off, route), self.progression(place)]
    }

    fn progression(&self, place: Point) -> Option<f64> {
        let (first, last) = self.logged?;
        Some(if first == last { 1.0 } else { (station(self.ground, place) - first) / (last - first) })
    }
}

/// The station (m) of the sample of the line that is nearest: Waymax asks points, and no segments.
fn station(ground: &Ground, place: Point) -> f64 {
    ground.line.stations()[nearest_sample(ground, place).0]
}

fn nearest_sample(ground: &Ground, place: Point) -> (usize, f64) {
    ground.samples.nearest(place).unwrap_or((0, f64::INFINITY))
}
