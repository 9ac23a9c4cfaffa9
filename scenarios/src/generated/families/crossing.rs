//! A stop sign: the AV lets cars and somebody on foot cross, then turns right.

use world::scene::SceneParts;

use crate::generated::draw::Draw;
use crate::generated::motion::{Ahead, Driver, Motion, drive};
use crate::generated::old_junction::{Junction, Way};
use crate::generated::old_roads::MapBuilder;
use crate::generated::stage::{AV_SIZE, CAR_SIZE, Stage, VAN_SIZE};

pub(super) fn compose(draw: &mut Draw) -> SceneParts {
    let junction = Junction { lanes: 1, stop: 17.0, reach: 150.0, speed_limit_mph: 25.0 };
    let mut map = MapBuilder::default();
    let controlled = junction.lay(&mut map);
    for arm in [0, 2] {
        junction.lay_stop_sign(arm, &controlled[arm], &mut map);
    }
    let stop = junction.stop_station();
    let centre = junction.reach;

    let eastward = junction.path(3, 0, Way::Straight);
    let westward = junction.path(1, 0, Way::Straight);
    let passing = Motion::steady(centre - draw.between(70.0, 85.0), 10.5);
    let from_left = Motion::steady(centre - draw.between(105.0, 118.0), 10.5);
    let from_right = Motion::steady(centre - draw.between(75.0, 90.0), 10.0);
    let walk = junction.crossing(0);
    let walker = Motion::steady(-draw.between(3.0, 6.0), 1.5);

    let clear = from_left.step_past(centre).max(walker.step_past(0.75 * walk.length())) + 4;
    let own = junction.path(0, 0, Way::Right);
    let av = Driver { station: stop - draw.between(50.0, 58.0), speed: 9.5, desired: 10.5, length: AV_SIZE[0] };
    let av = drive(av, &own, &[Ahead::Line(stop, clear)]);

    let mut stage = Stage::new(&own, &av);
    stage.vehicle(&eastward, &passing, CAR_SIZE);
    stage.vehicle(&eastward, &from_left, VAN_SIZE);
    stage.vehicle(&westward, &from_right, CAR_SIZE);
    stage.pedestrian(&walk, &walker);
    let opposite = junction.path(2, 0, Way::Straight);
    let waiting = Driver { station: stop - 45.0, speed: 8.0, desired: 10.0, length: CAR_SIZE[0] };
    stage.vehicle(&opposite, &drive(waiting, &opposite, &[Ahead::Line(stop, clear + 30)]), CAR_SIZE);
    stage.pedestrian(&junction.crossing(2), &Motion::steady(draw.between(0.0, 2.0), 1.3));
    stage.finish(map.finish())
}
