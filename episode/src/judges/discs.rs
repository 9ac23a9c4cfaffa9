//! Contact as the paper's code tests it: a body is a row of discs along its axis, and two bodies touch where the centres of any
//! two discs are closer than a threshold of both widths (`dipp/closed-loop.md` section 5).
//!
//! It is no test of boxes: a corner sticks out by up to 0.19 of the width beyond the discs. The strict protocol tests boxes.

use world::geometry::{Point, Pose};
use world::scene::AgentState;

/// Bodies shorter than this (m) have two discs.
const SHORT: f64 = 4.0;

/// Bodies at least this long (m) have five discs, those between have three.
const LONG: f64 = 8.0;

/// A body as a row of discs. One without size (the authors' filler for an agent that is not there) is a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Discs {
    centers: [Point; 5],
    count: usize,
    width: f64,
}

impl Discs {
    /// The discs of a body of this length and width (m) at `pose`.
    #[must_use]
    pub fn of(pose: Pose, length: f64, width: f64) -> Self {
        let reach = (length - width) / 2.0;
        let (count, along) = if length < SHORT {
            (2, [reach, -reach, 0.0, 0.0, 0.0])
        } else if length < LONG {
            (3, [0.0, reach, -reach, 0.0, 0.0])
        } else {
            (5, [0.0, reach, -reach, reach / 2.0, -reach / 2.0])
        };
        let forward = Point::unit(pose.heading);
        Self { centers: along.map(|along| pose.position() + forward * along), count, width }
    }

    /// Their centres.
    #[must_use]
    pub fn centers(&self) -> &[Point] {
        &self.centers[..self.count]
    }

    /// How far the two bodies are from touching (m): the least distance of two centres less [`threshold`]. They touch where it
    /// is negative.
    #[must_use]
    pub fn margin(&self, other: &Self) -> f64 {
        let pairs = self.centers().iter().flat_map(|own| other.centers().iter().map(move |their| own.distance(*their)));
        pairs.fold(f64::INFINITY, f64::min) - threshold(self.width, other.width)
    }
}

impl From<&AgentState> for Discs {
    fn from(state: &AgentState) -> Self {
        Self::of(state.pose(), state.length, state.width)
    }
}

/// The distance of two centres (m) below which two bodies of these widths (m) touch.
#[must_use]
pub fn threshold(width: f64, other_width: f64) -> f64 {
    (width + other_width) / 3.8_f64.sqrt()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use proptest::prelude::*;

    use super::*;

    #[test]
    fn the_longer_the_body_the_more_discs() {
        let along = |length| Discs::of(Pose::default(), length, 2.0).centers().iter().map(|c| c.x).collect::<Vec<_>>();
        assert_eq!(along(3.999), [0.9995, -0.9995]);
        assert_eq!(along(4.0), [0.0, 1.0, -1.0]);
        assert_eq!(along(7.0), [0.0, 2.5, -2.5]);
        assert_eq!(along(8.0), [0.0, 3.0, -3.0, 1.5, -1.5]);
    }

    #[test]
    fn cars_side_by_side_touch_just_before_their_sides_do() {
        let car = |y| Discs::of(Pose::new(0.0, y, 0.0), 5.0, 2.0);
        let touch = 4.0 / 3.8_f64.sqrt();
        assert!(touch > 2.0 && touch < 2.06);
        assert!(car(0.0).margin(&car(touch - 1e-9)) < 0.0);
        assert!(car(0.0).margin(&car(touch + 1e-9)) > 0.0);
    }

    #[test]
    fn a_corner_beyond_the_discs_is_not_seen() {
        // A pole at the corner of a car's box.
        let pole = Discs::of(Pose::new(2.5, 1.0, 0.0), 0.0, 0.0);
        assert!(Discs::of(Pose::default(), 5.0, 2.0).margin(&pole) > 0.19 * 2.0 - 0.01);
    }

    #[test]
    fn a_car_across_reaches_sideways() {
        let across = Discs::of(Pose::new(10.0, 3.0, FRAC_PI_2), 5.0, 2.0);
        let along = Discs::of(Pose::new(10.0, 0.0, 0.0), 5.0, 2.0);
        assert!((across.margin(&along) - (1.5 - threshold(2.0, 2.0))).abs() < 1e-12);
    }

    proptest! {
        #[test]
        fn the_margin_is_the_same_from_either_side_and_in_any_frame(
            (x, y, heading) in (-9.0..9.0, -9.0..9.0, -4.0..4.0), (length, width) in (0.0..12.0, 0.0..3.0),
            (other_length, other_width) in (0.0..12.0, 0.0..3.0), (to_x, to_y, turn) in (-99.0..99.0, -99.0..99.0, -4.0..4.0),
        ) {
            let (pose, frame) = (Pose::new(x, y, heading), Pose::new(to_x, to_y, turn));
            let moved = |pose: Pose| {
                let place = frame.to_world(pose.position());
                Pose::new(place.x, place.y, pose.heading + turn)
            };
            let margin = |own, their| Discs::of(own, length, width).margin(&Discs::of(their, other_length, other_width));
            let here = margin(pose, Pose::default());
            let back = Discs::of(Pose::default(), other_length, other_width).margin(&Discs::of(pose, length, width));
            prop_assert_eq!(here, back);
            prop_assert!((here - margin(moved(pose), moved(Pose::default()))).abs() < 1e-9);
        }
    }
}
