//! Sequences of lanes from where an agent is, and their points (`network.md` 3.3 to 3.5).

use super::lane_points::PreparedLane;
use super::lane_search::LaneStart;
use super::settings::Settings;
use crate::constants::POINTS;

/// A sequence ends with the lane in which it passes as many points: about 100 m.
const REACH: usize = 200;
/// As many points of a sequence are looked at.
const COLLECTED: usize = 300;
/// No more sequences than these are followed. In the densest junctions there are some forty; a map could be made to have millions.
const MOST: usize = 256;

/// Lanes one after another.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Chain {
    pub lanes: Vec<usize>,
}

/// All sequences from `starts`, without duplicates.
pub(super) fn follow(starts: &[LaneStart], lanes: &[PreparedLane], settings: Settings) -> Vec<Chain> {
    let mut chains = Vec::new();
    for start in starts {
        let left = lanes[start.lane].points.len() - start.point;
        descend(start.lane, left, lanes, &mut Vec::new(), &mut chains);
    }
    without_duplicates(chains, settings)
}

fn descend(lane: usize, passed: usize, lanes: &[PreparedLane], before: &mut Vec<usize>, chains: &mut Vec<Chain>) {
    before.push(lane);
    let exits = &lanes[lane].exits;
    if passed > REACH || exits.is_empty() {
        if chains.len() < MOST {
            chains.push(Chain { lanes: before.clone() });
        }
    } else {
        for exit in exits {
            if chains.len() < MOST {
                descend(*exit, passed + lanes[*exit].points.len(), lanes, before, chains);
            }
        }
    }
    before.pop();
}

/// Each sequence drops those that go on as it does, and those whose lanes it has all. The authors let two that consist of a single
/// lane count as going on alike, for neither goes on.
fn without_duplicates(chains: Vec<Chain>, settings: Settings) -> Vec<Chain> {
    let sets: Vec<Vec<usize>> = chains
        .iter()
        .map(|chain| {
            let mut set = chain.lanes.clone();
            set.sort_unstable();
            set.dedup();
            set
        })
        .collect();
    let mut dropped = vec![false; chains.len()];
    for i in 0..chains.len() {
        if dropped[i] {
            continue;
        }
        for j in (0..chains.len()).filter(|j| *j != i) {
            let (own, other) = (&chains[i].lanes[1..], &chains[j].lanes[1..]);
            let goes_on = settings == Settings::Authors || !own.is_empty();
            dropped[j] |= (goes_on && own == other) || is_subset(&sets[j], &sets[i]);
        }
    }
    chains.into_iter().zip(dropped).filter(|(_, dropped)| !dropped).map(|(chain, _)| chain).collect()
}

/// Whether all of `small` is in `large`; both in order.
fn is_subset(small: &[usize], large: &[usize]) -> bool {
    let mut rest = large.iter();
    small.iter().all(|value| rest.any(|other| other == value))
}

impl Chain {
    /// The point of each of its lanes to start from.
    pub fn starts(&self, starts: &[LaneStart]) -> Vec<usize> {
        let start = |lane: &usize| starts.iter().find(|start| start.lane == *lane).map_or(0, |start| start.point);
        self.lanes.iter().map(start).collect()
    }

    /// A hundred of its points: lane and index.
    pub fn points(&self, starts: &[usize], lanes: &[PreparedLane]) -> [(usize, usize); POINTS] {
        let all = self.lanes.iter().zip(starts);
        let all = all.flat_map(|(lane, start)| (*start..lanes[*lane].points.len()).map(|point| (*lane, point)));
        let collected: Vec<(usize, usize)> = all.take(COLLECTED).collect();
        sampled(collected.len()).map(|index| collected[index])
    }
}

/// Which of `count` points are taken: evenly spread, by a product that is rounded as the authors' is.
pub(super) fn sampled(count: usize) -> [usize; POINTS] {
    let step = count as f64 / POINTS as f64;
    std::array::from_fn(|index| (index as f64 * step) as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chains(lanes: &[&[usize]]) -> Vec<Chain> {
        lanes.iter().map(|lanes| Chain { lanes: lanes.to_vec() }).collect()
    }

    #[test]
    fn the_step_between_points_is_rounded_before_it_is_multiplied() {
        assert_eq!(sampled(58)[50], 28);
        assert_eq!((sampled(300)[99], sampled(1)[99], sampled(250)[1]), (297, 0, 2));
    }

    #[test]
    fn what_goes_on_alike_or_is_contained_is_dropped() {
        let all = chains(&[&[1, 2, 3], &[4, 2, 3], &[2, 3], &[5, 6], &[6, 5, 7]]);
        assert_eq!(without_duplicates(all, Settings::Mended), chains(&[&[1, 2, 3], &[6, 5, 7]]));
    }

    #[test]
    fn two_single_lanes_are_duplicates_by_the_authors_rule_alone() {
        let all = chains(&[&[1], &[2]]);
        assert_eq!(without_duplicates(all.clone(), Settings::Authors), chains(&[&[1]]));
        assert_eq!(without_duplicates(all.clone(), Settings::Mended), all);
    }
}
