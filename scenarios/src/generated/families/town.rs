//! Places with much going on at once.

use crate::generated::Family;
use crate::generated::parameters::Parameter;
use crate::generated::roads::{Control, Lot, Turn};
use crate::generated::stage::Side;
use crate::generated::towns::{self, Crossroads, FROM, Size, large, medium, small};

pub(super) const URBAN: Family = Family {
    name: "urban",
    about: "dense traffic, people and bicycles at a junction",
    parameters: &[Parameter {
        name: "density",
        about: "how much more of everything there is than elsewhere",
        default: [1.3, 2.0],
        limits: [0.5, 3.0],
    }],
    place: |draw| {
        let control = draw.pick(&[Control::Signals, Control::Signals, Control::AllWayStop, Control::MinorStop]);
        let own = if draw.chance(0.5) { medium(draw) } else { large(draw) };
        let across = if draw.chance(0.5) { small(draw) } else { medium(draw) };
        let arms = [true, true, draw.chance(0.8)];
        let own_is_major = draw.chance(0.6);
        towns::crossroads(Crossroads { control, own, across, own_is_major, arms, approach: 200.0 }, draw)
    },
    act: |stage| {
        let more = stage.draw.parameter("density");
        (stage.density, stage.people) = (stage.density * more, stage.people * more);
        let slot = stage.draw.below(stage.slots(FROM, Side::Backward));
        let turns = [Turn::Straight, Turn::Straight, Turn::Right, Turn::Left];
        let turn = stage.draw.pick(&turns);
        let (before, speed) = (stage.draw.between(25.0, 90.0), stage.draw.between(5.0, 9.0));
        stage.av(FROM, Side::Backward, slot, before, speed, &[turn]);
    },
};

pub(super) const PARKING_LOT: Family = Family {
    name: "parking-lot",
    about: "through a parking lot, with people between the cars",
    parameters: &[Parameter {
        name: "walkers",
        about: "people who cross the aisles",
        default: [2.0, 8.0],
        limits: [0.0, 20.0],
    }],
    place: |draw| {
        let (own, across) = (small(draw), small(draw));
        let place = Crossroads {
            control: Control::AllWayStop,
            own: Size { lanes: 1, ..own },
            across,
            own_is_major: true,
            arms: [true, true, true],
            approach: 190.0,
        };
        let mut place = towns::crossroads(place, draw);
        place.town.lots.retain(|lot| lot.street != FROM);
        let (aisles, bays) = (2 + draw.below(2), 9 + draw.below(5));
        place.town.lots.push(Lot { street: FROM, along: 0.5, right: draw.chance(0.6), aisles, bays });
        place
    },
    act: |stage| stage.av_in_the_lot(),
};
