//! What happens along a street: bends, vehicles ahead, vehicles from the lane beside, vehicles from the curb.

use crate::generated::draw::Draw;
use crate::generated::parameters::Parameter;
use crate::generated::stage::{Side, Stage};
use crate::generated::towns::{self, Place, Size, bend, large, medium};
use crate::generated::traffic::{AV, Script};
use crate::generated::{Family, curve::straight};

pub(super) const CRUISE: Family = Family {
    name: "cruise",
    about: "a wide street with little on it",
    parameters: &[],
    place: |draw| {
        let size = large(draw);
        let bends = [vec![straight(draw.between(280.0, 330.0))], bend(40.0, draw.between(-0.5, 0.5), 260.0, 150.0)];
        towns::winding(&bends, Size { pockets: true, ..size }, draw)
    },
    act: |stage| {
        stage.density *= 0.6;
        let slot = stage.draw.below(stage.slots(0, Side::Forward));
        let (before, speed) = (stage.draw.between(120.0, 170.0), stage.draw.between(13.0, 18.0));
        stage.av(0, Side::Forward, slot, before, speed, &[]);
    },
};

pub(super) const CURVE: Family = Family {
    name: "curve",
    about: "bends, one after the other",
    parameters: &[
        Parameter { name: "radius", about: "radius of the bends (m)", default: [16.0, 70.0], limits: [12.0, 400.0] },
        Parameter { name: "angle", about: "how far each bends (rad)", default: [0.6, 1.5], limits: [0.2, 1.6] },
    ],
    place: |draw| {
        let (radius, angle) = (draw.parameter("radius"), draw.parameter("angle"));
        let size = Size { pockets: false, ..medium(draw) };
        let side = if draw.chance(0.5) { 1.0 } else { -1.0 };
        let again = if draw.chance(0.5) { side } else { -side };
        let between = draw.between(25.0, 60.0);
        let bends = [
            vec![straight(150.0)],
            bend(20.0, side * angle, radius, between),
            bend(15.0, again * angle * draw.between(0.6, 1.0), radius * draw.between(0.9, 1.5), 100.0),
        ];
        let mut place = towns::winding(&bends, size, draw);
        // Nobody parks in a tight bend.
        place.town.streets[..3].iter_mut().for_each(|street| street.parking &= radius > 45.0);
        place
    },
    act: |stage| {
        let slot = stage.draw.below(stage.slots(0, Side::Forward));
        let (before, speed) = (stage.draw.between(20.0, 60.0), stage.draw.between(8.0, 13.0));
        stage.av(0, Side::Forward, slot, before, speed, &[]);
    },
};

/// A street without much of a bend, on which one follows another.
fn avenue(draw: &mut Draw) -> Place {
    let size = if draw.chance(0.6) { Size { pockets: draw.chance(0.5), ..large(draw) } } else { medium(draw) };
    let bends = [vec![straight(draw.between(260.0, 300.0))], bend(30.0, draw.between(-0.4, 0.4), 220.0, 140.0)];
    towns::winding(&bends, size, draw)
}

/// The AV on its way along an avenue; answers its speed (m/s).
fn av_on_the_avenue(stage: &mut Stage<'_>, slot: usize) -> f64 {
    let limit = stage.roads.lanes[stage.lanes(0, Side::Forward, slot)[0]].limit;
    let speed = limit * stage.draw.between(0.7, 0.95);
    let before = stage.draw.between(90.0, 140.0);
    stage.av(0, Side::Forward, slot, before, speed, &[]);
    speed
}

/// The AV behind a vehicle that slows down at some step within `from`, for a number of steps within `lasts`.
fn follow(stage: &mut Stage<'_>, from: [f64; 2], lasts: [f64; 2], braking: impl FnOnce(&mut Draw) -> f64) {
    let slot = stage.draw.below(stage.slots(0, Side::Forward));
    let speed = av_on_the_avenue(stage, slot);
    let gap = 2.0 + stage.draw.parameter("headway") * speed;
    let Some(leader) = stage.vehicle_ahead(gap, speed, &[]) else { return };
    let from = stage.draw.between(from[0], from[1]) as i32;
    let until = from + stage.draw.between(lasts[0], lasts[1]) as i32;
    let (speed, braking) = (stage.draw.parameter("down_to"), braking(&mut stage.draw));
    stage.traffic.vehicles[leader].script = Script::Slow { from, until, speed, braking };
}

pub(super) const FOLLOWING: Family = Family {
    name: "following",
    about: "the vehicle ahead slows down, and goes on",
    parameters: &[
        Parameter {
            name: "headway",
            about: "time to the vehicle ahead at first (s)",
            default: [1.2, 2.5],
            limits: [0.8, 6.0],
        },
        Parameter {
            name: "down_to",
            about: "speed that it slows down to (m/s)",
            default: [1.0, 7.0],
            limits: [0.0, 20.0],
        },
    ],
    place: avenue,
    act: |stage| {
        follow(stage, [25.0, 90.0], [30.0, 70.0], |draw| draw.between(1.5, 3.0));
    },
};

pub(super) const HARD_BRAKING: Family = Family {
    name: "hard-braking",
    about: "the vehicle ahead brakes hard",
    parameters: &[
        Parameter {
            name: "headway",
            about: "time to the vehicle ahead at first (s)",
            default: [1.0, 1.9],
            limits: [0.8, 4.0],
        },
        Parameter { name: "braking", about: "how hard it brakes (m/s^2)", default: [4.0, 7.0], limits: [3.0, 7.5] },
        Parameter {
            name: "down_to",
            about: "speed that it brakes down to (m/s)",
            default: [0.0, 4.0],
            limits: [0.0, 15.0],
        },
    ],
    place: avenue,
    act: |stage| {
        follow(stage, [28.0, 100.0], [25.0, 60.0], |draw| draw.parameter("braking"));
    },
};

pub(super) const CUT_IN: Family = Family {
    name: "cut-in",
    about: "a vehicle moves in from the lane beside",
    parameters: &[
        Parameter {
            name: "gap",
            about: "from the AV's front to its rear as it begins (m)",
            default: [3.0, 11.0],
            limits: [1.5, 40.0],
        },
        Parameter {
            name: "slower",
            about: "how much slower it is afterwards (m/s)",
            default: [0.0, 4.0],
            limits: [0.0, 12.0],
        },
    ],
    place: |draw| {
        let size = Size { pockets: draw.chance(0.5), ..large(draw) };
        let bends = [vec![straight(draw.between(280.0, 320.0))], bend(30.0, draw.between(-0.3, 0.3), 260.0, 150.0)];
        towns::winding(&bends, size, draw)
    },
    act: |stage| {
        let slots = stage.slots(0, Side::Forward);
        let slot = stage.draw.below(slots);
        // From the left, unless the AV is there already.
        let from_left = slot > 0 && (slot + 1 == slots || stage.draw.chance(0.6));
        let other = if from_left { slot - 1 } else { slot + 1 };
        let speed = av_on_the_avenue(stage, slot);
        let behind = stage.draw.between(8.0, 22.0);
        let Some((lane, station)) = stage.beside_av(0, Side::Forward, other, -behind) else { return };
        let limit = stage.roads.lanes[lane].limit;
        let (gap, then) = (stage.draw.parameter("gap"), (speed - stage.draw.parameter("slower")).max(2.0));
        let cutter = stage.vehicle_by((lane, station), speed + 3.0, &[], |driver| {
            driver.eagerness = ((speed + 3.5) / limit).max(0.5);
            driver.lane_change_threshold = f64::INFINITY;
            driver.headway = 0.9;
        });
        stage.traffic.vehicles[cutter].script = Script::CutIn { left: !from_left, gap, latest: 110, then };
    },
};

pub(super) const PARKED_CARS: Family = Family {
    name: "parked-cars",
    about: "parked cars along the street; one pulls out before the AV",
    parameters: &[Parameter {
        name: "gap",
        about: "from the AV's front to the car that pulls out (m)",
        default: [16.0, 34.0],
        limits: [6.0, 60.0],
    }],
    place: |draw| {
        let size = Size { lanes: 1, limit_mph: draw.pick(&[25.0, 25.0, 30.0]), pockets: false };
        let bends = [vec![straight(draw.between(220.0, 260.0))], bend(30.0, draw.between(-0.4, 0.4), 150.0, 80.0)];
        let mut place = towns::winding(&bends, size, draw);
        for street in &mut place.town.streets[..2] {
            (street.parking, street.bike_lane) = (true, false);
        }
        place
    },
    act: |stage| {
        let speed = stage.draw.between(7.0, 10.5);
        let before = stage.draw.between(110.0, 150.0);
        stage.av(0, Side::Forward, 0, before, speed, &[]);
        let gap = stage.draw.parameter("gap");
        // The first bay on the way that the AV reaches once it has been driven for a while.
        let reached = stage.draw.between(35.0, 80.0) + gap;
        let av = stage.traffic.vehicles[AV].route.clone();
        let start = stage.traffic.vehicles[AV].station + 6.0 * speed;
        let bay = (0..stage.roads.bays.len()).find(|bay| {
            let Some((lane, station)) = stage.roads.bays[*bay].beside else { return false };
            let Some(index) = av.lanes.iter().position(|l| *l == lane) else { return false };
            av.starts[index] + station > start + reached
        });
        if let Some(bay) = bay {
            stage.pulls_out(bay, gap);
        }
    },
};
