//! The rules of `paper`: the authors' log-replay simulator, quirk for quirk (`docs/protocols.md` lists the quirks).
//!
//! | module | what |
//! | --- | --- |
//! | [`sight`] | what their observation holds beside the agents: neighbors, window, lane, speed limit |

pub mod sight;

use wire::proto::event::Kind;
use wire::proto::{self, EndReason};
use world::geometry::angle_difference;
use world::plan::{Control, PlanState, STEP_SECONDS};
use world::route::{Route, RouteError};
use world::scene::{AgentState, Scene};
use world::vehicle::{VehicleState, WHEELBASE};

pub use self::sight::Sight;
use self::sight::Surroundings;
use crate::advance::{Advance, Undrivable, control_between};
use crate::guidance::Guidance;
use crate::judges::discs::Discs;

/// Log index of step 0.
pub const START: u32 = 19;

/// The most steps that are driven: the authors end "after 150", by a comparison that lets one more pass.
pub const MOST_STEPS: u32 = 151;

/// The most that the heading may change in a step (rad).
const HEADING_CLIP: f64 = 0.1;

/// The AV is off route beyond this distance (m) from the window of the line.
const OFF_ROUTE: f64 = 5.0;

/// An AV under these rules.
#[derive(Clone, Debug)]
pub(super) struct Paper {
    surroundings: Surroundings,
    sight: Sight,
    av: AgentState,
    control: Control,
    /// Height of the AV's centre above the line at the start (m).
    height: f64,
}

impl Paper {
    /// The AV in `state` at the start, `log_index`.
    pub(super) fn new(scene: &Scene, state: AgentState, log_index: usize) -> Result<Self, Undrivable> {
        let mut surroundings = Surroundings::new(scene)?;
        let mut sight = surroundings.first_sight();
        if !surroundings.look(scene, log_index, &state, &mut sight) {
            return Err(RouteError::NoLane { log_index }.into());
        }
        let height = state.z - surroundings.route().line.z[sight.sample];
        Ok(Self { surroundings, sight, av: state, control: Control::default(), height })
    }

    pub(super) fn route(&self) -> &Route {
        self.surroundings.route()
    }

    pub(super) fn av(&self) -> &AgentState {
        &self.av
    }

    /// What leads from the pose before to this one: nothing that anybody chose.
    pub(super) fn control(&self) -> Control {
        self.control
    }

    pub(super) fn sight(&self) -> &Sight {
        &self.sight
    }

    /// Puts the AV on the plan's pose of that moment; only the heading is held back. Without a plan it stays where it is.
    pub(super) fn drive(&mut self, guidance: &Guidance<'_>) {
        if let Some(plan) = guidance.now {
            self.put(&plan.states(0)[0]);
        }
    }

    /// Puts the AV on a state a step later, as far as its heading may turn.
    pub(super) fn put(&mut self, first: &PlanState) {
        let before = self.av;
        let turn = angle_difference(before.heading, first.heading).clamp(-HEADING_CLIP, HEADING_CLIP);
        self.av = AgentState {
            x: first.x,
            y: first.y,
            heading: before.heading + turn,
            velocity_x: (first.x - before.x) / STEP_SECONDS,
            velocity_y: (first.y - before.y) / STEP_SECONDS,
            ..before
        };
        self.control = control_between(&vehicle(&before), &vehicle(&self.av), WHEELBASE);
    }

    /// Judges the AV at `log_index`, and says whether that ends the episode.
    pub(super) fn judge(&mut self, scene: &Scene, log_index: usize, advance: &mut Advance) -> Option<EndReason> {
        // The neighbors of the observation before, where they are now.
        let contact = self.nearest_neighbor(scene, log_index);
        let has_lane = self.surroundings.look(scene, log_index, &self.av, &mut self.sight);
        self.sight.collision_margin = contact.map(|contact| contact.margin);
        self.av.z = self.route().line.z[self.sight.sample] + self.height;
        let Advance { record, events, .. } = advance;
        if let Some(av) = &mut record.av {
            av.z = self.av.z;
        }
        let frenet = self.route().to_frenet(self.av.position(), self.sight.sample);
        record.station = frenet.station;
        record.lateral_offset = frenet.lateral;
        record.route_distance = self.sight.route_distance;
        record.speed_limit = self.sight.window.speed_limit.unwrap_or_default();
        if !has_lane {
            return Some(EndReason::RouteLost);
        }
        let event = |kind: Kind, text: String| proto::Event {
            step: record.step,
            kind: kind.into(),
            text,
            ..proto::Event::default()
        };
        if let Some(Contact { track, margin, relative_speed }) = contact.filter(|contact| contact.margin < 0.0) {
            record.collision = true;
            let track = &scene.tracks()[track];
            let text = format!("a disc overlaps one of {} {} by {:.2} m", track.kind, track.id, -margin);
            let event = event(Kind::Collision, text);
            events.push(proto::Event { track: Some(track.id.0), relative_speed, ..event });
        }
        if self.sight.route_distance > OFF_ROUTE {
            record.off_route = true;
            events.push(event(Kind::OffRoute, format!("{:.1} m from the line", self.sight.route_distance)));
        }
        match (record.collision, record.off_route) {
            (true, _) => Some(EndReason::Collision),
            (_, true) => Some(EndReason::OffRoute),
            _ => None,
        }
    }

    /// The neighbor whose discs are nearest to the AV's, of those seen last, at `log_index`.
    fn nearest_neighbor(&self, scene: &Scene, log_index: usize) -> Option<Contact> {
        let own = Discs::from(&self.av);
        let contact = |&track: &usize| {
            // One that is not seen any more is a point at the origin of the map: the authors store zeros, and do not look.
            let state = scene.tracks()[track].states[log_index].unwrap_or_default();
            let relative_speed = (state.velocity() - self.av.velocity()).norm();
            Contact { track, margin: own.margin(&Discs::from(&state)), relative_speed }
        };
        self.sight.neighbors.iter().map(contact).reduce(|a, b| if b.margin < a.margin { b } else { a })
    }
}

/// The AV and a neighbor.
#[derive(Clone, Copy, Debug)]
struct Contact {
    /// Place in the scene's tracks.
    track: usize,
    /// What the nearest discs lack to an overlap (m).
    margin: f64,
    relative_speed: f64,
}

fn vehicle(av: &AgentState) -> VehicleState {
    VehicleState { x: av.x, y: av.y, heading: av.heading, speed: av.speed() }
}
