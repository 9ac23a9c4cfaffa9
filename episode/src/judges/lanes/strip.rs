//! Lanes as strips of ground, and the place of a point in them.
//!
//! Most lanes of a map are never driven in. What costs is found out when it is first asked for, once: how wide a lane is at a point,
//! and whether another one crosses it.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::{Arc, OnceLock};

use world::geometry::{Point, Segment, SegmentGrid};
use world::map::{Lane, Map, MapId};

use super::boundaries::{Boundaries, WIDEST};
use super::held::{Held, Place};
use crate::judges::STOREY;
use crate::judges::level::Level;

/// Segments at either end of a lane at which it may cross another without being in an intersection.
const END_SEGMENTS: usize = 2;

/// Ground that no lane holds belongs to an intersection up to this far (m) from one of its lanes.
const WITHIN_INTERSECTION: f64 = 5.0;

/// A lane as a strip of ground.
#[derive(Clone, Debug)]
pub struct Strip {
    /// Of the lane in the map.
    pub id: MapId,
    /// The center line.
    pub points: Vec<Point>,
    /// Height (m) of each point.
    heights: Vec<f64>,
    /// Half width (m) to the left and to the right at each point, as far as it was asked for.
    widths: Vec<OnceLock<[f64; 2]>>,
    /// Place of the lane in the map.
    lane: usize,
    /// Number of each point in the map's center line.
    numbers: Vec<usize>,
    /// Places, among all strips, of the lanes that lead here.
    pub entries: Vec<usize>,
    /// Places of those that this one leads to.
    pub exits: Vec<usize>,
    /// m/s, 0 where it is not known.
    pub speed_limit: f64,
    /// Whether the map says that it is one of an intersection.
    interpolating: bool,
    /// Whether another lane crosses it, once that was asked.
    crossed: OnceLock<bool>,
    /// Arc length (m) at each point.
    stations: Vec<f64>,
    /// Number of its first segment in the grid.
    first_segment: usize,
}

/// The lanes around the route that cars drive on.
#[derive(Clone, Debug)]
pub struct Lanes {
    map: Arc<Map>,
    boundaries: Boundaries,
    strips: Vec<Strip>,
    grid: SegmentGrid,
}

impl Lanes {
    /// The lanes of `map` on the route's level.
    #[must_use]
    pub fn of(map: &Arc<Map>, level: &Level) -> Self {
        let mut lanes: Vec<(usize, Vec<usize>)> = Vec::new();
        for (index, Lane { kind, centerline, .. }) in map.lanes.iter().enumerate() {
            if kind.is_drivable() && centerline.iter().any(|point| level.holds(*point)) {
                // Which points are kept: those that do not repeat.
                let mut kept: Vec<usize> = (0..centerline.len()).collect();
                kept.dedup_by(|a, b| centerline[*a].xy() == centerline[*b].xy());
                if kept.len() > 1 {
                    lanes.push((index, kept));
                }
            }
        }
        let places = lanes.iter().enumerate().map(|(place, (lane, _))| (map.lanes[*lane].id, place));
        let places: BTreeMap<MapId, usize> = places.collect();
        let mut first_segment = 0;
        let strips = lanes.into_iter().map(|(lane, numbers)| {
            let strip = Strip::of(map, lane, numbers, &places, first_segment);
            first_segment += strip.points.len() - 1;
            strip
        });
        let strips: Vec<Strip> = strips.collect();
        let chains = strips.iter().enumerate().map(|(index, strip)| (index as u32, strip.points.iter().copied()));
        let grid = SegmentGrid::new(chains, 4.0);
        Self { map: Arc::clone(map), boundaries: Boundaries::of(map), strips, grid }
    }

    /// All of them.
    #[must_use]
    pub fn strips(&self) -> &[Strip] {
        &self.strips
    }

    /// Half width (m) of a lane to the left and to the right at its point number `point`.
    #[must_use]
    pub fn widths(&self, lane: usize, point: usize) -> [f64; 2] {
        let strip = &self.strips[lane];
        *strip.widths[point].get_or_init(|| {
            let Lane { left_boundaries, right_boundaries, .. } = &self.map.lanes[strip.lane];
            [left_boundaries, right_boundaries]
                .map(|side| self.boundaries.half_width(&self.map, side, strip.numbers[point], strip.points[point]))
        })
    }

    /// Whether a lane is one of an intersection, because the map says so or another crosses it: what nuPlan calls a lane connector.
    #[must_use]
    pub fn is_connector(&self, lane: usize) -> bool {
        let strip = &self.strips[lane];
        strip.interpolating || *strip.crossed.get_or_init(|| self.is_crossed(lane))
    }

    /// Height (m) of the start of the segment with this number in the grid.
    fn height_of(&self, segment: usize) -> f64 {
        let strip = &self.strips[self.grid.payload(segment) as usize];
        strip.heights[segment - strip.first_segment]
    }

    /// The numbers of a lane's segments in the grid.
    fn segments(&self, lane: usize) -> Range<usize> {
        let strip = &self.strips[lane];
        strip.first_segment..strip.first_segment + strip.points.len() - 1
    }

    /// Whether another lane's center line crosses this one's: that is an intersection, whether the map marks it or not.
    fn is_crossed(&self, lane: usize) -> bool {
        // Lanes that begin or end together wriggle across each other there.
        let inner = |lane: usize| {
            let Range { start, end } = self.segments(lane);
            start + END_SEGMENTS..end.saturating_sub(END_SEGMENTS)
        };
        inner(lane).any(|index| {
            let own = self.grid.segment(index);
            let mut crossed = false;
            self.grid.for_each_near(own.start, own.length(), |other| {
                let other_lane = self.grid.payload(other) as usize;
                let candidate = other_lane != lane && inner(other_lane).contains(&other);
                let is_level = || (self.height_of(index) - self.height_of(other)).abs() <= STOREY;
                crossed |= candidate && is_level() && cross(&own, &self.grid.segment(other));
            });
            crossed
        })
    }

    /// The lanes that hold `point` where the ground is at the height `ground` (m), for a body that looks `forward`; into `held`.
    pub(super) fn hold(&self, held: &mut Held, point: Point, ground: f64, forward: Point) {
        held.forget(self.strips.len());
        self.grid.for_each_about(point, WIDEST, |about| {
            let (segment, lane) = (about.segment, self.grid.payload(about.segment) as usize);
            if held.knows(lane, segment) || !about.is_near() {
                return;
            }
            let Some(nearest) = self.downhill(lane, segment, point, |next| held.knows(lane, next)) else {
                return held.learn_more(lane, segment);
            };
            let is_level = (self.height_of(nearest) - ground).abs() <= STOREY;
            let place = is_level.then(|| self.place_at(lane, nearest, point, forward));
            held.learn(lane, segment, nearest, place.filter(|place| place.outside == 0.0));
        });
        held.sort();
    }

    /// The same, for whoever asks once.
    fn holding(&self, point: Point, ground: f64) -> Held {
        let mut held = Held::default();
        self.hold(&mut held, point, ground, Point::default());
        held
    }

    /// Places, among all strips, of the lanes that hold `point` where the ground is at the height `ground` (m), in ascending order.
    #[must_use]
    pub fn at(&self, point: Point, ground: f64) -> Vec<usize> {
        let mut lanes: Vec<usize> = self.holding(point, ground).lanes.into_iter().map(|(lane, _)| lane).collect();
        lanes.sort_unstable();
        lanes
    }

    /// Those of `before` that hold the point still, or, where there was one alone, what it leads to (nuPlan:
    /// `get_route_obj_with_candidates`).
    pub(super) fn follow(&self, before: &[usize], held: &Held) -> Vec<usize> {
        let kept: Vec<usize> = before.iter().copied().filter(|lane| held.contains(*lane)).collect();
        match before {
            [only] if kept.is_empty() => {
                self.exits(*only).iter().copied().filter(|lane| held.contains(*lane)).collect()
            }
            _ => kept,
        }
    }

    /// The lane that holds the point, else all connectors that do (nuPlan: `get_current_route_objects`). Its lanes do not lie on each
    /// other; ours do, where the map does not mark an intersection, and there what points the AV's way comes first.
    pub(super) fn search(&self, held: &Held) -> Vec<usize> {
        let mut lanes = held.lanes.iter().filter(|(lane, _)| !self.is_connector(*lane));
        let mut connectors = held.lanes.iter().filter(|(lane, _)| self.is_connector(*lane)).peekable();
        let lane = lanes.next();
        let oncoming = lane.is_some_and(|(_, place)| !place.is_aligned());
        match lane {
            Some((lane, _)) if !(oncoming && connectors.peek().is_some_and(|(_, place)| place.is_aligned())) => {
                vec![*lane]
            }
            _ => connectors.map(|(lane, _)| *lane).collect(),
        }
    }

    pub(super) fn exits(&self, lane: usize) -> &[usize] {
        &self.strips[lane].exits
    }

    pub(super) fn entries(&self, lane: usize) -> &[usize] {
        &self.strips[lane].entries
    }

    /// How far (m) `point` is outside of `lane`, 0 within.
    pub(super) fn distance(&self, lane: usize, point: Point) -> f64 {
        self.nearest_place(lane, point).outside
    }

    /// Arc length (m) along `lane` at which it is nearest to `point`.
    pub(super) fn station(&self, lane: usize, point: Point) -> f64 {
        self.nearest_place(lane, point).station
    }

    /// Where a lane points, at its nearest place.
    pub(super) fn direction(&self, lane: usize, point: Point) -> Point {
        let along = self.grid.segment(self.nearest_segment(lane, point)).vector();
        along * (1.0 / along.norm())
    }

    /// The speed limit (m/s) for an AV in these lanes, 0 where it is not known: a lane's own; of connectors the largest of what they join,
    /// if all of that is known (nuPlan: `speed_limit_compliance.py`), and their own where they join nothing.
    pub(super) fn speed_limit(&self, lanes: &[usize]) -> f64 {
        let own = |lane: &usize| self.strips[*lane].speed_limit;
        if let [lane, ..] = lanes
            && !self.is_connector(*lane)
        {
            return own(lane);
        }
        let joined = lanes.iter().flat_map(|lane| self.exits(*lane).iter().chain(self.entries(*lane)));
        let mut limits: Vec<f64> = joined.map(own).collect();
        if limits.is_empty() {
            limits = lanes.iter().map(own).collect();
        }
        if limits.contains(&0.0) { 0.0 } else { limits.into_iter().fold(0.0, f64::max) }
    }

    /// Whether `point` is in an intersection: on one of its lanes, or on no lane and beside one of its.
    #[must_use]
    pub fn is_intersection(&self, point: Point, ground: f64) -> bool {
        let held = self.holding(point, ground).lanes;
        if !held.is_empty() {
            return held.iter().any(|(lane, _)| self.is_connector(*lane));
        }
        let mut beside = false;
        self.grid.for_each_near(point, WIDEST + WITHIN_INTERSECTION, |segment| {
            let lane = self.grid.payload(segment) as usize;
            let is_level = || (self.height_of(segment) - ground).abs() <= STOREY;
            beside =
                beside || (is_level() && self.distance(lane, point) < WITHIN_INTERSECTION && self.is_connector(lane));
        });
        beside
    }

    /// The place of `point`, however far away it is.
    fn nearest_place(&self, lane: usize, point: Point) -> Place {
        self.place_at(lane, self.nearest_segment(lane, point), point, Point::default())
    }

    /// The number of the segment of `lane` that is nearest to `point`, the first of equals.
    fn nearest_segment(&self, lane: usize, point: Point) -> usize {
        let own = self.segments(lane);
        let nearest = self.grid.nearest_where(point, f64::INFINITY, |segment| own.contains(&segment));
        nearest.map_or(own.start, |nearest| nearest.segment)
    }

    /// The number of the segment of `lane` to which the way from segment `from` leads downhill, nearer and nearer to `point`: lanes are
    /// smooth, and `from` is near. None where the way comes to a segment from which `is_known` where it leads.
    fn downhill(&self, lane: usize, from: usize, point: Point, is_known: impl Fn(usize) -> bool) -> Option<usize> {
        let own = self.segments(lane);
        let distance = |segment: usize| self.grid.segment(segment).nearest_to(point).distance_squared;
        let (mut nearest, mut least) = (from, distance(from));
        for step in [1_isize, -1] {
            while let Some(next) = nearest.checked_add_signed(step).filter(|next| own.contains(next)) {
                let candidate = distance(next);
                if candidate >= least {
                    break;
                }
                if is_known(next) {
                    return None;
                }
                (nearest, least) = (next, candidate);
            }
        }
        Some(nearest)
    }

    /// The place of `point`, whose nearest segment of `lane` has this number in the grid.
    fn place_at(&self, lane: usize, segment: usize, point: Point, forward: Point) -> Place {
        let strip = &self.strips[lane];
        let index = segment - strip.first_segment;
        let segment = self.grid.segment(segment);
        let nearest = segment.nearest_to(point);
        let along = segment.vector();
        let length = strip.stations[index + 1] - strip.stations[index];
        let offset = point - segment.start;
        // Unclamped, to see what lies before the lane's start or beyond its end.
        let ahead = offset.dot(along) / length;
        let before = if index == 0 { (-ahead).max(0.0) } else { 0.0 };
        let behind = if index + 2 == strip.points.len() { (ahead - length).max(0.0) } else { 0.0 };
        let beyond = before.max(behind);
        let distance = nearest.distance_squared.sqrt();
        let side = along.cross(offset);
        let across = if beyond > 0.0 { side.abs() / length } else { distance };
        let widths = [index, index + 1].map(|at| self.widths(lane, at)[usize::from(side < 0.0)]);
        let width = widths[0] * (1.0 - nearest.fraction) + widths[1] * nearest.fraction;
        let beside = (across - width).max(0.0);
        Place {
            station: strip.stations[index] + length * nearest.fraction,
            distance,
            outside: if beyond > 0.0 { (beyond * beyond + beside * beside).sqrt() } else { beside },
            alignment: along.dot(forward) / length,
        }
    }
}

impl Strip {
    /// The strip of the map's lane at place `lane`, of its points with these `numbers`.
    fn of(map: &Map, lane: usize, numbers: Vec<usize>, places: &BTreeMap<MapId, usize>, first_segment: usize) -> Self {
        let at = &map.lanes[lane];
        let points: Vec<Point> = numbers.iter().map(|number| at.centerline[*number].xy()).collect();
        let mut stations = Vec::with_capacity(points.len());
        stations.push(0.0);
        for pair in points.windows(2) {
            stations.push(stations[stations.len() - 1] + pair[0].distance(pair[1]));
        }
        let linked = |links: &[MapId]| links.iter().filter_map(|id| places.get(id).copied()).collect();
        Self {
            id: at.id,
            heights: numbers.iter().map(|number| at.centerline[*number].z).collect(),
            widths: vec![OnceLock::new(); points.len()],
            stations,
            entries: linked(&at.entries),
            exits: linked(&at.exits),
            speed_limit: at.speed_limit().unwrap_or(0.0),
            interpolating: at.interpolating,
            crossed: OnceLock::new(),
            lane,
            numbers,
            first_segment,
            points,
        }
    }
}

/// Whether two segments cross, each at an inner point of the other.
fn cross(a: &Segment, b: &Segment) -> bool {
    a.side(b.start) * a.side(b.end) < 0.0 && b.side(a.start) * b.side(a.end) < 0.0
}

#[cfg(test)]
mod tests;
