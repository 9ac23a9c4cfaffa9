//! A car in the lane beside moves in, closely, ahead of the AV.

use world::geometry::Pose;
use world::scene::SceneParts;

use crate::generated::draw::Draw;
use crate::generated::motion::{Ahead, Driver, Motion, drive};
use crate::generated::old_curve::{Curve, straight};
use crate::generated::old_roads::{LANE_WIDTH, MapBuilder, Road};
use crate::generated::stage::{AV_SIZE, CAR_SIZE, Stage, VAN_SIZE};

/// Length of the lane change (m).
const CHANGE: f64 = 55.0;

pub(super) fn compose(draw: &mut Draw) -> SceneParts {
    let middle = Curve::new(Pose::default(), &[straight(450.0)]);
    let road = Road { middle, forward: 3, backward: 0, speed_limit_mph: 35.0, curbs: true };
    let mut map = MapBuilder::default();
    map.road(&road);

    let lane = road.forward_lane(1);
    let begins = draw.between(105.0, 125.0);
    // Station and place go together: the road is straight.
    let moving_in = road.forward_lane(0).shifted_by(|station| {
        let part = ((station - begins) / CHANGE).clamp(0.0, 1.0);
        -LANE_WIDTH * part * part * part * (10.0 - 15.0 * part + 6.0 * part * part)
    });
    let cutter = Driver { station: 40.0 + draw.between(14.0, 18.0), speed: 12.6, desired: 12.2, length: CAR_SIZE[0] };
    let cutter = drive(cutter, &moving_in, &[]);
    // From a fifth of the change on it is seen to come.
    let noticed = cutter.step_past(begins + 0.2 * CHANGE);
    let far = Motion::steady(40.0 + draw.between(85.0, 95.0), 13.0);
    let av = Driver { station: 40.0, speed: 13.0, desired: 14.0, length: AV_SIZE[0] };
    let ahead = [Ahead::Vehicle(&cutter, CAR_SIZE[0], noticed), Ahead::Vehicle(&far, VAN_SIZE[0], 0)];
    let av = drive(av, &lane, &ahead);

    let mut stage = Stage::new(&lane, &av);
    stage.vehicle(&moving_in, &cutter, CAR_SIZE);
    stage.vehicle(&lane, &far, VAN_SIZE);
    let left = Motion::steady(draw.between(5.0, 15.0), 12.8);
    stage.vehicle(&road.forward_lane(0), &left, CAR_SIZE);
    for station in [20.0, 62.0] {
        let right = Motion::steady(station + draw.between(-8.0, 8.0), 11.0);
        stage.vehicle(&road.forward_lane(2), &right, CAR_SIZE);
    }
    stage.finish(map.finish())
}
