//! The last resort, whoever should have gone first: one who would drive into somebody with the front brakes as hard as can be. Whose side or rear is
//! met leaves that to the other.

use world::geometry::{OrientedBox, Point, boxes_overlap};

use crate::ahead::View;
use crate::scenery::{Body, Forecast, LOOK_SECONDS, left_of};

/// How far ahead one looks, in looks of this time (s): 1.5 s.
const LOOKS: usize = 6;
const SECONDS: f64 = 0.25;

/// So near (m) is a contact.
const NEAR: f64 = 0.15;

/// Whether one drives into `body` soon, if both go on as they do.
pub(crate) fn is_imminent(view: &View<'_>, body: &Body, forecast: &Forecast) -> bool {
    let own = view.own;
    if own.speed < crate::scenery::STANDING {
        return false;
    }
    let reach = own.half_length + body.half_length + (own.speed + body.speed) * LOOKS as f64 * SECONDS + 1.0;
    let offset = body.position - own.position;
    if offset.norm_squared() > reach * reach || offset.dot(own.forward) < 0.0 {
        return false;
    }
    if boxes_overlap(&outline(own, own.position, own.forward, 0.0), &outline(body, body.position, body.forward, 0.0)) {
        return false; // it has happened, and both want to get out of it
    }
    (1..=LOOKS).any(|look| {
        let seconds = look as f64 * SECONDS;
        let station = view.place.station + own.speed * seconds;
        let forward = view.way.direction(view.way.sample_at(station));
        let position = view.way.point_at(station) + left_of(forward) * view.place.lateral;
        let (there, heads) = later(body, forecast, seconds);
        let other = outline(body, there, heads, NEAR);
        // The front half alone: what meets the rear half comes from the side.
        let front = Body { half_length: 0.5 * own.half_length, ..*own };
        boxes_overlap(&outline(&front, position + forward * front.half_length, forward, NEAR), &other)
    })
}

/// Where a body is, and where it heads, after a time within its forecast (s).
fn later(body: &Body, forecast: &Forecast, seconds: f64) -> (Point, Point) {
    let looks = seconds / LOOK_SECONDS;
    let after = looks.ceil().max(1.0) as usize - 1;
    let (from, to) = (if after == 0 { body.position } else { forecast.points[after - 1] }, forecast.points[after]);
    (from + (to - from) * (looks - after as f64), forecast.forwards[after])
}

fn outline(body: &Body, center: Point, forward: Point, by: f64) -> OrientedBox {
    OrientedBox { center, forward, half_length: body.half_length + by, half_width: body.half_width + by }
}
