//! Streets: lanes section by section, the lines between them, curbs, places to park, and where people walk.

use world::geometry::{Point, Point3, Pose};
use world::map::{RoadEdgeKind, RoadLineKind};

use super::super::curve::Curve;
use super::builder::{Bound, Builder, NewLane};
use super::net::{CROSSWALK, End, NetStreet};
use super::profile::{BIKE_LANE, Direction, PARKING, Profile, WALK};
use super::sections::Sections;
use super::{Bay, Crossing, LaneIndex, Middle, flat};
use world::pcg::Pcg32;

/// A place to park beside a curb (m), and how much of the street two of them take.
const BAY: f64 = 6.1;
const BAY_PITCH: f64 = 6.6;
/// How far bays keep from stop lines, from driveways' corners, and from the middles of crosswalks.
const CLEAR_OF_JUNCTION: f64 = 15.0;
const CLEAR_OF_DRIVEWAY: f64 = 4.0;
const CLEAR_OF_CROSSWALK: f64 = 8.0;

/// What is laid of one way of a street.
#[derive(Clone, Debug, Default)]
pub(super) struct Side {
    /// For each slot its lanes, in driving order.
    pub(super) slots: Vec<Vec<LaneIndex>>,
    pub(super) bikes: Vec<LaneIndex>,
    /// The lane to turn left from, before the stop line, and the one that leads to it.
    pub(super) pocket: Option<[LaneIndex; 2]>,
    /// Where the curb on its right begins and ends, in this direction; of a way without lanes, the curb of the other's left.
    pub(super) curb: [Pose; 2],
}

impl Side {
    /// The lanes that end at the stop line, from the left, and the bike lane.
    pub(super) fn inbound(&self) -> (Vec<LaneIndex>, Option<LaneIndex>) {
        let pocket = self.pocket.map(|[_, lane]| lane);
        let lanes = self.slots.iter().filter_map(|slot| slot.last().copied());
        (pocket.into_iter().chain(lanes).collect(), self.bikes.last().copied())
    }

    /// The lanes that begin behind the stop line, and the bike lane.
    pub(super) fn outbound(&self) -> (Vec<LaneIndex>, Option<LaneIndex>) {
        (self.slots.iter().filter_map(|slot| slot.first().copied()).collect(), self.bikes.first().copied())
    }
}

/// One way of a street, as it is laid: its middle in this direction, and what is common to all of it.
struct Lay<'a> {
    street: &'a NetStreet,
    direction: Direction,
    middle: Curve,
    profile: Profile,
    sections: Sections,
    /// The section in which the pocket's lane leaves the first lane.
    taper: Option<usize>,
}

/// Lays a street: forward and backward.
pub(super) fn lay(builder: &mut Builder, index: usize, street: &NetStreet) -> [Side; 2] {
    let length = street.middle.length();
    let mut random = Pcg32::new(length.to_bits() ^ index as u64, 0x0005_ec71);
    let sections = Sections::new(street, &mut random);
    let back = sections.reversed(length);
    let new = |direction: Direction, middle: Curve, sections: Sections| {
        let end = if direction == Direction::Forward { End::To } else { End::From };
        let taper = street.pocket[end as usize].then(|| sections.first_solid().checked_sub(1)).flatten();
        Lay { street, direction, middle, profile: street.profile(direction), sections, taper }
    };
    let lays = [
        new(Direction::Forward, street.middle.clone(), sections),
        new(Direction::Backward, street.middle.reversed(), back),
    ];
    let inner = inner_bounds(builder, street, &lays, &mut random);
    let sides =
        [0, 1].map(|way| Side { curb: lays[way].curb_ends(), ..lays[way].lanes(builder, inner[way], inner[1 - way]) });
    for (lay, side) in lays.iter().zip(&sides) {
        lay.bays(builder, side);
    }
    lay_crosswalks(builder, &lays, &sides);
    sides
}

/// What bounds the first lanes on their left: of both ways.
fn inner_bounds(
    builder: &mut Builder,
    street: &NetStreet,
    lays: &[Lay<'_>; 2],
    random: &mut Pcg32,
) -> [Option<Bound>; 2] {
    let (from, to) = street.reach();
    if !street.curbs {
        return [None; 2];
    }
    let one_way = lays.iter().position(|lay| lay.profile.lanes == 0);
    if let Some(empty) = one_way {
        // The curb on the left of the only way; as all edges, it runs with the road on its left.
        let lay = &lays[empty];
        let (from, to) = lay.reach();
        let edge = builder.edge(RoadEdgeKind::Boundary, lay.middle.strip(from, to, -lay.profile.curb()).polyline());
        let mut bounds = [Some(edge); 2];
        bounds[empty] = None;
        return bounds;
    }
    let kind = match street.street.middle {
        Middle::Line => {
            let passing = lays.iter().all(|lay| lay.profile.lanes == 1) && random.between(0.0, 1.0) < 0.25;
            let kind = if passing { RoadLineKind::PassingDoubleYellow } else { RoadLineKind::SolidDoubleYellow };
            let line = builder.line(kind, &street.middle.strip(from, to, 0.0));
            return [Some(line); 2];
        }
        Middle::Painted(_) => RoadLineKind::PassingDoubleYellow,
        Middle::Raised(_) => RoadLineKind::SolidSingleYellow,
    };
    if let Middle::Raised(_) = street.street.middle {
        island(builder, lays);
    }
    [0, 1].map(|way| {
        let lay = &lays[way];
        let (from, to) = (lay.sections.cuts[0], lay.before_pocket());
        (to > from).then(|| builder.line(kind, &lay.middle.strip(from, to, -lay.profile.inner)))
    })
}

/// The raised strip in the middle, where there is no pocket in it.
fn island(builder: &mut Builder, lays: &[Lay<'_>; 2]) {
    let [forward, backward] = lays;
    let half = forward.profile.inner - 0.25;
    let length = forward.middle.length();
    let (from, to) = (length - backward.before_pocket() + 1.5 + half, forward.before_pocket() - 1.5 - half);
    if half < 0.1 || to - from < 5.0 {
        return;
    }
    let nose = |pose: Pose, points: &mut Vec<Point3>| {
        // Half a circle around its end, from the right of `pose` to its left.
        for k in 1..8 {
            let to_point = Point::unit(-std::f64::consts::FRAC_PI_2 + f64::from(k) * std::f64::consts::PI / 8.0);
            points.push(flat(pose.to_world(to_point * half)));
        }
    };
    // With the road on its left it goes round clockwise: back along the forward lanes, and forth along the others.
    let mut points = forward.middle.strip(from, to, -half).reversed().polyline();
    let start = forward.middle.pose(from);
    // Seen backwards, the forward lanes are on the left.
    let turned = |pose: Pose| Pose { heading: pose.heading + std::f64::consts::PI, ..pose };
    let mut round = Vec::new();
    nose(turned(start), &mut round);
    points.extend(round.iter().rev());
    points.extend(forward.middle.strip(from, to, half).polyline());
    round.clear();
    nose(forward.middle.pose(to), &mut round);
    points.extend(round.iter().rev());
    points.extend(points.first().copied());
    builder.edge(RoadEdgeKind::Median, points);
}

impl Lay<'_> {
    fn reach(&self) -> (f64, f64) {
        (self.sections.cuts[0], self.sections.cuts[self.sections.count()])
    }

    /// Where the lane to the pocket begins, or else the stop line.
    fn before_pocket(&self) -> f64 {
        self.taper.map_or(self.reach().1, |taper| self.sections.cuts[taper])
    }

    fn lane(&self, builder: &mut Builder, section: usize, offset: f64, (width, bike): (f64, bool)) -> LaneIndex {
        let (from, to) = self.sections.span(section);
        self.lane_of(builder, section, self.middle.strip(from, to, -offset), (width, bike))
    }

    fn lane_of(&self, builder: &mut Builder, section: usize, course: Curve, (width, bike): (f64, bool)) -> LaneIndex {
        builder.lane(NewLane {
            course,
            width,
            limit_mph: self.street.street.speed_limit_mph,
            bike,
            way: None,
            solid: section >= self.sections.first_solid(),
            lot: self.street.lot,
        })
    }

    /// All lanes of this way, with the lines and the curb beside them. `inner` bounds the first on its left, up to a pocket; `across`
    /// does so for the other way.
    fn lanes(&self, builder: &mut Builder, inner: Option<Bound>, across: Option<Bound>) -> Side {
        let (profile, sections) = (&self.profile, &self.sections);
        let count = sections.count();
        let chain = |builder: &mut Builder, offset: f64, kind: (f64, bool)| {
            let lanes: Vec<LaneIndex> = (0..count).map(|section| self.lane(builder, section, offset, kind)).collect();
            lanes.windows(2).for_each(|pair| builder.link(pair[0], pair[1]));
            lanes
        };
        let slots: Vec<Vec<LaneIndex>> =
            (0..profile.lanes).map(|slot| chain(builder, profile.lane(slot), (profile.lane_width, false))).collect();
        let bikes = profile.bike_lane().map_or(Vec::new(), |offset| chain(builder, offset, (BIKE_LANE, true)));
        let mut side = Side { slots, bikes, ..Side::default() };
        if !self.street.curbs {
            return side;
        }

        let mut left: Vec<Option<Bound>> = vec![inner; count];
        if let Some(taper) = self.taper {
            self.pocket(builder, taper, across, &mut left, &mut side);
        }
        let curb = self.curb(builder);
        for slot in 0..profile.lanes {
            let is_last = slot + 1 == profile.lanes;
            let right = if !is_last {
                self.line(builder, profile.line(slot), RoadLineKind::BrokenSingleWhite)
            } else if profile.bike_lane().is_some() || profile.parking_line().is_some() {
                self.line(builder, profile.outer(), RoadLineKind::SolidSingleWhite)
            } else {
                vec![curb; count]
            };
            for section in 0..count {
                builder.bound(side.slots[slot][section], left[section], right[section]);
            }
            left = right;
        }
        if !side.bikes.is_empty() {
            let right = match profile.parking_line() {
                Some(offset) => self.line(builder, offset, RoadLineKind::SolidSingleWhite),
                None => vec![curb; count],
            };
            for section in 0..count {
                builder.bound(side.bikes[section], left[section], right[section]);
            }
        }
        for pair in side.slots.windows(2) {
            (0..count).for_each(|section| builder.beside(pair[0][section], pair[1][section]));
        }
        if let Some(outer) = side.slots.last() {
            outer.iter().zip(&side.bikes).for_each(|(lane, bike)| builder.beside(*lane, *bike));
        }
        if let (Some([_, pocket]), Some(first)) = (side.pocket, side.slots.first()) {
            builder.beside(pocket, first[count - 1]);
        }
        side
    }

    /// The lane to turn left from: it leaves the first lane in the section `taper`, and lies beside it in the next.
    fn pocket(
        &self,
        builder: &mut Builder,
        taper: usize,
        across: Option<Bound>,
        left: &mut [Option<Bound>],
        side: &mut Side,
    ) {
        let (width, offset, left_side) = self.profile.pocket();
        let last = self.sections.count() - 1;
        let first_lane = &side.slots[0];
        let (from, mid) = self.sections.span(taper);
        let to = self.sections.cuts[last + 1];
        let lane = self.lane(builder, last, offset, (width, false));
        let shift = self.profile.lane(0) - offset;
        let beside = &builder.roads.lanes[first_lane[taper]].course;
        let length = beside.length();
        let course = beside.shifted_by(|station| shift * smooth(station / length));
        let course = course.ending_at(builder.roads.lanes[lane].course.start());
        let lead = self.lane_of(builder, taper, course, (self.profile.lane_width, false));
        if let Some(before) = taper.checked_sub(1).map(|before| first_lane[before]) {
            builder.link(before, lead);
        }
        builder.link(lead, lane);
        let inner = self.profile.inner;
        left[taper] = Some(builder.line(RoadLineKind::BrokenSingleWhite, &self.middle.strip(from, mid, -inner)));
        left[last] = Some(builder.line(RoadLineKind::SolidSingleWhite, &self.middle.strip(mid, to, -inner)));
        // In a narrow strip the pocket reaches to the line of the other way.
        let shared = inner + left_side < 0.05;
        let far = if shared { across } else { None };
        let far = far
            .unwrap_or_else(|| builder.line(RoadLineKind::SolidDoubleYellow, &self.middle.strip(mid, to, -left_side)));
        builder.bound(lane, Some(far), left[last]);
        side.pocket = Some([lead, lane]);
    }

    /// The line at an offset: solid before the stop line. For each section what bounds it.
    fn line(&self, builder: &mut Builder, offset: f64, kind: RoadLineKind) -> Vec<Option<Bound>> {
        let count = self.sections.count();
        let solid = if kind == RoadLineKind::SolidSingleWhite { count } else { self.sections.first_solid() };
        let mut bounds = vec![None; count];
        for (first, end, kind) in [(0, solid, kind), (solid, count, RoadLineKind::SolidSingleWhite)] {
            if first < end {
                let course = self.middle.strip(self.sections.cuts[first], self.sections.cuts[end], -offset);
                bounds[first..end].fill(Some(builder.line(kind, &course)));
            }
        }
        bounds
    }

    fn curb_ends(&self) -> [Pose; 2] {
        let (from, to) = self.reach();
        [from, to].map(|at| self.middle.strip(at, at, -self.profile.curb()).start())
    }

    fn curb(&self, builder: &mut Builder) -> Option<Bound> {
        let (from, to) = self.reach();
        // A one-way street's other curb was laid as the bound of its first lane.
        (self.profile.lanes > 0)
            .then(|| builder.edge(RoadEdgeKind::Boundary, self.middle.strip(from, to, -self.profile.curb()).polyline()))
    }

    /// Where a stretch of this way lies on a lane's course.
    fn on_lane(&self, builder: &Builder, lane: LaneIndex, section: usize, station: f64) -> f64 {
        let (from, to) = self.sections.span(section);
        (station - from) / (to - from) * builder.roads.lanes[lane].course.length()
    }

    fn bays(&self, builder: &mut Builder, side: &Side) {
        let (Some(line), Some(outer)) = (self.profile.parking_line(), side.slots.last()) else { return };
        let (from, to) = self.reach();
        let (first, last) = self.clearances();
        let crosswalks: Vec<f64> = self.crosswalks().collect();
        let mut at = from + first + 0.5 * BAY;
        while at + 0.5 * BAY < to - last {
            let near = |crosswalk: &f64| (crosswalk - at).abs() < CLEAR_OF_CROSSWALK + 0.5 * BAY;
            let section = self.sections.within(at, at).next();
            if let (Some(section), false) = (section, crosswalks.iter().any(near)) {
                let heading = self.middle.pose(at).heading;
                let place = self.middle.beside(at, -line - 0.5 * PARKING);
                let lane = outer[section];
                // In bends the lane beside is longer or shorter here than there: to what lies abreast it is a step or two.
                let course = &builder.roads.lanes[lane].course;
                let abreast = |station: f64| station + course.pose(station).to_body(place).x;
                let beside = Some((lane, abreast(abreast(self.on_lane(builder, lane, section, at)))));
                let pose = Pose::new(place.x, place.y, heading);
                builder.roads.bays.push(Bay { pose, length: BAY, width: PARKING, beside });
            }
            at += BAY_PITCH;
        }
    }

    /// What bays leave free at both ends.
    fn clearances(&self) -> (f64, f64) {
        let of = |end: usize| match (self.street.stop[end], self.street.setback[end] > 0.0) {
            (true, _) => CLEAR_OF_JUNCTION,
            (false, true) => CLEAR_OF_DRIVEWAY,
            (false, false) => 1.0,
        };
        if self.is_forward() { (of(0), of(1)) } else { (of(1), of(0)) }
    }

    fn is_forward(&self) -> bool {
        self.direction == Direction::Forward
    }

    /// The middles of the crosswalks between the junctions.
    fn crosswalks(&self) -> impl Iterator<Item = f64> + '_ {
        let (length, is_forward) = (self.middle.length(), self.is_forward());
        let (from, to) = self.reach();
        let station = move |share: &f64| if is_forward { share * length } else { (1.0 - share) * length };
        let clear = move |at: &f64| *at > from + 12.0 && *at < to - 12.0;
        self.street.street.crosswalks.iter().map(station).filter(clear)
    }
}

/// From 0 to 1 without a jump of direction or curvature.
fn smooth(t: f64) -> f64 {
    t * t * t * (10.0 - 15.0 * t + 6.0 * t * t)
}

/// The crosswalks between a street's ends.
fn lay_crosswalks(builder: &mut Builder, lays: &[Lay<'_>; 2], sides: &[Side; 2]) {
    let half = 0.5 * (CROSSWALK.1 - CROSSWALK.0);
    let curbs = [0, 1].map(|way| lays[way].profile.curb());
    for at in lays[0].crosswalks() {
        let middle = &lays[0].middle;
        let corners = [(-half, -curbs[0]), (half, -curbs[0]), (half, curbs[1]), (-half, curbs[1])];
        builder.crosswalk(corners.map(|(along, left)| flat(middle.beside(at + along, left))).to_vec());
        let course = Curve::line(middle.beside(at, -curbs[0] - WALK), middle.beside(at, curbs[1] + WALK));
        builder.roads.crossings.push(Crossing { course: course.into(), arm: None });
        let crossing = builder.roads.crossings.len() - 1;
        for (lay, side) in lays.iter().zip(sides) {
            let station = if lay.is_forward() { at } else { middle.length() - at };
            let (from, to) = (station - half, station + half);
            for section in lay.sections.within(from, to) {
                let is_last = section + 1 == lay.sections.count();
                let pocket = side.pocket.filter(|_| Some(section) == lay.taper || (is_last && lay.taper.is_some()));
                let pocket = pocket.map(|[lead, lane]| if is_last { lane } else { lead });
                let lanes = side.slots.iter().chain([&side.bikes]).filter_map(|slot| slot.get(section).copied());
                for lane in lanes.chain(pocket).collect::<Vec<_>>() {
                    let on_lane = |at: f64| lay.on_lane(builder, lane, section, at);
                    let length = builder.roads.lanes[lane].course.length();
                    let span = (on_lane(from).clamp(0.0, length), on_lane(to).clamp(0.0, length));
                    builder.roads.lanes[lane].crossed.push((crossing, span.0, span.1));
                }
            }
        }
    }
}
