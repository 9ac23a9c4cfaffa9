//! Road users: boxes and discs with a mark at the front.

use world::geometry::{OrientedBox, Point};
use world::scene::{AgentKind, AgentState, Track};

use super::Moment;
use super::canvas::{Canvas, Path, Stroke};
use super::colours;
use super::frame::Frame;

/// A vehicle that comes less far than this from where it was first seen is stationary: parked, or waiting all the time (m).
const STATIONARY: f64 = 1.0;
/// Radius of somebody whose size the log does not say (m).
const NO_SIZE: f64 = 0.6;

/// What an agent is drawn as; the order is that of the legend.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Guise {
    Av,
    Vehicle,
    Stationary,
    Pedestrian,
    Cyclist,
    Other,
}

impl Guise {
    /// What track number `index` of the scene is drawn as.
    fn of(moment: Moment<'_>, index: usize, track: &Track) -> Self {
        match track.kind {
            _ if index == moment.scene().av_index() => Self::Av,
            AgentKind::Vehicle if is_stationary(track) => Self::Stationary,
            AgentKind::Vehicle => Self::Vehicle,
            AgentKind::Pedestrian => Self::Pedestrian,
            AgentKind::Cyclist => Self::Cyclist,
            AgentKind::Other => Self::Other,
        }
    }

    pub fn name(self) -> &'static str {
        match self {
            Self::Av => "AV",
            Self::Vehicle => "vehicle",
            Self::Stationary => "stationary",
            Self::Pedestrian => "pedestrian",
            Self::Cyclist => "cyclist",
            Self::Other => "other",
        }
    }

    pub fn colour(self) -> &'static str {
        match self {
            Self::Av => colours::AV,
            Self::Stationary => colours::STATIONARY,
            Self::Vehicle => colours::agent(AgentKind::Vehicle),
            Self::Pedestrian => colours::agent(AgentKind::Pedestrian),
            Self::Cyclist => colours::agent(AgentKind::Cyclist),
            Self::Other => colours::agent(AgentKind::Other),
        }
    }
}

fn is_stationary(track: &Track) -> bool {
    let mut places = track.states.iter().flatten().map(AgentState::position);
    places.next().is_none_or(|first| places.all(|place| place.distance(first) < STATIONARY))
}

/// An agent that is there and seen.
#[derive(Clone, Copy, Debug)]
pub struct Shown {
    pub guise: Guise,
    state: AgentState,
    pub of_interest: bool,
}

/// All who are seen at the moment, in the order in which they are drawn: the AV last, stationary vehicles first.
pub fn shown(frame: &Frame, moment: Moment<'_>) -> Vec<Shown> {
    let scene = moment.scene();
    let mut all = Vec::new();
    for (index, track) in scene.tracks().iter().enumerate() {
        let Some(state) = scene.logged(index, moment.step()) else { continue };
        let center = frame.pixel(state.position());
        if frame.sees(center, center, frame.pixels(0.5 * state.length.max(0.0)) + 8.0) {
            let of_interest = scene.objects_of_interest().contains(&track.id);
            all.push(Shown { guise: Guise::of(moment, index, track), state: *state, of_interest });
        }
    }
    all.sort_by_key(|agent| match agent.guise {
        Guise::Stationary => 0,
        Guise::Other => 1,
        Guise::Vehicle => 2,
        Guise::Cyclist => 3,
        Guise::Pedestrian => 4,
        Guise::Av => 5,
    });
    all
}

pub fn draw(canvas: &mut Canvas, frame: &Frame, agents: &[Shown]) {
    for agent in agents {
        let outline = outline(frame, agent, 0.0);
        let rim = frame.hairs(if agent.guise == Guise::Av { 3.6 } else { 1.8 });
        canvas.stroke(&outline, Stroke::new(colours::PAPER, rim));
        canvas.fill(&outline, agent.guise.colour());
        if !is_disc(agent) {
            canvas.fill(&nose(frame, &agent.state), colours::NOSE);
        }
    }
    for agent in agents.iter().filter(|agent| agent.of_interest) {
        let around = outline(frame, agent, frame.at_least(0.35, 2.2));
        canvas.stroke(&around, Stroke::new(colours::INTEREST, frame.hairs(1.8)));
    }
}

fn is_disc(agent: &Shown) -> bool {
    agent.guise == Guise::Pedestrian || agent.state.length <= 0.0 || agent.state.width <= 0.0
}

/// The shape on the ground, larger by `around` pixels on each side.
fn outline(frame: &Frame, agent: &Shown, around: f64) -> Path {
    let Shown { state, .. } = agent;
    if is_disc(agent) {
        let meters = if state.width > 0.0 { 0.5 * state.width.max(state.length).min(1.2) } else { NO_SIZE };
        return Path::of_disc(frame.pixel(state.position()), frame.at_least(meters, 2.6) + around);
    }
    let OrientedBox { half_length, half_width, .. } = state.oriented_box();
    let (along, across) = (frame.at_least(half_length, 2.6) + around, frame.at_least(half_width, 1.3) + around);
    let body = Body::new(frame, state);
    // Corners are cut a little, as those of cars are round.
    let cut = 0.3 * across.min(along);
    Path::of_area(&[
        body.at(along, across - cut),
        body.at(along - cut, across),
        body.at(cut - along, across),
        body.at(-along, across - cut),
        body.at(-along, cut - across),
        body.at(cut - along, -across),
        body.at(along - cut, -across),
        body.at(along, cut - across),
    ])
}

/// A wedge that points where the agent heads.
fn nose(frame: &Frame, state: &AgentState) -> Path {
    let OrientedBox { half_length, half_width, .. } = state.oriented_box();
    let (along, across) = (frame.at_least(half_length, 2.6), frame.at_least(half_width, 1.3));
    let body = Body::new(frame, state);
    let tip = along - 0.3 * across;
    let base = tip - (0.9 * across).min(0.8 * along);
    Path::of_area(&[body.at(tip, 0.0), body.at(base, 0.6 * across), body.at(base, -0.6 * across)])
}

/// A body's axes in pixels.
struct Body {
    center: Point,
    forward: Point,
    left: Point,
}

impl Body {
    fn new(frame: &Frame, state: &AgentState) -> Self {
        let shape = state.oriented_box();
        let center = frame.pixel(shape.center);
        let axis = |way: Point| (frame.pixel(shape.center + way) - center) * (1.0 / frame.pixels(1.0));
        Self { center, forward: axis(shape.forward), left: axis(shape.left()) }
    }

    fn at(&self, forward: f64, left: f64) -> Point {
        self.center + self.forward * forward + self.left * left
    }
}
