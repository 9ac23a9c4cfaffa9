//! Which lanes an agent may be on, and where they lead (the authors' `data_utils`): up to six sequences of lanes.

use std::f64::consts::PI;

use world::geometry::{Point, Pose, Segment};

use super::Style;
use super::map::PreparedMap;

/// How far, and how much askew, a lane may be; both grow until one is found.
const REACH: f64 = 3.5;
const ASKEW: f64 = 10.0 * PI / 180.0;
/// The same for who is on foot.
const REACH_ON_FOOT: f64 = 5.0;
/// A sequence is followed until it has more points than this.
const LONG: usize = 200;
/// Sequences that are looked at: more than any street has, and a hostile map may.
const MOST: usize = 1024;
/// How often the reach grows: 1 km. Farther away is no lane of the agent's.
const GROWTHS: usize = 286;

/// A lane, and the number of its point at which an agent enters it.
pub(super) type Entry = (usize, usize);

/// Memory of the search; what is found stands in `sequences` and `entries`.
#[derive(Clone, Debug, Default)]
pub(super) struct LaneSearch {
    /// Lanes that the agent may be on, then those beside them.
    pub(super) entries: Vec<Entry>,
    /// Lanes in the order in which they are driven.
    pub(super) sequences: Vec<Vec<usize>>,
    /// How many sequences there were, before the first six were kept.
    pub(super) candidates: usize,
    way: Vec<usize>,
}

impl LaneSearch {
    /// Looks for the lanes of an agent at `pose`, who is on foot or not.
    pub(super) fn run(&mut self, map: &PreparedMap, pose: Pose, on_foot: bool, style: Style, most: usize) {
        self.entries.clear();
        self.sequences.clear();
        if on_foot {
            on_foot_entries(map, pose.position(), &mut self.entries);
        } else {
            entries(map, pose, style, &mut self.entries);
            self.add_neighbors(map, pose.position());
        }
        for index in 0..self.entries.len() {
            let (lane, start) = self.entries[index];
            self.way.clear();
            self.follow(map, lane, map.lanes[lane].count - start.min(map.lanes[lane].count));
        }
        drop_duplicates(&mut self.sequences, style);
        self.candidates = self.sequences.len();
        if style == Style::Mended {
            let entry =
                |sequence: &Vec<usize>| self.entries.iter().position(|(lane, _)| Some(lane) == sequence.first());
            let cost = |sequence: &Vec<usize>| {
                let Some((lane, start)) = entry(sequence).map(|entry| self.entries[entry]) else {
                    return f64::INFINITY;
                };
                let vertex = map.points_of(lane)[start].center;
                let turn = difference(vertex.heading, pose.heading);
                vertex.point().distance(pose.position()) / REACH + turn / ASKEW
            };
            self.sequences.sort_by(|a, b| cost(a).total_cmp(&cost(b)));
        }
        self.sequences.truncate(most);
    }

    /// Of each lane that the agent may be on the lanes to its left and right.
    fn add_neighbors(&mut self, map: &PreparedMap, position: Point) {
        let current = self.entries.len();
        for index in 0..current {
            let (lane, start) = self.entries[index];
            for side in &map.lanes[lane].neighbors {
                let start = i32::try_from(start).unwrap_or(i32::MAX);
                let beside = |(other, [first, last]): &&(usize, [i32; 2])| {
                    (*first..=*last).contains(&start) && self.entries[..current].iter().all(|(own, _)| own != other)
                };
                // Of several the last one counts.
                let Some((other, _)) = side.iter().rev().find(beside) else { continue };
                if !self.entries.iter().any(|(own, _)| own == other)
                    && let Some(nearest) = nearest_point(map, *other, position)
                {
                    self.entries.push((*other, nearest));
                }
            }
        }
    }

    fn follow(&mut self, map: &PreparedMap, lane: usize, points: usize) {
        self.way.push(lane);
        let exits = &map.lanes[lane].exits;
        if self.sequences.len() >= MOST {
        } else if points > LONG || exits.is_empty() || self.way.len() > LONG {
            self.sequences.push(self.way.clone());
        } else {
            for exit in exits {
                self.follow(map, *exit, points + map.lanes[*exit].count);
            }
        }
        self.way.pop();
    }
}

/// Lanes near an agent on foot: from their beginning.
fn on_foot_entries(map: &PreparedMap, position: Point, entries: &mut Vec<Entry>) {
    for growth in 1..=GROWTHS {
        let reach = REACH_ON_FOOT * growth as f64;
        for (lane, prepared) in map.lanes.iter().enumerate() {
            if prepared.count < 2 || !is_within(prepared.bounds, position, reach) {
                continue;
            }
            let segments = map.points_of(lane).windows(2);
            let near = |pair: &[super::map::LaneVertex]| {
                let segment = Segment { start: pair[0].center.point(), end: pair[1].center.point() };
                segment.nearest_to(position).distance_squared < reach * reach
            };
            if segments.into_iter().any(near) {
                entries.push((lane, 0));
            }
        }
        if !entries.is_empty() {
            return;
        }
    }
}

/// Lanes that an agent may be on: near it, and pointing its way.
fn entries(map: &PreparedMap, pose: Pose, style: Style, entries: &mut Vec<Entry>) {
    let position = pose.position();
    for growth in 1..=GROWTHS {
        let (reach, askew) = (REACH * growth as f64, ASKEW * growth as f64);
        for (lane, prepared) in map.lanes.iter().enumerate() {
            if !is_within(prepared.bounds, position, reach) {
                continue;
            }
            let fits = map.points_of(lane).iter().enumerate().filter(|(_, vertex)| {
                vertex.center.point().distance_squared(position) <= reach * reach
                    && difference(vertex.center.heading, pose.heading) <= askew
            });
            let distance = |vertex: &super::map::LaneVertex| vertex.center.point().distance_squared(position);
            let chosen = match style {
                Style::Authors => fits.map(|(index, _)| index).next(),
                Style::Mended => fits
                    .map(|(index, vertex)| (index, distance(vertex)))
                    .reduce(|a, b| if b.1 < a.1 { b } else { a })
                    .map(|(index, _)| index),
            };
            entries.extend(chosen.map(|index| (lane, index)));
        }
        if !entries.is_empty() {
            return;
        }
    }
}

/// Whether a place may be within `reach` of what lies in `bounds`.
fn is_within([least, most]: [Point; 2], position: Point, reach: f64) -> bool {
    (least.x - reach..=most.x + reach).contains(&position.x) && (least.y - reach..=most.y + reach).contains(&position.y)
}

/// The angle between two headings that are at most a turn apart, as the authors take it.
fn difference(a: f64, b: f64) -> f64 {
    let difference = (a - b).abs();
    if difference > PI { 2.0 * PI - difference } else { difference }
}

fn nearest_point(map: &PreparedMap, lane: usize, position: Point) -> Option<usize> {
    let distances = map.points_of(lane).iter().map(|vertex| vertex.center.point().distance_squared(position));
    distances.enumerate().reduce(|a, b| if b.1 < a.1 { b } else { a }).map(|(index, _)| index)
}

/// Drops sequences that add nothing: the same from their second lane on as an earlier one, or with no lane of their own.
fn drop_duplicates(sequences: &mut Vec<Vec<usize>>, style: Style) {
    let mut kept = vec![true; sequences.len()];
    for i in 0..sequences.len() {
        if !kept[i] {
            continue;
        }
        for j in (0..sequences.len()).filter(|j| *j != i) {
            let (own, other) = (&sequences[i], &sequences[j]);
            let tails = own[1..] == other[1..] && (style == Style::Authors || own.len() > 1);
            let is_part = other.iter().all(|lane| own.contains(lane));
            if tails || is_part && (style == Style::Authors || kept[j]) {
                kept[j] = false;
            }
        }
    }
    let mut kept = kept.into_iter();
    sequences.retain(|_| kept.next() == Some(true));
}
