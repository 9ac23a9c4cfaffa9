//! Ramps that join a road: how far before and behind the node the road's lanes and the ramp's end.

use world::geometry::Point;

use super::junctions::turn;
use super::net::{Net, NetArm};

/// A ramp comes in at an angle between these (rad); others meet the road as at any junction.
const ANGLES: (f64, f64) = (0.04, 0.5);
/// Between the ramp's lane and the road's outermost, where they come together (m).
const GORE: f64 = 1.2;

/// What a merge takes of each arm; nothing if it is none: a ramp from the right, a road that comes, and one that goes on.
pub(super) fn setbacks(net: &Net, arms: &[NetArm]) -> Option<Vec<f64>> {
    let is_major = |arm: &NetArm| net.streets[arm.street].street.major;
    let inbound = |arm: &NetArm| net.streets[arm.street].profile(arm.end.inbound());
    let outbound = |arm: &NetArm| net.streets[arm.street].profile(arm.end.inbound().other());
    let ramp = arms.iter().position(|arm| !is_major(arm) && inbound(arm).lanes > 0)?;
    let open = |index: &usize| *index != ramp && is_major(&arms[*index]) && outbound(&arms[*index]).lanes > 0;
    let angle = |index: &usize| -turn(arms[ramp].heading, arms[*index].heading);
    let out = (0..arms.len()).filter(open).find(|index| (ANGLES.0..ANGLES.1).contains(&angle(index)))?;
    let direction = Point::unit(angle(&out));

    let (ramp_lanes, road) = (inbound(&arms[ramp]), outbound(&arms[out]));
    let outermost = road.lane(road.lanes.saturating_sub(1));
    let own = ramp_lanes.lane(0);
    // Along the ramp: where its lane's left curb leaves the road's right curb, and where the lanes' centre lines would cross.
    let inner = -(ramp_lanes.inner - net.streets[arms[ramp].street].profile(arms[ramp].end.inbound().other()).curb());
    let beside = (road.curb() + inner * direction.x + GORE) / direction.y;
    let cross = (outermost - own * direction.x) / direction.y;
    let (taken, after) = (beside * direction.x, (beside - cross) - cross * direction.x);
    Some(
        (0..arms.len())
            .map(|arm| {
                if arm == ramp {
                    beside
                } else if arm == out {
                    after.max(4.0)
                } else {
                    taken
                }
            })
            .collect(),
    )
}
