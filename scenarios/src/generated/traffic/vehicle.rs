//! Vehicles and bicycles on lanes.

use world::geometry::{Point, Pose};
use world::plan::STEP_SECONDS;
use world::scene::AgentKind;

use crate::generated::STEPS;
use crate::generated::roads::{LaneIndex, Roads};

use super::driver::{Driver, Mind};
use super::route::Route;

/// Somebody who moves along lanes.
#[derive(Clone, Debug)]
pub(in crate::generated) struct Vehicle {
    pub(in crate::generated) kind: AgentKind,
    /// Length, width, height (m).
    pub(in crate::generated) size: [f64; 3],
    pub(in crate::generated) driver: Driver,
    pub(in crate::generated) route: Route,
    pub(in crate::generated) script: Script,
    /// Breaks a rule, and is marked so.
    pub(in crate::generated) violator: bool,
    pub(in crate::generated) speed: f64,
    pub(in crate::generated) lateral: Lateral,
    /// On the map: not gone at its rim.
    pub(super) present: bool,
    /// Which lane of the route it is on, and where on that (m).
    pub(in crate::generated) at: usize,
    pub(in crate::generated) station: f64,
    pub(super) acceleration: f64,
    pub(super) mind: Mind,
    /// The lanes of the route before this one are granted to it.
    pub(super) granted: usize,
    /// It has not moved in the last step: it is where it was.
    pub(super) rests: bool,
    /// The step at which it came to rest at a stop line, until it goes.
    pub(super) stopped: Option<i32>,
    /// Way driven (m), for its wandering.
    pub(super) driven: f64,
    /// Step of its last lane change.
    pub(super) changed: i32,
    /// How far it has wandered (m); and with that the offset from the centre line, and its slope: reckoned once a step.
    wandered: f64,
    across: (f64, f64),
    /// Poses at the steps of the log.
    pub(in crate::generated) poses: Vec<Option<Pose>>,
}

/// What somebody does that the models do not.
#[derive(Clone, Debug, Default, PartialEq)]
pub(in crate::generated) enum Script {
    /// Nothing of the kind.
    #[default]
    None,
    /// Aims at `speed` (m/s) between two steps, braking with `braking` (m/s^2).
    Slow { from: i32, until: i32, speed: f64, braking: f64 },
    /// Changes to the lane beside it when its rear is `gap` (m) before the front of the AV, or at `latest`; and then aims at `then` (m/s) for a while.
    CutIn { left: bool, gap: f64, latest: i32, then: f64 },
    /// Stands at the curb, and pulls out when the AV's front comes within `gap` (m).
    PullOut { gap: f64 },
}

/// Where somebody is across the lane.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::generated) struct Lateral {
    /// From the centre line to the left (m).
    pub(in crate::generated) offset: f64,
    /// Its change over the way.
    pub(in crate::generated) slope: f64,
    /// Where it is heading to.
    pub(in crate::generated) target: f64,
}

impl Lateral {
    /// On by `way` (m) at `speed`: a critically damped approach over the way, so that wheels could do it.
    pub(super) fn advance(&mut self, way: f64, speed: f64) {
        let length = (0.85 * speed).max(4.5);
        let bend = (self.target - self.offset) / (length * length) - 2.0 * self.slope / length;
        self.slope += bend * way;
        self.offset += self.slope * way;
    }
}

impl Vehicle {
    /// A vehicle at `station` (m) on the first lane of its route.
    pub(in crate::generated) fn new(
        kind: AgentKind,
        size: [f64; 3],
        driver: Driver,
        route: Route,
        station: f64,
        speed: f64,
    ) -> Self {
        Self {
            kind,
            size,
            driver,
            route,
            script: Script::None,
            violator: false,
            speed,
            lateral: Lateral::default(),
            present: true,
            at: 0,
            station,
            acceleration: 0.0,
            mind: Mind::default(),
            granted: 0,
            rests: false,
            stopped: None,
            driven: 37.0 * station, // anything, as long as it differs
            changed: i32::MIN / 2,
            wandered: 0.0,
            across: (0.0, 0.0),
            poses: vec![None; STEPS],
        }
    }

    pub(in crate::generated) fn lane(&self) -> LaneIndex {
        self.route.lanes[self.at]
    }

    /// Way along the route (m).
    pub(super) fn way(&self) -> f64 {
        self.route.starts[self.at] + self.station
    }

    /// Offset from the centre line (m) with the wandering, and its slope.
    pub(super) fn across(&self) -> (f64, f64) {
        self.across
    }

    /// How far it has wandered to the left (m).
    pub(super) fn wandered(&self) -> f64 {
        self.wandered
    }

    /// Reckons [`Vehicle::across`] anew, after it or its driver has moved.
    pub(in crate::generated) fn settle(&mut self) {
        let (wandered, slope) = self.driver.wander.at(self.driven);
        self.wandered = wandered;
        self.across = (self.lateral.offset + wandered, self.lateral.slope + slope);
    }

    pub(in crate::generated) fn pose(&self, roads: &Roads) -> Pose {
        let base = roads.lanes[self.lane()].course.pose(self.station);
        let (offset, slope) = self.across();
        let at = base.to_world(Point::new(0.0, offset));
        Pose::new(at.x, at.y, base.heading + libm::atan(slope))
    }

    /// On by one step with its acceleration.
    pub(super) fn advance(&mut self, roads: &Roads) {
        let before = self.speed;
        self.speed = (self.speed + self.acceleration * STEP_SECONDS).max(0.0);
        if self.speed == 0.0 {
            self.acceleration = self.acceleration.max(0.0);
        }
        let way = 0.5 * (before + self.speed) * STEP_SECONDS;
        self.rests = way == 0.0;
        if self.rests {
            return;
        }
        self.station += way;
        self.driven += way;
        self.lateral.advance(way, self.speed);
        self.settle();
        while self.station > roads.lanes[self.lane()].course.length() {
            if self.at + 1 == self.route.lanes.len() {
                self.present = false;
                return;
            }
            self.station -= roads.lanes[self.lane()].course.length();
            self.at += 1;
        }
    }
}
