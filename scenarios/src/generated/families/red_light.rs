//! A junction with signals: the AV's is red, cross traffic goes, then it turns green.

use world::scene::SceneParts;
use world::signal::SignalState;

use crate::generated::draw::Draw;
use crate::generated::motion::{Ahead, Driver, Motion, drive};
use crate::generated::old_junction::{Junction, Way};
use crate::generated::old_roads::MapBuilder;
use crate::generated::stage::{AV_SIZE, CAR_SIZE, Stage, VAN_SIZE};

pub(super) fn compose(draw: &mut Draw) -> SceneParts {
    let junction = Junction { lanes: 2, stop: 20.0, reach: 170.0, speed_limit_mph: 30.0 };
    let mut map = MapBuilder::default();
    let controlled = junction.lay(&mut map);
    let stop = junction.stop_station();
    // Cross traffic: green, 3 s yellow, red; a second later ours turns green.
    let yellow = draw.between(55.0, 70.0) as usize;
    let green = yellow + 40;
    let car = |before_stop: f64, speed: f64| Driver {
        station: stop - before_stop,
        speed,
        desired: 12.5,
        length: CAR_SIZE[0],
    };

    let own = junction.path(0, 1, Way::Straight);
    let av = Driver { length: AV_SIZE[0], ..car(draw.between(70.0, 85.0), 11.5) };
    let av = drive(av, &own, &[Ahead::Line(stop, green)]);
    let mut stage = Stage::new(&own, &av);

    let beside = junction.path(0, 0, Way::Straight);
    stage.vehicle(
        &beside,
        &drive(car(draw.between(40.0, 50.0), 9.0), &beside, &[Ahead::Line(stop, green + 4)]),
        CAR_SIZE,
    );
    let oncoming = junction.path(2, 1, Way::Straight);
    let first = Driver { length: VAN_SIZE[0], ..car(30.0, 7.0) };
    let first = drive(first, &oncoming, &[Ahead::Line(stop, green + 3)]);
    let second = drive(car(55.0, 9.0), &oncoming, &[Ahead::Vehicle(&first, VAN_SIZE[0], 0), Ahead::Line(stop, green)]);
    stage.vehicle(&oncoming, &first, VAN_SIZE);
    stage.vehicle(&oncoming, &second, CAR_SIZE);

    for (arm, slot, distance) in [(1, 0, 12.0), (1, 1, 34.0), (3, 0, 25.0), (3, 1, 8.0)] {
        let crossing = junction.path(arm, slot, Way::Straight);
        let passing = drive(car(distance + draw.between(-4.0, 4.0), 12.0), &crossing, &[]);
        stage.vehicle(&crossing, &passing, CAR_SIZE);
        let stopping = car(115.0 + draw.between(-10.0, 10.0), 11.0);
        let ahead = [Ahead::Vehicle(&passing, CAR_SIZE[0], 0), Ahead::Line(stop, usize::MAX)];
        stage.vehicle(&crossing, &drive(stopping, &crossing, &ahead), CAR_SIZE);
    }
    stage.pedestrian(&junction.crossing(0), &Motion::steady(draw.between(1.0, 3.0), 1.75));

    for (arm, lanes) in controlled.iter().enumerate() {
        stage.signal(lanes, |step| match (arm % 2, step) {
            (0, step) if step >= green => SignalState::Go,
            (1, step) if step < yellow => SignalState::Go,
            (1, step) if step < yellow + 30 => SignalState::Caution,
            _ => SignalState::Stop,
        });
    }
    stage.finish(map.finish())
}
