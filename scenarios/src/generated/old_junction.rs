//! Four roads that meet at the origin.

use std::f64::consts::FRAC_PI_2;

use world::geometry::{Point, Point3, Pose};
use world::map::MapId;

use super::old_curve::{Curve, Piece, straight, turn};
use super::old_roads::{GUTTER, LANE_WIDTH, MapBuilder, Road, RoadLanes};

/// Where a path leads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Way {
    Left,
    Straight,
    Right,
}

/// A junction of four equal arms: 0 comes from the south, 1 from the east, 2 from the north, 3 from the west.
#[derive(Clone, Copy, Debug)]
pub(super) struct Junction {
    /// Lanes of each direction.
    pub(super) lanes: usize,
    /// From the centre to the stop lines (m).
    pub(super) stop: f64,
    /// From the centre to the arms' outer ends (m).
    pub(super) reach: f64,
    /// Speed limit (mph).
    pub(super) speed_limit_mph: f64,
}

/// Radius of the curbs at the corners (m), of right and of left turns, each with its clothoid's length.
const CORNER: (f64, f64) = (5.5, 1.0);
const RIGHT_TURN: (f64, f64) = (8.5, 4.0);
const LEFT_TURN: (f64, f64) = (12.0, 6.0);

impl Junction {
    /// Unit vector from the centre along an arm.
    fn outward(arm: usize) -> Point {
        [Point::new(0.0, -1.0), Point::new(1.0, 0.0), Point::new(0.0, 1.0), Point::new(-1.0, 0.0)][arm % 4]
    }

    /// The point at `distance` from the centre along an arm, `left` (m) to the left of the way in.
    pub(super) fn point(arm: usize, distance: f64, left: f64) -> Point {
        let out = Self::outward(arm);
        out * distance + Point::new(out.y, -out.x) * left
    }

    fn half_width(&self) -> f64 {
        self.lanes as f64 * LANE_WIDTH + GUTTER
    }

    fn arm(&self, arm: usize) -> Road {
        Road {
            middle: Curve::line(Self::point(arm, self.reach, 0.0), Self::point(arm, self.stop, 0.0)),
            forward: self.lanes,
            backward: self.lanes,
            speed_limit_mph: self.speed_limit_mph,
            curbs: false,
        }
    }

    /// From the inbound lane's end to the outbound lane's start. Right turns leave from the outer lane, left turns from the inner.
    fn connector(&self, arm: usize, slot: usize, way: Way) -> Curve {
        let start = self.arm(arm).forward_lane(slot).end();
        let offset = (slot as f64 + 0.5) * LANE_WIDTH;
        let pieces = match way {
            Way::Straight => vec![straight(2.0 * self.stop)],
            Way::Right => corner(-FRAC_PI_2, RIGHT_TURN, self.stop - offset),
            Way::Left => corner(FRAC_PI_2, LEFT_TURN, self.stop + offset),
        };
        Curve::new(start, &pieces)
    }

    fn exit(arm: usize, way: Way) -> usize {
        (arm + match way {
            Way::Right => 1,
            Way::Straight => 2,
            Way::Left => 3,
        }) % 4
    }

    /// The whole way from an arm's outer end through the junction to another's.
    pub(super) fn path(&self, arm: usize, slot: usize, way: Way) -> Curve {
        let inbound = self.arm(arm).forward_lane(slot);
        let outbound = self.arm(Self::exit(arm, way)).backward_lane(slot);
        inbound.then(&self.connector(arm, slot, way)).then(&outbound)
    }

    /// Station of the stop line on every path.
    pub(super) fn stop_station(&self) -> f64 {
        self.reach - self.stop
    }

    /// Where somebody on foot crosses an arm, from its inbound side to the other, from one pavement to the other.
    pub(super) fn crossing(&self, arm: usize) -> Curve {
        let (distance, side) = (self.stop - 2.5, self.half_width() + 1.5);
        Curve::line(Self::point(arm, distance, -side), Self::point(arm, distance, side))
    }

    /// Lays the junction. For each arm the lanes that begin at its stop line, with the place to stop.
    pub(super) fn lay(&self, map: &mut MapBuilder) -> [Vec<(MapId, Point3)>; 4] {
        let arms: [RoadLanes; 4] = std::array::from_fn(|arm| map.road(&self.arm(arm)));
        let mut controlled: [Vec<(MapId, Point3)>; 4] = Default::default();
        for arm in 0..4 {
            for slot in 0..self.lanes {
                let ways = [(Way::Left, slot == 0), (Way::Straight, true), (Way::Right, slot + 1 == self.lanes)];
                for (way, _) in ways.into_iter().filter(|(_, allowed)| *allowed) {
                    let course = self.connector(arm, slot, way);
                    let lane = map.lane(&course, self.speed_limit_mph, true);
                    map.link(arms[arm].forward[slot].1, lane);
                    map.link(lane, arms[Self::exit(arm, way)].backward[slot].0);
                    controlled[arm].push((lane, flat(course.start().position())));
                }
            }
            self.lay_curb(arm, map);
            let (near, far, side) = (self.stop - 1.0, self.stop - 4.0, self.half_width());
            let corners = [(near, -side), (near, side), (far, side), (far, -side)];
            map.crosswalk(corners.map(|(distance, left)| flat(Self::point(arm, distance, left))).to_vec());
        }
        controlled
    }

    /// The curb on the right of the way in, around the corner, and out along the next arm.
    fn lay_curb(&self, arm: usize, map: &mut MapBuilder) {
        let start = Self::point(arm, self.reach, -self.half_width());
        let heading = (Self::outward(arm) * -1.0).heading();
        let pieces = corner(-FRAC_PI_2, CORNER, self.reach - self.half_width());
        map.edge(&Curve::new(Pose::new(start.x, start.y, heading), &pieces));
    }

    /// Puts a stop sign at an arm's stop line.
    pub(super) fn lay_stop_sign(&self, arm: usize, lanes: &[(MapId, Point3)], map: &mut MapBuilder) {
        let position = flat(Self::point(arm, self.stop, -self.half_width()));
        map.stop_sign(lanes.iter().map(|(lane, _)| *lane).collect(), position);
    }
}

/// A right-angled turn whose legs, up to where they would meet, are `leg` long.
fn corner(angle: f64, (radius, ramp): (f64, f64), leg: f64) -> Vec<Piece> {
    let bend = turn(angle, radius, ramp);
    let extent = Curve::new(Pose::default(), &bend).end().x;
    let mut pieces = vec![straight(leg - extent)];
    pieces.extend(bend);
    pieces.push(straight(leg - extent));
    pieces
}

fn flat(point: Point) -> Point3 {
    Point3::new(point.x, point.y, 0.0)
}
