//! Curbs around the corners of junctions.

use world::geometry::wrap_angle;
use world::map::RoadEdgeKind;

use super::super::curve::{Curve, straight};
use super::builder::Builder;
use super::flat;
use super::place::Place;

/// Curbs whose directions differ by less (rad) have no corner between them.
const FLAT: f64 = 0.5;

/// Curbs that turn further than this (rad) turn back.
const GORE: f64 = 2.6;

/// The curbs around the corners, from each arm's inbound lanes to the next one's outbound.
pub(super) fn lay_curbs(builder: &mut Builder, places: &[Place<'_>], radius: f64) {
    for (index, place) in places.iter().enumerate() {
        let next = &places[(index + 1) % places.len()];
        if place.street().curbs && next.street().curbs {
            lay_curb(builder, place, next, radius);
        }
    }
}

pub(super) fn lay_curb(builder: &mut Builder, from: &Place<'_>, to: &Place<'_>, radius: f64) {
    let (start, end) = (from.curb_ends.0, to.curb_ends.1);
    let (ahead, back) = (start.to_body(end.position()), end.to_body(start.position()));
    let turned = wrap_angle(end.heading - start.heading);
    if start.position().distance(end.position()) < 1e-6 {
        return;
    }
    if turned.abs() > GORE {
        // Where a ramp joins, its curb and the road's end in a nose.
        builder.edge(RoadEdgeKind::Boundary, [start, end].map(|pose| flat(pose.position())).to_vec());
        return;
    }
    let shift = ahead.y.abs().min(back.y.abs());
    // On the flat side of a T between streets of different widths, the wide one's curb goes on as far as it can: ways that turn left
    // swing out there.
    let course = if turned.abs() < FLAT && shift > 1.5 && (ahead.y > 0.0) == (back.y < 0.0) {
        let short = (1.5 * shift).clamp(4.0, 0.7 * ahead.x.abs().max(6.0));
        if ahead.y > 0.0 {
            let on = Curve::new(start, &[straight((ahead.x - short).max(0.5))]);
            let rest = Curve::join(on.end(), end);
            on.then(&rest)
        } else {
            let before = Curve::new(end, &[straight(0.0)]).strip(-(-back.x - short).max(0.5), 0.0, 0.0);
            Curve::join(start, before.start()).then(&before)
        }
    } else {
        Curve::join_within(start, end, if turned.abs() < FLAT { f64::INFINITY } else { radius })
    };
    builder.edge(RoadEdgeKind::Boundary, course.polyline());
}
