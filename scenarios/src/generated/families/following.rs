//! The leader brakes and goes on; others overtake and come the other way.

use world::geometry::Pose;
use world::scene::SceneParts;

use crate::generated::draw::Draw;
use crate::generated::motion::{Ahead, Driver, Motion, drive};
use crate::generated::old_curve::{Curve, straight, turn};
use crate::generated::old_roads::{MapBuilder, Road};
use crate::generated::stage::{AV_SIZE, CAR_SIZE, Stage, VAN_SIZE};

pub(super) fn compose(draw: &mut Draw) -> SceneParts {
    let [bend_in, arc, bend_out] = turn(0.35, 220.0, 30.0);
    let middle = Curve::new(Pose::default(), &[straight(170.0), bend_in, arc, bend_out, straight(180.0)]);
    let road = Road { middle, forward: 2, backward: 1, speed_limit_mph: 30.0, curbs: true };
    let mut map = MapBuilder::default();
    map.road(&road);

    let lane = road.forward_lane(1);
    let speed = draw.between(10.5, 12.5);
    let brakes = draw.between(45.0, 65.0) as usize;
    let slow = Ahead::Speed(draw.between(3.0, 5.5), brakes, brakes + 55);
    let leader = Driver { station: 40.0 + draw.between(26.0, 34.0), speed, desired: speed + 0.5, length: VAN_SIZE[0] };
    let leader = drive(leader, &lane, &[slow]);
    let av = Driver { station: 40.0, speed, desired: 13.0, length: AV_SIZE[0] };
    let av = drive(av, &lane, &[Ahead::Vehicle(&leader, VAN_SIZE[0], 0)]);
    let follower = Driver { station: 8.0, speed, desired: 12.5, length: CAR_SIZE[0] };
    let follower = drive(follower, &lane, &[Ahead::Vehicle(&av, AV_SIZE[0], 0)]);

    let mut stage = Stage::new(&lane, &av);
    stage.vehicle(&lane, &leader, VAN_SIZE);
    stage.vehicle(&lane, &follower, CAR_SIZE);
    stage.vehicle(&road.forward_lane(0), &Motion::steady(draw.between(10.0, 25.0), 13.2), CAR_SIZE);
    for start in [60.0, 130.0, 215.0] {
        let oncoming = Motion::steady(start + draw.between(-10.0, 10.0), 12.4);
        stage.vehicle(&road.backward_lane(0), &oncoming, CAR_SIZE);
    }
    stage.finish(map.finish())
}
