//! Roads that bend: one bend of 90 degrees, or two against each other.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_3};

use world::geometry::Pose;
use world::scene::SceneParts;

use crate::generated::draw::Draw;
use crate::generated::motion::{Ahead, Driver, drive};
use crate::generated::old_curve::{Curve, Piece, straight, turn};
use crate::generated::old_roads::{MapBuilder, Road};
use crate::generated::stage::{AV_SIZE, CAR_SIZE, Stage};

pub(super) fn compose_curve(draw: &mut Draw) -> SceneParts {
    let mut pieces = vec![straight(90.0)];
    pieces.extend(turn(FRAC_PI_2, draw.between(26.0, 34.0), 14.0));
    pieces.push(straight(170.0));
    compose(&pieces, 25.0, draw)
}

pub(super) fn compose_s_curve(draw: &mut Draw) -> SceneParts {
    let mut pieces = vec![straight(80.0)];
    pieces.extend(turn(FRAC_PI_3, draw.between(38.0, 48.0), 16.0));
    pieces.push(straight(15.0));
    pieces.extend(turn(-FRAC_PI_3, draw.between(38.0, 48.0), 16.0));
    pieces.push(straight(150.0));
    compose(&pieces, 30.0, draw)
}

/// A car goes before the AV, others come the other way.
fn compose(pieces: &[Piece], speed_limit_mph: f64, draw: &mut Draw) -> SceneParts {
    let middle = Curve::new(Pose::default(), pieces);
    let road = Road { middle, forward: 2, backward: 1, speed_limit_mph, curbs: true };
    let mut map = MapBuilder::default();
    map.road(&road);

    let lane = road.forward_lane(1);
    let desired = 0.42 * speed_limit_mph;
    let av = Driver { station: 25.0, speed: desired - 0.5, desired, length: AV_SIZE[0] };
    let ahead = Driver { station: draw.between(55.0, 70.0), desired: desired - 0.3, length: CAR_SIZE[0], ..av };
    let ahead = drive(ahead, &lane, &[]);
    let av = drive(av, &lane, &[Ahead::Vehicle(&ahead, CAR_SIZE[0], 0)]);

    let mut stage = Stage::new(&lane, &av);
    stage.vehicle(&lane, &ahead, CAR_SIZE);
    let back = road.backward_lane(0);
    let first = Driver { station: draw.between(70.0, 90.0), speed: desired, desired, length: CAR_SIZE[0] };
    let first = drive(first, &back, &[]);
    let second = Driver { station: draw.between(20.0, 40.0), speed: desired, desired, length: CAR_SIZE[0] };
    let second = drive(second, &back, &[Ahead::Vehicle(&first, CAR_SIZE[0], 0)]);
    stage.vehicle(&back, &first, CAR_SIZE);
    stage.vehicle(&back, &second, CAR_SIZE);
    stage.finish(map.finish())
}
