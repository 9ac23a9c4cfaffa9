//! How lanes hang together: successors, predecessors and neighbours by index in [`Map::lanes`].
//!
//! Cycles are fine: no search here follows a lane twice.

use std::cmp::Reverse;
use std::collections::{BTreeSet, BinaryHeap};

use crate::geometry::Point3;
use crate::map::{LaneNeighbor, Map, MapId};

/// The lanes of a map as a graph. Links to lanes that the map does not hold are left out.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LaneGraph {
    nodes: Vec<Node>,
}

#[derive(Clone, Debug, Default, PartialEq)]
struct Node {
    successors: Vec<usize>,
    predecessors: Vec<usize>,
    neighbors: Vec<usize>,
    length: f64,
}

impl LaneGraph {
    /// The graph of `map`'s lanes; links in the order of the map.
    #[must_use]
    pub fn new(map: &Map) -> Self {
        let indices = map.lane_indices();
        let known = |ids: &[MapId]| ids.iter().filter_map(|id| indices.get(id).copied()).collect();
        let beside = |neighbor: &LaneNeighbor| indices.get(&neighbor.lane).copied();
        let node = |lane: &crate::map::Lane| {
            // A neighbour is listed once for each stretch.
            let neighbors: BTreeSet<usize> =
                lane.left_neighbors.iter().chain(&lane.right_neighbors).filter_map(beside).collect();
            Node {
                successors: known(&lane.exits),
                predecessors: known(&lane.entries),
                neighbors: neighbors.into_iter().collect(),
                length: length(&lane.centerline),
            }
        };
        Self { nodes: map.lanes.iter().map(node).collect() }
    }

    /// Lanes that `lane` leads to, in the map's order.
    #[must_use]
    pub fn successors(&self, lane: usize) -> &[usize] {
        &self.nodes[lane].successors
    }

    /// Lanes that lead into `lane`, in the map's order.
    #[must_use]
    pub fn predecessors(&self, lane: usize) -> &[usize] {
        &self.nodes[lane].predecessors
    }

    /// Lanes beside `lane` in the same direction, each once, in ascending order.
    #[must_use]
    pub fn neighbors(&self, lane: usize) -> &[usize] {
        &self.nodes[lane].neighbors
    }

    /// Length of `lane` (m).
    #[must_use]
    pub fn length(&self, lane: usize) -> f64 {
        self.nodes[lane].length
    }

    /// The lanes from `from` to `to`, both included, that have the least length between them, if that is at most `reach`
    /// metres. Successors only: no lane change.
    #[must_use]
    pub fn shortest_path(&self, from: usize, to: usize, reach: f64) -> Option<Vec<usize>> {
        let mut previous = vec![None; self.nodes.len()];
        let mut done = BTreeSet::new();
        // Distances are never negative, so their bits sort as they do.
        let mut open = BinaryHeap::from([Reverse((0_u64, from, from))]);
        while let Some(Reverse((bits, lane, by))) = open.pop() {
            if !done.insert(lane) {
                continue;
            }
            previous[lane] = Some(by);
            if lane == to {
                return Some(self.walk_back(&previous, from, to));
            }
            for next in self.successors(lane).iter().filter(|next| !done.contains(*next)) {
                let between = if *next == to { 0.0 } else { self.length(*next) };
                let distance = f64::from_bits(bits) + between;
                if distance <= reach {
                    open.push(Reverse((distance.to_bits(), *next, lane)));
                }
            }
        }
        None
    }

    fn walk_back(&self, previous: &[Option<usize>], from: usize, to: usize) -> Vec<usize> {
        let mut path = vec![to];
        let mut lane = to;
        while let Some(by) = previous[lane].filter(|_| lane != from) {
            path.push(by);
            lane = by;
        }
        path.reverse();
        path
    }
}

fn length(points: &[Point3]) -> f64 {
    points.windows(2).map(|pair| pair[0].xy().distance(pair[1].xy())).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::Lane;

    /// Lanes 1, 2, ... of 10 m each with these exits.
    fn graph(exits: &[&[i64]]) -> LaneGraph {
        let lane = |(index, exits): (usize, &&[i64])| Lane {
            id: MapId(index as i64 + 1),
            centerline: vec![Point3::new(0.0, 0.0, 0.0), Point3::new(10.0, 0.0, 0.0)],
            exits: exits.iter().map(|id| MapId(*id)).collect(),
            ..Lane::default()
        };
        LaneGraph::new(&Map { lanes: exits.iter().enumerate().map(lane).collect(), ..Map::default() })
    }

    #[test]
    fn the_shortest_of_two_ways_is_taken() {
        let graph = graph(&[&[2, 4], &[3], &[5], &[5], &[]]);
        assert_eq!(graph.shortest_path(0, 4, 100.0), Some(vec![0, 3, 4]));
        assert_eq!(graph.shortest_path(0, 0, 0.0), Some(vec![0]));
    }

    #[test]
    fn a_way_longer_than_the_reach_is_none() {
        let graph = graph(&[&[2], &[3], &[]]);
        assert_eq!(graph.shortest_path(0, 2, 9.9), None);
        assert_eq!(graph.shortest_path(0, 2, 10.0), Some(vec![0, 1, 2]));
    }

    #[test]
    fn a_cycle_ends_the_search_and_links_to_nowhere_are_dropped() {
        let graph = graph(&[&[2, 99], &[1, 2], &[]]);
        assert_eq!(graph.successors(0), [1]);
        assert_eq!(graph.shortest_path(0, 2, f64::INFINITY), None);
    }

    #[test]
    fn a_neighbor_is_listed_once_however_many_stretches_it_has() {
        let beside = |id| LaneNeighbor {
            lane: MapId(id),
            self_start_index: 0,
            self_end_index: 1,
            neighbor_start_index: 0,
            neighbor_end_index: 1,
            boundaries: Vec::new(),
        };
        let lanes = vec![
            Lane { id: MapId(7), left_neighbors: vec![beside(8), beside(8)], ..Lane::default() },
            Lane { id: MapId(8), right_neighbors: vec![beside(7)], ..Lane::default() },
        ];
        let graph = LaneGraph::new(&Map { lanes, ..Map::default() });
        assert_eq!((graph.neighbors(0), graph.neighbors(1)), (&[1][..], &[0][..]));
    }
}
