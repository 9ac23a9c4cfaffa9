//! How the generated road users move along their curves: the intelligent driver model (Treiber, Hennecke, Helbing, 2000)
//! with its jerk bounded. It keeps its distance by itself, so any seed gives a drive that hits nobody.

use world::plan::STEP_SECONDS;

use super::STEPS;
use super::old_curve::Curve;

/// Gap that is kept while standing (m).
const STANDSTILL_GAP: f64 = 2.0;
/// Time that is kept to the vehicle ahead (s).
const HEADWAY: f64 = 1.4;
/// Comfortable acceleration (m/s^2).
const ACCELERATION: f64 = 1.4;
/// Comfortable braking (m/s^2).
const BRAKING: f64 = 1.8;
/// The hardest braking (m/s^2).
const HARDEST_BRAKING: f64 = 3.5;
/// Bound of the jerk (m/s^3).
const JERK: f64 = 3.0;
/// Sideways acceleration that is aimed at in a bend (m/s^2); the model brakes by being too fast, so it comes to 1.4 times that.
const LATERAL: f64 = 1.4;
/// Integration steps in a step of the log.
const SUBSTEPS: usize = 10;

/// Where somebody is along a curve, and how fast, at each step.
#[derive(Clone, Debug)]
pub(super) struct Motion {
    /// Station of the box's centre (m).
    pub(super) stations: Vec<f64>,
    /// Speed (m/s).
    pub(super) speeds: Vec<f64>,
}

impl Motion {
    /// At one speed throughout.
    pub(super) fn steady(station: f64, speed: f64) -> Self {
        let stations = (0..STEPS).map(|step| station + speed * STEP_SECONDS * step as f64).collect();
        Self { stations, speeds: vec![speed; STEPS] }
    }

    /// The same motion along another curve whose stations are larger by `by`.
    pub(super) fn moved(mut self, by: f64) -> Self {
        self.stations.iter_mut().for_each(|station| *station += by);
        self
    }

    /// The first step at which `station` is passed; the last step if it never is.
    pub(super) fn step_past(&self, station: f64) -> usize {
        self.stations.iter().position(|s| *s > station).unwrap_or(STEPS - 1)
    }
}

/// Who drives.
#[derive(Clone, Copy, Debug)]
pub(super) struct Driver {
    /// Where the centre is at step 0 (m).
    pub(super) station: f64,
    /// Speed at step 0 (m/s).
    pub(super) speed: f64,
    /// Speed on a free, straight road (m/s).
    pub(super) desired: f64,
    /// Length of the vehicle (m).
    pub(super) length: f64,
}

/// What is minded ahead.
#[derive(Clone, Copy, Debug)]
pub(super) enum Ahead<'a> {
    /// A vehicle of a length, from a step on.
    Vehicle(&'a Motion, f64, usize),
    /// A line that is not crossed before a step.
    Line(f64, usize),
    /// Another desired speed, from one step to before another.
    Speed(f64, usize, usize),
}

/// The drive of `driver` along `curve`.
pub(super) fn drive(driver: Driver, curve: &Curve, ahead: &[Ahead<'_>]) -> Motion {
    let limits = bend_limits(curve);
    let mut motion = Motion { stations: Vec::with_capacity(STEPS), speeds: Vec::with_capacity(STEPS) };
    let (mut station, mut speed, mut acceleration) = (driver.station, driver.speed, 0.0);
    let dt = STEP_SECONDS / SUBSTEPS as f64;
    for step in 0..STEPS {
        motion.stations.push(station);
        motion.speeds.push(speed);
        for substep in 0..SUBSTEPS {
            let moment = (step, substep as f64 * dt);
            let bend = limits.get(station.max(0.0) as usize).copied().unwrap_or(f64::INFINITY);
            let wanted = idm(driver, station, speed, bend, moment, ahead);
            acceleration = wanted.clamp(acceleration - JERK * dt, acceleration + JERK * dt);
            let next = (speed + acceleration * dt).max(0.0);
            if next == 0.0 {
                acceleration = 0.0;
            }
            station += 0.5 * (speed + next) * dt;
            speed = next;
        }
    }
    motion
}

fn idm(driver: Driver, station: f64, speed: f64, bend: f64, moment: (usize, f64), ahead: &[Ahead<'_>]) -> f64 {
    let (step, seconds) = moment;
    let (mut desired, mut interaction) = (driver.desired, 0.0_f64);
    for thing in ahead {
        let (gap, other_speed) = match *thing {
            Ahead::Vehicle(other, length, from) if step >= from => {
                let other_station = other.stations[step] + other.speeds[step] * seconds;
                (other_station - station - 0.5 * (length + driver.length), other.speeds[step])
            }
            Ahead::Line(line, until) if step < until => (line - station - 0.5 * driver.length, 0.0),
            Ahead::Speed(wanted, from, until) if (from..until).contains(&step) => {
                desired = wanted;
                continue;
            }
            _ => continue,
        };
        // A line or a vehicle that is already passed is none.
        if gap > -0.5 * driver.length {
            let approach = speed * (speed - other_speed) / (2.0 * (ACCELERATION * BRAKING).sqrt());
            let wanted = STANDSTILL_GAP + (speed * HEADWAY + approach).max(0.0);
            let ratio = wanted / gap.max(0.3);
            interaction = interaction.max(ratio * ratio);
        }
    }
    let ratio = speed / desired.min(bend).max(0.5);
    let free = 1.0 - ratio * ratio * ratio * ratio;
    (ACCELERATION * (free - interaction)).clamp(-HARDEST_BRAKING, ACCELERATION)
}

/// For each metre of the curve the speed from which the bends ahead can still be met, braking softly.
fn bend_limits(curve: &Curve) -> Vec<f64> {
    let metres = curve.length().ceil() as usize + 1;
    let mut limits: Vec<f64> =
        (0..metres).map(|metre| (LATERAL / curve.curvature(metre as f64).abs().max(1e-6)).sqrt()).collect();
    for metre in (0..metres - 1).rev() {
        let reachable = (limits[metre + 1] * limits[metre + 1] + 2.0 * 0.7 * BRAKING).sqrt();
        limits[metre] = limits[metre].min(reachable);
    }
    limits
}
