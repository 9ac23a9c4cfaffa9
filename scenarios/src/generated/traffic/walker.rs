//! People on foot: they walk along sidewalks, wait at crossings and cross.

use std::rc::Rc;

use world::geometry::{Point, Pose};
use world::plan::STEP_SECONDS;

use crate::generated::STEPS;
use crate::generated::curve::Curve;
use crate::generated::draw::Draw;

/// Somebody on foot.
#[derive(Clone, Debug)]
pub(in crate::generated) struct Walker {
    /// Length, width, height (m).
    pub(in crate::generated) size: [f64; 3],
    pub(in crate::generated) course: Rc<Curve>,
    /// The crossing that `course` is, with traffic in its way.
    pub(in crate::generated) crossing: Option<usize>,
    /// Walks the course from its end to its start.
    pub(in crate::generated) back: bool,
    /// Crosses whoever comes, and is marked so.
    pub(in crate::generated) heedless: bool,
    /// Speed (m/s) when walking.
    pub(in crate::generated) pace: f64,
    pub(in crate::generated) starts: Start,
    /// Where on the way (m), and whether it has begun.
    pub(super) walked: f64,
    pub(super) speed: f64,
    pub(super) walking: bool,
    /// From the course to the left (m).
    pub(super) side: f64,
    sway: (f64, f64, f64),
    pub(in crate::generated) poses: Vec<Option<Pose>>,
}

/// When somebody begins to walk.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::generated) enum Start {
    /// At a step, if the crossing lets one.
    Step(i32),
    /// When the AV's front would be at the course within so many seconds, whoever comes.
    BeforeAv(f64),
    /// Never.
    Never,
}

impl Walker {
    pub(in crate::generated) fn new(
        course: Rc<Curve>,
        crossing: Option<usize>,
        starts: Start,
        draw: &mut Draw,
    ) -> Self {
        let width = draw.normal(0.84, 0.07).clamp(0.6, 1.1);
        let back = draw.chance(0.5);
        // Everybody keeps to the right.
        let right = draw.between(0.45, 0.8);
        Self {
            size: [draw.normal(0.87, 0.08).clamp(0.6, 1.2), width, draw.normal(1.72, 0.11).clamp(1.2, 2.0)],
            course,
            crossing,
            back,
            heedless: false,
            pace: draw.normal(1.25, 0.25).clamp(0.5, 2.2),
            starts,
            walked: 0.0,
            speed: 0.0,
            walking: false,
            side: if back { right } else { -right },
            sway: (draw.between(0.01, 0.05), draw.between(0.4, 0.9), draw.between(0.0, 6.0)),
            poses: vec![None; STEPS],
        }
    }

    /// Is the `nth` to wait at this end of a crossing: two stand side by side, the next behind them.
    pub(in crate::generated) fn in_line(mut self, nth: usize) -> Self {
        let right = 0.45 + 1.15 * (nth % 2) as f64;
        self.side = if self.back { right } else { -right };
        self.walked = -1.2 * (nth / 2) as f64;
        self
    }

    /// Begins `walked` (m) on its way, walking.
    pub(in crate::generated) fn on_the_way(mut self, walked: f64) -> Self {
        (self.walked, self.walking, self.speed) = (walked, true, self.pace);
        self
    }

    /// Stands where it is.
    pub(in crate::generated) fn stand(&mut self) {
        (self.walking, self.speed) = (false, 0.0);
    }

    /// Where on the course (m).
    pub(super) fn station(&self) -> f64 {
        if self.back { self.course.length() - self.walked } else { self.walked }
    }

    /// Has begun to walk, and not arrived.
    pub(super) fn is_on_the_way(&self) -> bool {
        self.walking && !self.has_arrived()
    }

    pub(super) fn has_arrived(&self) -> bool {
        self.walked >= self.course.length()
    }

    pub(super) fn pose(&self) -> Pose {
        let base = self.course.pose(self.station());
        let (sine, cosine) = libm::sincos(self.sway.1 * self.walked + self.sway.2);
        let at = base.to_world(Point::new(0.0, self.side + self.sway.0 * sine));
        let turn = libm::atan(self.sway.0 * self.sway.1 * cosine);
        let heading = if self.back { base.heading + std::f64::consts::PI } else { base.heading };
        Pose::new(at.x, at.y, heading + turn)
    }

    /// It has not moved in the last step: it is where it was.
    pub(super) fn rests(&self) -> bool {
        self.speed == 0.0
    }

    /// On by one step; not faster than `slowest` (m/s), whoever walks right ahead.
    pub(super) fn advance(&mut self, slowest: f64) {
        let wanted = if self.is_on_the_way() { self.pace.min(slowest) } else { 0.0 };
        let change = 2.5 * STEP_SECONDS;
        self.speed = wanted.clamp(self.speed - change, self.speed + change);
        self.walked += self.speed * STEP_SECONDS;
    }

    /// Whether `other` walks right ahead, on the same course the same way.
    pub(super) fn is_behind(&self, other: &Self) -> bool {
        let ahead = other.walked - self.walked;
        self.crossing == other.crossing
            && self.back == other.back
            && (self.side - other.side).abs() < 0.95
            && ahead > 0.0
            && ahead < 1.35
    }

    /// When (s from now) somebody at `station` of the course, as wide as `reach` (m) to both sides, has the walker before it: from, until. `None`
    /// if that is over.
    pub(super) fn span_at(&self, station: f64, reach: f64) -> Option<(f64, f64)> {
        let there = if self.back { self.course.length() - station } else { station };
        let pace = self.pace.max(0.3);
        let (from, until) = ((there - reach - self.walked) / pace, (there + reach - self.walked) / pace);
        (until > 0.0).then_some((from.max(0.0), until))
    }
}
