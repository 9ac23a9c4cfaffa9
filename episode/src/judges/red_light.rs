//! Whether the front bumper crosses the stop point of a lane of the route while its signal shows stop.

use std::collections::BTreeSet;

use world::geometry::{Point, Point3, Segment};
use world::map::MapId;
use world::scene::bridged::Bridged;
use world::signal::Signal;

use super::STOREY;

/// A crossing further to the side than this (m) is of another lane.
const HALF_WIDTH: f64 = 2.5;

/// Stop points nearer to each other than this (m) are one.
const SAME_PLACE: f64 = 0.5;

/// Steps in which a driver reacts to a signal that appears: a second.
const REACTION: u32 = 10;

/// A stop point that shows red.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RedStop {
    /// The lane that it rules.
    pub lane: MapId,
    /// Whether a driver has known for a second what it shows.
    pub known: bool,
    point: Point,
    direction: Point,
    /// Height of its lane there (m).
    height: f64,
}

impl RedStop {
    /// Whether both are one place where cars stop: lanes that part behind it share it.
    #[must_use]
    pub fn is_same_place(&self, other: &Self) -> bool {
        self.lane == other.lane || self.point.distance(other.point) < SAME_PLACE
    }

    /// Whether a front bumper that moves from `before` to `after` crosses it.
    #[must_use]
    pub fn is_crossed(&self, before: Point, after: Point) -> bool {
        let (before, after) = (before - self.point, after - self.point);
        before.dot(self.direction) <= 0.0
            && after.dot(self.direction) > 0.0
            && self.direction.cross(after).abs() <= HALF_WIDTH
    }
}

/// The red stop points of the route's lanes, step by step.
#[derive(Clone, Debug, Default)]
pub struct RedStops {
    steps: Vec<Vec<RedStop>>,
}

impl RedStops {
    /// Those of the lanes in `route`.
    #[must_use]
    pub fn of(bridged: &Bridged, route: &[MapId]) -> Self {
        let scene = bridged.judged();
        let on_route: BTreeSet<MapId> = route.iter().copied().collect();
        let lanes = scene.map().lane_indices();
        let stop = |signal: &Signal, step: usize| {
            let lane = &scene.map().lanes[*lanes.get(&signal.lane)?];
            let point = signal.stop_point.xy();
            let (direction, height) = way_at(&lane.centerline, point)?;
            // Before the log began nobody knows.
            let known =
                bridged.signal_known_for(signal.lane, step).is_some_and(|steps| steps >= REACTION.min(step as u32 + 1));
            Some(RedStop { lane: signal.lane, known, point, direction, height })
        };
        let steps = (0..scene.steps()).map(|step| {
            let signals = scene.signals(step).iter();
            let red = signals.filter(|signal| signal.state.is_red() && on_route.contains(&signal.lane));
            red.filter_map(|signal| stop(signal, step)).collect()
        });
        Self { steps: steps.collect() }
    }

    /// The stops that a front bumper crosses on its `way` from before a step to after it, at `log_index`. They must show red at
    /// both ends of the step: who enters on yellow is not blamed. The ground is at the height `ground` (m).
    pub fn crossed(&self, log_index: usize, way: Segment, ground: f64) -> impl Iterator<Item = &RedStop> {
        let at = |index: Option<usize>| index.and_then(|index| self.steps.get(index)).map_or(&[][..], Vec::as_slice);
        let (before, after) = (at(log_index.checked_sub(1)), at(Some(log_index)));
        let still_red = |stop: &&RedStop| before.iter().any(|earlier| earlier.lane == stop.lane);
        let is_level = move |stop: &&RedStop| (stop.height - ground).abs() <= STOREY;
        after.iter().filter(still_red).filter(is_level).filter(move |stop| stop.is_crossed(way.start, way.end))
    }
}

/// The unit vector along a lane, and its height (m), where it is nearest to `point`.
fn way_at(line: &[Point3], point: Point) -> Option<(Point, f64)> {
    let segments = line.windows(2).map(|pair| (Segment { start: pair[0].xy(), end: pair[1].xy() }, pair[0].z));
    let ((segment, height), _) = segments
        .filter(|(segment, _)| segment.length() > 0.0)
        .map(|(segment, height)| ((segment, height), segment.nearest_to(point).distance_squared))
        .reduce(|best, other| if other.1 < best.1 { other } else { best })?;
    let along = segment.vector();
    Some((along * (1.0 / along.norm()), height))
}

#[cfg(test)]
mod tests {
    use super::*;

    const STOP: RedStop = RedStop {
        lane: MapId(1),
        known: true,
        point: Point::new(10.0, 0.0),
        direction: Point::new(1.0, 0.0),
        height: 0.0,
    };

    #[test]
    fn a_stop_point_on_another_level_stops_nobody() {
        let stops = RedStops { steps: vec![vec![STOP]; 2] };
        let way = Segment { start: Point::new(9.9, 0.5), end: Point::new(10.1, 0.5) };
        assert_eq!([0.0, 6.0].map(|ground| stops.crossed(1, way, ground).count()), [1, 0]);
    }

    #[test]
    fn the_bumper_must_cross_the_stop_point_in_the_lane_and_in_its_direction() {
        assert!(STOP.is_crossed(Point::new(9.9, 0.5), Point::new(10.1, 0.5)));
        assert!(!STOP.is_crossed(Point::new(9.8, 0.5), Point::new(10.0, 0.5)), "it stops at the line");
        assert!(!STOP.is_crossed(Point::new(10.1, 0.5), Point::new(10.5, 0.5)), "it was past the line");
        assert!(!STOP.is_crossed(Point::new(10.1, 0.5), Point::new(9.9, 0.5)), "it comes from the other side");
        assert!(!STOP.is_crossed(Point::new(9.9, 3.5), Point::new(10.1, 3.5)), "it is in the next lane");
    }

    #[test]
    fn it_must_be_red_before_and_after_the_step() {
        let stops =
            |red: [bool; 2]| RedStops { steps: red.map(|red| if red { vec![STOP] } else { Vec::new() }).to_vec() };
        let way = Segment { start: Point::new(9.9, 0.0), end: Point::new(10.1, 0.0) };
        let crossed = |red| stops(red).crossed(1, way, 0.0).count() == 1;
        assert!(crossed([true, true]) && !crossed([false, true]) && !crossed([true, false]));
        assert_eq!(stops([true, true]).crossed(0, way, 0.0).count(), 0, "nobody knows how it came to the first step");
        assert_eq!(stops([true, true]).crossed(7, way, 0.0).count(), 0, "the log is over");
    }

    #[test]
    fn lanes_that_share_a_stop_point_are_one_place() {
        let other = RedStop { lane: MapId(2), ..STOP };
        assert!(STOP.is_same_place(&other));
        assert!(!STOP.is_same_place(&RedStop { point: Point::new(10.0, 3.5), ..other }));
    }
}
