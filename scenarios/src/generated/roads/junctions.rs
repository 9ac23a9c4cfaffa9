//! Junctions: ways from lane to lane, and what is known of them all.

use std::f64::consts::PI;

use world::geometry::{Point, Pose, wrap_angle};

use super::super::curve::Curve;
use super::builder::{Builder, NewLane};
use super::conflicts::conflicts;
use super::crosswalks::lay_crosswalk;
use super::curbs::{lay_curb, lay_curbs};
use super::net::{Net, NetNode};
use super::place::Place;
use super::streets::Side;
use super::{Arm, Control, Junction, LaneIndex, Turn, Way, flat, roundabout};

/// What leads on within this angle (rad) goes straight.
pub(super) const STRAIGHT: f64 = 0.65;

/// What leads back at more than this angle (rad) is no way to go.
const TURNING_BACK: f64 = 2.5;

/// The largest radii of turns (m).
const LARGEST_RIGHT: f64 = 13.0;
const LARGEST_LEFT: f64 = 24.0;

/// How one turns from the arm that points to one heading to the arm that points to another (rad, left is positive).
pub(super) fn turn(from: f64, to: f64) -> f64 {
    wrap_angle(to - from - PI)
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
    // Nobody turns back where there is another way.
    if targets.iter().any(|target| target.angle.abs() < TURNING_BACK) {
        targets.retain(|target| target.angle.abs() < TURNING_BACK);
    }
    let ahead = targets.iter_mut().min_by(|a, b| a.angle.abs().total_cmp(&b.angle.abs()));
    if let Some(ahead) = ahead.filter(|ahead| ahead.angle.abs() < STRAIGHT) {
        ahead.turn = Turn::Straight;
    }
    targets
}

/// The ways of one arm's lanes: from lane, to lane, where to. At a merge the ramp leads into the outermost lane.
fn ways(places: &[Place<'_>], from: usize, merge: bool) -> Vec<(LaneIndex, LaneIndex, Target)> {
    let place = &places[from];
    let targets = targets(places, from);
    let of = |turn: Turn| targets.iter().copied().filter(move |target| target.turn == turn);
    let (pocket, cars) = place.inbound.split_at(usize::from(place.pocket));
    let mut ways = Vec::new();
    let Some((first, last)) = cars.first().copied().zip(cars.last().copied()) else { return ways };
    for target in of(Turn::Straight) {
        let outbound = &places[target.arm].outbound;
        let first = if merge && !place.street().street.major { outbound.len().saturating_sub(cars.len()) } else { 0 };
        let on = cars.iter().zip(&outbound[first..]);
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
    let lanes = match node.control {
        Control::Roundabout { radius } => roundabout::lay(builder, node.at, radius, &places),
        _ => lay_ways(builder, node, &places),
    };
    finish(builder, index, node, &places, lanes);
}

/// The lanes of a junction: for each arm those that begin at its stop line, and those that end where its outbound lanes begin; and all.
#[derive(Debug, Default)]
pub(super) struct Through {
    pub(super) entering: Vec<Vec<LaneIndex>>,
    pub(super) leaving: Vec<Vec<LaneIndex>>,
    pub(super) all: Vec<LaneIndex>,
}

fn lay_ways(builder: &mut Builder, node: &NetNode, places: &[Place<'_>]) -> Through {
    let corner = node.corner();
    let junction = builder.roads.junctions.len();
    let none = || vec![Vec::new(); places.len()];
    let mut through = Through { entering: none(), leaving: none(), all: Vec::new() };
    for from in 0..places.len() {
        for (lane, next, target) in ways(places, from, node.control == Control::Merge) {
            let way = Way { junction, from, to: target.arm, turn: target.turn };
            let arms = (&places[from], &places[target.arm]);
            let radius = largest_radius(builder, corner, arms, (lane, next), target.turn);
            let way = lay_way(builder, (lane, next), Some(way), radius);
            through.entering[from].push(way);
            through.leaving[target.arm].push(way);
            through.all.push(way);
        }
    }
    lay_curbs(builder, places, corner);
    through
}

/// Crosswalks and signs; and what is known of the junction.
fn finish(builder: &mut Builder, index: usize, node: &NetNode, places: &[Place<'_>], through: Through) {
    let junction = builder.roads.junctions.len();
    let mut arms = Vec::new();
    for (arm, place) in places.iter().enumerate() {
        let street = &place.street().street;
        let lanes = (through.entering[arm].as_slice(), through.leaving[arm].as_slice());
        let crosses = street.walks && node.has_crosswalks(places.len());
        if crosses {
            lay_crosswalk(builder, place, (junction, arm), lanes);
        }
        let signed = match node.control {
            Control::AllWayStop => true,
            Control::MinorStop => !street.major,
            _ => false,
        };
        if signed && !through.entering[arm].is_empty() {
            let (left, _) = place.curbs();
            builder.stop_sign(&through.entering[arm], flat(place.at(0.0, left + 0.8)));
        }
        arms.push(Arm {
            street: place.street().part_of.unwrap_or(place.arm.street),
            heading: place.arm.heading,
            major: street.major,
            inbound: place.inbound.iter().copied().chain(place.bike_in).collect(),
        });
    }
    let conflicts = conflicts(&builder.roads.lanes, &through.all);
    builder.roads.junctions.push(Junction { node: index, control: node.control, arms, ways: through.all, conflicts });
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

pub(super) fn lay_way(
    builder: &mut Builder,
    (from, to): (LaneIndex, LaneIndex),
    way: Option<Way>,
    largest_radius: f64,
) -> LaneIndex {
    let (lanes, map) = (&builder.roads.lanes, &builder.roads.map);
    let course = Curve::join_within(lanes[from].course.end(), lanes[to].course.start(), largest_radius);
    let limit_mph = map.lanes[from].speed_limit_mph.min(map.lanes[to].speed_limit_mph);
    let (width, bike) = (lanes[from].width.min(lanes[to].width), lanes[from].bike);
    let lot = lanes[from].lot || lanes[to].lot;
    let lane = builder.lane(NewLane { course, width, limit_mph, bike, way, solid: way.is_some(), lot });
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
                lay_way(builder, (lane, next), None, f64::INFINITY);
            }
        }
    }
    if !meets && one.street().curbs && other.street().curbs {
        for (from, to) in [(one, other), (other, one)] {
            lay_curb(builder, from, to, f64::INFINITY);
        }
    }
}
