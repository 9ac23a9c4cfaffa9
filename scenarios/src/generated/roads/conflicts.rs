//! Which ways of a junction come too close to one another, and where.

use world::geometry::Point;

use super::{Conflict, Lane, LaneIndex};

/// Centre lines nearer than this (m) are in each other's way: of two lanes for cars; of a bike lane and one for cars; of two bike lanes.
const CARS: f64 = 2.8;
const BIKE_AND_CAR: f64 = 1.9;
const BIKES: f64 = 1.2;

/// Points in a chunk that has a box of its own.
const CHUNK: usize = 8;

/// A way with boxes around its parts, so that most of two ways need no look.
struct Boxed {
    lane: LaneIndex,
    points: Vec<Point>,
    chunks: Vec<Box2>,
    whole: Box2,
}

#[derive(Clone, Copy)]
struct Box2 {
    low: Point,
    high: Point,
}

impl Box2 {
    const NOTHING: Self =
        Self { low: Point::new(f64::INFINITY, f64::INFINITY), high: Point::new(f64::NEG_INFINITY, f64::NEG_INFINITY) };

    fn around(points: &[Point]) -> Self {
        points.iter().fold(Self::NOTHING, |all, point| all.and(&Self { low: *point, high: *point }))
    }

    fn and(&self, other: &Self) -> Self {
        let low = Point::new(self.low.x.min(other.low.x), self.low.y.min(other.low.y));
        Self { low, high: Point::new(self.high.x.max(other.high.x), self.high.y.max(other.high.y)) }
    }

    fn is_near(&self, other: &Self, by: f64) -> bool {
        self.low.x - by <= other.high.x
            && other.low.x - by <= self.high.x
            && self.low.y - by <= other.high.y
            && other.low.y - by <= self.high.y
    }
}

impl Boxed {
    fn new(lane: LaneIndex, lanes: &[Lane]) -> Self {
        let points: Vec<Point> = lanes[lane].course.points().collect();
        let chunks: Vec<Box2> = points.chunks(CHUNK).map(Box2::around).collect();
        let whole = chunks.iter().fold(Box2::NOTHING, |all, chunk| all.and(chunk));
        Self { lane, points, chunks, whole }
    }
}

/// All conflicts between `ways`; those from one and the same lane have none.
pub(super) fn conflicts(lanes: &[Lane], ways: &[LaneIndex]) -> Vec<Conflict> {
    let boxed: Vec<Boxed> = ways.iter().map(|way| Boxed::new(*way, lanes)).collect();
    let mut found = Vec::new();
    for (index, one) in boxed.iter().enumerate() {
        for other in &boxed[index + 1..] {
            let (a, b) = (&lanes[one.lane], &lanes[other.lane]);
            // Whoever is on the one comes to the other, at once or over a short piece of a ring.
            let leads = |from: &Lane, to: LaneIndex| {
                from.exits
                    .iter()
                    .any(|exit| *exit == to || (lanes[*exit].way.is_some() && lanes[*exit].exits.contains(&to)))
            };
            let follows = leads(a, other.lane) || leads(b, one.lane);
            if a.entries.iter().any(|entry| b.entries.contains(entry)) || follows {
                continue;
            }
            let within = match (a.bike, b.bike) {
                (false, false) => CARS,
                (true, true) => BIKES,
                _ => BIKE_AND_CAR,
            };
            if let Some((own, others)) = near(one, other, within) {
                let span = |lane: &Lane, (first, last): (usize, usize)| {
                    let at = |index: f64| (index * lane.course.step()).clamp(0.0, lane.course.length());
                    (at(first as f64 - 0.5), at(last as f64 + 0.5))
                };
                let merging = a.exits.iter().any(|exit| b.exits.contains(exit));
                let (one_span, other_span) = (span(a, own), span(b, others));
                found.push(Conflict { one: one.lane, other: other.lane, one_span, other_span, merging });
            }
        }
    }
    found
}

/// The first and last point of each that is nearer than `within` to the other.
fn near(one: &Boxed, other: &Boxed, within: f64) -> Option<((usize, usize), (usize, usize))> {
    if !one.whole.is_near(&other.whole, within) {
        return None;
    }
    let (mut own, mut others) = ((usize::MAX, 0), (usize::MAX, 0));
    let widen = |span: &mut (usize, usize), index: usize| *span = (span.0.min(index), span.1.max(index));
    for (chunk, around) in one.chunks.iter().enumerate().filter(|(_, around)| around.is_near(&other.whole, within)) {
        for (other_chunk, _) in other.chunks.iter().enumerate().filter(|(_, beside)| around.is_near(beside, within)) {
            for (i, a) in one.points.iter().enumerate().skip(chunk * CHUNK).take(CHUNK) {
                for (j, b) in other.points.iter().enumerate().skip(other_chunk * CHUNK).take(CHUNK) {
                    if a.distance_squared(*b) < within * within {
                        widen(&mut own, i);
                        widen(&mut others, j);
                    }
                }
            }
        }
    }
    (own.0 != usize::MAX).then_some((own, others))
}
