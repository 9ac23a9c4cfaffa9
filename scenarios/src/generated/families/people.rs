//! People on foot and on bicycles.

use crate::generated::Family;
use crate::generated::curve::straight;
use crate::generated::draw::Draw;
use crate::generated::parameters::Parameter;
use crate::generated::stage::{Side, Stage};
use crate::generated::towns::{self, Place, Size, bend, medium};
use crate::generated::traffic::Start;

fn residential(size: Size, draw: &mut Draw) -> Place {
    let bends = [vec![straight(draw.between(220.0, 260.0))], bend(30.0, draw.between(-0.4, 0.4), 150.0, 90.0)];
    let mut place = towns::winding(&bends, size, draw);
    place.town.streets[..2].iter_mut().for_each(|street| street.walks = true);
    place
}

/// The AV along the first street, so that it would reach the share `along` of it after `seconds`.
fn av_towards(stage: &mut Stage<'_>, along: f64, seconds: f64) {
    let length: f64 =
        stage.lanes(0, Side::Forward, 0).iter().map(|lane| stage.roads.lanes[*lane].course.length()).sum();
    let slot = stage.draw.below(stage.slots(0, Side::Forward));
    let speed = stage.draw.between(7.5, 11.0);
    stage.av(0, Side::Forward, slot, (1.0 - along) * length + seconds * speed, speed, &[]);
}

pub(super) const CROSSWALK: Family = Family {
    name: "crosswalk",
    about: "people cross on a crosswalk",
    parameters: &[Parameter { name: "walkers", about: "how many cross", default: [1.0, 4.0], limits: [0.0, 12.0] }],
    place: |draw| {
        let mut place = residential(medium(draw), draw);
        place.town.streets[0].crosswalks = vec![draw.between(0.68, 0.75)];
        place
    },
    act: |stage| {
        let seconds = stage.draw.between(4.0, 7.0);
        av_towards(stage, 0.7, seconds);
        let Some(crossing) = stage.crossing_on(0) else { return };
        for _ in 0..stage.draw.parameter("walkers").round() as usize {
            let start = ((seconds - 4.5) * 10.0 + stage.draw.between(-10.0, 40.0)) as i32;
            stage.walker(crossing, Start::Step(start));
        }
    },
};

pub(super) const JAYWALKER: Family = Family {
    name: "jaywalker",
    about: "somebody steps into the street where nobody should",
    parameters: &[Parameter {
        name: "surprise",
        about: "time left to the AV when somebody who walks would be before it (s): the less, the harder",
        default: [0.6, 2.2],
        limits: [0.2, 6.0],
    }],
    place: |draw| residential(Size { pockets: false, ..medium(draw) }, draw),
    act: |stage| {
        let seconds = stage.draw.between(5.0, 11.0);
        let along = stage.draw.between(0.62, 0.8);
        av_towards(stage, along, seconds);
        let crossing = stage.unmarked_crossing(0, along);
        let walker = stage.walker(crossing, Start::BeforeAv(stage.draw.parameter("surprise")));
        stage.traffic.walkers[walker].heedless = true;
    },
};

pub(super) const CYCLIST: Family = Family {
    name: "cyclist",
    about: "somebody on a bicycle at the edge of the lane",
    parameters: &[
        Parameter {
            name: "inside",
            about: "from the lane's edge into the lane (m)",
            default: [-0.2, 0.7],
            limits: [-1.0, 1.5],
        },
        Parameter { name: "ahead", about: "how far ahead at first (m)", default: [25.0, 60.0], limits: [8.0, 100.0] },
    ],
    place: |draw| {
        let mut place = residential(Size { pockets: false, ..medium(draw) }, draw);
        place.town.streets[..2].iter_mut().for_each(|street| (street.bike_lane, street.parking) = (false, false));
        place
    },
    act: |stage| {
        let slots = stage.slots(0, Side::Forward);
        let (before, speed) = (stage.draw.between(90.0, 130.0), stage.draw.between(7.5, 10.5));
        stage.av(0, Side::Forward, slots - 1, before, speed, &[]);
        let ahead = stage.draw.parameter("ahead") + 6.0 * (speed - 4.5);
        if let Some(place) = stage.place_ahead(ahead) {
            stage.cyclist(place, stage.draw.parameter("inside"), true);
        }
    },
};
