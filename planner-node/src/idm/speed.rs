//! The speed wanted on the line, and the acceleration.
//!
//! Constants: T and the comfortable deceleration are those of nuPlan's IDM planner (`idm_planner.yaml`: headway 1.5 s,
//! decel_max 3.0 m/s^2); the standstill gap of 2 m and the exponent 4 are Treiber's. nuPlan accelerates with 1.0 m/s^2;
//! 1.5 is nearer to the mean of Waymo's drivers, who would else leave it far behind.

use world::map::{METERS_PER_SECOND_PER_MPH, USUAL_SPEED_LIMIT_MPH};
use world::plan::STEP_SECONDS;
use world::reference_line::ReferenceWindow;

use super::corridor::Corridor;

/// How a driver follows and pulls away.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Manner {
    /// Time headway to the leader (s).
    pub headway: f64,
    /// Gap at standstill (m).
    pub standstill_gap: f64,
    /// Acceleration on a free road from standstill (m/s^2).
    pub acceleration: f64,
}

impl Manner {
    /// That of the planner `idm`.
    pub const IDM: Self = Self { headway: 1.5, standstill_gap: 2.0, acceleration: 1.5 };
}

/// Comfortable deceleration (m/s^2).
pub const DECELERATION: f64 = 3.0;
/// Braking for one that pulls away (m/s^2).
const COMFORTABLE_BRAKING: f64 = 1.0;
/// Hardest braking (m/s^2): the vehicle's own.
pub const HARDEST_BRAKING: f64 = 5.0;

/// Where the map gives no speed limit (m/s).
const DEFAULT_SPEED_LIMIT: f64 = USUAL_SPEED_LIMIT_MPH * METERS_PER_SECOND_PER_MPH;
/// Lateral acceleration in curves (m/s^2): between what passengers like (about 2) and the bound of nuPlan's comfort metric (4.89).
const LATERAL_ACCELERATION: f64 = 3.0;
/// Braking towards a curve or a lower limit (m/s^2).
const ANTICIPATION: f64 = 1.5;
/// What is too fast for the line goes in this time (s).
const SPEED_SETTLING: f64 = 1.0;
/// Fastest change of acceleration (m/s^3) while braking is comfortable: nuPlan's bound for comfort is 4.13.
const JERK: f64 = 4.0;
/// Slowest that a curve asks for (m/s): the line's kinks are no curves.
const SLOWEST_CURVE: f64 = 2.0;

/// The speed wanted at each sample: the limit, slower in and before curves.
#[derive(Clone, Debug, Default)]
pub struct DesiredSpeed {
    speeds: Vec<f64>,
}

impl DesiredSpeed {
    /// Fills it for the corridor, which is at `window`.
    pub fn fill(&mut self, corridor: &Corridor, window: &ReferenceWindow) {
        self.speeds.clear();
        self.speeds.extend((0..corridor.len()).map(|sample| {
            let limit = window.speed_limit_at(window.start + sample);
            let limit = if limit > 0.0 { limit } else { DEFAULT_SPEED_LIMIT };
            let straight = corridor.curvature_bound(sample) * limit * limit < 0.99 * LATERAL_ACCELERATION;
            if straight { limit } else { local(corridor.curvature(sample), limit) }
        }));
        // From the end backwards: no faster than what can be braked down from in time.
        let mut next = (f64::INFINITY, 0.0);
        for (speed, station) in self.speeds.iter_mut().zip(corridor.stations()).rev() {
            if *speed > next.0 {
                *speed = speed.min((next.0 * next.0 + 2.0 * ANTICIPATION * (next.1 - station)).sqrt());
            }
            next = (*speed, *station);
        }
    }

    /// At `sample`.
    pub fn at(&self, sample: usize) -> Wanted {
        let last = self.speeds.len() - 1;
        let (here, next) = (sample.min(last), (sample + 1).min(last));
        let (speed, falls) = (self.speeds[here], self.speeds[next] < self.speeds[here]);
        Wanted { speed, braking: if falls { ANTICIPATION } else { 0.0 } }
    }
}

/// What is wanted at a place on the line.
#[derive(Clone, Copy, Debug)]
pub struct Wanted {
    /// Speed (m/s).
    pub speed: f64,
    /// Deceleration (m/s^2) with which that speed falls along the line here.
    pub braking: f64,
}

/// The speed (m/s) that a place on the line allows by itself.
pub fn local(curvature: f64, limit: f64) -> f64 {
    let curvature = curvature.abs();
    if curvature * limit * limit <= LATERAL_ACCELERATION {
        return limit;
    }
    (LATERAL_ACCELERATION / curvature).sqrt().max(SLOWEST_CURVE).min(limit)
}

/// The acceleration (m/s^2) at `speed` where `wanted` is, among leaders given as (gap, speed).
///
/// Treiber's free-road term knows a desired speed that stays. Where it falls, before a curve, the vehicle follows that
/// fall, and what it is too fast goes within [`SPEED_SETTLING`].
pub fn acceleration(manner: &Manner, speed: f64, wanted: Wanted, leaders: impl Iterator<Item = (f64, f64)>) -> f64 {
    let desired = wanted.speed.max(0.1);
    // Treiber's exponent is 4.
    let squared = (speed / desired) * (speed / desired);
    let free = manner.acceleration * (1.0 - squared * squared);
    let tracking = (desired - speed) / SPEED_SETTLING - wanted.braking;
    let road = free.max(-DECELERATION).min(tracking).max(-DECELERATION);
    let interaction = leaders.map(|(gap, leader)| interaction(manner, speed, gap, leader)).fold(0.0, f64::max);
    // No harder than to a stop: what is asked for beyond that would have to be taken back first.
    (road - interaction).max(-HARDEST_BRAKING).max(-speed / STEP_SECONDS)
}

/// The acceleration that follows `previous` where `wanted` is: a comfortable change, unless the brakes are needed.
pub fn smooth(previous: f64, wanted: f64) -> f64 {
    let change = JERK * STEP_SECONDS;
    if wanted < -DECELERATION {
        return wanted;
    }
    let previous = previous.max(-DECELERATION);
    wanted.clamp(previous - change, previous + change)
}

/// How much one leader takes off (m/s^2).
pub fn interaction(manner: &Manner, speed: f64, gap: f64, leader: f64) -> f64 {
    let Manner { headway, standstill_gap, acceleration } = *manner;
    let approach = speed * (speed - leader) / (2.0 * (acceleration * DECELERATION).sqrt());
    let wanted = standstill_gap + (speed * headway + approach).max(0.0);
    // Closer than a hand's breadth is all the same: brake as hard as can be.
    let ratio = wanted / gap.max(0.1);
    let interaction = acceleration * ratio * ratio;
    // A faster one drives away: it is let go ahead, but nobody brakes hard for it. (It may just have been replayed through us.)
    if leader > speed { interaction.min(acceleration + COMFORTABLE_BRAKING) } else { interaction }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn steady(speed: f64) -> Wanted {
        Wanted { speed, braking: 0.0 }
    }

    #[test]
    fn on_a_free_road_it_speeds_up_to_the_desired_speed_and_no_further() {
        let mut speed = 0.0;
        for _ in 0..1000 {
            speed += 0.1 * acceleration(&Manner::IDM, speed, steady(10.0), std::iter::empty());
        }
        assert!((speed - 10.0).abs() < 0.1, "{speed}");
        assert!(acceleration(&Manner::IDM, 12.0, steady(10.0), std::iter::empty()) < 0.0);
    }

    #[test]
    fn behind_a_leader_of_its_speed_the_gap_is_treibers_equilibrium() {
        // s_e = (s0 + vT) / sqrt(1 - (v/v0)^4), equation 5 of the paper of 2000.
        let (speed, desired) = (10.0_f64, 15.0_f64);
        let gap = (Manner::IDM.standstill_gap + speed * Manner::IDM.headway)
            / (1.0 - (speed / desired) * (speed / desired) * (speed / desired) * (speed / desired)).sqrt();
        assert!(acceleration(&Manner::IDM, speed, steady(desired), std::iter::once((gap, speed))).abs() < 1e-12);
    }

    #[test]
    fn it_stops_before_a_wall() {
        let (mut gap, mut speed) = (60.0, 15.0);
        for _ in 0..400 {
            speed =
                (speed + 0.1 * acceleration(&Manner::IDM, speed, steady(15.0), std::iter::once((gap, 0.0)))).max(0.0);
            gap -= 0.1 * speed;
        }
        assert!(gap > 0.5 && gap < 4.0 && speed < 0.1, "gap {gap}, speed {speed}");
    }
}
