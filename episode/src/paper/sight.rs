//! What the authors' observation holds beside the agents: who counts as a neighbor, the window of the line, and the lane whose
//! limit is that of the whole line.

use std::cmp::Ordering;

use world::authors_frame::single;
use world::geometry::Point;
use world::map::MapId;
use world::map_matching::LanePoints;
use world::reference_line::ReferenceWindow;
use world::route::{Route, RouteError, RouteStyle};
use world::scene::{AgentState, Scene};

/// As many agents are looked at.
pub const NEIGHBORS: usize = 10;

/// The authors' metres a second of a mile an hour, upside down.
const MPH_PER_METER_PER_SECOND: f64 = 2.237;

/// What is seen at a step.
#[derive(Clone, Debug, PartialEq)]
pub struct Sight {
    /// The agents that the next step is judged against: places in the scene's tracks, nearest first.
    pub neighbors: Vec<usize>,
    /// The stretch of the line, with its red stops and its one speed limit.
    pub window: ReferenceWindow,
    /// The lane that gives the limit; none where no lane matches.
    pub lane: Option<MapId>,
    /// Sample of the line nearest to the AV.
    pub sample: usize,
    /// Distance of the AV to the window of the line, in single precision as the authors store it (m).
    pub route_distance: f64,
    /// What the nearest discs of the AV and the neighbors seen before lack to an overlap (m); none at the start, and without
    /// neighbors.
    pub collision_margin: Option<f64>,
}

/// The scene, laid out to be looked at.
#[derive(Clone, Debug)]
pub(super) struct Surroundings {
    route: Route,
    lanes: LanePoints,
    /// The line's samples as the authors store them.
    stored: Vec<Point>,
    /// Distance and place of each agent; kept to spare an allocation.
    near: Vec<(f64, usize)>,
}

impl Surroundings {
    pub(super) fn new(scene: &Scene) -> Result<Self, RouteError> {
        let route = Route::of_log(scene, RouteStyle::Paper)?;
        let stored = route.line.x.iter().zip(&route.line.y).map(|(x, y)| Point::new(single(*x), single(*y)));
        Ok(Self {
            stored: stored.collect(),
            lanes: LanePoints::new(scene.map(), |_| true),
            near: Vec::with_capacity(scene.tracks().len()),
            route,
        })
    }

    pub(super) fn route(&self) -> &Route {
        &self.route
    }

    /// The line's beginning, and nobody: to be looked from.
    pub(super) fn first_sight(&self) -> Sight {
        Sight {
            neighbors: Vec::with_capacity(NEIGHBORS),
            window: self.route.window(0, &[]),
            lane: None,
            sample: 0,
            route_distance: 0.0,
            collision_margin: None,
        }
    }

    /// What is seen from `av` at `log_index`; whether a lane matches it.
    pub(super) fn look(&mut self, scene: &Scene, log_index: usize, av: &AgentState, sight: &mut Sight) -> bool {
        let place = av.position();
        self.find_neighbors(scene, log_index, place, &mut sight.neighbors);
        sight.sample = self.route.nearest_sample_from(place, sight.sample).0;
        let window = &mut sight.window;
        self.route.move_window(window, sight.sample, scene.signals(log_index));
        let rows = &self.stored[window.start..window.start + window.samples];
        let nearest = rows.iter().map(|row| place.distance_squared(*row)).fold(f64::INFINITY, f64::min);
        sight.route_distance = nearest.sqrt();
        let lanes = &scene.map().lanes;
        // Lane numbers must be above 0 in the authors' code: 0 means none.
        let lane = self.lanes.authors_match(av.pose()).map(|found| &lanes[found.lane]).filter(|lane| lane.id.0 > 0);
        sight.lane = lane.map(|lane| lane.id);
        sight.window.speed_limit = Some(lane.map_or(0.0, |lane| lane.speed_limit_mph / MPH_PER_METER_PER_SECOND));
        lane.is_some()
    }

    /// The agents nearest to `place`; of equally near ones the first in the log.
    fn find_neighbors(&mut self, scene: &Scene, log_index: usize, place: Point, neighbors: &mut Vec<usize>) {
        self.near.clear();
        let others = scene.tracks().iter().enumerate().filter(|(index, _)| *index != scene.av_index());
        let seen = others.filter_map(|(index, track)| Some((index, track.states[log_index]?)));
        self.near.extend(seen.map(|(index, state)| (place.distance(state.position()), index)));
        let nearer =
            |a: &(f64, usize), b: &(f64, usize)| -> Ordering { a.0.total_cmp(&b.0).then_with(|| a.1.cmp(&b.1)) };
        self.near.sort_unstable_by(nearer);
        neighbors.clear();
        neighbors.extend(self.near.iter().take(NEIGHBORS).map(|(_, index)| *index));
    }
}
