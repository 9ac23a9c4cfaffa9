//! Junctions: ways from lane to lane, curbs around the corners, crosswalks, stop signs.

use std::f64::consts::PI;

use world::geometry::{Point, Pose, wrap_angle};
use world::map::RoadEdgeKind;

use super::super::curve::{Curve, straight};
use super::builder::{Builder, NewLane};
use super::conflicts::conflicts;
use super::net::{CORNER, CROSSWALK, DRIVEWAY, Net, NetArm};
use super::profile::{Direction, WALK};
use super::streets::Side;
use super::{Arm, Control, Crossing, Junction, LaneIndex, Turn, Way, flat};

/// What leads on within this angle (rad) goes straight.
pub(super) const STRAIGHT: f64 = 0.65;

/// Curbs whose directions differ by less (rad) have no corner between them.
const FLAT: f64 = 0.5;

/// The largest radii of turns (m).
const LARGEST_RIGHT: f64 = 13.0;
const LARGEST_LEFT: f64 = 24.0;

/// How one turns from the arm that points to one heading to the arm that points to another (rad, left is positive).
pub(super) fn turn(from: f64, to: f64) -> f64 {
    wrap_angle(to - from - PI)
}

/// An arm with what is laid of its street.
struct Place<'a> {
    arm: NetArm,
    inbound: Vec<LaneIndex>,
    outbound: Vec<LaneIndex>,
    bike_in: Option<LaneIndex>,
    bike_out: Option<LaneIndex>,
    /// Whether the first of `inbound` is a pocket.
    pocket: bool,
    /// Where the curbs beside it end and begin: on the right of who comes, and of who leaves.
    curb_ends: (Pose, Pose),
    net: &'a Net,
}

impl<'a> Place<'a> {
    fn new(net: &'a Net, arm: NetArm, sides: &[[Side; 2]]) -> Self {
        let inbound_side = &sides[arm.street][arm.end.inbound() as usize];
        let outbound_side = &sides[arm.street][arm.end.inbound().other() as usize];
        let ((inbound, bike_in), (outbound, bike_out)) = (inbound_side.inbound(), outbound_side.outbound());
        let (pocket, curb_ends) = (inbound_side.pocket.is_some(), (inbound_side.curb[1], outbound_side.curb[0]));
        Self { arm, inbound, outbound, bike_in, bike_out, pocket, curb_ends, net }
    }

    fn curb(&self, direction: Direction) -> f64 {
        self.net.streets[self.arm.street].profile(direction).curb()
    }

    /// How far to the left and to the right of its middle the curbs lie, as one looks outward.
    fn curbs(&self) -> (f64, f64) {
        let inbound = self.arm.end.inbound();
        (self.curb(inbound), self.curb(inbound.other()))
    }

    fn outward(&self, before_stop: f64) -> Pose {
        let street = &self.net.streets[self.arm.street];
        street.outward(self.arm.end, street.setback(self.arm.end) + before_stop)
    }

    fn at(&self, before_stop: f64, left: f64) -> Point {
        self.outward(before_stop).to_world(Point::new(0.0, left))
    }
}

/// Where an arm's lanes lead.
#[derive(Clone, Copy)]
struct Target {
    arm: usize,
    turn: Turn,
    angle: f64,
}

fn targets(places: &[Place<'_>], from: usize) -> Vec<Target> {
    let heading = places[from].arm.heading;
    let open = |(index, place): &(usize, &Place<'_>)| *index != from && !place.outbound.is_empty();
    let mut targets: Vec<Target> = (places.iter().enumerate().filter(open))
        .map(|(arm, place)| {
            let angle = turn(heading, place.arm.heading);
            Target { arm, turn: if angle > 0.0 { Turn::Left } else { Turn::Right }, angle }
        })
        .collect();
    let ahead = targets.iter_mut().min_by(|a, b| a.angle.abs().total_cmp(&b.angle.abs()));
    if let Some(ahead) = ahead.filter(|ahead| ahead.angle.abs() < STRAIGHT) {
        ahead.turn = Turn::Straight;
    }
    targets
}

/// The ways of one arm's lanes: from lane, to lane, where to.
fn ways(places: &[Place<'_>], from: usize) -> Vec<(LaneIndex, LaneIndex, Target)> {
    let place = &places[from];
    let targets = targets(places, from);
    let of = |turn: Turn| targets.iter().copied().filter(move |target| target.turn == turn);
    let (pocket, cars) = place.inbound.split_at(usize::from(place.pocket));
    let mut ways = Vec::new();
    let Some((first, last)) = cars.first().copied().zip(cars.last().copied()) else { return ways };
    for target in of(Turn::Straight) {
        let on = cars.iter().zip(&places[target.arm].outbound);
        ways.extend(on.map(|(lane, next)| (*lane, *next, target)));
    }
    for target in of(Turn::Left) {
        let next = places[target.arm].outbound.first().copied();
        ways.extend(next.map(|next| (pocket.first().copied().unwrap_or(first), next, target)));
    }
    for target in of(Turn::Right) {
        let next = places[target.arm].outbound.last().copied();
        ways.extend(next.map(|next| (last, next, target)));
    }
    // Lanes that lead nowhere yet: to the side they are on, beside those that turn already; else they end in the last lane ahead.
    for (slot, lane) in place.inbound.iter().enumerate() {
        if ways.iter().any(|(from, ..)| from == lane) {
            continue;
        }
        let rightmost = 2 * slot + 1 > place.inbound.len();
        let turns = if rightmost {
            [Turn::Right, Turn::Straight, Turn::Left]
        } else {
            [Turn::Left, Turn::Straight, Turn::Right]
        };
        let Some(target) = turns.into_iter().find_map(|turn| of(turn).next()) else { continue };
        let next = &places[target.arm].outbound;
        let from_right = place.inbound.len() - 1 - slot;
        let taken = if target.turn == Turn::Right {
            next.len().saturating_sub(1 + from_right)
        } else {
            slot.min(next.len() - 1)
        };
        ways.push((*lane, next[taken], target));
    }
    if let Some(bike) = place.bike_in {
        let with_bikes = |target: &Target| places[target.arm].bike_out.map(|next| (next, *target));
        let with_cars = |target: &Target| places[target.arm].outbound.last().map(|next| (*next, *target));
        let order = || of(Turn::Straight).chain(of(Turn::Right)).chain(of(Turn::Left));
        let next = order().find_map(|target| with_bikes(&target)).or_else(|| order().find_map(|t| with_cars(&t)));
        ways.extend(next.map(|(next, target)| (bike, next, target)));
    }
    ways
}

/// Lays what lies at a node.
pub(super) fn lay(builder: &mut Builder, net: &Net, index: usize, sides: &[[Side; 2]]) {
    let node = &net.nodes[index];
    let places: Vec<Place<'_>> = node.arms.iter().map(|arm| Place::new(net, *arm, sides)).collect();
    if places.len() < 2 {
        return;
    }
    if !node.is_junction(places.len()) {
        lay_bend(builder, &places);
        return;
    }
    let corner = if node.driveway { DRIVEWAY } else { CORNER };
    let junction = builder.roads.junctions.len();
    let mut all = Vec::new();
    let mut of_arm: Vec<Vec<LaneIndex>> = Vec::new();
    for from in 0..places.len() {
        let lanes: Vec<LaneIndex> = ways(&places, from)
            .into_iter()
            .map(|(lane, next, target)| {
                let way = Way { junction, from, to: target.arm, turn: target.turn };
                let arms = (&places[from], &places[target.arm]);
                let radius = largest_radius(builder, corner, arms, (lane, next), target.turn);
                lay_way(builder, (lane, next), Some(way), radius, node.lot)
            })
            .collect();
        all.extend(&lanes);
        of_arm.push(lanes);
    }
    lay_curbs(builder, net, &places, corner);
    let arms = places.iter().enumerate().map(|(arm, place)| {
        let street = &net.streets[place.arm.street].street;
        let crossing = (street.walks && node.has_crosswalks(places.len()))
            .then(|| lay_crosswalk(builder, place, (junction, arm), &all))
            .flatten();
        let signed = match node.control {
            Control::AllWayStop => true,
            Control::MinorStop => !street.major,
            _ => false,
        };
        if signed && !of_arm[arm].is_empty() {
            let (left, _) = place.curbs();
            builder.stop_sign(&of_arm[arm], flat(place.at(0.0, left + 0.8)));
        }
        Arm {
            street: net.streets[place.arm.street].part_of.unwrap_or(place.arm.street),
            heading: place.arm.heading,
            major: street.major,
            inbound: place.inbound.iter().copied().chain(place.bike_in).collect(),
            outbound: place.outbound.iter().copied().chain(place.bike_out).collect(),
            crossing,
        }
    });
    let arms = arms.collect();
    let conflicts = conflicts(&builder.roads.lanes, &all);
    builder.roads.junctions.push(Junction { node: index, control: node.control, arms, ways: all, conflicts });
}

/// How large a turn may be without cutting the corner, whose curb is of the radius `corner`: its arc may come as near to that as the
/// lanes themselves may.
fn largest_radius(
    builder: &Builder,
    corner: f64,
    (from, to): (&Place<'_>, &Place<'_>),
    (lane, next): (LaneIndex, LaneIndex),
    turn: Turn,
) -> f64 {
    let lanes = &builder.roads.lanes;
    let beside = |place: &Place<'_>, pose: Pose| place.outward(0.0).to_body(pose.position()).y;
    let (start, end) = (beside(from, lanes[lane].course.end()), beside(to, lanes[next].course.start()));
    let (largest, apart) = match turn {
        Turn::Straight => return f64::INFINITY,
        Turn::Right => (LARGEST_RIGHT, (from.curbs().0 - start).min(to.curbs().1 + end)),
        Turn::Left => (LARGEST_LEFT, (from.curbs().1 + start).min(to.curbs().0 - end)),
    };
    let angle = self::turn(from.arm.heading, to.arm.heading);
    // At its middle a turn comes this much nearer to the corner for each metre that its radius is larger.
    let nearer = 1.0 / Point::unit(0.5 * angle).x.max(0.3) - 1.0;
    let spare = apart - 0.5 * lanes[lane].width;
    (corner + apart + spare / nearer.max(0.02)).min(largest).max(6.0)
}

fn lay_way(
    builder: &mut Builder,
    (from, to): (LaneIndex, LaneIndex),
    way: Option<Way>,
    largest_radius: f64,
    lot: bool,
) -> LaneIndex {
    let (lanes, map) = (&builder.roads.lanes, &builder.roads.map);
    let course = Curve::join_within(lanes[from].course.end(), lanes[to].course.start(), largest_radius);
    let limit_mph = map.lanes[from].speed_limit_mph.min(map.lanes[to].speed_limit_mph);
    let (width, bike) = (lanes[from].width.min(lanes[to].width), lanes[from].bike);
    let lane = builder.lane(NewLane { course, width, limit_mph, bike, way, solid: true, lot });
    builder.link(from, lane);
    builder.link(lane, to);
    lane
}

/// From one street to another where nobody else comes: lane by lane.
fn lay_bend(builder: &mut Builder, places: &[Place<'_>]) {
    let [one, other] = places else { return };
    let mut meets = true;
    for (from, to) in [(one, other), (other, one)] {
        let last = to.outbound.len().saturating_sub(1);
        let cars =
            from.inbound.iter().enumerate().filter_map(|(slot, lane)| Some((*lane, *to.outbound.get(slot.min(last))?)));
        let bikes = from.bike_in.zip(to.bike_out.or_else(|| to.outbound.last().copied()));
        for (lane, next) in cars.chain(bikes).collect::<Vec<_>>() {
            let lanes = &builder.roads.lanes;
            let (end, start) = (lanes[lane].course.end(), lanes[next].course.start());
            let turned = wrap_angle(start.heading - end.heading).abs();
            if end.position().distance(start.position()) < 1e-6 && turned < 0.02 {
                builder.link(lane, next);
            } else {
                meets = false;
                let lot = lanes[lane].lot;
                lay_way(builder, (lane, next), None, f64::INFINITY, lot);
            }
        }
    }
    if !meets {
        for (from, to) in [(one, other), (other, one)] {
            lay_curb(builder, from, to, f64::INFINITY);
        }
    }
}

/// The curbs around the corners, from each arm's inbound lanes to the next one's outbound.
fn lay_curbs(builder: &mut Builder, net: &Net, places: &[Place<'_>], radius: f64) {
    for (index, place) in places.iter().enumerate() {
        let next = &places[(index + 1) % places.len()];
        let in_lot = |place: &Place<'_>| net.streets[place.arm.street].lot;
        if !in_lot(place) && !in_lot(next) {
            lay_curb(builder, place, next, radius);
        }
    }
}

fn lay_curb(builder: &mut Builder, from: &Place<'_>, to: &Place<'_>, radius: f64) {
    let (start, end) = (from.curb_ends.0, to.curb_ends.1);
    let (ahead, back) = (start.to_body(end.position()), end.to_body(start.position()));
    let turned = wrap_angle(end.heading - start.heading);
    if start.position().distance(end.position()) < 1e-6 {
        return;
    }
    let shift = ahead.y.abs().min(back.y.abs());
    // On the flat side of a T between streets of different widths, the wide one's curb goes on as far as it can: ways that turn left
    // swing out there.
    let course = if turned.abs() < FLAT && shift > 0.3 && (ahead.y > 0.0) == (back.y < 0.0) {
        let short = (1.5 * shift).clamp(4.0, 0.7 * ahead.x.abs().max(6.0));
        if ahead.y > 0.0 {
            let on = Curve::new(start, &[straight((ahead.x - short).max(0.5))]);
            let rest = Curve::join(on.end(), end);
            on.then(&rest)
        } else {
            let before = Curve::new(end, &[straight(0.0)]).strip(-(-back.x - short).max(0.5), 0.0, 0.0);
            Curve::join(start, before.start()).then(&before)
        }
    } else {
        Curve::join_within(start, end, radius)
    };
    builder.edge(RoadEdgeKind::Boundary, course.polyline());
}

/// The crosswalk over an arm, and where it crosses the ways.
fn lay_crosswalk(builder: &mut Builder, place: &Place<'_>, arm: (usize, usize), ways: &[LaneIndex]) -> Option<usize> {
    let street = &place.net.streets[place.arm.street];
    if street.setback(place.arm.end) < CROSSWALK.1 {
        return None;
    }
    let (near, far) = CROSSWALK;
    let (left, right) = place.curbs();
    let corners = [(near, -right), (near, left), (far, left), (far, -right)];
    builder.crosswalk(corners.map(|(behind, left)| flat(place.at(-behind, left))).to_vec());
    let middle = 0.5 * (near + far);
    let course = Curve::line(place.at(-middle, -right - WALK), place.at(-middle, left + WALK));
    builder.roads.crossings.push(Crossing { course, arm: Some(arm) });
    let crossing = builder.roads.crossings.len() - 1;
    let pose = place.outward(-middle);
    let half = 0.5 * (far - near);
    for way in ways {
        let lane = &mut builder.roads.lanes[*way];
        let Some(through) = lane.way.filter(|way| way.from == arm.1 || way.to == arm.1) else { continue };
        let count = lane.course.points().len();
        // The last of the points, counted from the arm, that still lies on it.
        let is_on = |point: Point| pose.to_body(point).x > -half;
        let leads_in = through.from == arm.1;
        let on = if leads_in {
            lane.course.points().take_while(|point| is_on(*point)).count()
        } else {
            lane.course.points().rev().take_while(|point| is_on(*point)).count()
        };
        let depth = (on.min(count) as f64 * lane.course.step()).clamp(near, lane.course.length());
        let length = lane.course.length();
        let span = if leads_in { (near, depth) } else { (length - depth, length - near) };
        lane.crossed.push((crossing, span.0, span.1));
    }
    Some(crossing)
}
