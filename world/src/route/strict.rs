//! The mended waypoints: the likeliest lanes of the whole drive, then places on them that only lead forward.

use super::Waypoint;
use crate::geometry::{Point, Point3, Pose, angle_difference};
use crate::lane_graph::LaneGraph;
use crate::map::Map;
use crate::map_matching::{LaneMatch, LanePoints};
use crate::scene::{AgentState, Scene};

/// The AV must have moved this far (m) for its pose to count anew: where it stands, it says nothing.
const POSE_SPACING: f64 = 1.0;

/// Distance between waypoints along the drive (m).
const WAYPOINT_SPACING: f64 = 5.0;

/// No waypoint this near to a lane change (m along the drive).
const CHANGE_MARGIN: f64 = 10.0;

/// How far the line reaches behind the log's first pose and ahead of its last (m along the lanes).
const BEHIND: f64 = 30.0;
const AHEAD: f64 = 120.0;

/// How far the line reaches straight on where the log begins or ends off the lanes (m).
const STRAIGHT: f64 = 10.0;

/// A lane within this distance (m) and heading (rad) may be the one driven on.
const SEARCH_RADIUS: f64 = 5.0;
const SEARCH_HEADING: f64 = std::f64::consts::FRAC_PI_3;

/// Lanes whose ends lie farther apart than this (m) do not lead into each other, whatever the map says.
const LARGEST_GAP: f64 = 2.0;

/// Costs of the search: squares of offsets in these units. A pose is off the lanes where all are 3.5 m away or worse.
const DISTANCE_UNIT: f64 = 1.0;
const HEADING_UNIT: f64 = 0.3;
const HEIGHT_UNIT: f64 = 2.0;
const OFF_LANES: f64 = 12.0;
/// What it costs to change to a neighbour, to leave or join the lanes, and to jump.
const CHANGE: f64 = 5.0;
const LEAVE: f64 = 10.0;
const JUMP: f64 = 30.0;

/// A pose of the drive and the lane chosen for it.
#[derive(Clone, Copy)]
struct Place {
    pose: Pose,
    ground: f64,
    /// Distance driven since the first place (m).
    driven: f64,
    lane: Option<LaneMatch>,
}

/// The waypoints, and the lanes of the route in order, each once in a row.
pub(super) fn waypoints(scene: &Scene) -> (Vec<Waypoint>, Vec<usize>) {
    let map = scene.map();
    let graph = LaneGraph::new(map);
    let points = LanePoints::new(map, |lane| map.lanes[lane].kind.is_drivable());
    let mut places = drive(&scene.av().states);
    choose_lanes(&mut places, &graph, &points);

    let (Some(first), Some(last)) = (places.first().copied(), places.last().copied()) else {
        return (Vec::new(), Vec::new()); // a checked scene has seen its AV
    };
    let (mut waypoints, mut lanes) = behind(map, &graph, &first);
    along(&places, &graph, &points, &mut waypoints);
    let driven: Vec<usize> = places.iter().filter_map(|place| place.lane.map(|lane| lane.lane)).collect();
    for lane in driven {
        push_lane(&mut lanes, lane, &graph);
    }
    let (ahead, lanes_ahead) = ahead(map, &graph, &last);
    extend_apart(&mut waypoints, ahead);
    lanes.extend(lanes_ahead);
    lanes.dedup();
    (waypoints, lanes)
}

/// The poses of the drive that are at least [`POSE_SPACING`] apart.
fn drive(states: &[Option<AgentState>]) -> Vec<Place> {
    let mut places: Vec<Place> = Vec::new();
    for state in states.iter().flatten() {
        let moved = places.last().map_or(0.0, |last| last.pose.position().distance(state.position()));
        if places.is_empty() || moved >= POSE_SPACING {
            let driven = places.last().map_or(0.0, |last| last.driven) + moved;
            places.push(Place { pose: state.pose(), ground: state.z - 0.5 * state.height, driven, lane: None });
        }
    }
    places
}

/// Dynamic programming over the drive: the sequence of lanes with the least cost of offsets and changes.
fn choose_lanes(places: &mut [Place], graph: &LaneGraph, points: &LanePoints) {
    let candidates: Vec<Vec<(Option<LaneMatch>, f64)>> = places.iter().map(|place| candidates(place, points)).collect();
    let mut from: Vec<Vec<usize>> = Vec::with_capacity(places.len());
    let mut costs: Vec<f64> =
        candidates.first().map_or_else(Vec::new, |first| first.iter().map(|(_, cost)| *cost).collect());
    for pair in candidates.windows(2) {
        let best = |to: &(Option<LaneMatch>, f64)| {
            let totals = pair[0].iter().zip(&costs).map(|(from, cost)| cost + change(&from.0, &to.0, graph));
            let (index, total) = totals
                .enumerate()
                .fold((0, f64::INFINITY), |best, (index, total)| if total < best.1 { (index, total) } else { best });
            (index, total + to.1)
        };
        let reached: Vec<(usize, f64)> = pair[1].iter().map(best).collect();
        costs = reached.iter().map(|(_, cost)| *cost).collect();
        from.push(reached.into_iter().map(|(index, _)| index).collect());
    }
    let mut index =
        costs.iter().enumerate().fold(0, |best, (index, cost)| if *cost < costs[best] { index } else { best });
    for step in (0..places.len()).rev() {
        places[step].lane = candidates[step][index].0;
        if step > 0 {
            index = from[step - 1][index];
        }
    }
}

/// For each lane nearby its nearest point, with what it costs to be there; and to be on none. Lanes in the map's order.
fn candidates(place: &Place, points: &LanePoints) -> Vec<(Option<LaneMatch>, f64)> {
    let mut found: Vec<LaneMatch> = Vec::new();
    points.for_each_near(place.pose.position(), SEARCH_RADIUS, |near| {
        if angle_difference(place.pose.heading, points.heading(&near)).abs() <= SEARCH_HEADING {
            found.push(near);
        }
    });
    found.sort_by(|a, b| a.lane.cmp(&b.lane).then(a.distance.total_cmp(&b.distance)).then(a.point.cmp(&b.point)));
    found.dedup_by_key(|near| near.lane);
    let cost = |near: LaneMatch| {
        let turn = angle_difference(place.pose.heading, points.heading(&near)) / HEADING_UNIT;
        let (aside, above) = (near.distance / DISTANCE_UNIT, (points.point(&near).z - place.ground) / HEIGHT_UNIT);
        (Some(near), aside * aside + turn * turn + above * above)
    };
    found.into_iter().map(cost).chain([(None, OFF_LANES)]).collect()
}

fn change(from: &Option<LaneMatch>, to: &Option<LaneMatch>, graph: &LaneGraph) -> f64 {
    match (from, to) {
        (None, None) => 0.0,
        (Some(from), Some(to)) if leads_on(from, to, graph) => 0.0,
        (Some(from), Some(to)) if graph.neighbors(from.lane).contains(&to.lane) => CHANGE,
        (Some(_), Some(_)) => JUMP,
        (Some(_), None) | (None, Some(_)) => LEAVE,
    }
}

/// Whether one place is reached from the other without leaving the lane graph's links: on the same lane not backwards (but
/// by a point, the nearest one flickers), or over at most two links.
fn leads_on(from: &LaneMatch, to: &LaneMatch, graph: &LaneGraph) -> bool {
    if from.lane == to.lane {
        return to.point + 1 >= from.point;
    }
    let next = graph.successors(from.lane);
    next.contains(&to.lane) || next.iter().any(|lane| graph.successors(*lane).contains(&to.lane))
}

/// Waypoints along the drive: lane points, or the pose itself off the lanes; none near a lane change.
fn along(places: &[Place], graph: &LaneGraph, points: &LanePoints, waypoints: &mut Vec<Waypoint>) {
    let is_change = |pair: &&[Place]| change(&pair[0].lane, &pair[1].lane, graph) > 0.0;
    let changes: Vec<f64> =
        places.windows(2).filter(is_change).map(|pair| 0.5 * (pair[0].driven + pair[1].driven)).collect();
    let far_from_changes = |place: &&Place| changes.iter().all(|at| (place.driven - at).abs() >= CHANGE_MARGIN);
    let waypoint = |place: &Place| match &place.lane {
        Some(lane) => Waypoint { point: points.point(lane), lane: Some(lane.lane) },
        None => Waypoint { point: Point3::new(place.pose.x, place.pose.y, place.ground), lane: None },
    };
    extend_apart(waypoints, places.iter().filter(far_from_changes).map(waypoint));
    if waypoints.is_empty() {
        waypoints.extend(places.first().map(waypoint));
    }
}

/// Appends those of `more` that are at least [`WAYPOINT_SPACING`] from the one before and do not lead back.
fn extend_apart(waypoints: &mut Vec<Waypoint>, more: impl IntoIterator<Item = Waypoint>) {
    for next in more {
        let count = waypoints.len();
        let step = |from: &Waypoint| next.point.xy() - from.point.xy();
        let apart = waypoints.last().is_none_or(|last| step(last).norm() >= WAYPOINT_SPACING);
        let forward = count < 2 || {
            let before = waypoints[count - 1].point.xy() - waypoints[count - 2].point.xy();
            before.dot(step(&waypoints[count - 1])) > 0.0
        };
        if apart && forward {
            waypoints.push(next);
        }
    }
}

/// The lane points behind the first place, in driving order, and their lanes; off the lanes a point straight behind.
fn behind(map: &Map, graph: &LaneGraph, first: &Place) -> (Vec<Waypoint>, Vec<usize>) {
    let Some(start) = first.lane else { return (vec![straight(first, -STRAIGHT)], Vec::new()) };
    let before = |lane: usize| {
        let entry = map.lanes[lane].centerline.first()?.xy();
        let gap = |from: &usize| Some(map.lanes[*from].centerline.last()?.xy().distance(entry));
        let linked =
            graph.predecessors(lane).iter().copied().filter(|from| gap(from).is_some_and(|g| g <= LARGEST_GAP));
        straightest(linked, |from| turn(map, from, lane))
    };
    let mut collected = Vec::new();
    let mut lanes = walk(map, start.lane, before, BEHIND, &mut collected, |lane| {
        let points = &map.lanes[lane].centerline;
        let count = if lane == start.lane { start.point } else { points.len() };
        points[..count].iter().rev().copied().collect()
    });
    collected.reverse();
    lanes.reverse();
    let mut waypoints = Vec::new();
    // From the far end on, so that the spacing comes out at the start's side uneven, if anywhere.
    extend_apart(&mut waypoints, collected);
    // The first pose's own point follows: leave it room.
    let room = |waypoint: &Waypoint| {
        let points = &map.lanes[start.lane].centerline;
        points.get(start.point).is_none_or(|at| at.xy().distance(waypoint.point.xy()) >= WAYPOINT_SPACING)
    };
    while waypoints.last().is_some_and(|last| !room(last)) {
        waypoints.pop();
    }
    (waypoints, lanes)
}

/// The lane points ahead of the last place and their lanes; off the lanes a point straight ahead.
fn ahead(map: &Map, graph: &LaneGraph, last: &Place) -> (Vec<Waypoint>, Vec<usize>) {
    let Some(end) = last.lane else { return (vec![straight(last, STRAIGHT)], Vec::new()) };
    let after = |lane: usize| {
        let exit = map.lanes[lane].centerline.last()?.xy();
        let gap = |to: &usize| Some(map.lanes[*to].centerline.first()?.xy().distance(exit));
        let linked = graph
            .successors(lane)
            .iter()
            .copied()
            .filter(|to| gap(to).is_some_and(|gap| gap <= LARGEST_GAP) && map.lanes[*to].kind.is_drivable());
        straightest(linked, |to| turn(map, lane, to))
    };
    let mut collected = Vec::new();
    let lanes = walk(map, end.lane, after, AHEAD, &mut collected, |lane| {
        let skip = if lane == end.lane { end.point } else { 0 };
        map.lanes[lane].centerline[skip..].to_vec()
    });
    (collected, lanes)
}

/// Follows lanes from `start` on until their points reach `reach` metres; no lane is followed twice.
fn walk(
    map: &Map,
    start: usize,
    next: impl Fn(usize) -> Option<usize>,
    reach: f64,
    collected: &mut Vec<Waypoint>,
    points: impl Fn(usize) -> Vec<Point3>,
) -> Vec<usize> {
    let (mut lanes, mut lane, mut walked) = (Vec::new(), start, 0.0);
    let mut previous: Option<Point> = None;
    while lanes.len() < map.lanes.len() && !lanes.contains(&lane) {
        lanes.push(lane);
        for point in points(lane) {
            walked += previous.map_or(0.0, |previous| previous.distance(point.xy()));
            if walked > reach {
                return lanes;
            }
            previous = Some(point.xy());
            collected.push(Waypoint { point, lane: Some(lane) });
        }
        let Some(following) = next(lane) else { break };
        lane = following;
    }
    lanes
}

fn straightest(lanes: impl Iterator<Item = usize>, turn: impl Fn(usize) -> f64) -> Option<usize> {
    lanes.map(|lane| (lane, turn(lane))).min_by(|a, b| a.1.total_cmp(&b.1)).map(|(lane, _)| lane)
}

/// How far one turns between the beginning of lane `from` and the end of lane `to` (rad, never negative).
fn turn(map: &Map, from: usize, to: usize) -> f64 {
    let direction = |pair: Option<&[Point3]>| pair.map_or(0.0, |pair| (pair[1].xy() - pair[0].xy()).heading());
    let leaving = direction(map.lanes[from].centerline.windows(2).next_back());
    let arriving = direction(map.lanes[to].centerline.windows(2).next_back());
    angle_difference(leaving, arriving).abs()
}

fn straight(place: &Place, distance: f64) -> Waypoint {
    let at = place.pose.to_world(Point::new(distance, 0.0));
    Waypoint { point: Point3::new(at.x, at.y, place.ground), lane: None }
}

/// Appends a lane, and before it those that lead there from the one before.
fn push_lane(lanes: &mut Vec<usize>, lane: usize, graph: &LaneGraph) {
    let Some(last) = lanes.last().copied() else { return lanes.push(lane) };
    if last == lane {
        return;
    }
    match graph.shortest_path(last, lane, 100.0) {
        Some(path) => lanes.extend(&path[1..]),
        None => lanes.push(lane),
    }
}
