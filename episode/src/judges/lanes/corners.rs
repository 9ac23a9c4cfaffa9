//! The lanes that the corners of the AV's box are in, and whether it is in one lane, as nuPlan asks
//! (`metrics/utils/route_extractor.py`, `extract_corners_route` and `extract_common_or_connecting_route_objs`).

use super::strip::{Held, Lanes};

/// Front left, rear left, rear right, front right: the order of `OrientedBox::corners`.
pub(super) type CornerLanes = [Vec<usize>; 4];

/// Follows the corners from lane to lane: each from the lanes that any of them was in.
#[derive(Clone, Debug, Default)]
pub(super) struct Corners {
    candidates: Vec<usize>,
    samples: usize,
}

impl Corners {
    /// The lanes of each corner at the next sample, given which lanes hold them.
    pub(super) fn read(&mut self, lanes: &Lanes, held: &[Held; 4]) -> CornerLanes {
        let mut next = Vec::new();
        let now = held.each_ref().map(|held| {
            let mut now = lanes.follow(&self.candidates, held);
            if now.is_empty() {
                now = lanes.search(held);
                // nuPlan's code: a corner's find helps the next ones at the second sample alone.
                if self.samples == 1 {
                    add(&mut self.candidates, &now);
                }
            }
            add(&mut next, &now);
            now
        });
        self.candidates = next;
        self.samples += 1;
        now
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
