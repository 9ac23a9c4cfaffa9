//! Position with a memory. A route may pass the same place twice: a roundabout, a loop, the ramp of a car park. The nearest
//! sample of the whole line is then as likely of the one pass as of the other; so a vehicle is followed from sample to sample.
//!
//! It is on the stretch on which it was a step before: the nearest sample is looked for from there, downhill. Where it is farther
//! than the corridor from that stretch, it has left it, and is taken up where else the line, on its level, is within the corridor,
//! if it is anywhere. What lies between on the line has not been driven along: no more of it counts as progress than the way that
//! was driven meanwhile.

use super::Route;
use crate::geometry::{Point, Pose};
use crate::reference_line::SAMPLE_SPACING;

/// Samples to either side that a step downhill looks at (2 m): the line has kinks.
const REACH: usize = 20;

/// A corridor wider than this (m) is taken for as wide: beyond it nobody is on the line.
const WIDEST: f64 = 20.0;

/// Where a first sample is looked for, a pass may be this much farther away (m) than the nearest one.
const SAME_PLACE: f64 = 1.0;

/// Heights further apart than this (m) are of different levels.
const STOREY: f64 = 3.0;

/// A vehicle on the line.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Follower {
    on: Option<On>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct On {
    sample: usize,
    /// Line that was passed over, and does not count (m).
    skipped: f64,
    point: Point,
    /// Way driven since it was last within the corridor (m).
    astray: f64,
}

/// Where a vehicle is on the line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Followed {
    /// The nearest sample of its stretch.
    pub sample: usize,
    /// Distance to the stretch on which it came (m).
    pub distance: f64,
    /// Line that it has passed over since the first sample, and that is no progress (m); negative where it was taken back.
    pub skipped: f64,
}

impl Follower {
    /// Where a vehicle is a step after the last one. `ground` is the height (m) below it: it tells the levels of a first sample
    /// apart. A vehicle farther than `corridor` (m) from its stretch has left it.
    pub fn follow(&mut self, route: &Route, pose: Pose, ground: f64, corridor: f64) -> Followed {
        let point = pose.position();
        let Some(mut on) = self.on else {
            let (sample, distance) = route.first_sample(pose, ground);
            self.on = Some(On { sample, skipped: 0.0, point, astray: 0.0 });
            return Followed { sample, distance, skipped: 0.0 };
        };
        on.astray += on.point.distance(point);
        on.point = point;
        let (sample, distance) = route.sample_downhill(point, on.sample);
        on.sample = sample;
        let corridor = corridor.min(WIDEST);
        if distance <= corridor {
            on.astray = 0.0;
        } else if let Some(other) = route.sample_on_level(point, corridor, route.line.z[sample]) {
            let jump = (other as f64 - sample as f64) * SAMPLE_SPACING;
            on.skipped += jump - jump.clamp(-on.astray, on.astray);
            on.sample = other;
            on.astray = 0.0;
        }
        self.on = Some(on);
        Followed { sample: on.sample, distance, skipped: on.skipped }
    }
}

impl Route {
    /// The nearest sample to `point` on the stretch around sample `from`, and its distance (m).
    fn sample_downhill(&self, point: Point, from: usize) -> (usize, f64) {
        let squared = |index: usize| point.distance_squared(self.samples.points()[index]);
        let last = self.line.len() - 1;
        let mut best = (from.min(last), squared(from.min(last)));
        loop {
            let around = best.0.saturating_sub(REACH)..=(best.0 + REACH).min(last);
            let before = best.0;
            for index in around {
                let distance = squared(index);
                if distance < best.1 {
                    best = (index, distance);
                }
            }
            if best.0 == before {
                return (best.0, best.1.sqrt());
            }
        }
    }

    /// The nearest sample within `reach` (m) of `point` at about the height `ground`.
    fn sample_on_level(&self, point: Point, reach: f64, ground: f64) -> Option<usize> {
        let on_level = |index: usize| (self.line.z[index] - ground).abs() <= STOREY;
        self.samples.nearest_where(point, reach, on_level).map(|(index, _)| index)
    }

    /// The sample at which a vehicle comes in: of all passes of its place, on its level and in its direction, the first.
    fn first_sample(&self, pose: Pose, ground: f64) -> (usize, f64) {
        let point = pose.position();
        let forward = Point::unit(pose.heading);
        let goes_its_way = |index: usize| Point::unit(self.line.heading[index]).dot(forward) > 0.0;
        let on_level = |index: usize| (self.line.z[index] - ground).abs() <= STOREY;
        let first_of = |accept: &dyn Fn(usize) -> bool| {
            let (_, nearest) = self.samples.nearest_where(point, f64::INFINITY, accept)?;
            let is_here =
                |index: &usize| accept(*index) && point.distance(self.samples.points()[*index]) <= nearest + SAME_PLACE;
            (0..self.line.len()).find(is_here)
        };
        // Logs and maps without heights, and drivers who back out, are somewhere too.
        let found = first_of(&|index| goes_its_way(index) && on_level(index));
        let found = found.filter(|index| point.distance(self.samples.points()[*index]) <= WIDEST);
        self.sample_downhill(point, found.or_else(|| first_of(&|_| true)).unwrap_or(0))
    }
}

#[cfg(test)]
mod tests;
