//! Signalled junctions.

use crate::generated::Family;
use crate::generated::draw::Draw;
use crate::generated::parameters::Parameter;
use crate::generated::roads::{Control, Turn};
use crate::generated::stage::{Side, Stage};
use crate::generated::towns::{self, AHEAD, Crossroads, FROM, Place, Size, large, medium};
use crate::generated::traffic::AV;

fn junction(own: Size, draw: &mut Draw) -> Place {
    let across = if draw.chance(0.4) { large(draw) } else { medium(draw) };
    // Three arms now and then: the AV goes straight on or to the left, so those are there.
    let arms = [draw.chance(0.85), true, true];
    let place = Crossroads { control: Control::Signals, own, across, own_is_major: true, arms, approach: 210.0 };
    towns::crossroads(place, draw)
}

/// The AV `before` (m) before the stop line, and vehicles ahead of it that stand there already.
fn queue(stage: &mut Stage<'_>, slot: usize, standing: usize, speed: f64, turns: &[Turn]) {
    let mut before = 3.5;
    for _ in 0..standing {
        let place = stage.before_end(FROM, Side::Backward, slot, before + 2.3);
        let turn = if stage.draw.chance(0.8) { Turn::Straight } else { Turn::Right };
        stage.vehicle(place, 0.0, &[turn]);
        before += stage.draw.between(7.0, 9.5);
    }
    let before = before + stage.draw.between(3.0, 12.0);
    stage.av(FROM, Side::Backward, slot, before + 4.0, speed * 0.45, turns);
    stage.traffic.vehicles[AV].speed = speed;
}

pub(super) const RED_LIGHT: Family = Family {
    name: "red-light",
    about: "a red light, which turns green in the end",
    parameters: &[
        Parameter {
            name: "before",
            about: "way to the stop line at first (m)",
            default: [45.0, 110.0],
            limits: [20.0, 140.0],
        },
        Parameter { name: "wait", about: "until the light turns green (s)", default: [5.0, 13.0], limits: [0.0, 40.0] },
    ],
    place: |draw| {
        let size = if draw.chance(0.6) { large(draw) } else { medium(draw) };
        junction(size, draw)
    },
    act: |stage| {
        let slot = stage.draw.below(stage.slots(FROM, Side::Backward));
        let speed = stage.draw.between(9.0, 13.0);
        let before = stage.draw.parameter("before");
        let wait = stage.draw.parameter("wait");
        stage.green_at(Turn::Straight, wait);
        if stage.draw.chance(0.4) {
            let place = stage.before_end(FROM, Side::Backward, slot, 6.0);
            stage.vehicle(place, 0.0, &[Turn::Straight]);
        }
        stage.av(FROM, Side::Backward, slot, before, speed, &[Turn::Straight]);
    },
};

pub(super) const GREEN_LIGHT: Family = Family {
    name: "green-light",
    about: "in a queue at a light that turns green",
    parameters: &[
        Parameter { name: "queue", about: "vehicles ahead at the light", default: [1.0, 5.0], limits: [0.0, 8.0] },
        Parameter { name: "wait", about: "until the light turns green (s)", default: [1.0, 6.0], limits: [0.0, 20.0] },
    ],
    place: RED_LIGHT.place,
    act: |stage| {
        let slot = stage.draw.below(stage.slots(FROM, Side::Backward));
        let wait = stage.draw.parameter("wait");
        stage.green_at(Turn::Straight, wait);
        let standing = stage.draw.parameter("queue").round() as usize;
        queue(stage, slot, standing, 6.0, &[Turn::Straight]);
    },
};

pub(super) const LEFT_TURN: Family = Family {
    name: "left-turn",
    about: "an unprotected left turn through oncoming traffic",
    parameters: &[
        Parameter {
            name: "gap",
            about: "mean time between oncoming vehicles (s)",
            default: [2.5, 5.5],
            limits: [1.5, 30.0],
        },
        Parameter {
            name: "before",
            about: "way to the stop line at first (m)",
            default: [25.0, 70.0],
            limits: [15.0, 120.0],
        },
    ],
    place: |draw| junction(Size { pockets: false, ..medium(draw) }, draw),
    act: |stage| {
        let green = stage.draw.between(-8.0, 1.0);
        stage.green_at(Turn::Left, green);
        let (before, speed) = (stage.draw.parameter("before"), stage.draw.between(7.0, 10.5));
        stage.av(FROM, Side::Backward, 0, before, speed, &[Turn::Left]);
        let gap = stage.draw.parameter("gap");
        stage.stream(AHEAD, gap, &[Turn::Straight]);
    },
};

pub(super) const PROTECTED_TURN: Family = Family {
    name: "protected-turn",
    about: "a left turn at a green arrow, from a lane of its own",
    parameters: &[
        Parameter { name: "queue", about: "vehicles ahead in the lane", default: [0.0, 3.0], limits: [0.0, 5.0] },
        Parameter { name: "wait", about: "until the arrow turns green (s)", default: [1.0, 9.0], limits: [0.0, 20.0] },
    ],
    place: |draw| junction(Size { pockets: true, ..large(draw) }, draw),
    act: |stage| {
        stage.give_arrows();
        let wait = stage.draw.parameter("wait");
        stage.green_at(Turn::Left, wait);
        let before = stage.draw.between(40.0, 80.0) + 8.0 * stage.draw.parameter("queue");
        stage.av(FROM, Side::Backward, 0, before, 9.0, &[Turn::Left]);
        let mut ahead = stage.draw.between(8.0, 12.0);
        for _ in 0..stage.draw.parameter("queue").round() as usize {
            stage.vehicle_ahead(ahead, 8.0, &[Turn::Left]);
            ahead += stage.draw.between(11.0, 15.0);
        }
    },
};
