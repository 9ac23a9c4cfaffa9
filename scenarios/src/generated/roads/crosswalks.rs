//! Crosswalks over the arms of junctions.

use world::geometry::Point;

use super::super::curve::Curve;
use super::builder::Builder;
use super::net::CROSSWALK;
use super::place::Place;
use super::profile::WALK;
use super::{Crossing, LaneIndex, flat};

/// The crosswalk over an arm, and where it crosses the ways.
pub(super) fn lay_crosswalk(
    builder: &mut Builder,
    place: &Place<'_>,
    arm: (usize, usize),
    (entering, leaving): (&[LaneIndex], &[LaneIndex]),
) -> Option<usize> {
    let street = place.street();
    if street.setback(place.arm.end) < CROSSWALK.1 {
        return None;
    }
    let (near, far) = CROSSWALK;
    let (left, right) = place.curbs();
    let corners = [(near, -right), (near, left), (far, left), (far, -right)];
    builder.crosswalk(corners.map(|(behind, left)| flat(place.at(-behind, left))).to_vec());
    let middle = 0.5 * (near + far);
    let course = Curve::line(place.at(-middle, -right - WALK), place.at(-middle, left + WALK));
    builder.roads.crossings.push(Crossing { course: course.into(), arm: Some(arm) });
    let crossing = builder.roads.crossings.len() - 1;
    let pose = place.outward(-middle);
    let half = 0.5 * (far - near);
    // How far along a way, from the stop line on, it still lies on the crosswalk.
    let depth = |course: &Curve, points: &mut dyn Iterator<Item = Point>| {
        let on = points.take_while(|point| pose.to_body(*point).x > -half).count();
        (on as f64 * course.step()).clamp(near, course.length())
    };
    for way in entering {
        let lane = &mut builder.roads.lanes[*way];
        let to = depth(&lane.course, &mut lane.course.points());
        lane.crossed.push((crossing, near, to));
    }
    for way in leaving {
        let lane = &mut builder.roads.lanes[*way];
        let (length, from) = (lane.course.length(), depth(&lane.course, &mut lane.course.points().rev()));
        lane.crossed.push((crossing, length - from, length - near));
    }
    Some(crossing)
}
