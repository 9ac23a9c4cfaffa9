//! Where signals stop the route: for every stop point of the log the rows of the line that it rules, found beforehand.

use super::RouteStyle;
use crate::geometry::{Point, PointGrid, Segment};
use crate::map::{Lane, MapId};
use crate::reference_line::ReferenceLine;
use crate::scene::Scene;
use crate::signal::{Signal, SignalState};

/// The authors' reach of a stop point (m, exclusive).
const REACH: f64 = 0.2;

/// How far beside the line the stop point of a lane of the route may lie (m): lines do not keep to the middle.
const BESIDE: f64 = 1.5;

/// Samples nearer to each other than these (5 m) are of one pass.
const SAME_PASS: u32 = 50;

/// Where the route passes a stop point more than once, those passes are stopped that go the lane's way, within 60 degrees.
const LANES_WAY: f64 = 0.5;

/// Heights further apart than this (m) are of different levels.
const STOREY: f64 = 3.0;

/// A stop point that rules the route.
#[derive(Clone, Debug, PartialEq)]
pub struct RouteStop {
    /// The lane behind it, which a signal rules.
    pub lane: MapId,
    /// Where to stop.
    pub point: Point,
    /// The samples of the line that it rules, ascending; at least one.
    pub samples: Vec<u32>,
}

/// The stop points on a route, in ascending order of lane and place.
#[derive(Clone, Debug, PartialEq)]
pub struct RouteStops {
    style: RouteStyle,
    stops: Vec<RouteStop>,
}

type Key = (MapId, u64, u64);

fn key(lane: MapId, point: Point) -> Key {
    (lane, point.x.to_bits(), point.y.to_bits())
}

impl RouteStops {
    /// Those of the stop points that any step of `scene` reports which rule the line.
    pub(super) fn new(
        scene: &Scene,
        style: RouteStyle,
        lanes: &[MapId],
        line: &ReferenceLine,
        samples: &PointGrid,
    ) -> Self {
        let reported = (0..scene.steps()).flat_map(|step| scene.signals(step));
        let mut places: Vec<(MapId, Point)> = reported.map(|signal| (signal.lane, signal.stop_point.xy())).collect();
        places.sort_unstable_by_key(|(lane, point)| key(*lane, *point));
        places.dedup_by_key(|(lane, point)| key(*lane, *point));
        let on_map = scene.map().lane_indices();
        let stop = |(lane, point): (MapId, Point)| {
            let samples = match style {
                RouteStyle::Paper => rows_within(samples, point),
                RouteStyle::Strict if lanes.contains(&lane) => {
                    let way = on_map.get(&lane).and_then(|lane| way_at(&scene.map().lanes[*lane], point));
                    rows_of_passes(samples, line, point, way)
                }
                // Of a lane that the map does not hold nothing is known but the place.
                RouteStyle::Strict if !on_map.contains_key(&lane) => row_beside(samples, point, REACH),
                // The turn-off's light often shares its stop point with the lane straight on.
                RouteStyle::Strict => Vec::new(),
            };
            (!samples.is_empty()).then_some(RouteStop { lane, point, samples })
        };
        Self { style, stops: places.into_iter().filter_map(stop).collect() }
    }

    /// All of them.
    #[must_use]
    pub fn all(&self) -> &[RouteStop] {
        &self.stops
    }

    /// The stop point that `signal` rules, whatever it shows.
    #[must_use]
    pub fn find(&self, signal: &Signal) -> Option<&RouteStop> {
        let wanted = key(signal.lane, signal.stop_point.xy());
        let found = self.stops.binary_search_by_key(&wanted, |stop| key(stop.lane, stop.point));
        found.ok().map(|index| &self.stops[index])
    }

    /// The samples at which `signal` stops the route now; none unless it is red.
    #[must_use]
    pub fn red_rows(&self, signal: &Signal) -> &[u32] {
        let red = signal.state.is_red()
            // The authors take a flashing stop, which is a stop sign, for a red light.
            || (self.style == RouteStyle::Paper && signal.state == SignalState::FlashingStop);
        if red { self.find(signal).map_or(&[], |stop| &stop.samples) } else { &[] }
    }
}

/// The authors' rows: all strictly within reach.
fn rows_within(samples: &PointGrid, point: Point) -> Vec<u32> {
    let mut rows = Vec::new();
    samples.for_each_near(point, REACH, |row| {
        if point.distance(samples.points()[row]) < REACH {
            rows.push(row as u32);
        }
    });
    rows.sort_unstable();
    rows
}

/// The nearest row of each pass that goes the lane's way, if it lies [`BESIDE`] the stop point; the nearest of all if none does.
fn rows_of_passes(samples: &PointGrid, line: &ReferenceLine, point: Point, way: Option<(Point, f64)>) -> Vec<u32> {
    let mut near: Vec<u32> = Vec::new();
    samples.for_each_near(point, BESIDE, |row| near.push(row as u32));
    near.sort_unstable();
    let distance = |row: &u32| point.distance(samples.points()[*row as usize]);
    let passes = near.chunk_by(|a, b| b - a < SAME_PASS);
    let nearest = passes.filter_map(|pass| pass.iter().copied().min_by(|a, b| distance(a).total_cmp(&distance(b))));
    let rows: Vec<u32> = nearest.collect();
    let goes = |row: &u32| {
        let row = *row as usize;
        way.is_none_or(|(way, height)| {
            Point::unit(line.heading[row]).dot(way) > LANES_WAY && (line.z[row] - height).abs() <= STOREY
        })
    };
    let stopped: Vec<u32> = rows.into_iter().filter(goes).collect();
    if stopped.is_empty() { row_beside(samples, point, BESIDE) } else { stopped }
}

/// The lane's direction and height (m) where it is nearest to `point`.
fn way_at(lane: &Lane, point: Point) -> Option<(Point, f64)> {
    let segments =
        lane.centerline.windows(2).map(|pair| (Segment { start: pair[0].xy(), end: pair[1].xy() }, pair[0].z));
    let apart = |segment: &Segment| segment.nearest_to(point).distance_squared;
    let (nearest, height) =
        segments.filter(|(segment, _)| segment.length() > 0.0).min_by(|a, b| apart(&a.0).total_cmp(&apart(&b.0)))?;
    Some((nearest.vector() * (1.0 / nearest.length()), height))
}

/// The nearest row, if it lies within `reach` metres.
fn row_beside(samples: &PointGrid, point: Point, reach: f64) -> Vec<u32> {
    let nearest = samples.nearest(point).filter(|(_, distance)| *distance <= reach);
    nearest.map(|(row, _)| row as u32).into_iter().collect()
}
