//! Parking lots. In the net a lot is more streets: the street beside it is cut in two where the driveway meets it, and a front lane, aisles
//! and a back lane are streets of their own, so that one can drive around.
//!
//! ```text
//!   back      B0 ───── B1 ───── B2        x: away from the street
//!              │ bays   │ bays   │        y: to the left of that
//!   front     F0 ───── F1 ───── F2
//!                       │ driveway
//!   street   ────────── D ──────────
//! ```

use std::f64::consts::FRAC_PI_2;

use world::geometry::{Point, Pose};
use world::map::RoadEdgeKind;

use super::super::curve::Curve;
use super::builder::Builder;
use super::net::{Net, NetNode, NetStreet};
use super::profile::{Direction, Profile};
use super::streets::Side;
use super::{Bay, Control, Lot, Middle, Street, Town, flat};

const LANE_WIDTH: f64 = 3.5;
const LIMIT_MPH: f64 = 15.0;
/// A bay (m).
const LENGTH: f64 = 5.2;
const WIDTH: f64 = 2.7;
/// From aisle to aisle: two lanes, two rows of bays, and what parts them.
const PITCH: f64 = 2.0 * LANE_WIDTH + 2.0 * LENGTH + 1.2;
/// From the street's curb to the front lane, and between the ends of an aisle and its bays.
const DRIVEWAY: f64 = 16.0;
const ENDS: f64 = 8.0;
/// How far a driveway keeps from the ends of its street, and from other driveways.
const CLEAR: f64 = 40.0;
/// How far a lot's curbs keep from the curbs of other streets.
const ROOM: f64 = 6.0;
/// The radius of the corners at a driveway, with what is left to people on foot.
const OPENING: f64 = 5.0;

/// A lot in the net.
#[derive(Debug)]
pub(super) struct Place {
    /// The town's street beside it, the station on its middle, and the way on whose right the lot lies.
    street: usize,
    station: f64,
    direction: Direction,
    /// Where the driveway leaves the middle of the street, looking away from it.
    pose: Pose,
    /// From there to the street's curb.
    curb: f64,
    aisles: usize,
    /// Aisles with bays on their sides: a lot of one has another to come back along.
    with_bays: usize,
    bays: usize,
    /// The driveway, as a street of the net.
    driveway: usize,
}

impl Place {
    /// The aisle that the driveway leads to.
    fn entry(&self) -> usize {
        self.aisles / 2
    }

    fn aisle(&self, index: usize) -> f64 {
        (index as f64 - self.entry() as f64) * PITCH
    }

    fn front(&self) -> f64 {
        self.curb + DRIVEWAY
    }

    fn back(&self) -> f64 {
        self.front() + 2.0 * ENDS + self.bays as f64 * WIDTH
    }

    fn at(&self, x: f64, y: f64) -> Point {
        self.pose.to_world(Point::new(x, y))
    }

    /// Its outline: from the street on, and to both sides: x, y, y.
    fn extent(&self) -> (f64, f64, f64) {
        let beside = |has_bays: bool| LANE_WIDTH + if has_bays { LENGTH + 0.8 } else { 1.0 };
        let right = self.aisle(0) - beside(self.with_bays == self.aisles);
        (self.back() + LANE_WIDTH + 1.0, right, self.aisle(self.aisles - 1) + beside(true))
    }

    /// Whether a point is in the lot, or too near to it.
    fn holds(&self, point: Point, room: f64) -> bool {
        let at = self.pose.to_body(point);
        let (far, right, left) = self.extent();
        (self.front() - LANE_WIDTH - room..far + room).contains(&at.x) && (right - room..left + room).contains(&at.y)
    }

    fn outline(&self) -> impl Iterator<Item = Point> + '_ {
        let (far, right, left) = self.extent();
        let (near, wide) = (self.front() - LANE_WIDTH, left - right);
        (0..=10).flat_map(move |k| {
            let share = f64::from(k) / 10.0;
            let (x, y) = (near + share * (far - near), right + share * wide);
            [(near, y), (far, y), (x, right), (x, left)].map(|(x, y)| self.at(x, y))
        })
    }
}

/// Puts the town's lots into the net. One that has no room beside its street, among other streets and lots, is made smaller, or left out.
pub(super) fn expand(net: &mut Net, town: &Town) -> Vec<Place> {
    let mut places: Vec<Place> = Vec::new();
    let middles: Vec<Curve> = net.streets.iter().map(|street| street.middle.clone()).collect();
    for street in 0..town.streets.len() {
        let length = middles[street].length();
        let mut lots: Vec<(f64, &Lot)> = (town.lots.iter().filter(|lot| lot.street == street))
            .map(|lot| ((lot.along * length).clamp(CLEAR.min(0.5 * length), (length - CLEAR).max(0.5 * length)), lot))
            .collect();
        lots.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut cuts: Vec<(f64, usize)> = Vec::new();
        for (station, lot) in lots {
            let before = cuts.last().map_or(0.0, |(station, _)| *station);
            if length < 2.0 * CLEAR - 1.0 || station - before < CLEAR - 1.0 {
                continue;
            }
            let Some(place) = find_room((net, &middles), (street, station), lot, &places) else { continue };
            let node = net.nodes.len();
            net.nodes.push(NetNode { driveway: true, ..NetNode::new(place.pose.position(), Control::MinorYield) });
            cuts.push((station, node));
            places.push(lay_out(net, place, node));
        }
        cut(net, street, &cuts);
    }
    places
}

/// The lot as large as it has room among the streets, whose middles these are, and the other lots.
fn find_room(
    (net, middles): (&Net, &[Curve]),
    (street, station): (usize, f64),
    lot: &Lot,
    others: &[Place],
) -> Option<Place> {
    let (direction, side) = if lot.right { (Direction::Forward, -FRAC_PI_2) } else { (Direction::Backward, FRAC_PI_2) };
    let middle = middles[street].pose(station);
    let pose = Pose { heading: middle.heading + side, ..middle };
    let curb = Profile::new(&net.streets[street].street, direction).curb();
    let is_free = |place: &Place| {
        let is_clear = |(index, other): (usize, &Curve)| {
            let curbs = Direction::BOTH.map(|way| Profile::new(&net.streets[index].street, way).curb());
            let widest = curbs.into_iter().fold(0.0, f64::max);
            // Its own street lies along its front, and must not bend into it.
            let room = widest + if index == street { 2.0 } else { ROOM };
            let count = (other.length() / 4.0).ceil().max(1.0);
            (0..=count as usize).all(|k| !place.holds(other.pose(k as f64 / count * other.length()).position(), room))
        };
        let is_apart = |other: &Place| {
            !place.outline().any(|point| other.holds(point, 3.0))
                && !other.outline().any(|point| place.holds(point, 3.0))
        };
        middles.iter().enumerate().all(is_clear) && others.iter().all(is_apart)
    };
    let sizes = (1..=lot.aisles.max(1)).rev().flat_map(|aisles| {
        let bays = lot.bays.max(3);
        [bays, bays * 2 / 3, bays / 2].map(|bays| (aisles, bays.max(3)))
    });
    sizes
        .map(|(with_bays, bays)| Place {
            street,
            station,
            direction,
            pose,
            curb,
            aisles: with_bays.max(2),
            with_bays,
            bays,
            driveway: 0,
        })
        .find(is_free)
}

/// Puts a lot's lanes into the net, from the node where its driveway meets the street.
fn lay_out(net: &mut Net, place: Place, gate: usize) -> Place {
    let node = |net: &mut Net, x: f64, y: f64, control: Control| {
        net.nodes.push(NetNode { lot: true, ..NetNode::new(place.at(x, y), control) });
        net.nodes.len() - 1
    };
    let last = place.aisles - 1;
    let control = |aisle: usize, is_gate: bool| {
        let is_corner = (aisle == 0 || aisle == last) && !is_gate;
        if is_corner { Control::Free } else { Control::MinorYield }
    };
    let (mut front, mut back) = (Vec::new(), Vec::new());
    for aisle in 0..place.aisles {
        front.push(node(net, place.front(), place.aisle(aisle), control(aisle, aisle == place.entry())));
        back.push(node(net, place.back(), place.aisle(aisle), control(aisle, false)));
    }
    let driveway = lane(net, gate, front[place.entry()], false);
    net.streets[driveway].curbs = true;
    for row in [&front, &back] {
        row.windows(2).for_each(|pair| {
            lane(net, pair[0], pair[1], true);
        });
    }
    for (front, back) in front.iter().zip(&back) {
        lane(net, *front, *back, false);
    }
    Place { driveway, ..place }
}

/// A lane each way between two nodes of a lot.
fn lane(net: &mut Net, from: usize, to: usize, major: bool) -> usize {
    let street = Street {
        from,
        to,
        bend: None,
        forward: 1,
        backward: 1,
        lane_width: LANE_WIDTH,
        speed_limit_mph: LIMIT_MPH,
        middle: Middle::Line,
        left_pocket: false,
        bike_lane: false,
        parking: false,
        walks: false,
        major,
        crosswalks: Vec::new(),
    };
    let middle = Curve::line(net.nodes[from].at, net.nodes[to].at);
    net.streets.push(NetStreet { lot: true, curbs: false, ..NetStreet::new(street, middle) });
    net.streets.len() - 1
}

/// Cuts a street where driveways meet it: at stations, with the nodes there. Its first part keeps its number.
fn cut(net: &mut Net, index: usize, cuts: &[(f64, usize)]) {
    let whole = net.streets[index].clone();
    let length = whole.middle.length();
    let ends = cuts.iter().copied().chain([(length, whole.street.to)]);
    let (mut station, mut node) = (0.0, whole.street.from);
    for (part, (end, next)) in ends.enumerate() {
        let share = |of: &f64| (of * length - station) / (end - station);
        let crosswalks = whole.street.crosswalks.iter().map(share).filter(|at| (0.0..1.0).contains(at)).collect();
        let street = Street { from: node, to: next, crosswalks, ..whole.street.clone() };
        let middle = if cuts.is_empty() { whole.middle.clone() } else { whole.middle.slice(station, end) };
        let piece = NetStreet { part_of: Some(index), ..NetStreet::new(street, middle) };
        if part == 0 {
            net.streets[index] = piece;
        } else {
            net.streets.push(piece);
            let last = net.streets.len() - 1;
            net.parts[index].push(last);
        }
        (station, node) = (end, next);
    }
}

/// Lays what lots have beside their lanes: bays, the curb around, and the driveway over the street's curb.
pub(super) fn lay(builder: &mut Builder, places: &[Place], sides: &[[Side; 2]]) {
    for place in places {
        for aisle in place.aisles - place.with_bays..place.aisles {
            for (bay, side) in (0..place.bays).flat_map(|bay| [(bay, 1.0), (bay, -1.0)]) {
                let x = place.front() + ENDS + (bay as f64 + 0.5) * WIDTH;
                let Point { x, y } = place.at(x, place.aisle(aisle) + side * (LANE_WIDTH + 0.5 * LENGTH));
                let pose = Pose::new(x, y, place.pose.heading + side * FRAC_PI_2);
                builder.roads.bays.push(Bay { pose, length: LENGTH, width: WIDTH, beside: None });
            }
        }
        let [out, back] = &sides[place.driveway];
        let (from, to) = (out.curb[1], back.curb[0]);
        let (far, right, left) = place.extent();
        let near = place.pose.to_body(from.position()).x;
        let corners = [(near, right), (far, right), (far, left), (near, left)].map(|(x, y)| place.at(x, y));
        let [first, .., last] = corners;
        let mut points = vec![flat(from.position())];
        let mut go = |from: Point, to: Point| points.extend(Curve::line(from, to).polyline().into_iter().skip(1));
        go(from.position(), first);
        corners.windows(2).for_each(|pair| go(pair[0], pair[1]));
        go(last, to.position());
        // Exactly where the driveway's curb begins, so that they are one.
        points.pop();
        points.push(flat(to.position()));
        builder.edge(RoadEdgeKind::Boundary, points);
        let half = LANE_WIDTH + OPENING;
        let driveway = [(place.curb - 0.3, -half), (near, -half), (near, half), (place.curb - 0.3, half)];
        builder.driveway(driveway.map(|(x, y)| flat(place.at(x, y))).to_vec());
    }
}

/// Where people on foot cannot walk along a street of the town: stations on its middle, on one side.
pub(super) fn openings(places: &[Place], street: usize, direction: Direction) -> Vec<(f64, f64)> {
    let half = LANE_WIDTH + OPENING;
    let here = places.iter().filter(|place| place.street == street && place.direction == direction);
    here.map(|place| (place.station - half, place.station + half)).collect()
}
