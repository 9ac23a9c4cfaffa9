//! The lanes that the corners of the AV's box are in, and whether it is in one lane, as nuPlan asks
//! (`metrics/utils/route_extractor.py`, `extract_corners_route` and `extract_common_or_connecting_route_objs`).

use world::geometry::Point;

use super::held::Held;
use super::strip::Lanes;
use crate::judges::Body;

/// Front left, rear left, rear right, front right: the order of `OrientedBox::corners`.
pub(super) type CornerLanes = [Vec<usize>; 4];

/// Follows the corners from lane to lane: each from the lanes that any of them was in. Samples wait until somebody asks.
#[derive(Clone, Debug, Default)]
pub(super) struct Corners {
    waiting: Vec<Sample>,
    candidates: Vec<usize>,
    samples: usize,
    /// The lanes of each corner at the last sample that does not wait.
    now: CornerLanes,
    held: Held,
}

#[derive(Clone, Copy, Debug)]
struct Sample {
    corners: [Point; 4],
    forward: Point,
    ground: f64,
}

impl Corners {
    /// The next sample is of this box, on ground at the height `ground` (m).
    pub(super) fn wait(&mut self, av: &Body, ground: f64) {
        self.waiting.push(Sample { corners: av.outline.corners(), forward: av.outline.forward, ground });
    }

    /// The lanes of each corner at the last sample.
    pub(super) fn now(&mut self, lanes: &Lanes) -> &CornerLanes {
        for index in 0..self.waiting.len() {
            self.read(lanes, self.waiting[index]);
        }
        self.waiting.clear();
        &self.now
    }

    fn read(&mut self, lanes: &Lanes, sample: Sample) {
        let mut next = Vec::new();
        for (now, corner) in self.now.iter_mut().zip(sample.corners) {
            lanes.hold(&mut self.held, corner, sample.ground, sample.forward);
            *now = lanes.follow(&self.candidates, &self.held);
            if now.is_empty() {
                *now = lanes.search(&self.held);
                // nuPlan's code: a corner's find helps the next ones at the second sample alone.
                if self.samples == 1 {
                    add(&mut self.candidates, now);
                }
            }
            add(&mut next, now);
        }
        self.candidates = next;
        self.samples += 1;
    }
}

fn add(to: &mut Vec<usize>, lanes: &[usize]) {
    for lane in lanes {
        if !to.contains(lane) {
            to.push(*lane);
        }
    }
}

/// Whether one lane holds all corners, or one that leads out of the rear corners' lanes or into the front corners'.
pub(super) fn in_one_lane(lanes: &Lanes, corners: &CornerLanes) -> bool {
    let [front_left, rear_left, rear_right, front_right] = corners;
    if corners.iter().any(Vec::is_empty) {
        return false;
    }
    if front_left.iter().any(|lane| corners.iter().all(|corner| corner.contains(lane))) {
        return true;
    }
    let with_exits = |of: &[usize]| joined(of, |lane| lanes.exits(lane));
    let with_entries = |of: &[usize]| joined(of, |lane| lanes.entries(lane));
    let (from_left, from_right) = (with_exits(rear_left), with_exits(rear_right));
    let meet = |a: &[usize], b: &[usize]| a.iter().any(|lane| b.contains(lane));
    if !meet(rear_left, &from_right) && !meet(rear_right, &from_left) {
        return false;
    }
    let (to_left, to_right) = (with_entries(front_left), with_entries(front_right));
    let common = |lane: &usize| from_right.contains(lane) && to_right.contains(lane) && from_left.contains(lane);
    to_left.iter().any(common)
}

fn joined<'a>(of: &[usize], links: impl Fn(usize) -> &'a [usize]) -> Vec<usize> {
    of.iter().copied().chain(of.iter().flat_map(|lane| links(*lane).iter().copied())).collect()
}
