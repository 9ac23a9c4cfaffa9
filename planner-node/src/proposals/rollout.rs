//! A proposal driven: the intelligent driver model along the line, at some speed, distance and offset, by the vehicle that the sim drives.

use world::geometry::OrientedBox;
use world::plan::{Control, PLAN_STEPS, STEP_SECONDS};
use world::scene::{AgentKind, AgentState};
use world::vehicle::{BicycleModel, Limits, VehicleState};

use super::company::{Company, Expected, LOOK_STEPS, Other};
use super::policy::{Policy, Regard};
use crate::idm::{Corridor, DesiredSpeed, Obstacle, Place, Wanted, speed, steering};

/// Room to either side of the AV (m), and for people on foot or on a bicycle.
const SIDE_MARGIN: f64 = 0.2;
const SIDE_MARGIN_VULNERABLE: f64 = 0.5;

/// ... and where it is to go by a hand's breadth (m).
const HAND: f64 = 0.1;

/// An offset is kept up to this (m).
const FARTHEST: f64 = 3.5;

/// Above this (m/s) along the line somebody moves on.
const MOVES: f64 = 0.5;

/// What lacks to the wanted offset shrinks to a third over this many metres, or over this many seconds.
const OFFSET_METERS: f64 = 8.0;
const OFFSET_SECONDS: f64 = 2.0;

/// Where a proposal leads.
#[derive(Clone, Debug)]
pub struct Rollout {
    pub controls: [Control; PLAN_STEPS],
    /// Before the first step, and after each.
    pub states: [VehicleState; PLAN_STEPS + 1],
    /// Place on the line of each.
    pub places: [Place; PLAN_STEPS + 1],
}

impl Default for Rollout {
    fn default() -> Self {
        let place = Place { sample: 0, station: 0.0, lateral: 0.0 };
        Self {
            controls: [Control::default(); PLAN_STEPS],
            states: [VehicleState::default(); PLAN_STEPS + 1],
            places: [place; PLAN_STEPS + 1],
        }
    }
}

/// All that a rollout needs to know.
pub struct Road<'a> {
    pub corridor: &'a Corridor,
    pub desired: &'a DesiredSpeed,
    pub company: &'a Company,
    /// What `idm` sees in its way.
    pub obstacles: &'a [Obstacle],
    /// Stations of red lights that can still be stopped at, and of the line's end.
    pub stops: &'a [f64],
    pub av: &'a AgentState,
    pub driven: Control,
    pub wheelbase: f64,
    /// The AV's nearest sample.
    pub own: usize,
}

impl Rollout {
    /// Drives a policy from step `from` on, after what is there.
    pub fn drive(&mut self, road: &Road<'_>, policy: &Policy, from: usize) {
        let model = BicycleModel::new(road.wheelbase);
        let av = road.av;
        if from == 0 {
            self.states[0] = VehicleState { x: av.x, y: av.y, heading: av.heading, speed: av.speed() };
            self.places[0] = road.corridor.project(av.position(), road.own);
        }
        let start = self.states[from];
        let mut driven = if from == 0 { road.driven } else { self.controls[from - 1] };
        let mut rollout = model.roll_out(start);
        let mut state = start;
        let (half_length, half_width) = (0.5 * av.length, 0.5 * av.width);
        let begun = self.places[from].lateral;
        let offset = policy.offset.unwrap_or(begun.clamp(-FARTHEST, FARTHEST));
        for k in from..PLAN_STEPS {
            let place = self.places[k];
            let front = place.station + half_length;
            let look = k / LOOK_STEPS;
            let at = Av { place, front, half_width, speed: state.speed, offset };
            let others = road.company.others().iter();
            let leaders =
                others.filter_map(|other| at.leader(other, &road.company.places(other, 0)[look], policy.regard));
            let seconds = k as f64 * STEP_SECONDS;
            let crossing = road.obstacles.iter().filter(|_| policy.regard == Regard::Yields);
            let crossing = crossing.map(|o| (o.station_after(seconds) - front, o.speed));
            let stops = road.stops.iter().map(|station| (station - front, 0.0));
            let Wanted { speed: allowed, braking } = road.desired.at(place.sample);
            let wanted = Wanted { speed: policy.share * allowed, braking: policy.share * policy.share * braking };
            let acceleration = if let Some(braking) = policy.braking {
                smooth(policy, driven.acceleration, -braking).max(-state.speed / STEP_SECONDS)
            } else {
                let asked =
                    speed::acceleration(&policy.manner, state.speed, wanted, leaders.chain(crossing).chain(stops));
                smooth(policy, driven.acceleration, asked)
            };
            let target = approach(begun, offset, (k - from) as f64 * STEP_SECONDS);
            let aside = Place { lateral: place.lateral - target, ..place };
            let angle = steering::angle(road.corridor, &aside, &state, road.wheelbase);
            driven = Limits::STRICT.apply(
                Control { acceleration, steering: gentle(driven.steering, angle, state.speed, road.wheelbase) },
                driven.steering,
                STEP_SECONDS,
            );
            state = rollout.step(driven, STEP_SECONDS);
            self.controls[k] = driven;
            self.states[k + 1] = state;
            self.places[k + 1] = road.corridor.follow(state.pose().position(), place.sample);
        }
    }

    /// Drives given controls.
    pub fn follow(&mut self, road: &Road<'_>, controls: impl Iterator<Item = Control>) {
        let av = road.av;
        self.states[0] = VehicleState { x: av.x, y: av.y, heading: av.heading, speed: av.speed() };
        self.places[0] = road.corridor.project(av.position(), road.own);
        let model = BicycleModel::new(road.wheelbase);
        let mut rollout = model.roll_out(self.states[0]);
        let mut wheel = road.driven.steering;
        for (k, control) in controls.take(PLAN_STEPS).enumerate() {
            let control = Limits::STRICT.apply(control, wheel, STEP_SECONDS);
            wheel = control.steering;
            self.controls[k] = control;
            self.states[k + 1] = rollout.step(control, STEP_SECONDS);
            self.places[k + 1] = road.corridor.follow(self.states[k + 1].pose().position(), self.places[k].sample);
        }
    }

    /// The AV's box after `k` steps.
    #[must_use]
    pub fn outline(&self, k: usize, av: &AgentState) -> OrientedBox {
        OrientedBox::new(self.states[k].pose(), av.length, av.width)
    }
}

/// The AV, as it looks for a leader.
struct Av {
    place: Place,
    front: f64,
    half_width: f64,
    speed: f64,
    offset: f64,
}

impl Av {
    /// Gap (m) and speed of who is there in its way.
    fn leader(&self, other: &Other, there: &Expected, regard: Regard) -> Option<(f64, f64)> {
        let room = match (regard, other.kind) {
            (Regard::Nobody, _) => return None,
            (Regard::Squeezes, _) => HAND,
            (Regard::Yields, AgentKind::Pedestrian | AgentKind::Cyclist) => SIDE_MARGIN_VULNERABLE,
            (Regard::Yields, AgentKind::Vehicle | AgentKind::Other) => SIDE_MARGIN,
        };
        let (rear, nose) = there.footprint.stations;
        let ahead = if there.along > MOVES { nose > self.front + 0.5 } else { rear > self.front - 0.5 };
        let (right, left) = there.footprint.laterals;
        let reach = self.half_width + room;
        let (lateral, offset) = (self.place.lateral, self.offset);
        // On the way there the AV comes to its offset.
        if !ahead || right >= lateral.max(offset) + reach || left <= lateral.min(offset) - reach {
            return None;
        }
        let fade = libm::exp(-(rear - self.front).max(0.0) / (OFFSET_SECONDS * self.speed).max(OFFSET_METERS));
        let aside = offset + (lateral - offset) * fade;
        (right < aside + reach && left > aside - reach).then_some((rear - self.front, there.along.max(0.0)))
    }
}

/// The acceleration (m/s^2) that follows `before` where `wanted` is.
fn smooth(policy: &Policy, before: f64, wanted: f64) -> f64 {
    let change = policy.jerk * STEP_SECONDS;
    wanted.clamp(before - change, before + change)
}

/// The offset (m) that is wanted `seconds` after the AV was at `from`.
fn approach(from: f64, to: f64, seconds: f64) -> f64 {
    /// How fast the AV goes aside (m/s).
    const ASIDE: f64 = 0.7;
    if to == 0.0 {
        return 0.0;
    }
    let way = ASIDE * seconds;
    from + (to - from).clamp(-way, way)
}

/// The wheels' angle (rad), as far as nobody in the car feels it.
fn gentle(before: f64, wanted: f64, speed: f64, wheelbase: f64) -> f64 {
    /// Fastest change of the yaw rate (rad/s^2).
    const YAW_ACCELERATION: f64 = 0.8;
    let turn = YAW_ACCELERATION * wheelbase / speed.max(1.0) * STEP_SECONDS;
    wanted.clamp(before - turn, before + turn)
}
