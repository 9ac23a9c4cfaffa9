//! Lanes as strips of ground, and the place of a point in them.

use std::collections::BTreeMap;

use world::geometry::{Point, Segment, SegmentGrid};
use world::map::{BoundarySegment, Lane, Map, MapId};

use crate::judges::STOREY;
use crate::judges::level::Level;

/// Half the width (m) of a lane whose boundary the map does not name: half of a lane of 12 feet.
pub const HALF_WIDTH: f64 = 1.83;

/// A lane reaches at most this far (m) from its center line, wherever its boundary is.
const WIDEST: f64 = 4.0;

/// Segments at either end of a lane at which it may cross another without being in an intersection.
const END_SEGMENTS: usize = 2;

/// Ground that no lane holds belongs to an intersection up to this far (m) from one of its lanes.
const WITHIN_INTERSECTION: f64 = 5.0;

/// cos 45 degrees: a lane points the AV's way if it points within that of where the AV looks.
const ALIGNED: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// A lane as a strip of ground.
#[derive(Clone, Debug)]
pub struct Strip {
    /// Of the lane in the map.
    pub id: MapId,
    /// The center line.
    pub points: Vec<Point>,
    /// Height (m) of each point.
    heights: Vec<f64>,
    /// Half width (m) to the left and to the right at each point.
    pub widths: Vec<[f64; 2]>,
    /// Places, among all strips, of the lanes that lead here.
    pub entries: Vec<usize>,
    /// Places of those that this one leads to.
    pub exits: Vec<usize>,
    /// m/s, 0 where it is not known.
    pub speed_limit: f64,
    /// Whether it is one of an intersection: what nuPlan calls a lane connector.
    pub connector: bool,
    /// Arc length (m) at each point.
    stations: Vec<f64>,
    /// Number of its first segment in the grid.
    first_segment: usize,
}

/// A point's place in a lane.
#[derive(Clone, Copy, Debug)]
struct Place {
    station: f64,
    /// Height of the lane there (m).
    height: f64,
    /// Distance to the center line (m).
    distance: f64,
    /// How far outside of the strip (m), 0 within.
    outside: f64,
    /// Cosine of the angle between the lane and where the body looks.
    alignment: f64,
}

impl Place {
    fn is_aligned(&self) -> bool {
        self.alignment >= ALIGNED
    }
}

/// The lanes that hold a point: those that point the body's way first, the nearer before the farther; then the others, the better aligned
/// before the worse; then in the map's order.
#[derive(Clone, Debug, Default)]
pub(super) struct Held(Vec<(usize, Place)>);

impl Held {
    fn contains(&self, lane: usize) -> bool {
        self.0.iter().any(|(held, _)| *held == lane)
    }

    fn sort(&mut self) {
        let rank = |place: &Place| if place.is_aligned() { (0_u8, place.distance) } else { (1, -place.alignment) };
        self.0.sort_by(|a, b| {
            let (one, other) = (rank(&a.1), rank(&b.1));
            one.0.cmp(&other.0).then(one.1.total_cmp(&other.1)).then(a.0.cmp(&b.0))
        });
    }
}

/// The lanes around the route that cars drive on.
#[derive(Clone, Debug)]
pub struct Lanes {
    strips: Vec<Strip>,
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
            lanes.strips[index].connector |= lanes.is_crossed(index);
        }
        lanes
    }

    /// All of them.
    #[must_use]
    pub fn strips(&self) -> &[Strip] {
        &self.strips
    }

    /// Height (m) of the start of the segment with this number in the grid.
    fn height_of(&self, segment: usize) -> f64 {
        let strip = &self.strips[self.grid.payload(segment) as usize];
        strip.heights[segment - strip.first_segment]
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
                let is_level = || (self.height_of(index) - self.height_of(other)).abs() <= STOREY;
                crossed |= candidate && is_level() && cross(&own, &self.grid.segment(other));
            });
            crossed
        })
    }

    /// The lanes that hold `point` where the ground is at the height `ground` (m), for a body that looks `forward`.
    pub(super) fn holding(&self, point: Point, ground: f64, forward: Point) -> Held {
        let mut found = Held::default();
        self.grid.for_each_near(point, WIDEST, |segment| {
            let lane = self.grid.payload(segment) as usize;
            if !found.contains(lane) {
                let strip = &self.strips[lane];
                let place = strip.place(segment - strip.first_segment, point, forward);
                if place.outside == 0.0 && (place.height - ground).abs() <= STOREY {
                    found.0.push((lane, place));
                }
            }
        });
        found.sort();
        found
    }

    /// Places, among all strips, of the lanes that hold `point` where the ground is at the height `ground` (m), in ascending order.
    #[must_use]
    pub fn at(&self, point: Point, ground: f64) -> Vec<usize> {
        let mut lanes: Vec<usize> =
            self.holding(point, ground, Point::default()).0.into_iter().map(|(lane, _)| lane).collect();
        lanes.sort_unstable();
        lanes
    }

    /// Those of `before` that hold the point still, or, where there was one alone, what it leads to (nuPlan:
    /// `get_route_obj_with_candidates`).
    pub(super) fn follow(&self, before: &[usize], held: &Held) -> Vec<usize> {
        let kept: Vec<usize> = before.iter().copied().filter(|lane| held.contains(*lane)).collect();
        match before {
            [only] if kept.is_empty() => {
                self.exits(*only).iter().copied().filter(|lane| held.contains(*lane)).collect()
            }
            _ => kept,
        }
    }

    /// The lane that holds the point, else all connectors that do (nuPlan: `get_current_route_objects`). Its lanes do not lie on each
    /// other; ours do, where the map does not mark an intersection, and there what points the AV's way comes first.
    pub(super) fn search(&self, held: &Held) -> Vec<usize> {
        let mut lanes = held.0.iter().filter(|(lane, _)| !self.is_connector(*lane));
        let mut connectors = held.0.iter().filter(|(lane, _)| self.is_connector(*lane)).peekable();
        let lane = lanes.next();
        let oncoming = lane.is_some_and(|(_, place)| !place.is_aligned());
        match lane {
            Some((lane, _)) if !(oncoming && connectors.peek().is_some_and(|(_, place)| place.is_aligned())) => {
                vec![*lane]
            }
            _ => connectors.map(|(lane, _)| *lane).collect(),
        }
    }

    pub(super) fn is_connector(&self, lane: usize) -> bool {
        self.strips[lane].connector
    }

    pub(super) fn exits(&self, lane: usize) -> &[usize] {
        &self.strips[lane].exits
    }

    pub(super) fn entries(&self, lane: usize) -> &[usize] {
        &self.strips[lane].entries
    }

    /// How far (m) `point` is outside of `lane`, 0 within.
    pub(super) fn distance(&self, lane: usize, point: Point) -> f64 {
        self.strips[lane].nearest_place(point).outside
    }

    /// Arc length (m) along `lane` at which it is nearest to `point`.
    pub(super) fn station(&self, lane: usize, point: Point) -> f64 {
        self.strips[lane].nearest_place(point).station
    }

    /// Where a lane points, at its nearest place.
    pub(super) fn direction(&self, lane: usize, point: Point) -> Point {
        let strip = &self.strips[lane];
        let along = strip.segment(strip.nearest_segment(point)).vector();
        along * (1.0 / along.norm())
    }

    /// The speed limit (m/s) for an AV in these lanes, 0 where it is not known: a lane's own; of connectors the largest of what they join,
    /// if all of that is known (nuPlan: `speed_limit_compliance.py`), and their own where they join nothing.
    pub(super) fn speed_limit(&self, lanes: &[usize]) -> f64 {
        let own = |lane: &usize| self.strips[*lane].speed_limit;
        if let [lane, ..] = lanes
            && !self.is_connector(*lane)
        {
            return own(lane);
        }
        let joined = lanes.iter().flat_map(|lane| self.exits(*lane).iter().chain(self.entries(*lane)));
        let mut limits: Vec<f64> = joined.map(own).collect();
        if limits.is_empty() {
            limits = lanes.iter().map(own).collect();
        }
        if limits.contains(&0.0) { 0.0 } else { limits.into_iter().fold(0.0, f64::max) }
    }

    /// Whether `point` is in an intersection: on one of its lanes, or on no lane and beside one of its.
    #[must_use]
    pub fn is_intersection(&self, point: Point, ground: f64) -> bool {
        let held = self.holding(point, ground, Point::default());
        if !held.0.is_empty() {
            return held.0.iter().any(|(lane, _)| self.is_connector(*lane));
        }
        let mut beside = false;
        self.grid.for_each_near(point, WIDEST + WITHIN_INTERSECTION, |segment| {
            let lane = self.grid.payload(segment) as usize;
            let is_level = || (self.height_of(segment) - ground).abs() <= STOREY;
            beside =
                beside || (is_level() && self.is_connector(lane) && self.distance(lane, point) < WITHIN_INTERSECTION);
        });
        beside
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
            id: lane.id,
            heights: kept.iter().map(|index| lane.centerline[*index].z).collect(),
            widths: widths.collect(),
            stations,
            entries: linked(&lane.entries),
            exits: linked(&lane.exits),
            speed_limit: lane.speed_limit().unwrap_or(0.0),
            connector: lane.interpolating,
            first_segment,
            points,
        }
    }

    /// The place of `point`, looked for from segment `from` on downhill: lanes are smooth, and `from` is near.
    fn place(&self, from: usize, point: Point, forward: Point) -> Place {
        let last = self.points.len() - 2;
        let distance = |index: usize| self.segment(index).nearest_to(point).distance_squared;
        let (mut index, mut least) = (from.min(last), distance(from.min(last)));
        for step in [1_isize, -1] {
            while let Some(next) = index.checked_add_signed(step).filter(|next| *next <= last) {
                let candidate = distance(next);
                if candidate >= least {
                    break;
                }
                (index, least) = (next, candidate);
            }
        }
        self.place_at(index, point, forward)
    }

    /// The place of `point`, however far away it is.
    fn nearest_place(&self, point: Point) -> Place {
        self.place_at(self.nearest_segment(point), point, Point::default())
    }

    fn nearest_segment(&self, point: Point) -> usize {
        let distance = |index: &usize| self.segment(*index).nearest_to(point).distance_squared;
        (0..self.points.len() - 1).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(0)
    }

    fn segment(&self, index: usize) -> Segment {
        Segment { start: self.points[index], end: self.points[index + 1] }
    }

    /// The place of `point`, whose nearest segment is number `index`.
    fn place_at(&self, index: usize, point: Point, forward: Point) -> Place {
        let segment = self.segment(index);
        let nearest = segment.nearest_to(point);
        let along = segment.vector();
        let length = self.stations[index + 1] - self.stations[index];
        let offset = point - segment.start;
        // Unclamped, to see what lies before the lane's start or beyond its end.
        let ahead = offset.dot(along) / length;
        let before = if index == 0 { (-ahead).max(0.0) } else { 0.0 };
        let behind = if index + 2 == self.points.len() { (ahead - length).max(0.0) } else { 0.0 };
        let beyond = before.max(behind);
        let distance = nearest.distance_squared.sqrt();
        let side = along.cross(offset);
        let across = if beyond > 0.0 { side.abs() / length } else { distance };
        let widths = [self.widths[index], self.widths[index + 1]].map(|widths| widths[usize::from(side < 0.0)]);
        let width = widths[0] * (1.0 - nearest.fraction) + widths[1] * nearest.fraction;
        let beside = (across - width).max(0.0);
        Place {
            height: self.heights[index],
            station: self.stations[index] + length * nearest.fraction,
            distance,
            outside: if beyond > 0.0 { (beyond * beyond + beside * beside).sqrt() } else { beside },
            alignment: along.dot(forward) / length,
        }
    }
}

/// Whether two segments cross, each at an inner point of the other.
fn cross(a: &Segment, b: &Segment) -> bool {
    a.side(b.start) * a.side(b.end) < 0.0 && b.side(a.start) * b.side(a.end) < 0.0
}
