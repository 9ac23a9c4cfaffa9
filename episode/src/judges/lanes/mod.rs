//! Which lane the AV is in, whether its box lies wholly in one, how far it has driven against a lane's direction, and how
//! fast it may go there: what nuPlan asks its lane polygons for.
//!
//! WOMD has center lines and, along most of them, boundaries. What stands for a polygon is the strip from one boundary to
//! the other (`strip.rs`). As in nuPlan, the AV's lane is kept while it holds the AV's centre, then looked for among the lanes
//! that it leads to, then in the whole map. In an intersection many lanes hold the same point; nuPlan picks by where the AV ends
//! up, we by the direction it looks to.

mod strip;

use world::plan::STEP_SECONDS;

use self::strip::{ALIGNED, Place, nearer};
use super::Body;

pub use self::strip::Lanes;

/// Metres driven against a lane within a second from which on the AV drives the wrong way (nuPlan's compliance threshold).
pub const WRONG_WAY: f64 = 2.0;

/// Samples of that second, both ends included.
const SECOND: usize = 1 + (1.0 / STEP_SECONDS) as usize;

/// So far (m) outside of its lane the AV still follows it in an intersection (nuPlan's distance).
const CUTTING: f64 = 5.0;

/// What the lanes say of the AV at one step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LaneReading {
    /// Whether its box lies wholly in one lane, or in one and those it leads to or comes from.
    pub in_one_lane: bool,
    /// Whether its lane is one of an intersection.
    pub in_intersection: bool,
    /// Metres driven against the lane's direction in the last second, never negative.
    pub backward_travel: f64,
    /// m/s, 0 where it is not known.
    pub speed_limit: f64,
}

/// Follows the AV from lane to lane.
#[derive(Clone, Debug, Default)]
pub struct LaneTracker {
    /// The AV's lane, and its segment in it.
    lane: Option<(usize, usize)>,
    /// The lane that the last progress was measured in, and the AV's station in it.
    measured: Option<(usize, Option<f64>)>,
    /// Progress along the lane (m) at each of the last samples.
    progress: [f64; SECOND],
    next: usize,
}

impl LaneTracker {
    /// The reading at the next step.
    pub fn read(&mut self, lanes: &Lanes, av: &Body) -> LaneReading {
        let found = self.find(lanes, av);
        self.lane = found.map(|(lane, place)| (lane, place.segment));
        self.progress[self.next] = found.map_or(0.0, |(lane, place)| self.measure(lane, place.station));
        self.next = (self.next + 1) % SECOND;
        let strip = found.map(|(lane, _)| &lanes.strips[lane]);
        LaneReading {
            in_one_lane: found.is_some_and(|(lane, place)| in_one_lane(lanes, lane, place.segment, av)),
            in_intersection: strip.is_some_and(|strip| strip.intersection),
            backward_travel: (-self.progress.iter().sum::<f64>()).max(0.0),
            speed_limit: strip.map_or(0.0, |strip| strip.speed_limit),
        }
    }

    fn find(&self, lanes: &Lanes, av: &Body) -> Option<(usize, Place)> {
        let (center, forward) = (av.outline.center, av.outline.forward);
        let current = self.lane.map(|(lane, segment)| (lane, lanes.strips[lane].place(segment, center, forward)));
        if let Some((lane, place)) = current {
            if place.is_way(0.0) {
                return current;
            }
            let exits = lanes.strips[lane].exits.iter();
            let exits = exits.map(|exit| (*exit, lanes.strips[*exit].place(0, center, forward)));
            let best = exits.filter(|(_, place)| place.is_way(0.0)).min_by(nearer);
            if best.is_some() {
                return best;
            }
        }
        // One that points the AV's way before one that crosses it, that before one that comes towards it.
        let candidates = lanes.holding(center, forward);
        let aligned = candidates.iter().filter(|(_, place)| place.alignment >= ALIGNED).min_by(nearer);
        let found = aligned
            .or_else(|| candidates.iter().max_by(|a, b| a.1.alignment.total_cmp(&b.1.alignment).then(b.0.cmp(&a.0))));
        // Who cuts a corner within an intersection keeps his lane, rather than take one that only crosses it.
        let in_intersection = |lane: usize| lanes.strips[lane].intersection;
        let kept = current.filter(|(lane, place)| in_intersection(*lane) && place.is_way(CUTTING));
        let leads_on = |(lane, place): (usize, Place)| !in_intersection(lane) && place.alignment >= ALIGNED;
        kept.filter(|_| !found.is_some_and(leads_on)).or(found)
    }

    /// Progress in `lane` since the last sample (m), as nuPlan counts it: none at the first two samples in a new lane.
    fn measure(&mut self, lane: usize, station: f64) -> f64 {
        match self.measured {
            Some((same, before)) if same == lane => {
                self.measured = Some((lane, Some(station)));
                before.map_or(0.0, |before| station - before)
            }
            Some(_) => {
                self.measured = Some((lane, None));
                0.0
            }
            None => {
                self.measured = Some((lane, Some(station)));
                0.0
            }
        }
    }
}

fn in_one_lane(lanes: &Lanes, lane: usize, segment: usize, av: &Body) -> bool {
    let corners = av.outline.corners();
    lanes.holds_all(lane, segment, &corners)
        || lanes
            .holding(av.outline.center, av.outline.forward)
            .iter()
            .any(|(other, place)| other != lane && lanes.holds_all(other, place.segment, &corners))
}

#[cfg(test)]
mod tests {
    use world::geometry::{Point3, Pose};
    use world::map::{BoundarySegment, Lane, LaneKind, Map, MapId, RoadLine, RoadLineKind};
    use world::scene::AgentState;

    use super::*;
    use crate::judges::level::Level;

    /// A lane from one point to another, in steps of a metre.
    fn lane(id: i64, from: (f64, f64), to: (f64, f64)) -> Lane {
        let steps = 40;
        let point = |step: i32| {
            let share = f64::from(step) / f64::from(steps);
            Point3::new(from.0 + (to.0 - from.0) * share, from.1 + (to.1 - from.1) * share, 0.0)
        };
        let centerline = (0..=steps).map(point).collect();
        Lane { id: MapId(id), kind: LaneKind::SurfaceStreet, centerline, ..Lane::default() }
    }

    fn lanes(map: &Map) -> Lanes {
        Lanes::of(map, &Level::along(&[Point3::new(-60.0, 0.0, 0.0), Point3::new(60.0, 0.0, 0.0)]))
    }

    fn av(x: f64, y: f64, heading: f64) -> Body {
        let Pose { x, y, heading } = Pose::new(x, y, heading);
        Body::of(AgentState { x, y, heading, length: 5.0, width: 2.0, ..AgentState::default() })
    }

    fn read(map: &Map, at: &[Body]) -> LaneReading {
        let lanes = lanes(map);
        let mut tracker = LaneTracker::default();
        at.iter().map(|av| tracker.read(&lanes, av)).last().unwrap_or_default()
    }

    #[test]
    fn a_box_is_in_one_lane_until_a_corner_leaves_it() {
        let map = Map { lanes: vec![lane(1, (-20.0, 0.0), (20.0, 0.0))], ..Map::default() };
        assert!(read(&map, &[av(0.0, 0.82, 0.0)]).in_one_lane);
        assert!(!read(&map, &[av(0.0, 0.84, 0.0)]).in_one_lane, "1.84 m is beyond half of 12 feet");
        assert!(!read(&map, &[av(0.0, 0.0, 0.4)]).in_one_lane);
    }

    #[test]
    fn a_boundary_of_the_map_comes_before_the_usual_width() {
        let mut narrow = lane(1, (-20.0, 0.0), (20.0, 0.0));
        let feature = MapId(9);
        narrow.left_boundaries =
            vec![BoundarySegment { lane_start_index: 0, lane_end_index: 40, feature, kind: RoadLineKind::Unknown }];
        let polyline = vec![Point3::new(-20.0, 1.4, 0.0), Point3::new(20.0, 1.4, 0.0)];
        let line = RoadLine { id: feature, kind: RoadLineKind::SolidSingleWhite, polyline };
        let map = Map { lanes: vec![narrow], road_lines: vec![line], ..Map::default() };
        assert!(read(&map, &[av(0.0, 0.39, 0.0)]).in_one_lane);
        assert!(!read(&map, &[av(0.0, 0.41, 0.0)]).in_one_lane);
        assert!(read(&map, &[av(0.0, -0.8, 0.0)]).in_one_lane, "to the right nothing is named");
    }

    #[test]
    fn a_box_across_the_seam_of_two_lanes_is_in_one() {
        let mut first = lane(1, (-40.0, 0.0), (0.0, 0.0));
        let mut second = lane(2, (0.0, 0.0), (40.0, 0.0));
        let apart = Map { lanes: vec![first.clone(), second.clone()], ..Map::default() };
        assert!(!read(&apart, &[av(0.5, 0.0, 0.0)]).in_one_lane);
        first.exits = vec![MapId(2)];
        second.entries = vec![MapId(1)];
        let joined = Map { lanes: vec![first, second], ..Map::default() };
        assert!(read(&joined, &[av(0.5, 0.0, 0.0)]).in_one_lane);
        assert!(read(&joined, &[av(-0.5, 0.0, 0.0)]).in_one_lane);
    }

    #[test]
    fn a_lane_that_is_crossed_is_an_intersection_with_the_larger_limit_around() {
        let limit = |lane: Lane, speed_limit_mph| Lane { speed_limit_mph, ..lane };
        let before = limit(lane(1, (-60.0, 0.0), (-20.0, 0.0)), 25.0);
        let within =
            Lane { entries: vec![MapId(1)], exits: vec![MapId(3)], ..limit(lane(2, (-20.0, 0.0), (20.0, 0.0)), 10.0) };
        let after = limit(lane(3, (20.0, 0.0), (60.0, 0.0)), 40.0);
        let crossing = lane(4, (0.3, -20.3), (0.3, 19.7));
        let map = Map { lanes: vec![before, within, after, crossing], ..Map::default() };
        let reading = read(&map, &[av(5.0, 0.0, 0.0)]);
        assert!(reading.in_intersection && (reading.speed_limit - 40.0 * 0.447_04).abs() < 1e-9, "{reading:?}");
        assert!(!read(&map, &[av(-40.0, 0.0, 0.0)]).in_intersection);
        // Where both hold it, its heading decides.
        assert!(read(&map, &[av(0.3, 0.0, 1.57)]).speed_limit == 0.0);
    }

    #[test]
    fn backward_travel_is_summed_over_a_second() {
        let map = Map { lanes: vec![lane(1, (20.0, 0.0), (-20.0, 0.0))], ..Map::default() };
        let against: Vec<Body> = (0..30).map(|step| av(-10.0 + 0.5 * f64::from(step), 0.0, 0.0)).collect();
        assert!((read(&map, &against[..5]).backward_travel - 2.0).abs() < 1e-9);
        assert!((read(&map, &against).backward_travel - 5.5).abs() < 1e-9, "eleven samples, as nuPlan sums them");
        let along: Vec<Body> = against.into_iter().rev().collect();
        assert_eq!(read(&map, &along).backward_travel, 0.0);
    }
}
