//! Outlines of the drivable area as road edges, which have the road on their left.

use world::geometry::{Point, polygon_contains};
use world::map::RoadEdge;

/// So many rings are told apart by what lies in what; maps have some tens. Of more, each is taken as it is.
const MOST_RINGS: usize = 256;

/// The rings, turned round where the road is on their right: around an area they go counter-clockwise, around a hole in it clockwise. A ring
/// that lies in an odd number of others is one around a hole.
pub(super) fn with_the_road_on_their_left(mut rings: Vec<RoadEdge>) -> Vec<RoadEdge> {
    if rings.len() > MOST_RINGS {
        return rings;
    }
    let within = |ring: &RoadEdge, other: &RoadEdge| {
        let point = ring.polyline.first().map(|point| point.xy());
        point.is_some_and(|point| polygon_contains(other.polyline.iter().map(|corner| corner.xy()), point))
    };
    let around_hole: Vec<bool> = (0..rings.len())
        .map(|place| {
            let others = rings.iter().enumerate().filter(|(other, _)| *other != place);
            others.filter(|(_, other)| within(&rings[place], other)).count() % 2 == 1
        })
        .collect();
    for (ring, around_hole) in rings.iter_mut().zip(around_hole) {
        let corners: Vec<Point> = ring.polyline.iter().map(|point| point.xy()).collect();
        let twice_area: f64 = corners.windows(2).map(|pair| pair[0].x * pair[1].y - pair[1].x * pair[0].y).sum();
        if (twice_area > 0.0) == around_hole {
            ring.polyline.reverse();
        }
    }
    rings
}
