//! A ramp leads into the right lane of a road with traffic: the AV finds its gap.

use world::geometry::{Point, Pose};
use world::scene::SceneParts;

use crate::generated::draw::Draw;
use crate::generated::motion::{Ahead, Driver, drive};
use crate::generated::old_curve::{Curve, straight, turn};
use crate::generated::old_roads::{GUTTER, LANE_WIDTH, MapBuilder, Road};
use crate::generated::stage::{AV_SIZE, CAR_SIZE, Stage, VAN_SIZE};

/// Where the ramp's lane has become the road's (m along the road).
const MERGED: f64 = 220.0;
const SPEED_LIMIT_MPH: f64 = 35.0;

pub(super) fn compose(draw: &mut Draw) -> SceneParts {
    let road = |from: f64, to: f64| Road {
        middle: Curve::line(Point::new(from, 0.0), Point::new(to, 0.0)),
        forward: 2,
        backward: 0,
        speed_limit_mph: SPEED_LIMIT_MPH,
        curbs: false,
    };
    let (before, after, whole) = (road(0.0, MERGED), road(MERGED, 460.0), road(0.0, 460.0));
    let ramp = ramp(after.forward_lane(1).start());

    let mut map = MapBuilder::default();
    let (before, after) = (map.road(&before), map.road(&after));
    for slot in 0..2 {
        map.link(before.forward[slot].1, after.forward[slot].0);
    }
    let split = 0.5 * ramp.length();
    let outer = map.lane(&ramp.slice(0.0, split), SPEED_LIMIT_MPH, false);
    let inner = map.lane(&ramp.slice(split, ramp.length()), SPEED_LIMIT_MPH, true);
    map.link(outer, inner);
    map.link(inner, after.forward[1].0);
    lay_curbs(&ramp, &whole, &mut map);

    // Stations on the road are those on the ramp's way plus `ahead`.
    let own = ramp.clone().then(&whole.forward_lane(1).slice(MERGED, 460.0));
    let ahead = MERGED - ramp.length();
    let main = whole.forward_lane(1);
    let leader_start = MERGED - draw.between(100.0, 108.0);
    let leader = Driver { station: leader_start, speed: 13.0, desired: 13.4, length: VAN_SIZE[0] };
    let leader = drive(leader, &main, &[]);
    let av = Driver {
        station: leader_start - ahead - draw.between(24.0, 29.0),
        speed: 12.0,
        desired: 14.0,
        length: AV_SIZE[0],
    };
    let av = drive(av, &own, &[Ahead::Vehicle(&leader.clone().moved(-ahead), VAN_SIZE[0], 0)]);
    let follower =
        Driver { station: leader_start - draw.between(56.0, 62.0), speed: 12.0, desired: 13.5, length: CAR_SIZE[0] };
    let follower = drive(follower, &main, &[Ahead::Vehicle(&av.clone().moved(ahead), AV_SIZE[0], 0)]);

    let mut stage = Stage::new(&own, &av);
    stage.vehicle(&main, &leader, VAN_SIZE);
    stage.vehicle(&main, &follower, CAR_SIZE);
    let left = whole.forward_lane(0);
    let overtaking = Driver { station: draw.between(55.0, 75.0), speed: 14.5, desired: 15.0, length: CAR_SIZE[0] };
    stage.vehicle(&left, &drive(overtaking, &left, &[]), CAR_SIZE);
    stage.finish(map.finish())
}

/// The ramp, laid backwards from where it has become the road's right lane.
fn ramp(merged: Pose) -> Curve {
    let back = Pose::new(merged.x, merged.y, merged.heading + std::f64::consts::PI);
    // Driven forward it bends to the right, to lie along the road; so backwards to the left.
    let [bend_in, arc, bend_out] = turn(0.16, 300.0, 30.0);
    Curve::new(back, &[bend_in, arc, bend_out, straight(125.0)]).reversed()
}

/// The road's left curb; its right curb up to the gore, back along the ramp's left side; the ramp's right curb, which becomes the road's.
fn lay_curbs(ramp: &Curve, whole: &Road, map: &mut MapBuilder) {
    map.edge(&whole.middle.reversed().shifted(-GUTTER));
    let side = 0.5 * LANE_WIDTH + GUTTER;
    let right = whole.forward_lane(1).shifted(-side);
    let ramp_left = ramp.shifted(side);
    let road_right_y = right.start().y;
    // The ramp comes from the right, so its left side rises to the road's right curb.
    let (mut below, mut above) = (0.0, ramp_left.length());
    for _ in 0..50 {
        let gore = 0.5 * (below + above);
        if ramp_left.pose(gore).y < road_right_y { below = gore } else { above = gore }
    }
    let road_side = right.slice(0.0, ramp_left.pose(below).x);
    map.edge(&road_side.then(&ramp_left.slice(0.0, below).reversed()));
    map.edge(&ramp.shifted(-side).then(&right.slice(MERGED, right.length())));
}
