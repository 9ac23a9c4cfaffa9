//! What the logged AV itself does wrong, over the whole log. It says of a scene what to expect: the judges of a drive look from the
//! start on, at the route's lanes alone, and tell levels of the road apart (`docs/metrics.md`).

use world::geometry::{Bounds, Point, SegmentGrid, boxes_overlap};
use world::route::{Route, RouteError};
use world::scene::bridged::Bridged;
use world::scene::{AgentState, Scene};

use super::{Lint, Steps};

/// Off road by less than this counts as on it (m): edges are surveyed, boxes are estimated. nuPlan's tolerance.
const EDGE_TOLERANCE: f64 = 0.3;
/// An AV farther than this from every lane's centre follows none (m).
const FAR_FROM_LANE: f64 = 3.0;
/// The strict protocol's bound (m).
const OFF_ROUTE: f64 = 5.0;
/// A red stop point further to the side than this is of another lane (m): as far as the judges of a drive look.
const BESIDE: f64 = 2.5;
/// How far is looked for edges and lanes (m).
const SEARCH: f64 = 50.0;
/// Size of the grids' cells (m).
const CELL: f64 = 5.0;
/// An AV that moves less than this is parked (m).
const PARKED: f64 = 5.0;

/// Where a drive starts: the strict protocol's default, and the one of `paper`.
const START: usize = 19;

/// `edges`: whether the map's road edges can be believed.
pub(super) fn lint(bridged: &Bridged, route: Result<Route, RouteError>, edges: bool, lints: &mut Vec<Lint>) {
    missing(bridged, lints);
    let scene = bridged.judged();
    let av: Vec<(usize, AgentState)> =
        scene.av().states.iter().enumerate().filter_map(|(step, state)| Some((step, (*state)?))).collect();
    overlaps(scene, &av, lints);
    // Only what is near the AV's corners is asked for.
    let corners = av.iter().flat_map(|(_, state)| state.oriented_box().corners());
    let around = Bounds::of(corners).grown(SEARCH + 1.0);
    if edges {
        off_road(scene, &av, &around, lints);
    }
    let lanes = lanes(scene, &around);
    far_from_lane(scene, &av, &lanes, lints);
    off_route(route, &av, lints);
    red_lights(scene, &av, lints);
    super::lanes::lint(scene, &av, &lanes, lints);
    let meters: f64 = av.windows(2).map(|pair| pair[0].1.position().distance(pair[1].1.position())).sum();
    if meters < PARKED {
        lints.push(Lint::AvParked { meters });
    }
}

fn missing(bridged: &Bridged, lints: &mut Vec<Lint>) {
    let there = |step: usize| bridged.logged().av().states[step].is_some();
    let steps: Steps = (0..bridged.logged().steps()).filter(|step| !there(*step)).collect();
    if !steps.is_empty() {
        // A scene that ends before the start is not driven either way: another finding says so.
        let drivable = bridged.judged().av().states.get(START).is_none_or(Option::is_some);
        lints.push(Lint::AvMissing { steps, drivable });
    }
}

fn overlaps(scene: &Scene, av: &[(usize, AgentState)], lints: &mut Vec<Lint>) {
    for (index, track) in scene.tracks().iter().enumerate() {
        if index == scene.av_index() {
            continue;
        }
        let mut steps = Steps::default();
        for (step, av) in av {
            if track.states[*step].is_some_and(|other| boxes_overlap(&av.oriented_box(), &other.oriented_box())) {
                steps.push(*step);
            }
        }
        if !steps.is_empty() {
            lints.push(Lint::AvOverlap { track: track.id, kind: track.kind, steps });
        }
    }
}

/// The centre lines of the drivable lanes `around` the AV; a lane's payload is its place in the map.
fn lanes(scene: &Scene, around: &Bounds) -> SegmentGrid {
    let drivable = scene.map().lanes.iter().enumerate().filter(|(_, lane)| lane.kind.is_drivable());
    let runs = drivable.flat_map(|(index, lane)| around.runs(&lane.centerline).map(move |run| (index as u32, run)));
    SegmentGrid::new(runs.map(|(index, run)| (index, run.iter().map(|point| point.xy()))), CELL)
}

fn off_road(scene: &Scene, av: &[(usize, AgentState)], around: &Bounds, lints: &mut Vec<Lint>) {
    let runs = scene.map().road_edges.iter().flat_map(|edge| around.runs(&edge.polyline));
    let grid = SegmentGrid::new(runs.map(|run| (0, run.iter().map(|point| point.xy()))), CELL);
    let driveways = &scene.map().driveways;
    let beyond = |corner: Point| {
        if driveways.iter().any(|driveway| driveway.contains(corner)) {
            return 0.0;
        }
        let edge = grid.nearest(corner, SEARCH).filter(|edge| !edge.beyond_end);
        edge.map_or(0.0, |edge| -edge.signed_distance)
    };
    let worst_corner = |av: &AgentState| av.oriented_box().corners().into_iter().map(beyond).fold(0.0, f64::max);
    if let Some((worst, steps)) = exceeding(av, EDGE_TOLERANCE, worst_corner) {
        lints.push(Lint::AvOffRoad { worst, steps });
    }
}

fn far_from_lane(scene: &Scene, av: &[(usize, AgentState)], lanes: &SegmentGrid, lints: &mut Vec<Lint>) {
    if !scene.map().lanes.iter().any(|lane| lane.kind.is_drivable()) {
        lints.push(Lint::NoDrivableLane);
        return;
    }
    let distance = |av: &AgentState| lanes.nearest(av.position(), SEARCH).map_or(SEARCH, |lane| lane.distance());
    if let Some((worst, steps)) = exceeding(av, FAR_FROM_LANE, distance) {
        lints.push(Lint::AvFarFromLane { worst, steps });
    }
}

fn off_route(route: Result<Route, RouteError>, av: &[(usize, AgentState)], lints: &mut Vec<Lint>) {
    let route = match route {
        Ok(route) => route,
        Err(error) => return lints.push(Lint::NoRoute(error)),
    };
    if let Some((worst, steps)) = exceeding(av, OFF_ROUTE, |av| route.nearest_sample(av.position()).1) {
        lints.push(Lint::AvOffRoute { worst, steps });
    }
}

/// The steps at which `measure` is above `bound`, and its highest value.
fn exceeding(av: &[(usize, AgentState)], bound: f64, measure: impl Fn(&AgentState) -> f64) -> Option<(f64, Steps)> {
    let (mut worst, mut steps) = (0.0_f64, Steps::default());
    for (step, state) in av {
        let value = measure(state);
        if value > bound {
            worst = worst.max(value);
            steps.push(*step);
        }
    }
    (!steps.is_empty()).then_some((worst, steps))
}

/// The front bumper passes a red signal's stop point: it was behind it, is past it, and not too far beside it.
fn red_lights(scene: &Scene, av: &[(usize, AgentState)], lints: &mut Vec<Lint>) {
    let mut crossed = std::collections::BTreeSet::new();
    for pair in av.windows(2) {
        let ((_, before), (step, now)) = (pair[0], pair[1]);
        for signal in scene.signals(step).iter().filter(|signal| signal.state.is_red()) {
            let stop = signal.stop_point.xy();
            let ahead = |state: &AgentState| {
                let front = state.oriented_box().front();
                let seen = world::geometry::Pose::new(front.x, front.y, state.heading).to_body(stop);
                (seen.x, seen.y.abs())
            };
            let ((was_ahead, _), (is_ahead, beside)) = (ahead(&before), ahead(&now));
            if was_ahead >= 0.0 && is_ahead < 0.0 && beside <= BESIDE && crossed.insert((step, stop_key(stop))) {
                lints.push(Lint::AvRunsRed { lane: signal.lane, step });
            }
        }
    }
}

/// Several controlled lanes share a stop point: it counts once.
fn stop_key(point: Point) -> (i64, i64) {
    ((point.x * 100.0) as i64, (point.y * 100.0) as i64)
}
