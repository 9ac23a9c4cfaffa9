//! Lanes as strips of ground, and the place of a point in them.

use std::collections::BTreeMap;

use world::geometry::{Point, Segment, SegmentGrid};
use world::map::{BoundarySegment, Lane, Map, MapId};

use crate::judges::level::Level;

/// Half the width (m) of a lane whose boundary the map does not name: half of a lane of 12 feet.
pub const HALF_WIDTH: f64 = 1.83;

/// A lane reaches at most this far (m) from its center line, wherever its boundary is.
const WIDEST: f64 = 4.0;

/// Segments at either end of a lane at which it may cross another without being in an intersection.
const END_SEGMENTS: usize = 2;

/// The most lanes that are looked at around a point.
const CANDIDATES: usize = 32;

/// cos 45 degrees: a lane is the AV's way if it points within that of where the AV looks.
pub(super) const ALIGNED: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// A lane as a strip.
#[derive(Clone, Debug)]
pub(super) struct Strip {
    points: Vec<Point>,
    /// Arc length (m) at each point.
    stations: Vec<f64>,
    /// Half width (m) to the left and to the right at each point.
    widths: Vec<[f64; 2]>,
    entries: Vec<usize>,
    pub(super) exits: Vec<usize>,
    /// m/s, 0 where it is not known.
    pub(super) speed_limit: f64,
    pub(super) intersection: bool,
    /// Number of its first segment in the grid.
    first_segment: usize,
}

/// A point's place in a lane.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub(super) segment: usize,
    pub(super) station: f64,
    /// Distance to the center line (m).
    distance: f64,
    /// How far outside of the strip (m), 0 within; infinite before the lane's start and beyond its end.
    outside: f64,
    /// Cosine of the angle between the lane and where the body looks.
    pub(super) alignment: f64,
}

impl Place {
    fn is_inside(&self) -> bool {
        self.outside == 0.0
    }

    /// Whether the body is in the lane, or `margin` (m) beside it, and looks its way.
    pub(super) fn is_way(&self, margin: f64) -> bool {
        self.outside <= margin && self.alignment >= ALIGNED
    }
}

/// By distance to the center line, then in the map's order.
pub(super) fn nearer(a: &(usize, Place), b: &(usize, Place)) -> std::cmp::Ordering {
    a.1.distance.total_cmp(&b.1.distance).then(a.0.cmp(&b.0))
}

/// The lanes around the route that cars drive on.
#[derive(Clone, Debug)]
pub struct Lanes {
    pub(super) strips: Vec<Strip>,
    grid: SegmentGrid,
}

impl Lanes {
    /// The lanes of `map` on the route's level.
    #[must_use]
    pub fn of(map: &Map, level: &Level) -> Self {
        let usable = |lane: &&Lane| lane.kind.is_drivable() && lane.centerline.iter().any(|point| level.holds(*point));
        let mut lanes: Vec<(&Lane, Vec<usize>)> = Vec::new();
        for lane in map.lanes.iter().filter(usable) {
            // Which points are kept: those that do not repeat.
            let mut kept: Vec<usize> = (0..lane.centerline.len()).collect();
            kept.dedup_by(|a, b| lane.centerline[*a].xy() == lane.centerline[*b].xy());
            if kept.len() > 1 {
                lanes.push((lane, kept));
            }
        }
        let places: BTreeMap<MapId, usize> = lanes.iter().enumerate().map(|(at, (lane, _))| (lane.id, at)).collect();
        let boundaries = Boundaries::of(map);
        let mut first_segment = 0;
        let strips = lanes.iter().map(|(lane, kept)| {
            let strip = Strip::of(lane, kept, &places, &boundaries, first_segment);
            first_segment += kept.len() - 1;
            strip
        });
        let strips: Vec<Strip> = strips.collect();
        let chains = strips.iter().enumerate().map(|(index, strip)| (index as u32, strip.points.iter().copied()));
        let mut lanes = Self { grid: SegmentGrid::new(chains, 4.0), strips };
        for index in 0..lanes.strips.len() {
            lanes.strips[index].intersection |= lanes.is_crossed(index);
        }
        let limits: Vec<f64> = lanes.strips.iter().map(|strip| strip.speed_limit).collect();
        for strip in &mut lanes.strips {
            strip.set_connector_limit(&limits);
        }
        lanes
    }

    /// Whether another lane's center line crosses this one's: that is an intersection, whether the map marks it or not.
    fn is_crossed(&self, lane: usize) -> bool {
        // Lanes that begin or end together wriggle across each other there.
        let inner = |lane: usize| {
            let first = self.strips[lane].first_segment;
            first + END_SEGMENTS..(first + self.strips[lane].points.len() - 1).saturating_sub(END_SEGMENTS)
        };
        inner(lane).any(|index| {
            let own = self.grid.segment(index);
            let mut crossed = false;
            self.grid.for_each_near(own.start, own.length(), |other| {
                let other_lane = self.grid.payload(other) as usize;
                let candidate = other_lane != lane && inner(other_lane).contains(&other);
                crossed |= candidate && cross(&own, &self.grid.segment(other));
            });
            crossed
        })
    }

    /// The lanes that hold `point`, each with its place, up to [`CANDIDATES`]; in no order to rely on.
    pub(super) fn holding(&self, point: Point, forward: Point) -> Candidates {
        let mut found = Candidates::default();
        self.grid.for_each_near(point, WIDEST, |segment| {
            let lane = self.grid.payload(segment) as usize;
            if found.iter().all(|(known, _)| known != lane) {
                let strip = &self.strips[lane];
                let place = strip.place(segment - strip.first_segment, point, forward);
                if place.is_inside() {
                    found.push(lane, place);
                }
            }
        });
        found
    }

    /// Whether each corner lies in `lane` or in one that it leads to or comes from.
    pub(super) fn holds_all(&self, lane: usize, segment: usize, corners: &[Point; 4]) -> bool {
        let strip = &self.strips[lane];
        corners.iter().all(|corner| {
            let inside =
                |lane: usize, from: usize| self.strips[lane].place(from, *corner, Point::default()).is_inside();
            inside(lane, segment)
                || strip.exits.iter().any(|exit| inside(*exit, 0))
                || strip.entries.iter().any(|entry| inside(*entry, self.strips[*entry].points.len() - 2))
        })
    }
}

/// Finds where a lane's boundaries run.
struct Boundaries {
    grid: SegmentGrid,
    ids: Vec<MapId>,
}

impl Boundaries {
    fn of(map: &Map) -> Self {
        let lines = map.road_lines.iter().map(|line| (line.id, &line.polyline));
        let edges = map.road_edges.iter().map(|edge| (edge.id, &edge.polyline));
        let features: Vec<_> = lines.chain(edges).collect();
        let ids = features.iter().map(|(id, _)| *id).collect();
        let chains = features.iter().enumerate();
        let chains = chains.map(|(index, (_, line))| (index as u32, line.iter().map(|point| point.xy())));
        Self { grid: SegmentGrid::new(chains, 4.0), ids }
    }

    /// How far (m) a lane reaches to one side at its point number `index`.
    fn half_width(&self, segments: &[BoundarySegment], index: usize, point: Point) -> f64 {
        let covers = |segment: &&BoundarySegment| {
            let range = segment.lane_start_index..=segment.lane_end_index;
            segment.feature != MapId(0) && i32::try_from(index).is_ok_and(|index| range.contains(&index))
        };
        let Some(boundary) = segments.iter().find(covers) else { return HALF_WIDTH };
        let mut nearest = WIDEST;
        self.grid.for_each_near(point, WIDEST, |segment| {
            if self.ids[self.grid.payload(segment) as usize] == boundary.feature {
                nearest = nearest.min(self.grid.segment(segment).nearest_to(point).distance_squared.sqrt());
            }
        });
        nearest
    }
}

impl Strip {
    fn of(
        lane: &Lane,
        kept: &[usize],
        places: &BTreeMap<MapId, usize>,
        boundaries: &Boundaries,
        first_segment: usize,
    ) -> Self {
        let points: Vec<Point> = kept.iter().map(|index| lane.centerline[*index].xy()).collect();
        let widths = kept.iter().zip(&points).map(|(index, point)| {
            [&lane.left_boundaries, &lane.right_boundaries].map(|side| boundaries.half_width(side, *index, *point))
        });
        let mut stations = vec![0.0];
        for pair in points.windows(2) {
            stations.push(stations[stations.len() - 1] + pair[0].distance(pair[1]));
        }
        let linked = |links: &[MapId]| links.iter().filter_map(|id| places.get(id).copied()).collect();
        Self {
            widths: widths.collect(),
            stations,
            entries: linked(&lane.entries),
            exits: linked(&lane.exits),
            speed_limit: lane.speed_limit().unwrap_or(0.0),
            intersection: lane.interpolating,
            first_segment,
            points,
        }
    }

    /// In an intersection the larger limit of the lanes before and after counts, if all are known (nuPlan's rule for
    /// connectors).
    fn set_connector_limit(&mut self, limits: &[f64]) {
        let around = self.entries.iter().chain(&self.exits).map(|lane| limits[*lane]);
        if self.intersection && around.clone().count() > 0 && around.clone().all(|limit| limit > 0.0) {
            self.speed_limit = around.fold(0.0, f64::max);
        }
    }

    /// The place of `point`, looked for from segment `from` on downhill: lanes are smooth, and `from` is near.
    pub(super) fn place(&self, from: usize, point: Point, forward: Point) -> Place {
        let at = |index: usize| {
            let segment = Segment { start: self.points[index], end: self.points[index + 1] };
            (segment, segment.nearest_to(point))
        };
        let last = self.points.len() - 2;
        let (mut index, mut best) = (from.min(last), at(from.min(last)));
        for step in [1_isize, -1] {
            while let Some(next) = index.checked_add_signed(step).filter(|next| *next <= last) {
                let candidate = at(next);
                if candidate.1.distance_squared >= best.1.distance_squared {
                    break;
                }
                (index, best) = (next, candidate);
            }
        }
        let (segment, nearest) = best;
        let along = segment.vector();
        let length = self.stations[index + 1] - self.stations[index];
        let offset = point - segment.start;
        // Unclamped, to see what lies before the lane's start or beyond its end.
        let ahead = offset.dot(along) / length;
        let beyond = (index == 0 && ahead < 0.0) || (index == last && ahead > length);
        let distance = nearest.distance_squared.sqrt();
        let side = usize::from(along.cross(offset) < 0.0);
        let width =
            self.widths[index][side] * (1.0 - nearest.fraction) + self.widths[index + 1][side] * nearest.fraction;
        Place {
            segment: index,
            station: self.stations[index] + length * nearest.fraction,
            distance,
            outside: if beyond { f64::INFINITY } else { (distance - width).max(0.0) },
            alignment: along.dot(forward) / length,
        }
    }
}

/// Whether two segments cross, each at an inner point of the other.
fn cross(a: &Segment, b: &Segment) -> bool {
    a.side(b.start) * a.side(b.end) < 0.0 && b.side(a.start) * b.side(a.end) < 0.0
}

/// A handful of lanes, without allocation.
#[derive(Default)]
pub(super) struct Candidates {
    lanes: [Option<(usize, Place)>; CANDIDATES],
    count: usize,
}

impl Candidates {
    fn push(&mut self, lane: usize, place: Place) {
        if self.count < CANDIDATES {
            self.lanes[self.count] = Some((lane, place));
            self.count += 1;
        }
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = (usize, Place)> + '_ {
        self.lanes[..self.count].iter().flatten().copied()
    }
}
