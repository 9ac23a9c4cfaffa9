//! What is compared with the log, and how far it is from it.
//!
//! Speed, acceleration, distance to the nearest and time to collision are those of the Waymo Open Sim Agents Challenge, with the bins of its histograms (Montali
//! et al. 2023, arXiv 2305.12032; `challenge_2024_config.textproto`): by differences of places, and whoever is followed is he whose box begins ahead of the own front, in its trail, headed as oneself by
//! 75 degrees, by 10 if he reaches less than 0.5 m into it. Gap and headway are the distance to him, in metres and in seconds.

use episode::judges::STOREY;
use world::geometry::{OrientedBox, Point, angle_difference, boxes_overlap};
use world::plan::STEP_SECONDS;
use world::scene::AgentState;

use super::stage::Member;
use crate::score::convex;

/// Something that is compared.
#[derive(Clone, Copy, Debug)]
pub struct Feature {
    /// Its name.
    pub name: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// Where the bins of its histogram begin and end, and how many there are; what is beyond is in the first or the last.
    pub bins: (f64, f64, usize),
    /// Whether it is told only of moments at which both the drive and the log have it: it is of one agent alone.
    pub of_both: bool,
}

const fn feature(name: &'static str, unit: &'static str, bins: (f64, f64, usize), of_both: bool) -> Feature {
    Feature { name, unit, bins, of_both }
}

/// All of them.
pub const FEATURES: [Feature; 6] = [
    feature("speed", "m/s", (0.0, 25.0, 10), true),
    feature("acceleration", "m/s²", (-12.0, 12.0, 11), true),
    feature("distance to the nearest", "m", (-5.0, 40.0, 10), true),
    feature("time to collision", "s", (0.0, 5.0, 10), true),
    feature("gap", "m", (0.0, 40.0, 10), false),
    feature("headway", "s", (0.0, 5.0, 10), false),
];

/// The challenge adds so much to each bin.
const PSEUDOCOUNT: f64 = 0.1;

/// Nobody farther than this (m) is told of: the challenge's last bin ends there.
const FARTHEST: f64 = 40.0;

/// The longest time to collision (s), also of who follows nobody.
const LONGEST: f64 = 5.0;

/// Below this speed (m/s) a gap is no headway.
const MOVING: f64 = 1.0;

/// How somebody moved, by differences of places over two steps.
pub(super) struct Motion {
    speeds: Vec<Option<f64>>,
}

impl Motion {
    pub(super) fn of(states: &[Option<AgentState>]) -> Self {
        let speed = |step: usize| {
            let (before, after) = ((*states.get(step.checked_sub(1)?)?)?, (*states.get(step + 1)?)?);
            let (way, height) = (after.position().distance(before.position()), after.z - before.z);
            Some((way * way + height * height).sqrt() / (2.0 * STEP_SECONDS))
        };
        Self { speeds: (0..states.len()).map(speed).collect() }
    }

    fn speed(&self, step: usize) -> Option<f64> {
        self.speeds.get(step).copied().flatten()
    }

    /// The change of speed (m/s^2).
    pub(super) fn acceleration(&self, step: usize) -> Option<f64> {
        Some((self.speed(step + 1)? - self.speed(step.checked_sub(1)?)?) / (2.0 * STEP_SECONDS))
    }
}

/// The features of somebody at a moment, in the order of [`FEATURES`].
pub(super) fn of(own: &Member, all: &[Member], motion: &Motion, step: usize) -> [Option<f64>; FEATURES.len()] {
    let others =
        || all.iter().filter(|other| other.place != own.place && (other.state.z - own.state.z).abs() <= STOREY);
    let nearest = others().map(|other| distance(&own.outline, &other.outline)).fold(FARTHEST, f64::min);
    let ahead = others().filter_map(|other| Some((gap(&own.outline, &other.outline)?, other)));
    let ahead = ahead.min_by(|(one, _), (other, _)| one.total_cmp(other)).filter(|(gap, _)| *gap <= FARTHEST);
    let speed = motion.speed(step);
    let closing = ahead.zip(speed).map(|((gap, other), speed)| (gap, speed - other.state.speed()));
    let time = closing.filter(|(_, closing)| *closing > 0.0).map_or(LONGEST, |(gap, closing)| gap / closing);
    let gap = ahead.map(|(gap, _)| gap);
    let headway = gap.zip(speed.filter(|speed| *speed > MOVING)).map(|(gap, speed)| gap / speed);
    [speed, motion.acceleration(step), Some(nearest), Some(time.min(LONGEST)), gap, headway]
}

/// How far boxes are apart (m); where they overlap, how far one would have to move at least, below 0.
fn distance(a: &OrientedBox, b: &OrientedBox) -> f64 {
    if a.center.distance(b.center) - a.radius() - b.radius() > FARTHEST {
        return FARTHEST;
    }
    if boxes_overlap(a, b) {
        let offset = b.center - a.center;
        let depth = |axis: Point| reach(a, axis) + reach(b, axis) - offset.dot(axis).abs();
        return -[a.forward, a.left(), b.forward, b.left()].into_iter().map(depth).fold(f64::INFINITY, f64::min);
    }
    convex::distance(&a.corners(), &b.corners())
}

/// Half of a box's extent along an axis (m).
fn reach(a: &OrientedBox, axis: Point) -> f64 {
    a.half_length * a.forward.dot(axis).abs() + a.half_width * a.left().dot(axis).abs()
}

/// The distance (m) from the front of `own` to `other`, if that is followed.
fn gap(own: &OrientedBox, other: &OrientedBox) -> Option<f64> {
    let offset = other.center - own.center;
    let gap = offset.dot(own.forward) - own.half_length - reach(other, own.forward);
    let aside = offset.dot(own.left()).abs() - own.half_width - reach(other, own.left());
    let turned = angle_difference(own.forward.heading(), other.forward.heading()).abs().to_degrees();
    let most = if aside > -0.5 { 10.0 } else { 75.0 };
    (gap > 0.0 && aside < 0.0 && turned <= most).then_some(gap)
}

/// How far two distributions are apart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Distance {
    /// Wasserstein's first distance, in the feature's unit: how far values have to be moved on average.
    pub wasserstein: f64,
    /// Jensen and Shannon's divergence of the histograms, 0 for the same and 1 for such as have nothing in common.
    pub jensen_shannon: f64,
}

impl Feature {
    /// How far these values are from those; none where there are none of either.
    #[must_use]
    pub fn distance(&self, of: &[f64], from: &[f64]) -> Option<Distance> {
        if of.is_empty() || from.is_empty() {
            return None;
        }
        let shares = [of, from].map(|values| self.histogram(values));
        let entropy = |shares: &[f64]| -shares.iter().map(|share| share * libm::log2(*share)).sum::<f64>();
        let mean: Vec<f64> = shares[0].iter().zip(&shares[1]).map(|(a, b)| 0.5 * (a + b)).collect();
        let jensen_shannon = entropy(&mean) - 0.5 * (entropy(&shares[0]) + entropy(&shares[1]));
        Some(Distance { wasserstein: wasserstein(of, from), jensen_shannon: jensen_shannon.clamp(0.0, 1.0) })
    }

    fn histogram(&self, values: &[f64]) -> Vec<f64> {
        let (from, to, bins) = self.bins;
        let mut counts = vec![PSEUDOCOUNT; bins];
        for value in values {
            let bin = ((value - from) / (to - from) * bins as f64).floor();
            counts[(bin.max(0.0) as usize).min(bins - 1)] += 1.0;
        }
        let sum: f64 = counts.iter().sum();
        counts.iter().map(|count| count / sum).collect()
    }
}

/// The area between the two distribution functions.
fn wasserstein(of: &[f64], from: &[f64]) -> f64 {
    let sorted = |values: &[f64]| {
        let mut values = values.to_vec();
        values.sort_by(f64::total_cmp);
        values
    };
    let (a, b) = (sorted(of), sorted(from));
    let mut all: Vec<f64> = a.iter().chain(&b).copied().collect();
    all.sort_by(f64::total_cmp);
    let share = |values: &[f64], at: f64| values.partition_point(|value| *value <= at) as f64 / values.len() as f64;
    all.windows(2).map(|pair| (share(&a, pair[0]) - share(&b, pair[0])).abs() * (pair[1] - pair[0])).sum()
}

#[cfg(test)]
mod tests {
    use world::geometry::Pose;

    use super::*;

    fn car(x: f64, y: f64, heading: f64) -> OrientedBox {
        OrientedBox::new(Pose::new(x, y, heading), 4.0, 2.0)
    }

    #[test]
    fn distances_of_boxes_by_hand() {
        let own = car(0.0, 0.0, 0.0);
        assert!((distance(&own, &car(10.0, 0.0, 0.0)) - 6.0).abs() < 1e-12);
        assert!((distance(&own, &car(7.0, 5.0, 0.0)) - 18.0_f64.sqrt()).abs() < 1e-12);
        assert!((distance(&own, &car(3.5, 0.0, 0.0)) + 0.5).abs() < 1e-12, "half a metre deep");
        assert_eq!(distance(&own, &car(100.0, 0.0, 0.0)), FARTHEST);
    }

    #[test]
    fn who_is_followed_is_ahead_in_the_trail_and_headed_alike() {
        let own = car(0.0, 0.0, 0.0);
        assert_eq!(gap(&own, &car(10.0, 0.0, 0.0)), Some(6.0));
        assert_eq!(gap(&own, &car(-10.0, 0.0, 0.0)), None, "behind");
        assert_eq!(gap(&own, &car(10.0, 2.5, 0.0)), None, "beside");
        assert_eq!(gap(&own, &car(10.0, 0.0, 1.5)), None, "across");
        // It reaches 0.3 m into the trail: headed alike it counts, turned by 20 degrees it does not.
        assert_eq!(gap(&own, &car(10.0, 1.7, 0.0)), Some(6.0));
        assert_eq!(gap(&own, &car(10.0, 2.3, 0.35)), None);
    }

    #[test]
    fn distributions_that_are_the_same_have_no_distance_and_a_shift_is_the_distance() {
        let speed = FEATURES[0];
        let values: Vec<f64> = (0..500).map(|k| f64::from(k) * 0.02).collect();
        let shifted: Vec<f64> = values.iter().map(|value| value + 1.5).collect();
        let none = speed.distance(&values, &values).unwrap();
        assert!(none.wasserstein.abs() < 1e-12 && none.jensen_shannon.abs() < 1e-12);
        let some = speed.distance(&shifted, &values).unwrap();
        assert!((some.wasserstein - 1.5).abs() < 1e-9 && some.jensen_shannon > 0.01, "{some:?}");
        let far: Vec<f64> = values.iter().map(|value| value + 15.0).collect();
        assert!(speed.distance(&far, &values).unwrap().jensen_shannon > 0.95);
        // Of other numbers of values: a half of them 1 higher.
        let half = [1.0, 1.0, 2.0, 2.0];
        assert!((speed.distance(&half, &[1.0, 1.0]).unwrap().wasserstein - 0.5).abs() < 1e-12);
        assert_eq!(speed.distance(&[], &values), None);
    }

    #[test]
    fn motion_is_of_differences_of_places() {
        let state = |x: f64| Some(AgentState { x, velocity_x: 99.0, ..AgentState::default() });
        // 1 m/s more each step.
        let states: Vec<_> = [0.0, 0.1, 0.3, 0.6, 1.0].map(state).into();
        let motion = Motion::of(&states);
        assert!((motion.speed(2).unwrap() - 2.5).abs() < 1e-12);
        assert!((motion.acceleration(2).unwrap() - 10.0).abs() < 1e-9);
        assert_eq!((motion.speed(0), motion.acceleration(1)), (None, None));
    }
}
