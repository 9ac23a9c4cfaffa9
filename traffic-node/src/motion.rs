//! From an acceleration to the next state: along the way, and back onto it from beside.
//!
//! With e the offset from where one steers, p the error of the course and distance as the variable: e' = p, p' = k - k_way. The law
//! k = k_way - 2 p / l - e / l^2 makes that critically damped, over the length l. So whatever offset and course somebody was taken over with
//! fade without a jump, and who stands does not slide.

use world::geometry::{Point, angle_difference};
use world::plan::STEP_SECONDS;
use world::traffic::way::SPACING;
use world::traffic::{Way, WayPlace};

/// The length l in seconds of driving, and at least in metres.
const SETTLING_SECONDS: f64 = 1.2;
const SETTLING_METERS: f64 = 5.0;

/// Offsets beyond this (m) are approached at this one's angle.
const LARGEST_OFFSET: f64 = 3.0;

/// Tightest curve (1/m), and most sideways acceleration (m/s^2): what a car can do.
pub(crate) const TIGHTEST: f64 = 0.25;
const MOST_SIDEWAYS: f64 = 5.0;

/// A heading that fits the course no better than at hand-over comes to fit it over this distance (m).
const SKEW_FADES: f64 = 8.0;

/// A car takes to a bend over this distance (m).
const BEND_FADES: f64 = 2.0;

/// In the first step the course turns by no more than this (rad): how far the wheels were turned is not known.
const FIRST_TURN: f64 = 0.018;

/// A heading turns by no more in a step (rad): what a kink asks for beyond that comes later.
const MOST_TURN: f64 = 0.3;

/// A velocity that leads no farther aside than this (m/s) from where the front points says nothing, and a slip above this (rad) is noise.
const ASIDE: f64 = 0.3;
const MOST_SLIP: f64 = 0.3;

/// Somebody in motion.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Motion {
    pub position: Point,
    /// Where the centre goes (rad): not quite where the front points, in a bend.
    pub course: f64,
    /// What of the heading the bend does not explain (rad).
    pub skew: f64,
    /// The curvature (1/m) that the car is in.
    bend: f64,
    pub speed: f64,
    /// From the rear axle to the centre (m): the centre goes aside in a bend by this much of the curvature.
    pub rear: f64,
    /// It was taken over just now.
    is_new: bool,
}

impl Motion {
    /// Whoever is at `position`, heads so and moves so.
    pub(crate) fn of(position: Point, heading: f64, velocity: Point, rear: f64, curvature: f64) -> Self {
        let speed = velocity.norm();
        let slip = angle_difference(heading, velocity.heading());
        let course = if speed * slip.abs() > ASIDE && slip.abs() <= MOST_SLIP { heading + slip } else { heading };
        let skew = heading - course + rear * curvature;
        Self { position, course, skew, bend: curvature, speed, rear, is_new: true }
    }

    /// The heading (rad).
    pub(crate) fn heading(&self) -> f64 {
        self.course - self.rear * self.bend + self.skew
    }

    /// A step on, at an acceleration (m/s^2), steering to `target` (m to the left of the way).
    pub(crate) fn advance(&mut self, way: &Way, place: &WayPlace, target: f64, acceleration: f64) {
        let heading = self.heading();
        let next = (self.speed + acceleration * STEP_SECONDS).max(0.0);
        let moved = 0.5 * (self.speed + next) * STEP_SECONDS;
        let settling = (SETTLING_SECONDS * self.speed).max(SETTLING_METERS);
        let error = angle_difference(way.heading(place.sample), self.course);
        let offset = (place.lateral - target).clamp(-LARGEST_OFFSET, LARGEST_OFFSET);
        let middle = way.sample_at(place.station + 0.5 * moved + 0.5 * SPACING);
        let wanted = way.curvature(middle) - 2.0 * error / settling - offset / (settling * settling);
        let tightest = TIGHTEST.min(MOST_SIDEWAYS / (next * next).max(1.0));
        let mut turn = wanted.clamp(-tightest, tightest) * moved;
        if std::mem::take(&mut self.is_new) {
            turn = turn.clamp(-FIRST_TURN, FIRST_TURN);
        } else {
            self.bend += (way.curvature(middle) - self.bend) * (moved / BEND_FADES).min(1.0);
            self.skew *= (1.0 - moved / SKEW_FADES).max(0.0);
        }
        self.position = self.position + Point::unit(self.course + 0.5 * turn) * moved;
        self.course += turn;
        self.speed = next;
        let turned = self.heading() - heading;
        self.skew -= turned - turned.clamp(-MOST_TURN, MOST_TURN);
    }
}

#[cfg(test)]
mod tests {
    use world::geometry::Point3;

    use super::*;

    #[test]
    fn an_offset_fades_without_a_jump_and_who_stands_does_not_slide() {
        let samples: Vec<Point3> = (0..400).map(|k| Point3::new(0.5 * f64::from(k), 0.0, 0.0)).collect();
        let way = Way::new(&samples, Vec::new()).unwrap();
        let mut motion = Motion::of(Point::new(5.0, 1.2), 0.08, Point::unit(0.02) * 8.0, 1.4, 0.0);
        assert!((motion.heading() - 0.08).abs() < 1e-12 && (motion.course - 0.02).abs() < 1e-12);
        let mut place = way.follow(motion.position, 10);
        let mut before = motion;
        for step in 0..100 {
            motion.advance(&way, &place, 0.0, 0.0);
            place = way.follow(motion.position, place.sample);
            assert!((motion.heading() - before.heading()).abs() < 0.05, "step {step}");
            before = motion;
        }
        assert!(place.lateral.abs() < 0.05 && motion.heading().abs() < 0.01, "{place:?} {motion:?}");
        motion.speed = 0.0;
        let stood = motion;
        motion.advance(&way, &place, 1.0, 0.0);
        assert_eq!((motion.position, motion.course), (stood.position, stood.course));
    }
}
