//! Which lane the AV is in, whether its box lies wholly in one, how far it has driven against a lane's direction, and how
//! fast it may go there: what nuPlan asks its lane polygons for, asked as nuPlan asks.
//!
//! WOMD has center lines and, along most of them, boundaries. What stands for a polygon is the strip from one boundary to
//! the other. An intersection's lanes stand for nuPlan's lane connectors.
//!
//! | module | what |
//! | --- | --- |
//! | `strip` | lanes as strips of ground; which of them hold a point |
//! | `held` | the lanes that hold a point |
//! | `boundaries` | how far a lane reaches to either side |
//! | `driven` | the lanes of the AV's centre: direction, speed limit |
//! | `corners` | the lanes of the box's corners: whether it is in one lane |

mod boundaries;
mod corners;
mod driven;
mod held;
mod strip;

use world::geometry::Point;

use self::corners::{Corners, in_one_lane};
use self::driven::DrivenLanes;
use self::held::Held;
use super::Body;

pub use self::driven::Driven;
pub use self::strip::{Lanes, Strip};

/// Tells who drives against the traffic. What it needs is kept from place to place.
#[derive(Clone, Debug, Default)]
pub struct Against(Held);

impl Against {
    /// Whether every lane that holds `place`, on ground at the height `ground` (m), points away from `forward`, and one does.
    pub fn is_oncoming(&mut self, lanes: &Lanes, place: Point, ground: f64, forward: Point) -> bool {
        lanes.hold(&mut self.0, place, ground, forward);
        !self.0.lanes.is_empty() && self.0.lanes.iter().all(|(_, place)| place.alignment < 0.0)
    }
}

/// Metres driven against a lane within a second from which on the AV drives the wrong way (nuPlan's compliance threshold).
pub const WRONG_WAY: f64 = 2.0;

/// Follows the AV from lane to lane. Its corners are followed only if somebody asks for them: they cost four times what its centre does.
#[derive(Clone, Debug, Default)]
pub struct LaneTracker {
    driven: DrivenLanes,
    corners: Corners,
}

impl LaneTracker {
    /// The reading at the next step, of an AV on ground at the height `ground` (m).
    pub fn read(&mut self, lanes: &Lanes, av: &Body, ground: f64) -> Driven {
        self.corners.wait(av, ground);
        self.driven.read(lanes, av, ground)
    }

    /// Whether the AV's box lies wholly in one lane now, or across ones that lead into each other.
    pub fn in_one_lane(&mut self, lanes: &Lanes) -> bool {
        in_one_lane(lanes, self.corners.now(lanes))
    }

    /// How far (m) a corner of the AV's box is outside of the lanes that its centre is in now; 0 where any lane holds it, infinite where
    /// no lane holds the centre.
    pub fn corner_outside(&mut self, lanes: &Lanes, corner: usize, place: Point) -> f64 {
        let from_centre = self.driven.now().iter().map(|lane| lanes.distance(*lane, place));
        if self.corners.now(lanes)[corner].is_empty() { from_centre.fold(f64::INFINITY, f64::min) } else { 0.0 }
    }

    /// What the samples so far say of direction and speed limit, now that it is known where the AV went: in an intersection that tells
    /// which of several lanes it drove in.
    #[must_use]
    pub fn settle(&self, lanes: &Lanes) -> Vec<Driven> {
        self.driven.settle(lanes)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use world::geometry::{Point3, Pose};
    use world::map::{BoundarySegment, Lane, LaneKind, Map, MapId, RoadLine, RoadLineKind};
    use world::scene::AgentState;
    use world::vehicle::WHEELBASE;

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
        Lanes::of(
            &Arc::new(map.clone()),
            &Level::along(&[Point3::new(-60.0, 0.0, 0.0), Point3::new(60.0, 0.0, 0.0)], 5.0),
        )
    }

    fn av(x: f64, y: f64, heading: f64) -> Body {
        let Pose { x, y, heading } = Pose::new(x, y, heading);
        Body::of(AgentState { x, y, heading, length: 5.0, width: 2.0, ..AgentState::default() })
    }

    /// All that the lanes say of the AV at one step.
    #[derive(Debug, Default)]
    struct Reading {
        in_one_lane: bool,
        in_intersection: bool,
        backward_travel: f64,
        speed_limit: f64,
    }

    fn read_next(tracker: &mut LaneTracker, lanes: &Lanes, av: &Body, ground: f64) -> Reading {
        let Driven { backward_travel, speed_limit } = tracker.read(lanes, av, ground);
        let in_intersection = lanes.is_intersection(av.rear_axle(WHEELBASE), ground);
        Reading { in_one_lane: tracker.in_one_lane(lanes), in_intersection, backward_travel, speed_limit }
    }

    fn read(map: &Map, at: &[Body]) -> Reading {
        let lanes = lanes(map);
        let mut tracker = LaneTracker::default();
        at.iter().map(|av| read_next(&mut tracker, &lanes, av, 0.0)).last().unwrap_or_default()
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
    }

    #[test]
    fn an_intersection_begins_where_the_rear_axle_enters_it() {
        let mut within = lane(2, (0.0, 0.0), (40.0, 0.0));
        within.interpolating = true;
        let map = Map { lanes: vec![lane(1, (-40.0, 0.0), (0.0, 0.0)), within], ..Map::default() };
        assert!(!read(&map, &[av(1.4, 0.0, 0.0)]).in_intersection, "1.461 m from centre to rear axle");
        assert!(read(&map, &[av(1.5, 0.0, 0.0)]).in_intersection);
        // On no lane, but beside one of the intersection's.
        assert!(read(&map, &[av(20.0, 5.0, 0.0)]).in_intersection);
        assert!(!read(&map, &[av(20.0, 8.0, 0.0)]).in_intersection);
    }

    #[test]
    fn a_lane_is_kept_against_its_direction_as_long_as_it_holds_the_centre() {
        // Two lanes on each other that point a little apart: which fits the heading better changes from step to step.
        let wriggling = |id, sign: f64| {
            let point = |step: i32| {
                let x = 20.0 - f64::from(step);
                Point3::new(x, sign * 0.02 * libm::sin(x * 1.7), 0.0)
            };
            Lane { centerline: (0..=40).map(point).collect(), ..lane(id, (20.0, 0.0), (-20.0, 0.0)) }
        };
        let map = Map { lanes: vec![wriggling(1, 1.0), wriggling(2, -1.0)], ..Map::default() };
        let against: Vec<Body> = (0..30).map(|step| av(-10.0 + 0.8 * f64::from(step), 0.3, 0.0)).collect();
        let travel = read(&map, &against).backward_travel;
        assert!((travel - 8.8).abs() < 0.05, "{travel}");
    }

    #[test]
    fn a_lane_on_a_bridge_holds_nobody_below_and_makes_no_intersection() {
        let mut bridge = lane(2, (0.0, -20.0), (0.0, 20.0));
        bridge.centerline.iter_mut().for_each(|point| point.z = 6.0);
        let map = Map { lanes: vec![lane(1, (-20.0, 0.0), (20.0, 0.0)), bridge], ..Map::default() };
        // The route goes over both.
        let route = [(-60.0, 0.0, 0.0), (60.0, 0.0, 0.0), (30.0, -30.0, 6.0), (0.0, -20.0, 6.0), (0.0, 60.0, 6.0)];
        let lanes = Lanes::of(&Arc::new(map), &Level::along(&route.map(|(x, y, z)| Point3::new(x, y, z)), 5.0));
        let at = |ground| read_next(&mut LaneTracker::default(), &lanes, &av(0.0, 0.0, 0.0), ground);
        assert_eq!((lanes.strips().len(), at(0.0).in_intersection, at(6.0).in_intersection), (2, false, false));
        assert!(at(0.0).in_one_lane && !at(6.0).in_one_lane, "above, the car lies across a lane");
    }

    #[test]
    fn the_seam_of_a_lane_that_goes_round_is_no_way_back() {
        let at = |turn: f64| Point::unit(turn * std::f64::consts::TAU) * 12.0;
        let centerline = (0..=100).map(|k| at(f64::from(k) / 100.0)).map(|p| Point3::new(p.x, p.y, 0.0)).collect();
        let circle = Lane { centerline, ..lane(1, (0.0, 0.0), (1.0, 0.0)) };
        let map = Map { lanes: vec![circle], ..Map::default() };
        let drive = |sign: f64| {
            let state = |step: i32| {
                let turn = sign * (0.011 * f64::from(step) - 0.5);
                let heading = (turn + 0.25 * sign) * std::f64::consts::TAU;
                av(at(turn).x, at(turn).y, heading)
            };
            let states: Vec<Body> = (0..80).map(state).collect();
            let lanes = lanes(&map);
            let mut tracker = LaneTracker::default();
            states.iter().map(|av| tracker.read(&lanes, av, 0.0).backward_travel).collect::<Vec<_>>()
        };
        assert!(drive(1.0).iter().all(|back| *back < 1e-9), "{:?}", drive(1.0));
        // Against it: 0.83 m a step, also across the seam.
        assert!(drive(-1.0)[12..].iter().all(|back| (back - 11.0 * 0.829).abs() < 0.9), "{:?}", drive(-1.0));
    }

    #[test]
    fn backward_travel_begins_late_after_a_start_in_no_lane() {
        let map = Map { lanes: vec![lane(1, (20.0, 0.0), (-20.0, 0.0))], ..Map::default() };
        let against: Vec<Body> = (0..8).map(|step| av(-20.5 + f64::from(step), 0.0, 0.0)).collect();
        // The first sample is beyond the lane's end; the first two in it count nothing.
        assert!((read(&map, &against).backward_travel - 5.0).abs() < 1e-9);
        assert!((read(&map, &against[1..]).backward_travel - 6.0).abs() < 1e-9);
    }

    #[test]
    fn a_car_longer_than_a_lane_is_in_one_across_three() {
        let linked = |lane: Lane, entries: &[i64], exits: &[i64]| Lane {
            entries: entries.iter().copied().map(MapId).collect(),
            exits: exits.iter().copied().map(MapId).collect(),
            ..lane
        };
        let before = linked(lane(1, (-40.0, 0.0), (-1.0, 0.0)), &[], &[2]);
        let short = linked(lane(2, (-1.0, 0.0), (1.0, 0.0)), &[1], &[3]);
        let after = linked(lane(3, (1.0, 0.0), (40.0, 0.0)), &[2], &[]);
        let apart = linked(lane(4, (1.0, 0.0), (40.0, 0.0)), &[], &[]);
        let map = |after: &Lane| Map { lanes: vec![before.clone(), short.clone(), after.clone()], ..Map::default() };
        assert!(read(&map(&after), &[av(0.0, 0.0, 0.0)]).in_one_lane);
        assert!(!read(&map(&apart), &[av(0.0, 0.0, 0.0)]).in_one_lane);
    }

    #[test]
    fn where_the_av_went_tells_which_connector_it_drove() {
        // Two lanes part in an intersection; the AV starts where both hold it, and turns off.
        let connector = |lane: Lane, exit| Lane { interpolating: true, exits: vec![MapId(exit)], ..lane };
        let straight = connector(lane(1, (-20.0, 0.0), (20.0, 0.0)), 3);
        let turning = connector(lane(2, (-20.0, 0.0), (20.0, 12.0)), 4);
        let limit = |lane: Lane, speed_limit_mph| Lane { speed_limit_mph, ..lane };
        let fast = limit(lane(3, (20.0, 0.0), (60.0, 0.0)), 50.0);
        let slow = limit(lane(4, (20.0, 12.0), (60.0, 24.0)), 20.0);
        let lanes = lanes(&Map { lanes: vec![straight, turning, fast, slow], ..Map::default() });
        let heading = libm::atan(0.3);
        let mut tracker = LaneTracker::default();
        let way = (0..30).map(|step| -19.0 + 2.0 * f64::from(step)).map(|x| av(x, 0.3 * (x + 20.0), heading));
        let online: Vec<f64> = way.map(|av| tracker.read(&lanes, &av, 0.0).speed_limit).collect();
        let settled: Vec<f64> = tracker.settle(&lanes).iter().map(|driven| driven.speed_limit).collect();
        assert!((online[0] - 50.0 * 0.447_04).abs() < 1e-9, "the larger of both");
        assert!(settled.iter().all(|limit| (limit - 20.0 * 0.447_04).abs() < 1e-9), "{settled:?}");
    }

    /// Backward travel of an AV that drives a lane of so many rounds on a circle of 12 m from its beginning, 1 m a step. The lane climbs
    /// by so much (m) a round.
    fn wind(rounds: f64, climb: f64, metres: u32) -> Vec<f64> {
        let point = |step: i32| {
            let round = f64::from(step) / 150.0;
            let at = Point::unit(round * std::f64::consts::TAU) * 12.0;
            Point3::new(at.x, at.y, climb * round)
        };
        let centerline: Vec<Point3> = (0..=(rounds * 150.0) as i32).map(point).collect();
        let level = Level::along(&centerline, 5.0);
        let lane = Lane { centerline, ..lane(1, (0.0, 0.0), (1.0, 0.0)) };
        let lanes = Lanes::of(&Arc::new(Map { lanes: vec![lane], ..Map::default() }), &level);
        let mut tracker = LaneTracker::default();
        let reading = |metre: u32| {
            let angle = f64::from(metre) / 12.0;
            let at = Point::unit(angle) * 12.1;
            let body = av(at.x, at.y, angle + std::f64::consts::FRAC_PI_2);
            tracker.read(&lanes, &body, climb * angle / std::f64::consts::TAU).backward_travel
        };
        (0..metres).map(reading).collect()
    }

    #[test]
    fn who_drives_round_within_one_lane_never_drives_against_it() {
        for (rounds, climb, metres) in [(1.5, 0.0, 105), (1.5, 4.0, 105), (3.0, 4.0, 220), (3.0, 0.0, 220)] {
            let back = wind(rounds, climb, metres);
            assert!(back.iter().all(|back| *back < 1e-9), "{rounds} rounds, {climb} m up a round: {back:?}");
        }
    }

    #[test]
    fn a_lane_that_comes_down_from_a_bridge_holds_nobody_below_it() {
        let below = Lane { speed_limit_mph: 25.0, ..lane(1, (-20.0, 0.0), (20.0, 0.0)) };
        let mut above = Lane { speed_limit_mph: 60.0, ..lane(2, (20.0, 0.5), (-20.0, -0.5)) };
        // 6 m above where the AV drives; at its end it is on the road's level.
        above.centerline.iter_mut().for_each(|point| point.z = (20.0 + point.x).min(6.0));
        let map = Map { lanes: vec![below, above], ..Map::default() };
        let drive: Vec<Body> = (0..15).map(|step| av(f64::from(step), 0.0, 0.0)).collect();
        let reading = read(&map, &drive);
        assert!((reading.speed_limit - 25.0 * 0.447_04).abs() < 1e-9 && !reading.in_intersection, "{reading:?}");
        assert_eq!(reading.backward_travel, 0.0);
        let against: Vec<Body> = drive.into_iter().rev().collect();
        assert!(read(&map, &against).backward_travel > 8.0, "the lane below, not the one above that goes its way");
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
