//! The mended waypoints: places on the lanes that were driven, and on those behind and ahead, that only lead forward.

use std::collections::BTreeMap;

use super::Waypoint;
use super::drive::{Link, Place, drive, link};
use crate::geometry::{Point, Point3, angle_difference};
use crate::lane_graph::LaneGraph;
use crate::map::Map;
use crate::map_matching::{LaneMatch, LanePoints};
use crate::scene::Scene;

/// Distance between waypoints (m).
const WAYPOINT_SPACING: f64 = 5.0;

/// No waypoint this near (m along the drive) to a change of lanes, so that the spline leads over; nor to where the drive
/// leaves the lanes or joins them.
const CHANGE_MARGIN: f64 = 10.0;
const LEAVE_MARGIN: f64 = 3.0;

/// How far the line reaches behind the log's first pose and ahead of its last (m along the lanes).
const BEHIND: f64 = 30.0;
const AHEAD: f64 = 120.0;

/// How far the line reaches straight on where the log begins or ends off the lanes (m).
const STRAIGHT: f64 = 10.0;

/// Lanes whose ends lie farther apart than this (m) do not lead into each other, whatever the map says.
const LARGEST_GAP: f64 = 2.0;

/// A driven lane may follow another after lanes of this length (m) that no pose fell on.
const LONGEST_SKIP: f64 = 100.0;

/// A waypoint and the direction of travel there.
#[derive(Clone, Copy)]
pub(crate) struct Mark {
    pub(crate) waypoint: Waypoint,
    forward: Point,
}

/// The map as the walk along its lanes needs it.
pub(crate) struct Lanes<'a> {
    pub(crate) map: &'a Map,
    pub(crate) graph: &'a LaneGraph,
    pub(crate) points: &'a LanePoints,
}

/// The waypoints, and the lanes of the route in order, each once in a row.
pub(super) fn waypoints(scene: &Scene) -> (Vec<Waypoint>, Vec<usize>) {
    let map = scene.map().as_ref();
    let points = LanePoints::new(map, |lane| map.lanes[lane].kind.is_drivable());
    let graph = LaneGraph::new(map);
    let lanes = Lanes { map, graph: &graph, points: &points };
    let places = drive(&scene.av().states, lanes.graph, lanes.points);
    let (Some(first), Some(last)) = (places.first(), places.last()) else {
        return (Vec::new(), Vec::new()); // a checked scene has seen its AV
    };
    let mut marks = lanes.along(&places);
    let (behind, lanes_behind) = lanes.behind(first, &marks[0]);
    marks.splice(0..0, behind);
    let (ahead, lanes_ahead) = lanes.ahead(last);
    extend_forward(&mut marks, ahead);

    let mut route = lanes_behind;
    for lane in places.iter().filter_map(|place| place.lane) {
        lanes.follow(&mut route, lane.lane);
    }
    route.extend(lanes_ahead);
    route.dedup();
    (marks.into_iter().map(|mark| mark.waypoint).collect(), route)
}

impl Lanes<'_> {
    /// Marks along the drive, the first place's always among them.
    fn along(&self, places: &[Place]) -> Vec<Mark> {
        let margin = |pair: &[Place]| {
            let moved = pair[1].driven - pair[0].driven;
            match link(&pair[0].lane, &pair[1].lane, moved, self.graph, self.points) {
                Link::On => None,
                Link::Leave => Some(LEAVE_MARGIN),
                Link::Change | Link::Jump => Some(CHANGE_MARGIN),
            }
        };
        let changes: Vec<(f64, f64)> = places
            .windows(2)
            .filter_map(|pair| Some((0.5 * (pair[0].driven + pair[1].driven), margin(pair)?)))
            .collect();
        let clear = |place: &&Place| changes.iter().all(|(at, margin)| (place.driven - at).abs() >= *margin);
        let mut marks: Vec<Mark> = places.first().map(|place| self.mark(place)).into_iter().collect();
        extend_forward(&mut marks, places.iter().filter(clear).map(|place| self.mark(place)));
        marks
    }

    /// The lane point that a place is matched to; off the lanes the place itself.
    fn mark(&self, place: &Place) -> Mark {
        place.lane.map_or_else(|| straight(place, 0.0), |lane| self.lane_mark(lane.lane, lane.point))
    }

    fn lane_mark(&self, lane: usize, point: usize) -> Mark {
        let at = LaneMatch { lane, point, distance: 0.0 };
        let waypoint = Waypoint { point: self.points.point(&at), lane: Some(lane) };
        Mark { waypoint, forward: Point::unit(self.points.heading(&at)) }
    }

    /// Marks behind the first place in driving order, and their lanes; off the lanes a mark straight behind.
    fn behind(&self, first: &Place, first_mark: &Mark) -> (Vec<Mark>, Vec<usize>) {
        let Some(start) = first.lane else { return (vec![straight(first, -STRAIGHT)], Vec::new()) };
        let before = |lane: usize| {
            let linked = self.graph.predecessors(lane).iter().copied().chain(self.itself(lane));
            self.straightest(linked.map(|from| (from, (from, lane))))
        };
        let points = |lane: usize, is_first: bool| {
            let end = if is_first { start.point } else { self.map.lanes[lane].centerline.len() };
            (0..end).rev().collect()
        };
        let (walked, mut lanes) = self.walk(start.lane, BEHIND, points, before);
        // Backwards from the first mark, so that the spacing holds there.
        let mut marks = vec![*first_mark];
        for mark in walked {
            if distance(&marks[marks.len() - 1], &mark) >= WAYPOINT_SPACING {
                marks.push(mark);
            }
        }
        marks.remove(0);
        marks.reverse();
        lanes.reverse();
        (marks, lanes)
    }

    /// Marks ahead of the last place, and their lanes; off the lanes a mark straight ahead.
    pub(crate) fn ahead(&self, last: &Place) -> (Vec<Mark>, Vec<usize>) {
        last.lane.map_or_else(|| (vec![straight(last, STRAIGHT)], Vec::new()), |end| self.onward(end))
    }

    /// Marks at the points of a lane from one of them on, and at those of the lanes that it leads to; and these lanes.
    pub(crate) fn onward(&self, end: LaneMatch) -> (Vec<Mark>, Vec<usize>) {
        let after = |lane: usize| {
            let linked = self.graph.successors(lane).iter().copied().chain(self.itself(lane));
            self.straightest(linked.map(|to| (to, (lane, to))))
        };
        let points = |lane: usize, is_first: bool| {
            let begin = if is_first { end.point } else { 0 };
            (begin..self.map.lanes[lane].centerline.len()).collect()
        };
        self.walk(end.lane, AHEAD, points, after)
    }

    /// The lane itself, if it is closed: it leads on to its own beginning where the map names nothing else.
    fn itself(&self, lane: usize) -> Option<usize> {
        self.points.closed_length(lane).map(|_| lane)
    }

    /// Follows lanes from `start` until their points reach `reach` metres. A ring is followed round and round; lanes without length
    /// that lead into each other are followed once.
    fn walk(
        &self,
        start: usize,
        reach: f64,
        points: impl Fn(usize, bool) -> Vec<usize>,
        next: impl Fn(usize) -> Option<usize>,
    ) -> (Vec<Mark>, Vec<usize>) {
        let (mut marks, mut lanes): (Vec<Mark>, Vec<usize>) = (Vec::new(), Vec::new());
        let (mut following, mut walked) = (Some(start), 0.0);
        // For each lane how far the walk was when it last came by.
        let mut came_by: BTreeMap<usize, f64> = BTreeMap::new();
        while let Some(lane) = following {
            if came_by.insert(lane, walked).is_some_and(|before| walked - before < WAYPOINT_SPACING) {
                break;
            }
            lanes.push(lane);
            for mark in points(lane, lanes.len() == 1).into_iter().map(|point| self.lane_mark(lane, point)) {
                walked += marks.last().map_or(0.0, |last| distance(last, &mark));
                if walked > reach {
                    return (marks, lanes);
                }
                marks.push(mark);
            }
            following = next(lane);
        }
        (marks, lanes)
    }

    /// Of lanes, each with the link (from, to) that leads there, the one that turns least from the end of `from` to the end
    /// of `to`; the first of equals. Only drivable ones whose ends really meet.
    fn straightest(&self, linked: impl Iterator<Item = (usize, (usize, usize))>) -> Option<usize> {
        let line = |lane: usize| &self.map.lanes[lane].centerline;
        let meets = |from: usize, to: usize| {
            let ends = line(from).last().zip(line(to).first());
            ends.is_some_and(|(end, start)| end.xy().distance(start.xy()) <= LARGEST_GAP)
        };
        let leaving = |lane: usize| {
            let last = line(lane).windows(2).next_back();
            last.map_or(0.0, |pair| (pair[1].xy() - pair[0].xy()).heading())
        };
        linked
            .filter(|(lane, (from, to))| self.map.lanes[*lane].kind.is_drivable() && meets(*from, *to))
            .map(|(lane, (from, to))| (lane, angle_difference(leaving(from), leaving(to)).abs()))
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .map(|(lane, _)| lane)
    }

    /// Appends a driven lane, and before it those that lead there from the one before.
    fn follow(&self, route: &mut Vec<usize>, lane: usize) {
        match route.last() {
            Some(last) if *last == lane => {}
            Some(last) => match self.graph.shortest_path(*last, lane, LONGEST_SKIP) {
                Some(path) => route.extend(&path[1..]),
                None => route.push(lane),
            },
            None => route.push(lane),
        }
    }
}

fn distance(from: &Mark, to: &Mark) -> f64 {
    from.waypoint.point.xy().distance(to.waypoint.point.xy())
}

/// A mark `ahead` metres straight ahead of a place, off the lanes.
fn straight(place: &Place, ahead: f64) -> Mark {
    let at = place.pose.to_world(Point::new(ahead, 0.0));
    let waypoint = Waypoint { point: Point3::new(at.x, at.y, place.ground), lane: None };
    Mark { waypoint, forward: Point::unit(place.pose.heading) }
}

/// Appends those of `more` that lie at least [`WAYPOINT_SPACING`] from the mark before, and not behind it.
fn extend_forward(marks: &mut Vec<Mark>, more: impl IntoIterator<Item = Mark>) {
    for mark in more {
        let leads_on = |last: &Mark| {
            let step = mark.waypoint.point.xy() - last.waypoint.point.xy();
            step.norm() >= WAYPOINT_SPACING && step.dot(mark.forward) > 0.0
        };
        if marks.last().is_none_or(leads_on) {
            marks.push(mark);
        }
    }
}
