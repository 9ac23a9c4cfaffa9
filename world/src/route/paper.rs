//! The authors' waypoints: each pose goes to the nearest lane point of about its heading, greedily.

use super::{RouteError, Waypoint};
use crate::geometry::Point3;
use crate::lane_graph::LaneGraph;
use crate::map_matching::{LaneMatch, LanePoints};
use crate::scene::Scene;

/// Lane points (0.5 m apart) that the route should reach behind and ahead of the log before a further lane is added.
const ENOUGH_POINTS: usize = 40;

/// Of the lane points behind and ahead every fifth is a waypoint.
const EVERY: usize = 5;

/// Log indices between two waypoints.
const POSE_STRIDE: usize = 10;

/// The waypoints, and the lanes that they lie on in order, each once in a row.
pub(super) fn waypoints(scene: &Scene) -> Result<(Vec<Waypoint>, Vec<usize>), RouteError> {
    let map = scene.map();
    let graph = LaneGraph::new(map);
    let points = LanePoints::new(map, |_| true);
    // The log indices at which the AV was seen: in real logs, all.
    let states = &scene.av().states;
    let poses: Vec<_> = (0..states.len()).filter_map(|index| Some((index, states[index]?.pose()))).collect();
    let matched = |place: usize| -> Result<LaneMatch, RouteError> {
        let (log_index, pose) = poses[place];
        // Lane numbers must be above 0 in the authors' code: 0 means none.
        let found = points.authors_match(pose).filter(|found| map.lanes[found.lane].id.0 > 0);
        found.ok_or(RouteError::NoLane { log_index })
    };
    let waypoint = |lane: usize, point: Point3| Waypoint { point, lane: Some(lane) };
    let whole = |lane: usize| map.lanes[lane].centerline.iter().map(move |point| waypoint(lane, *point));

    let start = matched(0)?;
    let mut behind = Vec::new();
    if start.point < ENOUGH_POINTS {
        behind.extend(graph.predecessors(start.lane).first().into_iter().flat_map(|lane| whole(*lane)));
    }
    behind.extend(whole(start.lane).take(start.point));
    if behind.is_empty() {
        return Err(RouteError::NothingBehind);
    }

    let end = matched(poses.len() - 1)?;
    let mut ahead: Vec<Waypoint> = whole(end.lane).skip(end.point).collect();
    if ahead.len() < ENOUGH_POINTS {
        ahead.extend(graph.successors(end.lane).first().into_iter().flat_map(|lane| whole(*lane)));
    }

    let mut waypoints: Vec<Waypoint> = behind.into_iter().step_by(EVERY).collect();
    for place in (0..poses.len()).step_by(POSE_STRIDE) {
        let found = matched(place)?;
        waypoints.push(waypoint(found.lane, points.point(&found)));
    }
    waypoints.extend(ahead.into_iter().step_by(EVERY));
    let mut lanes: Vec<usize> = waypoints.iter().filter_map(|waypoint| waypoint.lane).collect();
    lanes.dedup();
    Ok((waypoints, lanes))
}
