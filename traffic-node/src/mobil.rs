//! Changes of lane by MOBIL (Kesting, Treiber, Helbing, "General lane-changing model MOBIL for car-following models", 2007): one goes over if it
//! gains more than it costs those behind, and nobody has to brake hard.

use world::geometry::angle_difference;
use world::traffic::{Way, Ways};

use crate::ahead::View;
use crate::scenery::Scenery;

/// Nobody behind must brake harder (m/s^2).
const SAFE: f64 = 2.0;

/// Nobody changes who is slower than this (m/s).
const SLOWEST: f64 = 4.0;

/// A lane beside is this far away (m), and as straight (rad) as one's own.
const APART: std::ops::Range<f64> = 2.0..5.0;
const PARALLEL: f64 = 0.15;

/// Gaps that are left at least: so many metres, and seconds of whoever is behind.
const LEAST_GAP: f64 = 3.0;
const LEAST_SECONDS: f64 = 0.5;

/// What a change of lane must be worth.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Incentive {
    /// What others' loss counts.
    pub politeness: f64,
    /// What it must gain (m/s^2).
    pub threshold: f64,
    /// The acceleration as it is, and on a free road (m/s^2).
    pub now: f64,
    pub free: f64,
}

/// The way along a lane beside, if that is worth it.
pub(crate) fn change(view: &View<'_>, incentive: &Incentive, scenery: &Scenery, ways: &Ways) -> Option<Way> {
    if view.own.speed < SLOWEST || incentive.free - incentive.now <= incentive.threshold {
        return None;
    }
    let lane = view.way.lane_at(view.place.station)?;
    ways.beside(lane, view.own.position).find_map(|beside| {
        let (point, heading) = ways.place(&beside);
        let place = view.way.follow(point, view.place.sample);
        let turned = angle_difference(view.way.heading(place.sample), heading);
        if !APART.contains(&place.lateral.abs()) || turned.abs() > PARALLEL {
            return None;
        }
        let gain = gain(view, incentive, scenery, place.lateral)?;
        (gain > incentive.threshold).then(|| ways.along(beside))?
    })
}

/// What it gains (m/s^2) to be so far to the left; none where that is not safe.
fn gain(view: &View<'_>, incentive: &Incentive, scenery: &Scenery, lateral: f64) -> Option<f64> {
    let own = view.own;
    let (mut then, mut cost) = (incentive.free, 0.0_f64);
    for body in scenery.bodies.iter().filter(|body| body.track != own.track && (body.z - own.z).abs() < 3.0) {
        if body.position.distance_squared(own.position) > 6400.0 {
            continue;
        }
        let place = view.way.follow(body.position, view.place.sample);
        let direction = view.way.direction(place.sample);
        let (across, along) = body.reach(direction, body.forward);
        if (place.lateral - lateral).abs() > across + own.half_width + 0.3 {
            continue;
        }
        let gap = (place.station - view.place.station).abs() - along - own.half_length;
        let speed = direction.dot(body.velocity);
        if place.station >= view.place.station {
            if gap < LEAST_GAP + LEAST_SECONDS * (own.speed - speed).max(0.0) {
                return None;
            }
            then = then.min(view.idm.behind(own.speed, gap, speed.max(0.0)));
        } else {
            if gap < LEAST_GAP + LEAST_SECONDS * speed.max(0.0) {
                return None;
            }
            let braking = -view.idm.behind(speed.max(0.0), gap, own.speed);
            if braking > SAFE {
                return None;
            }
            cost = cost.max(braking);
        }
    }
    Some(then - incentive.now - incentive.politeness * cost)
}
