//! Who comes into one's way within the next seconds, and who goes first. Where ways cross, whoever is there first goes first; those whom the log
//! drives always do, because nothing keeps them; and an AV that comes at the same time.

use world::traffic::WayPlace;

use crate::ahead::View;
use crate::scenery::{Body, Forecast, LOOK_SECONDS, LOOKS, STANDING, Who};

/// Room (m) that who comes must have beside one.
const ROOM: f64 = 0.3;

/// Whoever heads along the way (cosine of 0.1 rad), now and at last, and comes no nearer than this (m/s), stays beside it.
const ALONG: f64 = 0.995;
const DRIFT: f64 = 0.3;

/// Whoever goes along one's way as straight as this (cosine of 45 degrees) merges.
const MERGES: f64 = 0.7;

/// Somebody who stands starts to go: times are reckoned at this speed (m/s) at least.
const PACE: f64 = 3.0;

/// Arrivals nearer to each other than this (s) are at the same time.
const SAME_TIME: f64 = 0.4;

/// Distance to where somebody crosses at which one stands (m).
const STAND_BACK: f64 = 1.0;

/// One who would have to brake harder than this (m/s^2) to let somebody pass goes on.
const STOPS_BY: f64 = 6.0;

/// What somebody's coming asks for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Claim {
    /// To be followed from now on: he merges so far ahead (m), at so much speed along the way (m/s).
    Follow { gap: f64, speed: f64 },
    /// To be let in ahead of one who is beside him: one falls back, by such an acceleration (m/s^2).
    FallBack { acceleration: f64 },
    /// To be let pass: one stands so far ahead (m).
    Yield { distance: f64 },
}

/// The part of one's way that somebody takes, and when.
#[derive(Clone, Copy, Debug)]
struct Zone {
    /// Stations (m).
    from: f64,
    until: f64,
    /// Times (s).
    enters: f64,
    leaves: f64,
    /// Speed along the way when he comes (m/s), and whether that is where he goes.
    along: f64,
    merges: bool,
}

/// Whether somebody beside the way comes to it, or over it: by where he is after 2 s and after 4. Who does not, in three lanes of traffic nearly
/// everybody, is looked at no closer.
pub(crate) fn comes_near(view: &View<'_>, body: &Body, place: &WayPlace, forecast: &Forecast) -> bool {
    if body.speed < STANDING {
        return false;
    }
    let direction = view.way.direction(place.sample);
    let last = LOOKS - 1;
    let then = view.way.direction(view.way.sample_at(place.station + body.speed * LOOKS as f64 * LOOK_SECONDS));
    let is_along = direction.dot(body.forward) > ALONG && then.dot(forecast.forwards[last]) > ALONG;
    if is_along && direction.cross(body.velocity).abs() < DRIFT && view.clearance(place, body.half_width) > ROOM {
        return false; // it keeps its lane, and that lies beside the way
    }
    let mut sample = place.sample;
    [LOOKS / 2 - 1, last].into_iter().any(|look| {
        let there = view.way.follow(forecast.points[look], sample);
        sample = there.sample;
        let (across, _) = body.reach(view.way.direction(sample), forecast.forwards[look]);
        let changes_sides = (there.lateral > view.place.lateral) != (place.lateral > view.place.lateral);
        changes_sides || view.clearance(&there, across) < ROOM
    })
}

/// What `body`, now at `place` beside the way and out of it, asks for.
pub(crate) fn claim(view: &View<'_>, body: &Body, place: &WayPlace, forecast: &Forecast) -> Option<Claim> {
    let direction = view.way.direction(place.sample);
    let (across, _) = body.reach(direction, body.forward);
    let is_behind = place.station <= view.place.station;
    if is_behind && view.clearance(place, across) < ROOM {
        return None; // he follows, and has eyes of his own
    }
    let zone = zone(view, body, place, forecast)?;
    let speed = view.own.speed.max(PACE);
    let distance = zone.from - view.front();
    let (arrives, gone) = (distance / speed, (zone.until + view.own.half_length - view.place.station) / speed);
    if distance < 0.0 && zone.merges && !is_behind {
        return Some(Claim::FallBack { acceleration: fall_back(view, &zone, distance) });
    }
    if distance < 0.0 || gone + view.margin < zone.enters || zone.leaves + view.margin < arrives {
        return None;
    }
    let is_first = match body.who {
        Who::Replayed => true,
        Who::Av => zone.enters < arrives + SAME_TIME,
        Who::Reacting if (zone.enters - arrives).abs() < SAME_TIME => body.track < view.own.track,
        Who::Reacting => zone.enters < arrives,
    };
    if !is_first {
        return None;
    }
    if zone.merges {
        let gap = distance - zone.along * zone.enters;
        return (!is_behind || gap > 0.0).then_some(Claim::Follow { gap, speed: zone.along });
    }
    let distance = distance - STAND_BACK;
    let needed = view.own.speed * view.own.speed / (2.0 * distance.max(0.1));
    (needed <= STOPS_BY).then_some(Claim::Yield { distance })
}

/// The even acceleration (m/s^2) by which one who is beside somebody is behind him when their ways meet.
fn fall_back(view: &View<'_>, zone: &Zone, distance: f64) -> f64 {
    let time = zone.enters.max(LOOK_SECONDS);
    let gap = distance - zone.along * zone.enters;
    let too_far = view.idm.standstill_gap - gap + (view.own.speed - zone.along) * time;
    (-2.0 * too_far / (time * time)).min(0.0)
}

/// Where and when he is in the way.
fn zone(view: &View<'_>, body: &Body, place: &WayPlace, forecast: &Forecast) -> Option<Zone> {
    let mut zone: Option<Zone> = None;
    let mut sample = place.sample;
    for look in 0..LOOKS {
        let there = view.way.follow(forecast.points[look], sample);
        sample = there.sample;
        let (direction, forward) = (view.way.direction(sample), forecast.forwards[look]);
        let (across, along) = body.reach(direction, forward);
        let is_in = view.clearance(&there, across) < ROOM && there.station > view.place.station;
        // Past the end of the way nothing is known.
        if !is_in || sample + 1 >= view.way.len() {
            if zone.is_some() {
                break;
            }
            continue;
        }
        let time = (look + 1) as f64 * LOOK_SECONDS;
        let (from, until) = (there.station - along, there.station + along);
        let cosine = direction.dot(forward);
        let first = Zone {
            from,
            until,
            // It came in since the look before.
            enters: time - LOOK_SECONDS,
            leaves: time,
            along: (cosine * body.speed).max(0.0),
            merges: cosine > MERGES,
        };
        let so_far = zone.unwrap_or(first);
        zone = Some(Zone {
            from: so_far.from.min(from),
            until: so_far.until.max(until),
            leaves: time + LOOK_SECONDS,
            merges: cosine > MERGES,
            ..so_far
        });
    }
    zone
}
