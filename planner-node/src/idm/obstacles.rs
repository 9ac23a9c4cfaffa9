//! Who is in the way: what overlaps the AV's corridor ahead now, what will cross it when the AV would be there, red lights,
//! and the end of the line. Each stands for a leader of the intelligent driver model.

use std::fmt;

use world::geometry::Point;
use world::observation::{Observation, ObservedAgent};
use world::plan::STEP_SECONDS;
use world::scene::{AgentKind, AgentState, TrackId};

use super::corridor::{Corridor, Footprint, Place};
use super::speed::HARDEST_BRAKING;

/// Agents are expected to keep their velocity for so long (s). Beyond it that is no expectation any more.
const PROJECTION: f64 = 3.0;
/// ... in steps of (s).
const PROJECTION_STEP: f64 = 0.25;
/// A crossing is a conflict if the AV is there within this of the agent (s).
const CROSSING_MARGIN: f64 = 0.8;
/// The AV counts as no slower than this (m/s) where it is asked when it would be there: standing, it would never be.
const SLOWEST_APPROACH: f64 = 3.0;
/// Room to either side of the AV (m), and for people on foot or on a bicycle.
const SIDE_MARGIN: f64 = 0.15;
const SIDE_MARGIN_VULNERABLE: f64 = 0.4;
/// An agent drives along the line, or against it, where this share of its speed at most is across (sine of 30 degrees).
const PARALLEL: f64 = 0.5;
/// ... and drifts out of its lane where it is more than this (m/s): what is less is noise.
const DRIFT: f64 = 0.3;
/// Below this (m/s) an agent stands: what is logged is noise.
const STANDING: f64 = 0.5;
/// What is this much above or below the line (m) is on another level.
const OTHER_LEVEL: f64 = 3.5;
/// The AV's own offset from the line shrinks to a third over this many metres, or over this many seconds.
const OFFSET_METERS: f64 = 8.0;
const OFFSET_SECONDS: f64 = 2.0;

/// What an obstacle is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum What {
    Agent(TrackId),
    Crossing(TrackId),
    RedLight,
    LineEnd,
}

impl fmt::Display for What {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Agent(track) => write!(f, "behind {track}"),
            Self::Crossing(track) => write!(f, "gives way to {track}"),
            Self::RedLight => f.write_str("red light"),
            Self::LineEnd => f.write_str("end of the line"),
        }
    }
}

/// Something to stop before or to follow.
#[derive(Clone, Copy, Debug)]
pub struct Obstacle {
    pub what: What,
    /// Where its near end is now (m along the line).
    pub station: f64,
    /// Its speed along the line (m/s), never negative.
    pub speed: f64,
}

impl Obstacle {
    /// Whether it stays where it is: a red light, or the line's end.
    pub fn is_fixed(&self) -> bool {
        matches!(self.what, What::RedLight | What::LineEnd)
    }

    /// Where it is `seconds` later.
    pub fn station_after(&self, seconds: f64) -> f64 {
        self.station + self.speed * seconds
    }
}

/// The AV, as the line sees it.
struct Av {
    place: Place,
    front: f64,
    rear: f64,
    half_width: f64,
    speed: f64,
}

impl Av {
    /// How far from the line its corridor reaches at most (m), to either side.
    fn reach(&self, margin: f64) -> f64 {
        self.place.lateral.abs() + self.half_width + margin
    }

    /// Right and left edge of its corridor at `station`: its offset now, fading as it steers back onto the line.
    fn edges(&self, station: f64, margin: f64) -> (f64, f64) {
        let fade = libm::exp(-(station - self.front).max(0.0) / OFFSET_METERS.max(OFFSET_SECONDS * self.speed));
        let center = self.place.lateral * fade;
        (center - self.half_width - margin, center + self.half_width + margin)
    }
}

/// Puts all that is in the way of the AV, which is at `place`, into `obstacles`, in no order.
pub fn in_the_way(corridor: &Corridor, place: Place, observation: &Observation, obstacles: &mut Vec<Obstacle>) {
    let state = &observation.av;
    let av = Av {
        place,
        front: place.station + 0.5 * state.length,
        rear: place.station - 0.5 * state.length,
        half_width: 0.5 * state.width,
        speed: state.speed(),
    };
    obstacles.clear();
    obstacles.extend(observation.agents.iter().filter_map(|agent| of_agent(corridor, &av, agent)));
    obstacles.extend(red_light(corridor, &av, &observation.window.red_stops));
    obstacles.extend(line_end(corridor));
}

fn of_agent(corridor: &Corridor, av: &Av, agent: &ObservedAgent) -> Option<Obstacle> {
    let state = &agent.state;
    let speed = state.speed();
    let standing = speed < STANDING;
    let margin = match agent.kind {
        AgentKind::Pedestrian | AgentKind::Cyclist => SIDE_MARGIN_VULNERABLE,
        AgentKind::Vehicle | AgentKind::Other => SIDE_MARGIN,
    };
    // Out of reach within the projection, whatever it does.
    let reach = 2.0 * av.half_width + PROJECTION * if standing { 0.0 } else { speed };
    let sample = corridor.nearest_pass(state.position(), av.place.sample);
    let above = state.z - corridor.height(sample);
    if above.abs() > OTHER_LEVEL || corridor.is_beside(state, sample, reach) {
        return None;
    }
    let now = corridor.footprint(&state.oriented_box(), sample);
    if now.laterals.0 > reach || now.laterals.1 < -reach || now.stations.0 >= corridor.station(corridor.len() - 1) {
        return None;
    }
    let motion = Motion::of(corridor, sample, state);
    if overlaps(av, &now, margin) && is_ahead(av, &now, motion.speed()) {
        return Some(Obstacle { what: What::Agent(agent.track), station: now.stations.0, speed: motion.speed() });
    }
    if standing { None } else { crossing(corridor, av, agent, (sample, now), motion, margin) }
}

/// How an agent goes on.
#[derive(Clone, Copy)]
struct Motion {
    /// Its velocity along the line and to the left (m/s).
    along: f64,
    across: f64,
    /// It drives roughly with the line or against it: so it will where the line turns.
    follows: bool,
}

impl Motion {
    /// That of one whose centre lies at `sample`.
    fn of(corridor: &Corridor, sample: usize, state: &AgentState) -> Self {
        let velocity = if state.speed() < STANDING { Point::default() } else { state.velocity() };
        let tangent = corridor.direction(sample);
        let (along, across) = (tangent.dot(velocity), tangent.cross(velocity));
        let follows = across.abs() < PARALLEL * velocity.norm();
        let drifts = across.abs() > DRIFT;
        Self { along, across: if follows && !drifts { 0.0 } else { across }, follows }
    }

    /// Speed along the line (m/s), never negative.
    fn speed(&self) -> f64 {
        self.along.max(0.0)
    }
}

/// Whether the footprint lies in the AV's corridor.
fn overlaps(av: &Av, footprint: &Footprint, margin: f64) -> bool {
    let reach = av.reach(margin);
    if footprint.laterals.0 >= reach || footprint.laterals.1 <= -reach {
        return false; // wherever along the line
    }
    let (right, left) = av.edges(footprint.stations.0, margin);
    footprint.laterals.0 < left && footprint.laterals.1 > right
}

/// Whether the AV can avoid it by braking. One that moves along the line cuts in as soon as its nose is ahead; one that
/// stands or crosses is past when the AV's front is.
fn is_ahead(av: &Av, footprint: &Footprint, speed: f64) -> bool {
    if speed > STANDING { footprint.stations.1 > av.front + 0.5 } else { footprint.stations.0 > av.front - 0.5 }
}

/// An agent that is beside the corridor now, and will be in it when the AV is there.
fn crossing(
    corridor: &Corridor,
    av: &Av,
    agent: &ObservedAgent,
    (sample, now): (usize, Footprint),
    motion: Motion,
    margin: f64,
) -> Option<Obstacle> {
    let steps = (PROJECTION / PROJECTION_STEP) as usize;
    (1..=steps).find_map(|k| {
        let seconds = k as f64 * PROJECTION_STEP;
        let then = if motion.follows {
            now.moved(motion.along * seconds, motion.across * seconds)
        } else {
            let later = later(&agent.state, seconds);
            let sample = corridor.nearest_pass(later.position(), sample);
            if corridor.is_beside(&later, sample, av.reach(margin)) {
                return None;
            }
            corridor.footprint(&later.oriented_box(), sample)
        };
        if then.stations.1 < av.front || !overlaps(av, &then, margin) {
            return None;
        }
        // When the AV would come to where the agent is then, and when it would have left it.
        let pace = av.speed.max(SLOWEST_APPROACH);
        let arrival = (then.stations.0 - av.front) / pace - CROSSING_MARGIN;
        let departure = (then.stations.1 - av.rear) / pace + CROSSING_MARGIN;
        // One that drives along the line merges, and is followed from now on at its own speed.
        let merges = motion.follows && motion.along > 0.0;
        if !merges && !(arrival..=departure).contains(&seconds) {
            return None;
        }
        let speed = if merges { motion.along } else { 0.0 };
        // One that comes from behind has its own driver to brake.
        let start = then.moved(-speed * seconds, 0.0);
        let obstacle = Obstacle { what: What::Crossing(agent.track), station: start.stations.0, speed };
        is_ahead(av, &start, speed).then_some(obstacle)
    })
}

fn later(state: &AgentState, seconds: f64) -> AgentState {
    let ahead = state.velocity() * seconds;
    AgentState { x: state.x + ahead.x, y: state.y + ahead.y, ..*state }
}

/// The next red light that the AV can still stop at; its stop points are at samples `stops`.
fn red_light(corridor: &Corridor, av: &Av, stops: &[u32]) -> Option<Obstacle> {
    let stations = stops.iter().map(|sample| corridor.station(*sample as usize));
    let can_stop = |station: &f64| {
        let gap = station - av.front;
        // Past it already, or too fast: to brake now would be to stop in the crossing.
        gap > 0.0 && av.speed * av.speed <= 2.0 * HARDEST_BRAKING * (gap + av.speed * STEP_SECONDS)
    };
    let nearest = stations.filter(can_stop).min_by(f64::total_cmp)?;
    Some(Obstacle { what: What::RedLight, station: nearest, speed: 0.0 })
}

/// The end of the whole line, if the window reaches it: beyond it is off the route.
fn line_end(corridor: &Corridor) -> Option<Obstacle> {
    let station = corridor.station(corridor.len() - 1);
    corridor.reaches_the_end().then_some(Obstacle { what: What::LineEnd, station, speed: 0.0 })
}
