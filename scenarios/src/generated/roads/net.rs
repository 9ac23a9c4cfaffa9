//! Where everything lies before it is laid: the middles of the streets, the arms of each node, and how far from it streets end.

use std::f64::consts::{PI, TAU};

use world::geometry::{Point, Pose};

use super::super::curve::{Curve, straight};
use super::profile::{Direction, Profile};
use super::{Control, Middle, Street, Town, merge, roundabout};

/// Where a junction's crosswalks lie behind its stop lines (m): from, to.
pub(super) const CROSSWALK: (f64, f64) = (1.0, 4.3);
/// Radius of the curbs at the corners of junctions (m); of bends between two streets.
const CORNER: f64 = 7.5;
const BEND: f64 = 18.0;
/// Radii at driveways and in lots.
const DRIVEWAY: f64 = 4.0;
const IN_LOT: f64 = 4.3;
/// From this angle between two arms on (rad) there is no corner between them.
const NEARLY_FLAT: f64 = 2.5;
/// Of its length, the junctions at its ends take at most this much from a street.
const MOST: f64 = 0.85;

#[derive(Debug, Default)]
pub(super) struct Net {
    pub(super) nodes: Vec<NetNode>,
    /// First those of the town.
    pub(super) streets: Vec<NetStreet>,
    /// For each street of the town the streets here that are its parts, in order.
    pub(super) parts: Vec<Vec<usize>>,
}

#[derive(Clone, Debug)]
pub(super) struct NetNode {
    pub(super) at: Point,
    pub(super) control: Control,
    /// Counter-clockwise.
    pub(super) arms: Vec<NetArm>,
    /// A driveway meets the street here: no stop line, no crosswalk, tight corners.
    pub(super) driveway: bool,
    /// In a lot, or at the street beside one.
    pub(super) lot: bool,
}

/// A street's end at a node.
#[derive(Clone, Copy, Debug)]
pub(super) struct NetArm {
    pub(super) street: usize,
    pub(super) end: End,
    /// Outward (rad).
    pub(super) heading: f64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum End {
    From,
    To,
}

impl End {
    /// The way that leads to this end.
    pub(super) fn inbound(self) -> Direction {
        match self {
            Self::From => Direction::Backward,
            Self::To => Direction::Forward,
        }
    }
}

#[derive(Clone, Debug)]
pub(super) struct NetStreet {
    pub(super) street: Street,
    /// From node to node.
    pub(super) middle: Curve,
    /// Which of the town's streets it is, or is a part of.
    pub(super) part_of: Option<usize>,
    pub(super) lot: bool,
    /// Whether curbs lie beside it.
    pub(super) curbs: bool,
    /// How much its ends lie before the nodes (m): the stop lines.
    pub(super) setback: [f64; 2],
    /// Whether a stop line, or at least a junction, lies at its ends.
    pub(super) stop: [bool; 2],
    /// Whether there is a lane to turn left from, before each end.
    pub(super) pocket: [bool; 2],
}

impl NetStreet {
    pub(super) fn new(street: Street, middle: Curve) -> Self {
        Self {
            street,
            middle,
            part_of: None,
            lot: false,
            curbs: true,
            setback: [0.0; 2],
            stop: [false; 2],
            pocket: [false; 2],
        }
    }

    pub(super) fn profile(&self, direction: Direction) -> Profile {
        Profile::new(&self.street, direction)
    }

    /// The stations between which lanes are laid.
    pub(super) fn reach(&self) -> (f64, f64) {
        (self.setback[0], self.middle.length() - self.setback[1])
    }

    /// The pose on the middle `distance` from a node, looking away from it.
    pub(super) fn outward(&self, end: End, distance: f64) -> Pose {
        match end {
            End::From => self.middle.pose(distance),
            End::To => {
                let pose = self.middle.pose(self.middle.length() - distance);
                Pose { heading: pose.heading + PI, ..pose }
            }
        }
    }

    pub(super) fn setback(&self, end: End) -> f64 {
        self.setback[end as usize]
    }
}

impl Net {
    /// The nodes and middles of a town. A bent street puts the node at its end where it ends.
    pub(super) fn new(town: &Town) -> Self {
        let mut nodes: Vec<NetNode> = town.nodes.iter().map(|node| NetNode::new(node.at, node.control)).collect();
        let mut bent: Vec<Option<Curve>> = Vec::new();
        for street in &town.streets {
            bent.push(street.bend.as_ref().map(|(heading, pieces)| {
                let Point { x, y } = nodes[street.from].at;
                let middle = Curve::new(Pose::new(x, y, *heading), pieces);
                nodes[street.to].at = middle.end().position();
                middle
            }));
        }
        let streets = town.streets.iter().zip(bent).enumerate();
        let lay = |(index, (street, bent)): (usize, (&Street, Option<Curve>))| {
            let (from, to) = (nodes[street.from].at, nodes[street.to].at);
            let heading = (to - from).heading();
            let line = || Curve::new(Pose::new(from.x, from.y, heading), &[straight(from.distance(to))]);
            NetStreet { part_of: Some(index), ..NetStreet::new(street.clone(), bent.unwrap_or_else(line)) }
        };
        let streets: Vec<NetStreet> = streets.map(lay).collect();
        let parts = (0..streets.len()).map(|street| vec![street]).collect();
        Self { nodes, streets, parts }
    }

    /// Finds the arms of each node, and what junctions take of the streets. To be called when all streets are there.
    pub(super) fn arrange(&mut self) {
        for (index, street) in self.streets.iter().enumerate() {
            let ends = [(End::From, street.street.from), (End::To, street.street.to)];
            for (end, node) in ends {
                let heading = street.outward(end, 0.0).heading.rem_euclid(TAU);
                self.nodes[node].arms.push(NetArm { street: index, end, heading });
            }
        }
        for node in 0..self.nodes.len() {
            let mut arms = std::mem::take(&mut self.nodes[node].arms);
            arms.sort_by(|a, b| a.heading.total_cmp(&b.heading));
            let setbacks = self.setbacks(&self.nodes[node], &arms);
            let is_junction = self.nodes[node].is_junction(arms.len());
            for (arm, setback) in arms.iter().zip(setbacks) {
                let street = &mut self.streets[arm.street];
                street.setback[arm.end as usize] = setback;
                street.stop[arm.end as usize] = is_junction && self.nodes[node].stops();
            }
            self.nodes[node].arms = arms;
        }
        for street in &mut self.streets {
            let (most, taken) = (MOST * street.middle.length(), street.setback[0] + street.setback[1]);
            if taken > most {
                street.setback = street.setback.map(|setback| setback * most / taken);
            }
        }
        for node in 0..self.nodes.len() {
            self.find_pockets(node);
        }
    }

    /// How far from a node each of its arms ends, so that the curbs at its corners are round and crosswalks have room.
    fn setbacks(&self, node: &NetNode, arms: &[NetArm]) -> Vec<f64> {
        let mut setbacks = vec![0.0_f64; arms.len()];
        if arms.len() < 2 {
            return setbacks;
        }
        match node.control {
            Control::Roundabout { radius } => return vec![radius + roundabout::APPROACH; arms.len()],
            Control::Merge => {
                if let Some(setbacks) = merge::setbacks(self, arms) {
                    return setbacks;
                }
            }
            _ => {}
        }
        let radius = node.corner();
        for (index, arm) in arms.iter().enumerate() {
            let next_index = (index + 1) % arms.len();
            let next = &arms[next_index];
            let gap = (next.heading - arm.heading).rem_euclid(TAU);
            // A bend's outside, or the flat side of a T.
            if !(0.2..PI - 0.02).contains(&gap) {
                continue;
            }
            let left = self.streets[arm.street].profile(arm.end.inbound()).curb();
            let right = self.streets[next.street].profile(next.end.inbound().other()).curb();
            let (ahead, half) = (Point::unit(gap), Point::unit(0.5 * (PI - gap)));
            let tangent = radius * half.y / half.x;
            // Where one street nearly goes on as the other, their curbs meet anywhere: an S joins them.
            let most = if gap > NEARLY_FLAT { 8.0 } else { f64::INFINITY };
            let own = ((right + left * ahead.x) / ahead.y).min(most);
            let other = ((left + right * ahead.x) / ahead.y).min(most);
            for (place, clear) in [(index, own), (next_index, other)] {
                let street = &self.streets[arms[place].street].street;
                let walks = street.walks && node.has_crosswalks(arms.len());
                let needed = clear + if walks { tangent.max(CROSSWALK.1 + 0.5) } else { tangent };
                setbacks[place] = setbacks[place].max(needed);
            }
        }
        let least = match node.control {
            Control::Free => 0.0,
            _ if node.lot => 0.0,
            _ if node.driveway => 5.0,
            _ => 8.0,
        };
        setbacks.into_iter().map(|setback| setback.max(least)).collect()
    }

    /// A pocket is where it is wished, one may turn left, and there is room.
    fn find_pockets(&mut self, node: usize) {
        let arms = self.nodes[node].arms.clone();
        let turns = matches!(
            self.nodes[node].control,
            Control::Signals | Control::AllWayStop | Control::MinorStop | Control::MinorYield
        );
        for arm in &arms {
            let street = &self.streets[arm.street];
            let (wide, length) = match street.street.middle {
                Middle::Line => (false, 0.0),
                Middle::Painted(width) | Middle::Raised(width) => (width >= 2.6, street.middle.length()),
            };
            let left = arms.iter().any(|other| {
                let outbound = self.streets[other.street].profile(other.end.inbound().other());
                outbound.lanes > 0 && super::junctions::turn(arm.heading, other.heading) > super::junctions::STRAIGHT
            });
            let both = street.street.forward > 0 && street.street.backward > 0;
            let other_end = street.stop[1 - arm.end as usize];
            let room = length - street.setback[0] - street.setback[1] > if other_end { 75.0 } else { 50.0 };
            let pocket = street.street.left_pocket && turns && arms.len() > 2 && wide && left && both && room;
            self.streets[arm.street].pocket[arm.end as usize] = pocket && self.nodes[node].stops();
        }
    }
}

impl NetNode {
    pub(super) fn new(at: Point, control: Control) -> Self {
        Self { at, control, arms: Vec::new(), driveway: false, lot: false }
    }

    /// The radius of the curbs at its corners (m).
    pub(super) fn corner(&self) -> f64 {
        match self.control {
            _ if self.driveway => DRIVEWAY,
            _ if self.lot => IN_LOT,
            Control::Free => BEND,
            _ => CORNER,
        }
    }

    /// Whether lanes keep apart before it.
    fn stops(&self) -> bool {
        !self.driveway && !self.lot && self.control != Control::Merge
    }

    /// Whether ways lead through it, rather than lanes on from one street to another.
    pub(super) fn is_junction(&self, arms: usize) -> bool {
        arms > 2 || (arms == 2 && self.control != Control::Free)
    }

    pub(super) fn has_crosswalks(&self, arms: usize) -> bool {
        self.is_junction(arms) && self.stops()
    }
}
