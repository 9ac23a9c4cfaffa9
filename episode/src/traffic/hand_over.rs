//! Who is taken over from the log, and when.
//!
//! An agent on wheels within the radius that is seen at this very step, and that does not stand for the rest of the log, is taken over
//!
//! - where the log would bring it into the AV: [`must_react`] says so of the AV that is driven, and not of the logged one;
//! - from the step on at which the AV has left the log: where its way may meet the AV's, within the time that [`Stretch`] looks ahead;
//! - where somebody who reacts has left the log: where that would bring it into him, or he is ahead on its way. Here the radius is no matter.
//!
//! Who appears in the log where somebody is now, or is about to drive into him, does not come at all: there is no room.
//!
//! People on foot are taken over by the first of these alone, if a setting says so at all.

use std::sync::Arc;

use world::geometry::{Bounds, OrientedBox, Point, angle_difference, boxes_overlap};
use world::reference_line::ReferenceLine;
use world::scene::{AgentKind, AgentState};
use world::traffic::Way;
use world::traffic::way::SPACING;

use super::{Pedestrians, TrafficSettings};
use crate::judges::reaction::must_react;
use crate::judges::time_to_collision::TrafficAgent;
use crate::judges::{Body, STOREY};

/// How far the AV's way counts (m): behind its centre, and ahead.
const AV_BEHIND: usize = 5;
const AV_AHEAD: usize = 80;

/// Samples of the reference line in a metre.
const LINE_SAMPLES: usize = 10;

/// How long an agent's way is looked ahead (s), and at least how far (m).
const LOOK_SECONDS: f64 = 6.0;
const LOOK_LEAST: f64 = 25.0;

/// Samples of an agent's way between those that are looked at (2 m).
const STRIDE: usize = 4;

/// Ways with less room than this (m) between who drives on them meet.
const ROOM: f64 = 0.3;

/// Who would be so near to somebody (m), after one of these times (s), if both went straight on, does not appear; nor who is so near ahead of him
/// (s, and at least m).
const NO_DISTANCE: f64 = 0.3;
const NO_TIMES: [f64; 4] = [0.0, 0.5, 1.0, 1.5];
const NO_ROOM: f64 = 1.0;
const LEAST_ROOM: f64 = 1.0;

/// Somebody who is on one's way but for this (m) is on it.
const BESIDE: f64 = 0.8;

/// Who is said to go aside by more than this (rad), at more than this (m/s), slides or backs up, or the log is wrong for a moment.
const SLIDING: f64 = 0.3;
const SLIDING_SPEED: f64 = 0.45;

/// Who is faster (m/s) was tracked wrongly.
const FASTEST: f64 = 50.0;

/// Somebody so far ahead on one's way (m) is followed.
const FOLLOWED: f64 = 40.0;

/// The stretch of its way on which the AV is now.
#[derive(Clone, Debug)]
pub struct Stretch {
    points: Vec<(Point, f64)>,
    bounds: Bounds,
    half_width: f64,
}

impl Stretch {
    /// That of an AV of so much width (m) at a sample of its line.
    #[must_use]
    pub fn of(line: &ReferenceLine, sample: usize, width: f64) -> Self {
        let from = sample.saturating_sub(AV_BEHIND * LINE_SAMPLES);
        let until = line.len().min(sample + AV_AHEAD * LINE_SAMPLES);
        let points: Vec<(Point, f64)> =
            (from..until).step_by(LINE_SAMPLES).map(|sample| (line.point(sample), line.z[sample])).collect();
        Self { bounds: Bounds::of(points.iter().map(|(point, _)| *point)), points, half_width: 0.5 * width }
    }

    /// Whether an agent of so much width (m) and speed (m/s) at `sample` of its way comes into it.
    #[must_use]
    pub fn is_met_by(&self, way: &Way, sample: usize, width: f64, speed: f64) -> bool {
        let near = self.half_width + 0.5 * width + ROOM;
        let bounds = self.bounds.grown(near);
        let samples = ((LOOK_SECONDS * speed).max(LOOK_LEAST) / SPACING) as usize;
        (sample..way.len().min(sample + samples)).step_by(STRIDE).any(|sample| {
            let point = way.points()[sample];
            bounds.hold(point)
                && self.points.iter().any(|(own, z)| {
                    own.distance_squared(point) <= near * near + 0.25 && (z - way.height(sample)).abs() <= STOREY
                })
        })
    }
}

/// Somebody who is not where the log has him: the AV, or an agent that reacts.
#[derive(Clone, Copy, Debug)]
pub struct Departed {
    /// Where he is.
    pub body: Body,
    /// Where the log has him, if anywhere.
    pub logged: Option<Body>,
}

impl Departed {
    /// Whether the log would bring `agent` into him, and not into where it has him itself.
    #[must_use]
    pub fn is_run_into_by(&self, agent: &TrafficAgent) -> bool {
        must_react(&self.body, agent).is_some() && self.logged.is_none_or(|logged| must_react(&logged, agent).is_none())
    }

    /// Whether he is ahead of somebody of so much width (m) at `sample` of `way`, and on it.
    #[must_use]
    pub fn is_on(&self, way: &Way, sample: usize, width: f64) -> bool {
        let state = &self.body.state;
        let from = way.points()[sample.min(way.len() - 1)];
        if from.distance_squared(state.position()) > FOLLOWED * FOLLOWED {
            return false;
        }
        let place = way.follow(state.position(), sample);
        let ahead = place.station - sample as f64 * SPACING;
        let direction = way.direction(place.sample);
        let forward = self.body.outline.forward;
        let across = 0.5 * (state.length * direction.cross(forward).abs() + state.width * direction.dot(forward).abs());
        (0.0..=FOLLOWED).contains(&ahead) && place.lateral.abs() <= across + 0.5 * width + BESIDE
    }
}

/// Whether an agent that has just appeared in the log has no room to: it would be in somebody, or in him soon.
#[must_use]
pub fn has_no_room(agent: &TrafficAgent, others: &[Departed]) -> bool {
    let later = |of: &OrientedBox, moved: Point, by: f64| OrientedBox {
        center: of.center + moved,
        half_length: of.half_length + by,
        half_width: of.half_width + by,
        ..*of
    };
    let is_in_the_way = |other: &Departed| {
        let Body { state, outline, speed } = other.body;
        let ahead = (speed * NO_ROOM).max(LEAST_ROOM);
        let center = outline.center + outline.forward * (0.5 * ahead);
        let taken = OrientedBox { center, half_length: outline.half_length + 0.5 * ahead, ..outline };
        let meet = |seconds: f64| {
            let his = later(&outline, state.velocity() * seconds, NO_DISTANCE);
            boxes_overlap(&his, &later(&agent.outline, agent.outline.forward * (agent.speed * seconds), 0.0))
        };
        (state.z - agent.z).abs() <= STOREY && (boxes_overlap(&taken, &agent.outline) || NO_TIMES.into_iter().any(meet))
    };
    agent.sudden && others.iter().any(is_in_the_way)
}

/// An agent that the log still drives.
#[derive(Clone, Debug)]
pub struct Replayed<'a> {
    /// As the judges see it.
    pub agent: &'a TrafficAgent,
    /// Where it is.
    pub state: &'a AgentState,
    /// Where it goes, and the sample where it is now; none where it stands for the rest of the log.
    pub way: Option<(&'a Arc<Way>, usize)>,
    /// Whether it is within the radius.
    pub is_near: bool,
}

/// Whether an agent goes where its front points, as who is driven does: else it would jump aside when it is taken over.
fn goes_where_it_points(state: &AgentState) -> bool {
    let velocity = state.velocity();
    let (speed, slip) = (velocity.norm(), angle_difference(state.heading, velocity.heading()).abs());
    speed <= FASTEST && (slip <= SLIDING || speed * slip <= SLIDING_SPEED)
}

/// Whether `replayed` is to be taken over. `stretch` is the AV's, once that has left the log.
#[must_use]
pub fn is_due(
    settings: &TrafficSettings,
    replayed: &Replayed<'_>,
    av: &Departed,
    stretch: Option<&Stretch>,
    others: &[Departed],
) -> bool {
    let Some((way, sample)) = replayed.way.filter(|_| goes_where_it_points(replayed.state)) else { return false };
    let agent = replayed.agent;
    match agent.kind {
        AgentKind::Other => return false,
        AgentKind::Pedestrian => {
            return settings.pedestrians == Pedestrians::Stop && replayed.is_near && av.is_run_into_by(agent);
        }
        AgentKind::Vehicle | AgentKind::Cyclist => {}
    }
    let width = replayed.state.width;
    let meets_av = || {
        av.is_run_into_by(agent) || stretch.is_some_and(|stretch| stretch.is_met_by(way, sample, width, agent.speed))
    };
    replayed.is_near && meets_av()
        || others.iter().any(|other| other.is_run_into_by(agent) || other.is_on(way, sample, width))
}
