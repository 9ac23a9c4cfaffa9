//! Everybody at a step, in the order of their tracks, and where each will be in the next seconds: along its way, if that is known, else straight
//! on. Nobody speeds up or slows down in it.

use std::sync::Arc;

use world::geometry::{Bounds, Point};
use world::observation::Observation;
use world::reference_line::{ReferenceLine, SAMPLE_SPACING};
use world::scene::{AgentKind, AgentState, TrackId};

use crate::driver::Driver;

/// Times that are looked at: half a second apart, 4 s in all. As far as a driver who gives way looks.
pub(crate) const LOOKS: usize = 8;
pub(crate) const LOOK_SECONDS: f64 = 0.5;

/// Who is slower than this (m/s) stands.
pub(crate) const STANDING: f64 = 0.3;

/// An AV farther from its line than this (m) is taken to go straight on.
const ON_LINE: f64 = 4.0;

/// Discs are wider than the box by this share where it lies across: its corners count.
const CORNERS: f64 = 0.25;

/// Who it is that one meets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Who {
    Av,
    /// Somebody who reacts too.
    Reacting,
    /// Somebody who does what he did in the log, whatever happens.
    Replayed,
}

/// Somebody's box, and how it moves.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Body {
    pub track: TrackId,
    pub who: Who,
    pub kind: AgentKind,
    pub position: Point,
    pub forward: Point,
    pub velocity: Point,
    pub speed: f64,
    pub half_length: f64,
    pub half_width: f64,
    pub z: f64,
}

/// Where a body will be.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Forecast {
    pub points: [Point; LOOKS],
    pub forwards: [Point; LOOKS],
    pub bounds: Bounds,
}

/// Everybody.
#[derive(Clone, Debug)]
pub(crate) struct Scenery {
    line: Arc<ReferenceLine>,
    pub bodies: Vec<Body>,
    pub forecasts: Vec<Forecast>,
    /// What holds each of them, now and as far as is looked ahead.
    pub reaches: Vec<Bounds>,
}

impl Scenery {
    pub(crate) fn new(line: &Arc<ReferenceLine>) -> Self {
        Self { line: Arc::clone(line), bodies: Vec::new(), forecasts: Vec::new(), reaches: Vec::new() }
    }

    /// Takes in a step. `drivers` are in ascending order of track.
    pub(crate) fn see(&mut self, observation: &Observation, drivers: &[Driver]) {
        self.bodies.clear();
        self.bodies.extend(observation.agents.iter().map(|agent| {
            let reacts = drivers.binary_search_by_key(&agent.track, |driver| driver.track).is_ok();
            let who = if reacts { Who::Reacting } else { Who::Replayed };
            body(agent.track, who, agent.kind, &agent.state)
        }));
        self.bodies.sort_unstable_by_key(|body| body.track);
        // The AV's track is in no observation; its number is no matter.
        self.bodies.push(body(TrackId(i32::MIN), Who::Av, AgentKind::Vehicle, &observation.av));
        self.forecasts.clear();
        self.reaches.clear();
        for index in 0..self.bodies.len() {
            let forecast = self.forecast(&self.bodies[index], drivers);
            let Body { position, half_length, .. } = self.bodies[index];
            let Bounds { least, greatest } = forecast.bounds;
            self.reaches.push(Bounds::of([position, least, greatest]).grown(half_length));
            self.forecasts.push(forecast);
        }
    }

    fn forecast(&self, body: &Body, drivers: &[Driver]) -> Forecast {
        match body.who {
            Who::Replayed => straight(body),
            Who::Av => self.along_the_line(body).unwrap_or_else(|| straight(body)),
            Who::Reacting => {
                let place = drivers.binary_search_by_key(&body.track, |driver| driver.track).ok();
                place.map_or_else(|| straight(body), |place| drivers[place].forecast())
            }
        }
    }

    /// Where an AV will be that goes along its line, as far beside it as it is now.
    fn along_the_line(&self, body: &Body) -> Option<Forecast> {
        let line = &self.line;
        let coarse = (0..line.len()).step_by(20).map(|at| (at, line.point(at).distance_squared(body.position)));
        let (coarse, _) = coarse.min_by(|a, b| a.1.total_cmp(&b.1))?;
        let near = coarse.saturating_sub(20)..line.len().min(coarse + 20);
        let fine = near.map(|at| (at, line.point(at).distance_squared(body.position)));
        let (sample, _) = fine.min_by(|a, b| a.1.total_cmp(&b.1))?;
        let offset = body.position - line.point(sample);
        let lateral = Point::unit(line.heading[sample]).cross(offset);
        if offset.norm() > ON_LINE {
            return None;
        }
        Some(Forecast::of(|seconds| {
            let ahead = (body.speed * seconds / SAMPLE_SPACING) as usize;
            let at = (sample + ahead).min(line.len() - 1);
            let forward = Point::unit(line.heading[at]);
            let over = (sample + ahead - at) as f64 * SAMPLE_SPACING;
            (line.point(at) + left_of(forward) * lateral + forward * over, forward)
        }))
    }
}

impl Forecast {
    /// The forecast of somebody who is, after so many seconds, at a point and heads along a unit vector.
    pub(crate) fn of(at: impl Fn(f64) -> (Point, Point)) -> Self {
        let looks: [(Point, Point); LOOKS] = std::array::from_fn(|look| at((look + 1) as f64 * LOOK_SECONDS));
        let points = looks.map(|(point, _)| point);
        Self { points, forwards: looks.map(|(_, forward)| forward), bounds: Bounds::of(points) }
    }
}

fn straight(body: &Body) -> Forecast {
    Forecast::of(|seconds| (body.position + body.velocity * seconds, body.forward))
}

fn body(track: TrackId, who: Who, kind: AgentKind, state: &AgentState) -> Body {
    Body {
        track,
        who,
        kind,
        position: state.position(),
        forward: Point::unit(state.heading),
        velocity: state.velocity(),
        speed: state.speed(),
        half_length: 0.5 * state.length,
        half_width: 0.5 * state.width,
        z: state.z,
    }
}

/// The unit vector to the left of `forward`.
pub(crate) fn left_of(forward: Point) -> Point {
    Point::new(-forward.y, forward.x)
}

impl Body {
    /// Discs that cover it, seen along a direction: their centres and radii, from front to rear.
    pub(crate) fn discs(&self, direction: Point) -> [(Point, f64); 3] {
        let end = self.forward * (self.half_length - self.half_width).max(0.0);
        let radius = (1.0 + CORNERS * direction.cross(self.forward).abs()) * self.half_width.min(self.half_length);
        [(self.position + end, radius), (self.position, radius), (self.position - end, radius)]
    }

    /// How far it reaches across and along a direction (m).
    pub(crate) fn reach(&self, direction: Point, forward: Point) -> (f64, f64) {
        let (cosine, sine) = (direction.dot(forward).abs(), direction.cross(forward).abs());
        (self.half_length * sine + self.half_width * cosine, self.half_length * cosine + self.half_width * sine)
    }
}
