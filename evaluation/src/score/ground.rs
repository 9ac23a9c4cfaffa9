//! What the map says around the route: the line, the lanes as strips, the road's edges. What the scores of other tools ask of their
//! drivable areas, lane polygons and paths is asked of these.

use std::cell::OnceCell;
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;

use episode::judges::lanes::Lanes;
use episode::judges::level::Level;
use episode::judges::road::RoadEdges;
use world::geometry::{Point, PointGrid, Polyline};
use world::lane_graph::LaneGraph;
use world::map::MapId;
use world::route::{Route, RouteStyle};
use world::scene::{AgentState, Scene};

/// How far from the route the map is of interest (m): the corridor of `strict`.
const CORRIDOR: f64 = 5.0;

/// Samples of the line, before and after the last place, among which the next place is looked for.
const NEAR: (usize, usize) = (100, 200);

/// The map around a route.
pub struct Ground {
    /// The reference line, a point each 0.1 m.
    pub line: Polyline,
    /// Its points in a grid.
    pub samples: PointGrid,
    level: Level,
    surface: OnceCell<Surface>,
    scene: Arc<Scene>,
    route: Vec<MapId>,
    length: f64,
}

impl Ground {
    /// The map of `scene` around the route that `strict` makes of the log.
    pub(super) fn of(scene: &Arc<Scene>) -> Result<Self, String> {
        let Route { lanes: route, line, .. } =
            Route::of_log(scene, RouteStyle::Strict).map_err(|error| error.to_string())?;
        let level = Level::of_line(&line, CORRIDOR);
        let polyline = Polyline::new((0..line.len()).map(|index| line.point(index)).collect());
        let line = polyline.ok_or("the route has no line")?;
        let length = line.length();
        let samples = PointGrid::new(line.points().to_vec(), 2.0);
        let surface = OnceCell::new();
        Ok(Self { line, samples, level, surface, scene: Arc::clone(scene), route, length })
    }

    /// Lanes and edges. They cost more than all the rest: whoever asks no lane does not pay for them.
    pub fn surface(&self) -> &Surface {
        self.surface.get_or_init(|| {
            let lanes = Lanes::of(self.scene.map(), &self.level);
            let edges = RoadEdges::of(self.scene.map(), &self.level);
            let beside = with_neighbors(&self.scene, &self.route);
            let on_route = lanes.strips().iter().map(|strip| beside.contains(&strip.id)).collect();
            Surface { lanes, edges, on_route }
        })
    }

    /// The points of the centre lines of all lanes that a car can come to from the route's begin by lanes that lead on or lie beside,
    /// as far as the route is long: those beside the route's own lanes, and all others.
    pub fn paths(&self) -> Paths {
        let map = self.scene.map();
        let graph = LaneGraph::new(map);
        let indices = map.lane_indices();
        let own = with_neighbors(&self.scene, &self.route);
        let mut reach: BTreeMap<usize, f64> = BTreeMap::new();
        let first = self.route.first().and_then(|id| indices.get(id).copied());
        let mut open: VecDeque<(usize, f64)> = first.into_iter().map(|lane| (lane, 0.0)).collect();
        while let Some((lane, distance)) = open.pop_front() {
            if distance > self.length || reach.get(&lane).is_some_and(|known| *known <= distance) {
                continue;
            }
            reach.insert(lane, distance);
            let on = distance + graph.length(lane);
            open.extend(graph.successors(lane).iter().map(|next| (*next, on)));
            open.extend(graph.neighbors(lane).iter().map(|next| (*next, distance)));
        }
        let points = |wanted: bool| {
            let lanes = reach.keys().map(|lane| &map.lanes[*lane]).filter(|lane| own.contains(&lane.id) == wanted);
            let points: Vec<Point> = lanes.flat_map(|lane| lane.centerline.iter().map(|point| point.xy())).collect();
            PointGrid::new(points, 4.0)
        };
        Paths { beside: points(true), others: points(false) }
    }

    /// The height of the ground below a body (m).
    #[must_use]
    pub fn below(state: &AgentState) -> f64 {
        state.z - 0.5 * state.height
    }

    /// Follows points along the line, each from the one before.
    pub(super) fn follow(&self) -> Along<'_> {
        Along { line: &self.line, at: None }
    }
}

/// What there is to drive on.
pub struct Surface {
    /// Lanes as strips of ground.
    pub lanes: Lanes,
    /// The road's edges.
    pub edges: RoadEdges,
    /// For each strip, whether its lane is one of the route's or beside one, in the same direction.
    pub on_route: Vec<bool>,
}

/// The lanes beside a route, and the others that lead away from its begin.
pub struct Paths {
    /// Centre lines of the route's lanes, and of those beside them.
    pub beside: PointGrid,
    /// Centre lines of all others.
    pub others: PointGrid,
}

/// The lanes of a route, and those beside them in the same direction.
fn with_neighbors(scene: &Scene, route: &[MapId]) -> BTreeSet<MapId> {
    let map = scene.map();
    let (graph, indices) = (LaneGraph::new(map), map.lane_indices());
    let mut known: BTreeSet<usize> = route.iter().filter_map(|id| indices.get(id).copied()).collect();
    let mut open: Vec<usize> = known.iter().copied().collect();
    while let Some(lane) = open.pop() {
        let beside = graph.neighbors(lane).iter().copied();
        open.extend(beside.filter(|next| known.insert(*next)));
    }
    known.into_iter().map(|lane| map.lanes[lane].id).collect()
}

/// A point that moves along a line.
pub(super) struct Along<'a> {
    line: &'a Polyline,
    at: Option<usize>,
}

impl Along<'_> {
    /// The distance to the line (m), near where it was last; far from there, to the whole line.
    pub(super) fn distance(&mut self, point: Point) -> f64 {
        let last = self.line.points().len().saturating_sub(2);
        let Some(at) = self.at else { return self.anywhere(point) };
        let window = at.saturating_sub(NEAR.0)..=(at + NEAR.1).min(last);
        let distance = |index: &usize| self.line.segment(*index).nearest_to(point).distance_squared;
        let nearest = window.clone().min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(at);
        // At the window's end the line may come nearer beyond it.
        let inside = (nearest != *window.start() || nearest == 0) && (nearest != *window.end() || nearest == last);
        if !inside {
            return self.anywhere(point);
        }
        self.at = Some(nearest);
        distance(&nearest).sqrt()
    }

    fn anywhere(&mut self, point: Point) -> f64 {
        let found = self.line.project(point);
        self.at = Some(found.segment);
        found.distance
    }
}
