//! Junctions ruled by signs.

use crate::generated::Family;
use crate::generated::draw::Draw;
use crate::generated::parameters::Parameter;
use crate::generated::roads::{Control, Turn};
use crate::generated::stage::{Side, Stage};
use crate::generated::towns::{self, Crossroads, FROM, LEFT, Place, RIGHT, Size, large, medium, small};

const BEFORE: Parameter = Parameter {
    name: "before",
    about: "way to the stop line at first (m)",
    default: [25.0, 65.0],
    limits: [15.0, 120.0],
};
const GAP: Parameter = Parameter {
    name: "gap",
    about: "mean time between vehicles on the street across (s)",
    default: [3.0, 7.0],
    limits: [1.5, 30.0],
};

fn junction(control: Control, draw: &mut Draw) -> Place {
    let across = if control == Control::AllWayStop || draw.chance(0.4) { small(draw) } else { medium(draw) };
    let across = if control == Control::MinorYield && draw.chance(0.5) { large(draw) } else { across };
    let arms = [true, draw.chance(0.8), true];
    let own = Size { lanes: 1, ..small(draw) };
    towns::crossroads(Crossroads { control, own, across, own_is_major: false, arms, approach: 170.0 }, draw)
}

/// The AV on the street that waits, and vehicles on the one that does not.
fn arrive(stage: &mut Stage<'_>, turns: &[Turn]) {
    let (before, speed) = (stage.draw.parameter("before"), stage.draw.between(6.0, 10.0));
    stage.av(FROM, Side::Backward, 0, before, speed, turns);
    let gap = stage.draw.parameter("gap");
    stage.stream(LEFT, gap, &[Turn::Straight]);
    stage.stream(RIGHT, 1.3 * gap, &[Turn::Straight]);
}

fn any_turn(stage: &mut Stage<'_>) -> Turn {
    let turns = [Turn::Straight, Turn::Right, Turn::Left];
    let turn = stage.draw.pick(&turns);
    if stage.leads(FROM, Side::Backward, turn) { turn } else { Turn::Right }
}

pub(super) const RIGHT_TURN: Family = Family {
    name: "right-turn",
    about: "a right turn that gives way",
    parameters: &[BEFORE, GAP],
    place: |draw| junction(Control::MinorYield, draw),
    act: |stage| arrive(stage, &[Turn::Right]),
};

pub(super) const STOP_SIGN: Family = Family {
    name: "stop-sign",
    about: "a stop sign before a street with traffic",
    parameters: &[BEFORE, GAP],
    place: |draw| junction(Control::MinorStop, draw),
    act: |stage| {
        let turn = any_turn(stage);
        arrive(stage, &[turn]);
    },
};

pub(super) const ALL_WAY_STOP: Family = Family {
    name: "all-way-stop",
    about: "everybody stops, and goes in turn",
    parameters: &[BEFORE, GAP],
    place: |draw| junction(Control::AllWayStop, draw),
    act: |stage| {
        let turn = any_turn(stage);
        arrive(stage, &[turn]);
    },
};
