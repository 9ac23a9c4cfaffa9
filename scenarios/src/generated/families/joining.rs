//! Where streams of traffic join.

use world::geometry::Point;

use crate::generated::Family;
use crate::generated::parameters::Parameter;
use crate::generated::roads::{Control, Middle, Node, Town};
use crate::generated::stage::Side;
use crate::generated::towns::{self, Crossroads, FROM, LEFT, Place, RIGHT, Size, small};

pub(super) const MERGE: Family = Family {
    name: "merge",
    about: "a ramp leads into a road with traffic",
    parameters: &[
        Parameter {
            name: "gap",
            about: "mean time between vehicles on the road (s)",
            default: [2.2, 4.5],
            limits: [1.5, 30.0],
        },
        Parameter {
            name: "before",
            about: "way to where the ramp joins at first (m)",
            default: [70.0, 130.0],
            limits: [40.0, 180.0],
        },
    ],
    place: |draw| {
        let size = Size { lanes: 1 + draw.below(3), limit_mph: draw.pick(&[40.0, 45.0, 50.0]), pockets: false };
        let mut town = Town::default();
        let angle = draw.between(0.12, 0.25);
        let (before, after, ramp) = (draw.between(240.0, 300.0), draw.between(280.0, 340.0), 300.0);
        let ends =
            [Point::new(0.0, 0.0), Point::new(-before, 0.0), Point::new(after, 0.0), Point::unit(-angle) * -ramp];
        town.nodes.extend(ends.map(|at| Node { at, control: Control::Free }));
        // The ramp comes from the right: from below, as the road leads to the right.
        town.nodes[3].at = Point::new(-ramp * libm::cos(angle), -ramp * libm::sin(angle));
        town.nodes[0].control = Control::Merge;
        let mut road = |from, to, size, is_major, draw: &mut _| {
            let mut street = towns::street(from, to, size, is_major, draw);
            street.backward = 0;
            (street.walks, street.parking, street.bike_lane, street.middle) = (false, false, false, Middle::Line);
            street.lane_width = 3.6;
            town.streets.push(street);
        };
        road(3, 0, Size { lanes: 1, ..size }, false, draw);
        road(1, 0, size, true, draw);
        road(0, 2, size, true, draw);
        towns::go_on(&mut town, 2, 0.0, Size { lanes: size.lanes, ..small(draw) }, draw);
        Place { town: towns::laid_out(town, draw), arms: [Some(0), None, Some(2), Some(1)] }
    },
    act: |stage| {
        let (before, speed) = (stage.draw.parameter("before"), stage.draw.between(13.0, 17.0));
        stage.av(0, Side::Forward, 0, before, speed, &[]);
        let gap = stage.draw.parameter("gap");
        stage.flow(1, Side::Forward, usize::MAX, gap, &[]);
    },
};

pub(super) const ROUNDABOUT: Family = Family {
    name: "roundabout",
    about: "into a roundabout, and out again",
    parameters: &[
        Parameter {
            name: "gap",
            about: "mean time between vehicles on the other streets (s)",
            default: [3.0, 8.0],
            limits: [1.5, 30.0],
        },
        Parameter {
            name: "before",
            about: "way to the ring at first (m)",
            default: [25.0, 70.0],
            limits: [15.0, 120.0],
        },
        Parameter { name: "radius", about: "radius of the ring (m)", default: [13.0, 22.0], limits: [12.0, 40.0] },
    ],
    place: |draw| {
        let control = Control::Roundabout { radius: draw.parameter("radius") };
        let (own, across) = (Size { lanes: 1, ..small(draw) }, Size { lanes: 1, ..small(draw) });
        let arms = [true, true, draw.chance(0.7)];
        towns::crossroads(Crossroads { control, own, across, own_is_major: true, arms, approach: 170.0 }, draw)
    },
    act: |stage| {
        let (before, speed) = (stage.draw.parameter("before"), stage.draw.between(6.0, 10.0));
        stage.av(FROM, Side::Backward, 0, before, speed, &[]);
        let gap = stage.draw.parameter("gap");
        stage.stream(LEFT, gap, &[]);
        stage.stream(RIGHT, gap, &[]);
    },
};
