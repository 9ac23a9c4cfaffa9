//! Who drives: the intelligent driver model (Treiber, Hennecke, Helbing, 2000) with everybody's own parameters, and what keeps people from
//! following it exactly: they react late, misjudge distances (an Ornstein-Uhlenbeck process, after Treiber, Kesting, Helbing, 2006),
//! wander in their lane, and move the pedal only so fast.

use std::f64::consts::TAU;

use world::plan::STEP_SECONDS;

use crate::generated::draw::Draw;

/// The most steps by which somebody reacts late.
pub(super) const LATEST: usize = 8;

/// A driver's own parameters.
#[derive(Clone, Debug)]
pub(in crate::generated) struct Driver {
    /// Speed that is aimed at, as a share of the limit.
    pub(in crate::generated) eagerness: f64,
    /// Time that is kept to the vehicle ahead (s).
    pub(in crate::generated) headway: f64,
    /// Gap that is kept while standing (m).
    pub(in crate::generated) standstill_gap: f64,
    /// Comfortable acceleration and braking (m/s^2).
    pub(in crate::generated) acceleration: f64,
    pub(in crate::generated) braking: f64,
    /// Sideways acceleration that is accepted in bends (m/s^2).
    pub(in crate::generated) lateral: f64,
    /// Time that must be left between oneself and cross traffic (s).
    pub(in crate::generated) margin: f64,
    /// Reaction time (steps), at most [`LATEST`].
    pub(in crate::generated) delay: usize,
    /// How fast acceleration changes (m/s^3) while nothing urges.
    pub(in crate::generated) jerk: f64,
    /// How much distances are misjudged, as a share.
    pub(in crate::generated) misjudging: f64,
    /// How unsteady the pedal is (m/s^2).
    pub(in crate::generated) unsteadiness: f64,
    /// Sideways acceleration to the left that tempts into another lane; infinite for those who never change.
    pub(in crate::generated) lane_change_threshold: f64,
    /// How likely it is to turn into a parking lot, beside going on along the street.
    pub(in crate::generated) parks: f64,
    pub(in crate::generated) wander: Wander,
}

impl Driver {
    /// Somebody of the traffic.
    pub(in crate::generated) fn anybody(draw: &mut Draw) -> Self {
        Self {
            eagerness: draw.normal(0.98, 0.09).clamp(0.75, 1.2),
            headway: draw.normal(0.9, 0.3).clamp(0.4, 2.0),
            standstill_gap: draw.normal(3.0, 1.0).clamp(1.3, 6.0),
            acceleration: draw.normal(1.5, 0.3).clamp(0.9, 2.4),
            braking: draw.normal(1.65, 0.3).clamp(1.0, 2.8),
            lateral: draw.normal(2.2, 0.35).clamp(1.4, 3.2),
            margin: draw.normal(1.1, 0.3).clamp(0.5, 2.0),
            delay: 1 + draw.below(4),
            jerk: draw.between(2.0, 4.0),
            misjudging: draw.between(0.02, 0.1),
            unsteadiness: draw.between(0.1, 0.3),
            lane_change_threshold: draw.between(0.15, 0.5),
            parks: 0.05,
            wander: Wander::new(draw, 0.32),
        }
    }

    /// The human at the wheel of the AV's log: calm, attentive, later than a machine.
    pub(in crate::generated) fn of_the_av(draw: &mut Draw) -> Self {
        Self {
            eagerness: draw.between(0.86, 1.02),
            headway: draw.between(1.2, 2.0),
            standstill_gap: draw.between(2.5, 5.0),
            acceleration: draw.between(1.3, 2.0),
            braking: draw.between(1.0, 1.5),
            lateral: draw.between(1.7, 2.4),
            margin: draw.between(1.0, 1.8),
            delay: 3 + draw.below(4),
            jerk: draw.between(1.8, 3.0),
            misjudging: draw.between(0.03, 0.07),
            unsteadiness: draw.between(0.08, 0.2),
            lane_change_threshold: f64::INFINITY,
            parks: 0.0,
            wander: Wander::new(draw, 0.16),
        }
    }

    /// Somebody on a bicycle.
    pub(in crate::generated) fn on_a_bicycle(draw: &mut Draw) -> Self {
        Self {
            eagerness: draw.between(0.65, 1.1),
            headway: 1.2,
            standstill_gap: 1.5,
            acceleration: draw.between(0.6, 1.0),
            lane_change_threshold: f64::INFINITY,
            wander: Wander::new(draw, 0.15),
            ..Self::anybody(draw)
        }
    }

    /// The acceleration (m/s^2) wished for at `speed` with nothing ahead, aiming at `desired` (m/s).
    pub(super) fn free(&self, speed: f64, desired: f64) -> f64 {
        if speed <= desired {
            let ratio = speed / desired.max(0.1);
            self.acceleration * (1.0 - ratio * ratio * ratio * ratio)
        } else {
            -(1.1 * self.braking).min(1.0 * (speed - desired))
        }
    }

    /// The acceleration at which something `gap` (m) ahead that goes at `other` (m/s) is followed; `standstill` (m) is kept at rest.
    pub(super) fn follow(&self, speed: f64, gap: f64, other: f64, standstill: f64, headway: f64) -> f64 {
        let approach = speed * (speed - other) / (2.0 * (self.acceleration * self.braking).sqrt());
        let wanted = standstill + (speed * headway + approach).max(0.0);
        let ratio = wanted / gap.max(0.2);
        self.acceleration * (1.0 - ratio * ratio)
    }
}

/// How somebody wanders within a lane: two slow waves over the way driven, so that nobody slides sideways while standing.
#[derive(Clone, Debug)]
pub(in crate::generated) struct Wander {
    bias: f64,
    waves: [(f64, f64, f64); 2],
}

impl Wander {
    fn new(draw: &mut Draw, size: f64) -> Self {
        let mut wave = |share: f64, short: f64, long: f64| {
            (share * size * draw.between(0.3, 1.0), TAU / draw.between(short, long), draw.between(0.0, TAU))
        };
        let waves = [wave(0.8, 70.0, 140.0), wave(0.3, 35.0, 60.0)];
        Self { bias: draw.normal(0.0, 0.6 * size).clamp(-size, size), waves }
    }

    /// Nobody wanders: for what is parked.
    pub(in crate::generated) fn none() -> Self {
        Self { bias: 0.0, waves: [(0.0, 0.0, 0.0); 2] }
    }

    /// Offset to the left (m) after `way` (m), and its slope.
    pub(super) fn at(&self, way: f64) -> (f64, f64) {
        self.waves.iter().fold((self.bias, 0.0), |(offset, slope), (size, frequency, phase)| {
            let (sine, cosine) = libm::sincos(frequency * way + phase);
            (offset + size * sine, slope + size * frequency * cosine)
        })
    }
}

/// What is on somebody's mind from step to step.
#[derive(Clone, Debug, Default)]
pub(super) struct Mind {
    /// Share by which distances are misjudged now, and how the pedal trembles (m/s^2).
    misjudged: f64,
    trembling: f64,
    /// Accelerations wished for lately, the newest first.
    wishes: [f64; LATEST + 1],
}

impl Mind {
    /// How a gap looks.
    pub(super) fn seen(&self, gap: f64) -> f64 {
        gap * (1.0 + self.misjudged)
    }

    /// The acceleration that comes of a wish, from what it was.
    pub(super) fn react(&mut self, driver: &Driver, draw: &mut Draw, wish: f64, now: f64, speed: f64) -> f64 {
        let noise = |size: f64, value: f64, seconds: f64, random: f64| {
            let keep = 1.0 - STEP_SECONDS / seconds;
            keep * value + size * (1.0 - keep * keep).sqrt() * random
        };
        let mut random = || draw.between(-1.0, 1.0) * 1.732; // of variance 1
        self.misjudged = noise(driver.misjudging, self.misjudged, 5.0, random());
        self.trembling = noise(driver.unsteadiness, self.trembling, 1.5, random());
        self.wishes.rotate_right(1);
        self.wishes[0] = wish;
        // Danger is met with what was seen last; everything else with what was on the mind.
        let late = self.wishes[driver.delay.min(LATEST)];
        // Nobody trembles over a stop line.
        let wanted = late + self.trembling * (0.3 * speed).min(1.0);
        let urgent = (-wanted - 2.0).max(0.0);
        let (up, down) = (driver.jerk * STEP_SECONDS, (driver.jerk + 8.0 * urgent) * STEP_SECONDS);
        wanted.clamp(now - down, now + up).clamp(-HARDEST_BRAKING, 0.35 + driver.acceleration)
    }
}

/// No vehicle brakes harder (m/s^2).
pub(in crate::generated) const HARDEST_BRAKING: f64 = 7.5;
