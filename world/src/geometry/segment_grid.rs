//! Segments in the cells of a uniform grid, so that those near a point are found without looking at all of them.

use std::collections::BTreeMap;

use super::Point;
use super::cells::{Cell, Cells};
use super::segment::{Segment, is_left_of_corner};

/// Stands for no segment in a chain's links.
const NONE: u32 = u32::MAX;

/// A uniform grid over the segments of chains. A chain carries a payload, such as its index in the map.
///
/// Queries allocate nothing. Where two segments are equally near, the one that was given first is taken.
#[derive(Clone, Debug, PartialEq)]
pub struct SegmentGrid {
    segments: Vec<ChainedSegment>,
    cells: Cells,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct ChainedSegment {
    segment: Segment,
    payload: u32,
    previous: u32,
    next: u32,
}

/// The segment of a grid that is nearest to a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NearestSegment {
    /// Number of the segment in the order given.
    pub segment: usize,
    /// The payload of its chain.
    pub payload: u32,
    /// The nearest point on it.
    pub point: Point,
    /// Where along the segment: 0 its start, 1 its end.
    pub fraction: f64,
    /// Distance (m), positive where the point lies to the left of the chain, negative to the right.
    ///
    /// At a corner the segments on both sides of it decide; where another chain begins exactly at this one's end, they
    /// count as one chain.
    pub signed_distance: f64,
    /// The nearest point is the free end of a chain, and the point lies beyond it: the side says little.
    pub beyond_end: bool,
}

impl NearestSegment {
    /// Distance (m).
    #[must_use]
    pub fn distance(&self) -> f64 {
        self.signed_distance.abs()
    }
}

/// A segment in a cell about a point.
#[derive(Clone, Copy, Debug)]
pub struct About<'a> {
    /// Number of the segment.
    pub segment: usize,
    grid: &'a SegmentGrid,
    cell: Cell,
    point: Point,
    radius: f64,
}

impl About<'_> {
    /// Whether the segment has a point within the radius, the nearest of them in this cell: a segment is in many cells.
    #[must_use]
    pub fn is_near(&self) -> bool {
        let nearest = self.grid.segment(self.segment).nearest_to(self.point);
        nearest.distance_squared <= self.radius * self.radius && self.grid.cells.cell_of(nearest.point) == self.cell
    }
}

impl SegmentGrid {
    /// The grid over `chains`, each with its payload, in cells of about `cell` metres. A chain of one point is a segment
    /// without length.
    #[must_use]
    pub fn new<C>(chains: impl IntoIterator<Item = (u32, C)>, cell: f64) -> Self
    where
        C: IntoIterator<Item = Point>,
    {
        let mut segments = Vec::new();
        for (payload, points) in chains {
            push_chain(&mut segments, payload, points);
        }
        join_chains(&mut segments);
        let ends = segments.iter().flat_map(|s| [s.segment.start, s.segment.end]);
        let cells = Cells::new(ends, cell, segments.len(), |cells, index, placed| {
            let Segment { start, end } = segments[index].segment;
            cells.for_each_along(start, end, |cell| placed.put(cell));
        });
        Self { segments, cells }
    }

    /// Number of segments.
    #[must_use]
    pub fn len(&self) -> usize {
        self.segments.len()
    }

    /// Whether there is no segment.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.segments.is_empty()
    }

    /// Segment number `index`.
    #[must_use]
    pub fn segment(&self, index: usize) -> Segment {
        self.segments[index].segment
    }

    /// The payload of the chain of segment number `index`.
    #[must_use]
    pub fn payload(&self, index: usize) -> u32 {
        self.segments[index].payload
    }

    /// The segment nearest to `point`, if one is within `radius` metres (inclusive).
    #[must_use]
    pub fn nearest(&self, point: Point, radius: f64) -> Option<NearestSegment> {
        self.nearest_where(point, radius, |_| true)
    }

    /// The same of the segments whose numbers are accepted.
    #[must_use]
    pub fn nearest_where(&self, point: Point, radius: f64, accept: impl Fn(usize) -> bool) -> Option<NearestSegment> {
        let mut best = (radius * radius, NONE);
        self.cells.walk_outwards(point, best.0, |members| {
            for member in members.iter().filter(|member| accept(**member as usize)) {
                let distance_squared = self.segments[*member as usize].segment.nearest_to(point).distance_squared;
                if distance_squared < best.0 || (distance_squared == best.0 && *member < best.1) {
                    best = (distance_squared, *member);
                }
            }
            best.0
        });
        (best.1 != NONE).then(|| self.describe(best.1 as usize, point))
    }

    /// Calls `visit` with the number of each segment that has a point within `radius` metres of `point` (inclusive): each
    /// once, in no order to rely on.
    pub fn for_each_near(&self, point: Point, radius: f64, mut visit: impl FnMut(usize)) {
        self.for_each_about(point, radius, |about| {
            if about.is_near() {
                visit(about.segment);
            }
        });
    }

    /// The same in the same order for who may not want to know of each whether it is near: calls `visit` with all segments in cells
    /// about `point`, some of them more than once. Each that is near is near once.
    pub fn for_each_about(&self, point: Point, radius: f64, mut visit: impl FnMut(About<'_>)) {
        self.cells.for_each_within(point, radius, |cell| {
            for member in self.cells.members(cell) {
                visit(About { segment: *member as usize, grid: self, cell, point, radius });
            }
        });
    }

    fn describe(&self, index: usize, point: Point) -> NearestSegment {
        let ChainedSegment { segment, payload, previous, next } = self.segments[index];
        let nearest = segment.nearest_to(point);
        let (at_start, at_end) = (nearest.fraction <= 0.0, nearest.fraction >= 1.0);
        let neighbor = |link: u32| (link != NONE).then(|| self.segments[link as usize].segment);
        let corner = match (at_start.then(|| neighbor(previous)).flatten(), at_end.then(|| neighbor(next)).flatten()) {
            (Some(before), _) => Some((before, segment)),
            (None, Some(after)) => Some((segment, after)),
            (None, None) => None,
        };
        let is_left = corner
            .map_or_else(|| segment.side(point) > 0.0, |(before, after)| is_left_of_corner(&before, &after, point));
        let distance = nearest.distance_squared.sqrt();
        let along = segment.vector().dot(point - nearest.point);
        let beyond_start = at_start && previous == NONE && along < 0.0;
        let beyond_end = at_end && next == NONE && along > 0.0;
        NearestSegment {
            segment: index,
            payload,
            point: nearest.point,
            fraction: nearest.fraction,
            signed_distance: if is_left { distance } else { -distance },
            beyond_end: beyond_start || beyond_end,
        }
    }
}

fn push_chain(segments: &mut Vec<ChainedSegment>, payload: u32, points: impl IntoIterator<Item = Point>) {
    let mut points = points.into_iter();
    let Some(first) = points.next() else { return };
    let (mut start, mut previous) = (first, NONE);
    let mut push = |start: Point, end: Point, previous: u32| {
        let index = segments.len() as u32;
        segments.push(ChainedSegment { segment: Segment { start, end }, payload, previous, next: NONE });
        if previous != NONE {
            segments[previous as usize].next = index;
        }
        index
    };
    for end in points {
        // Points that repeat have no direction, and would blur the side at a corner.
        if end != start {
            previous = push(start, end, previous);
            start = end;
        }
    }
    if previous == NONE {
        push(first, first, NONE);
    }
}

/// Links chains whose ends meet exactly, and a closed chain with itself.
fn join_chains(segments: &mut [ChainedSegment]) {
    let key = |point: Point| (point.x.to_bits(), point.y.to_bits());
    let mut beginnings = BTreeMap::new();
    for (index, segment) in segments.iter().enumerate().rev() {
        if segment.previous == NONE && segment.segment.length() > 0.0 {
            beginnings.insert(key(segment.segment.start), index);
        }
    }
    for index in 0..segments.len() {
        let free_end = segments[index].next == NONE && segments[index].segment.length() > 0.0;
        if let Some(next) = free_end.then(|| beginnings.remove(&key(segments[index].segment.end))).flatten() {
            segments[index].next = next as u32;
            segments[next].previous = index as u32;
        }
    }
}

#[cfg(test)]
mod tests;
