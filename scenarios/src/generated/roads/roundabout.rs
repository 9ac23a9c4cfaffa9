//! Roundabouts: a ring of lanes, cut where streets join and leave it.
//!
//! ```text
//!              arm k             On the ring, counter-clockwise: `pass` in front of arm k, from where its exit leaves
//!             │ ↑ │ ↓            to where its entry joins; `arc` from there to where the exit of arm k + 1 leaves.
//!       exit ╭╯   ╰╮ entry
//!       ◀────┴ pass┴──── arc
//! ```

use std::f64::consts::{FRAC_PI_2, TAU};

use world::geometry::{Point, Pose};
use world::map::{METERS_PER_SECOND_PER_MPH, RoadEdgeKind};

use super::super::curve::{Curve, Piece};
use super::builder::{Builder, NewLane};
use super::junctions::Through;
use super::place::Place;
use super::{LaneIndex, Turn, Way, flat};

/// From the ring's centre line to the stop lines (m).
pub(super) const APPROACH: f64 = 11.0;
/// Width of the ring's lane (m), and from its sides to the curbs.
const WIDTH: f64 = 4.6;
const GUTTER: f64 = 0.4;
/// Exits leave, and entries join, this far (rad) from their arm's direction, where there is room.
const SPREAD: f64 = 0.72;
/// Of the angle between two arms, the entry of one and the exit of the other take this much each.
const SHARE: f64 = 0.4;
const LIMIT_MPH: f64 = 15.0;

/// A circle driven counter-clockwise.
#[derive(Clone, Copy)]
struct Ring {
    centre: Point,
    radius: f64,
}

impl Ring {
    /// On the ring in the direction `angle` from its centre.
    fn pose(&self, angle: f64) -> Pose {
        let at = self.centre + Point::unit(angle) * self.radius;
        Pose::new(at.x, at.y, angle + FRAC_PI_2)
    }

    fn arc(&self, from: f64, to: f64) -> Curve {
        let length = ((to - from) * self.radius).max(0.1);
        let piece = Piece { length, from: 1.0 / self.radius, to: 1.0 / self.radius };
        Curve::new(self.pose(from), &[piece]).ending_at(self.pose(to))
    }
}

/// Lays the ring with what leads into it and out of it. Ways of the ring lead from the arm where they begin: to the same one in front of it,
/// to the next one between the two; those into it and out of it belong to their own arm alone.
pub(super) fn lay(builder: &mut Builder, centre: Point, radius: f64, places: &[Place<'_>]) -> Through {
    let ring = Ring { centre, radius };
    let count = places.len();
    let next = |arm: usize| (arm + 1) % count;
    let gap = |arm: usize| {
        let gap = (places[next(arm)].arm.heading - places[arm].arm.heading).rem_euclid(TAU);
        if gap == 0.0 { TAU } else { gap }
    };
    // For each arm where its exit leaves and its entry joins.
    let spread = |gap: f64| SPREAD.min(SHARE * gap);
    let before = |arm: usize| gap((arm + count - 1) % count);
    let exits: Vec<f64> = (0..count).map(|arm| places[arm].arm.heading - spread(before(arm))).collect();
    let entries: Vec<f64> = (0..count).map(|arm| places[arm].arm.heading + spread(gap(arm))).collect();

    let junction = builder.roads.junctions.len();
    let way = |from: usize, to: usize, turn: Turn| Some(Way { junction, from, to, turn });
    let piece = |builder: &mut Builder, course: Curve, way: Option<Way>| {
        builder.lane(NewLane { course, width: WIDTH, limit_mph: LIMIT_MPH, bike: false, way, solid: true, lot: false })
    };
    let mut through = Through::default();
    let mut passes = Vec::new();
    let mut arcs = Vec::new();
    for arm in 0..count {
        passes.push(piece(builder, ring.arc(exits[arm], entries[arm]), way(arm, arm, Turn::Straight)));
        let to = entries[arm] + (exits[next(arm)] - entries[arm]).rem_euclid(TAU);
        arcs.push(piece(builder, ring.arc(entries[arm], to), way(arm, next(arm), Turn::Straight)));
    }
    for arm in 0..count {
        builder.link(passes[arm], arcs[arm]);
        builder.link(arcs[arm], passes[next(arm)]);
        let place = &places[arm];
        let limit = |builder: &Builder, lane: LaneIndex| {
            (builder.roads.lanes[lane].limit / METERS_PER_SECOND_PER_MPH).min(20.0).round()
        };
        let mut entering = Vec::new();
        for lane in place.inbound.iter().copied().chain(place.bike_in) {
            let (course, bike) = (&builder.roads.lanes[lane].course, builder.roads.lanes[lane].bike);
            let (course, limit_mph) = (Curve::join(course.end(), ring.pose(entries[arm])), limit(builder, lane));
            let (width, way) = (builder.roads.lanes[lane].width, way(arm, arm, Turn::Right));
            let entry = builder.lane(NewLane { course, width, limit_mph, bike, way, solid: true, lot: false });
            builder.link(lane, entry);
            builder.link(entry, arcs[arm]);
            entering.push(entry);
        }
        let before = arcs[(arm + count - 1) % count];
        let mut leaving = Vec::new();
        for lane in place.outbound.iter().copied().chain(place.bike_out) {
            let (course, bike) = (&builder.roads.lanes[lane].course, builder.roads.lanes[lane].bike);
            let (course, limit_mph) = (Curve::join(ring.pose(exits[arm]), course.start()), limit(builder, lane));
            let (width, way) = (builder.roads.lanes[lane].width, way(arm, arm, Turn::Right));
            let exit = builder.lane(NewLane { course, width, limit_mph, bike, way, solid: true, lot: false });
            builder.link(before, exit);
            builder.link(exit, lane);
            leaving.push(exit);
        }
        through.all.extend([passes[arm], arcs[arm]]);
        through.all.extend(entering.iter().chain(&leaving));
        through.entering.push(entering);
        through.leaving.push(leaving);
    }
    lay_curbs(builder, ring, places, (&entries, &exits));
    through
}

/// The island's curb, which goes round clockwise, and the outer curbs from each arm to the next.
fn lay_curbs(builder: &mut Builder, ring: Ring, places: &[Place<'_>], (entries, exits): (&[f64], &[f64])) {
    let island = Ring { radius: ring.radius - 0.5 * WIDTH - GUTTER, ..ring };
    if island.radius > 0.5 {
        let mut points = island.arc(0.0, TAU).reversed().polyline();
        if let Some(first) = points.first().copied() {
            points.pop();
            points.push(first);
        }
        builder.edge(RoadEdgeKind::Median, points);
    }
    let outer = Ring { radius: ring.radius + 0.5 * WIDTH + GUTTER, ..ring };
    for (arm, place) in places.iter().enumerate() {
        let next = (arm + 1) % places.len();
        let (start, end) = (place.curb_ends.0, places[next].curb_ends.1);
        let from = entries[arm];
        let to = from + (exits[next] - from).rem_euclid(TAU);
        let onto = Curve::join(start, outer.pose(from));
        let off = Curve::join(outer.pose(to), end);
        let course = onto.then(&outer.arc(from, to)).then(&off);
        let mut points = course.polyline();
        // Exactly where the streets' curbs end and begin, so that they are one.
        if let [first, .., last] = points.as_mut_slice() {
            (*first, *last) = (flat(start.position()), flat(end.position()));
        }
        builder.edge(RoadEdgeKind::Boundary, points);
    }
}
