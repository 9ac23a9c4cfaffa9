//! One agent from step to step.

use std::sync::Arc;

use world::geometry::{Point, Pose, angle_difference};
use world::scene::{AgentKind, AgentState, TrackId};
use world::traffic::way::SPACING;
use world::traffic::{Taken, Way, WayPlace, Ways};

use crate::ahead::{Heed, View};
use crate::character::{Character, LATEST};
use crate::idm::{HARDEST_BRAKING, Idm};
use crate::mobil::{self, Incentive};
use crate::motion::Motion;
use crate::scenery::{Body, Forecast, Scenery, Who};
use crate::signals::Lights;
use crate::trajectory::{Trajectory, Traveller, nearest};

/// The first step after a hand-over changes the speed by no more than 0.19 m/s: nobody's foot is on the brake at once.
const FIRST_ACCELERATION: f64 = 1.9;

/// How far the place that one steers to moves aside in a step (m).
const ASIDE: f64 = 0.05;

/// Steps between thoughts about lanes; without any after a hand-over, and after a change.
const THINKS: u32 = 10;
const ARRIVED: u32 = 20;
const SETTLED: u32 = 60;

/// Who follows a future and is slower than this (m/s) looks ahead as if he were this fast: so nobody sets off, or creeps, into somebody.
const CREEP: f64 = 0.5;

/// Who has followed a future and is no farther than this from the way that he was taken over with (m, rad) goes on along it.
const BACK_METERS: f64 = 2.0;
const BACK_RADIANS: f64 = 0.5;

/// Who has changed lanes looks for how his lane goes on when less than this of his way is left (m).
const LEAST_LEFT: f64 = 90.0;

/// No bend asks for less than this (m/s): ways have kinks.
const SLOWEST_CURVE: f64 = 2.0;

/// What the comfortable deceleration counts before bends: one looks ahead.
const ANTICIPATION: f64 = 0.6;

/// From the rear axle to the centre, as a share of the length (nuPlan's vehicle: 1.461 of 5.176 m).
const REAR: f64 = 0.28;

/// What anybody does at once who is late otherwise: brake harder than this (m/s^2), once it has been due for so many steps.
const ALARM: f64 = -2.0;
const ALARMED: usize = 3;

/// People on foot, who stop for a car in their way (m/s, m, s, m/s^2).
const WALKER: Idm = Idm { desired_speed: 1.4, standstill_gap: 0.8, headway: 0.6, acceleration: 0.8, deceleration: 1.5 };

/// Speed that is usual on a bicycle (m/s).
const CYCLIST_SPEED: f64 = 5.0;

/// An agent that is driven.
#[derive(Clone, Debug)]
pub(crate) struct Driver {
    pub track: TrackId,
    /// Whether it is still among those that are taken over.
    pub is_present: bool,
    kind: AgentKind,
    since_step: u32,
    character: Character,
    /// The way that it was taken over with, and the one that it is on.
    own: Arc<Way>,
    way: Arc<Way>,
    /// Whether that is another, of a lane that it changed to or of a future that it followed.
    has_changed: bool,
    /// What it follows of a future.
    trajectory: Option<Trajectory>,
    /// Whether it was met just now, and has not been told of a future yet.
    pub is_new: bool,
    place: WayPlace,
    motion: Motion,
    /// As it was last.
    state: AgentState,
    /// Offset from the way that is steered to (m).
    target: f64,
    /// Speed that is aimed at, at each sample of the way (m/s).
    speeds: Vec<f64>,
    /// Speed at hand-over (m/s): whoever was faster than the limit stays so.
    own_speed: f64,
    /// Accelerations wished for lately, the newest first.
    wishes: [f64; LATEST + 1],
    /// The step from which on it may think about lanes.
    settled: u32,
}

impl Driver {
    pub(crate) fn new(taken: &Taken, character: Character, ways: &Ways) -> Self {
        let state = taken.state;
        let character = match taken.kind {
            AgentKind::Pedestrian => Character { idm: WALKER, room: 0.0, delay: 0, ..character },
            // Who looks elsewhere on a bicycle does not get far.
            AgentKind::Cyclist => Character { threshold: f64::INFINITY, delay: 0, ..character },
            AgentKind::Vehicle | AgentKind::Other => character,
        };
        let place = taken.way.follow(state.position(), world::traffic::ways::BEHIND_SAMPLES);
        let rear = if taken.kind == AgentKind::Pedestrian { 0.0 } else { REAR * state.length };
        let curvature = taken.way.curvature(place.sample);
        let mut driver = Self {
            track: taken.track,
            is_present: true,
            kind: taken.kind,
            since_step: taken.since_step,
            own: Arc::clone(&taken.way),
            way: Arc::clone(&taken.way),
            has_changed: false,
            trajectory: None,
            is_new: true,
            motion: Motion::of(state.position(), state.heading, state.velocity(), rear, curvature),
            speeds: Vec::new(),
            own_speed: state.speed(),
            wishes: [0.0; LATEST + 1],
            target: 0.0,
            settled: taken.since_step.saturating_add(ARRIVED),
            place,
            state,
            character,
        };
        driver.aim(ways);
        driver
    }

    /// It is told of again.
    pub(crate) fn see(&mut self, taken: &Taken) {
        self.is_present = true;
        self.state = taken.state;
    }

    /// Fills in the speeds that are aimed at: by the lane, by its bends, and in time before them.
    fn aim(&mut self, ways: &Ways) {
        let Character { idm, eagerness, lateral_acceleration, .. } = self.character;
        let usual = match self.kind {
            AgentKind::Cyclist => CYCLIST_SPEED,
            AgentKind::Vehicle | AgentKind::Pedestrian | AgentKind::Other => idm.desired_speed,
        };
        let limit = |lane| match self.kind {
            AgentKind::Vehicle => ways.speed_limit(lane),
            AgentKind::Cyclist | AgentKind::Pedestrian | AgentKind::Other => None,
        };
        self.speeds.clear();
        self.speeds.resize(self.way.len(), (usual * eagerness).max(self.own_speed));
        for (index, stretch) in self.way.lanes().iter().enumerate() {
            let Some(limit) = stretch.lane.and_then(limit) else { continue };
            let until = self.way.lanes().get(index + 1).map_or(self.way.length(), |next| next.from);
            let samples = self.way.sample_at(stretch.from)..=self.way.sample_at(until);
            self.speeds[samples].fill((limit * eagerness).max(self.own_speed));
        }
        if self.kind == AgentKind::Pedestrian {
            return;
        }
        let mut next = f64::INFINITY;
        for (sample, speed) in self.speeds.iter_mut().enumerate().rev() {
            let curvature = self.way.curvature(sample).abs();
            let bend = (lateral_acceleration / curvature.max(1e-6)).sqrt().max(SLOWEST_CURVE);
            let in_time = (next * next + 2.0 * ANTICIPATION * idm.deceleration * SPACING).sqrt();
            *speed = speed.min(bend).min(in_time);
            next = *speed;
        }
    }

    fn body(&self) -> Body {
        Body {
            track: self.track,
            who: Who::Reacting,
            kind: self.kind,
            position: self.motion.position,
            forward: Point::unit(self.state.heading),
            velocity: self.state.velocity(),
            speed: self.motion.speed,
            half_length: 0.5 * self.state.length,
            half_width: 0.5 * self.state.width,
            z: self.state.z,
        }
    }

    /// Where it will be if it goes on along its way as it does.
    pub(crate) fn forecast(&self) -> Forecast {
        Forecast::of(|seconds| {
            let station = self.place.station + self.motion.speed * seconds;
            let forward = self.way.direction(self.way.sample_at(station));
            (self.way.point_at(station) + crate::scenery::left_of(forward) * self.place.lateral, forward)
        })
    }

    /// Is told its part of a future from `step` on: its poses a step later, two steps later, and so on. Where it has none, or none that can be
    /// driven, it drives by itself.
    pub(crate) fn follow(&mut self, step: u32, poses: Option<&[Pose]>, ways: &Ways) {
        self.is_new = false;
        // What the network says of people on foot was not made for cars in their way.
        let poses = poses.filter(|_| self.kind != AgentKind::Pedestrian);
        let traveller = Traveller {
            kind: self.kind,
            state: &self.state,
            course: self.motion.course,
            own: &self.own,
            way: &self.way,
        };
        let trajectory = poses.and_then(|poses| Trajectory::new(step, poses, &traveller, ways));
        if let Some(trajectory) = &trajectory {
            if !Arc::ptr_eq(&self.way, &trajectory.way) {
                self.way = Arc::clone(&trajectory.way);
                self.place = self.way.follow(self.motion.position, nearest(&self.way, self.motion.position));
                self.has_changed = true;
            }
            self.target = 0.0;
        } else if self.trajectory.is_some() {
            self.go_back(ways);
        }
        self.trajectory = trajectory;
    }

    /// Goes on by itself where a future leaves off: along its own way where that is near, else where the future led.
    fn go_back(&mut self, ways: &Ways) {
        let place = self.own.follow(self.motion.position, nearest(&self.own, self.motion.position));
        let error = angle_difference(self.own.heading(place.sample), self.motion.course);
        if place.lateral.abs() <= BACK_METERS && error.abs() <= BACK_RADIANS {
            self.way = Arc::clone(&self.own);
            self.has_changed = false;
            self.place = place;
        }
        self.aim(ways);
    }

    /// The acceleration (m/s^2) that it wishes for; it may go over to another lane. Who follows a future heeds others as `heed` says.
    pub(crate) fn decide(
        &mut self,
        step: u32,
        scenery: &Scenery,
        lights: &Lights,
        ways: &Ways,
        (heed, near): (Heed, &mut Vec<(f64, usize)>),
    ) -> f64 {
        let own = self.body();
        if let Some(pace) = self.pace(step) {
            return pace.min(self.heeded(heed, &own, scenery, lights, near));
        }
        let Character { idm, margin, room, politeness, threshold, .. } = self.character;
        let heed = Heed::Everybody;
        let view =
            View { way: &self.way, place: self.place, target: self.target, own: &own, idm: &idm, margin, room, heed };
        let ahead = view.ahead(scenery, near);
        let free = idm.free(own.speed, self.speeds[self.place.sample]);
        let mut wish = free.min(ahead.acceleration);
        if self.kind != AgentKind::Pedestrian {
            wish = wish.min(lights.acceleration(&self.way, view.front(), own.speed, &idm));
        }
        let aside = ahead.aside.1 - ahead.aside.0;
        if self.has_changed {
            // Behind the end of a lane nothing is known.
            wish = wish.min(idm.before_a_line(own.speed, self.way.length() - view.front()));
        }
        let thinks = step.wrapping_add(self.track.0.cast_unsigned()).is_multiple_of(THINKS);
        if thinks && step >= self.settled && self.kind == AgentKind::Vehicle && ahead.leader.is_some() {
            let incentive = Incentive { politeness, threshold, now: wish, free };
            if let Some(way) = mobil::change(&view, &incentive, scenery, ways) {
                self.go_over(step, way, ways);
            }
        }
        if thinks && self.has_changed && self.way.length() - self.place.station < LEAST_LEFT {
            self.go_on(ways);
        }
        self.target += (aside - self.target).clamp(-ASIDE, ASIDE);
        self.late(wish)
    }

    /// The acceleration (m/s^2) that the future asks for which it follows.
    pub(crate) fn pace(&self, step: u32) -> Option<f64> {
        let trajectory = self.trajectory.as_ref()?;
        Some(trajectory.acceleration(step, self.place.station, self.motion.speed))
    }

    /// The acceleration (m/s^2) that others and lights allow who follows a future.
    fn heeded(&self, heed: Heed, own: &Body, scenery: &Scenery, lights: &Lights, near: &mut Vec<(f64, usize)>) -> f64 {
        if heed == Heed::Nobody {
            return f64::INFINITY;
        }
        let Character { idm, margin, room, .. } = Character::GUARDED;
        let lights = |view: &View<'_>| lights.acceleration(&self.way, view.front(), own.speed, &idm);
        let own = &Body { speed: own.speed.max(CREEP), ..*own };
        let view = View { way: &self.way, place: self.place, target: 0.0, own, idm: &idm, margin, room, heed };
        view.ahead(scenery, near).acceleration.min(lights(&view))
    }

    fn go_over(&mut self, step: u32, way: Way, ways: &Ways) {
        self.target = 0.0;
        self.settled = step.saturating_add(SETTLED);
        self.take(way, ways);
    }

    /// Looks for how its lane goes on.
    fn go_on(&mut self, ways: &Ways) {
        let rest = self.way.length() - self.place.station;
        let lane = self.way.lane_at(self.place.station);
        let way = lane.and_then(|lane| ways.along_lane(lane, self.motion.position));
        if let Some(way) = way.filter(|way| way.length() > rest) {
            self.take(way, ways);
        }
    }

    fn take(&mut self, way: Way, ways: &Ways) {
        self.place = way.follow(self.motion.position, 0);
        self.way = Arc::new(way);
        self.has_changed = true;
        self.aim(ways);
    }

    /// What comes of a wish in somebody who reacts late.
    fn late(&mut self, wish: f64) -> f64 {
        self.wishes.rotate_right(1);
        self.wishes[0] = wish;
        let alarmed = self.wishes[..ALARMED].iter().all(|wish| *wish < ALARM);
        if alarmed { wish } else { self.wishes[self.character.delay.min(LATEST)] }
    }

    /// Its state a step later.
    pub(crate) fn advance(&mut self, step: u32, wish: f64) -> AgentState {
        // A future is held by its own bounds.
        let most = if self.trajectory.is_some() { f64::INFINITY } else { self.character.idm.acceleration };
        let mut acceleration = wish.clamp(-HARDEST_BRAKING, most);
        if step == self.since_step {
            acceleration = acceleration.clamp(-FIRST_ACCELERATION, FIRST_ACCELERATION);
        }
        let ground = self.way.height(self.place.sample);
        self.motion.advance(&self.way, &self.place, self.target, acceleration);
        self.place = self.way.follow(self.motion.position, self.place.sample);
        let Motion { position, course, speed, .. } = self.motion;
        let velocity = Point::unit(course) * speed;
        self.state = AgentState {
            x: position.x,
            y: position.y,
            z: self.state.z + self.way.height(self.place.sample) - ground,
            heading: self.motion.heading(),
            velocity_x: velocity.x,
            velocity_y: velocity.y,
            ..self.state
        };
        self.state
    }
}
