//! Roads of generated scenes: what is wished for ([`Town`]), and what is laid from it ([`Roads`]): lanes that traffic moves on, and
//! the map that says all that a real one says of them.
//!
//! ```text
//! family ──▶ Town (nodes, streets, lots) ──▶ lay ──▶ Roads (lanes, junctions, crossings, walks, bays; map) ──▶ traffic
//! ```
//!
//! | module | what |
//! | --- | --- |
//! | `lay` | all of it in order |
//! | `net`, `lots`, `merge` | where everything lies: middles of streets, arms of nodes, how far from them streets end; lots as more streets |
//! | `profile`, `sections`, `streets`, `walks` | a street across and along, its lanes, lines, curbs, bays and sidewalks |
//! | `place`, `junctions`, `roundabout`, `curbs`, `crosswalks`, `conflicts` | what lies at nodes |
//! | `builder` | lanes of traffic and of the map, side by side |

mod builder;
mod conflicts;
mod crosswalks;
mod curbs;
mod junctions;
mod lay;
mod lots;
mod merge;
mod net;
mod place;
mod profile;
mod roundabout;
mod sections;
mod streets;
#[cfg(test)]
mod tests;
mod walks;

use std::rc::Rc;

use world::geometry::{Point, Point3, Pose};
use world::map::{Map, MapId};

pub(super) use lay::lay;

use super::curve::{Curve, Piece};

/// What is wished for: nodes joined by streets, as a graph in the plane.
#[derive(Clone, Debug, Default)]
pub(super) struct Town {
    pub(super) nodes: Vec<Node>,
    pub(super) streets: Vec<Street>,
    pub(super) lots: Vec<Lot>,
}

/// A place where streets meet or end.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    pub(super) at: Point,
    pub(super) control: Control,
}

/// Who goes first at a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Control {
    /// Nobody meets anybody: the end of a street, or a bend between two.
    Free,
    /// Lights.
    Signals,
    /// A stop sign on every arm.
    AllWayStop,
    /// A stop sign on the arms of streets that are not `major`.
    MinorStop,
    /// The arms of streets that are not `major` give way (yield).
    MinorYield,
    /// A ring of this radius (m, of its lane's centre line); who is on it goes first. Streets have one lane each way.
    Roundabout { radius: f64 },
    /// A ramp (the street that is not `major`, one lane forward) joins the outermost lane of a major street that goes on beyond the node.
    Merge,
}

/// A street between two nodes.
#[derive(Clone, Debug)]
pub(super) struct Street {
    pub(super) from: usize,
    pub(super) to: usize,
    /// Its middle runs straight from node to node, unless these pieces say otherwise: then it begins at `from`, heads for `heading`, and
    /// the node `to` is put where it ends.
    pub(super) bend: Option<(f64, Vec<Piece>)>,
    /// Lanes from `from` to `to`, on the right of the middle; and back.
    pub(super) forward: usize,
    pub(super) backward: usize,
    pub(super) lane_width: f64,
    pub(super) speed_limit_mph: f64,
    pub(super) middle: Middle,
    /// A lane to turn left from, in the space of the middle, before a junction at its end: needs `Middle::Painted` or `Raised` as wide as a lane.
    pub(super) left_pocket: bool,
    /// A lane for bicycles outside the lanes for cars, each way that has any.
    pub(super) bike_lane: bool,
    /// A strip to park beside the curb, each way that has lanes.
    pub(super) parking: bool,
    /// Sidewalks on both sides, and crosswalks at its junctions.
    pub(super) walks: bool,
    /// Goes first where signs rule.
    pub(super) major: bool,
    /// Crosswalks between its ends, as shares of its length.
    pub(super) crosswalks: Vec<f64>,
}

/// What lies between the two directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Middle {
    /// One line.
    Line,
    /// A painted strip of a width (m).
    Painted(f64),
    /// A raised strip of a width (m), with road edges of type median.
    Raised(f64),
}

/// A parking lot beside a street: aisles with rows of bays, joined to the street by a driveway.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lot {
    pub(super) street: usize,
    /// Where its driveway meets the street, as a share of the street's length.
    pub(super) along: f64,
    /// On the right of the street, seen from `from`; else on the left.
    pub(super) right: bool,
    /// Aisles, and bays on each side of one.
    pub(super) aisles: usize,
    pub(super) bays: usize,
}

pub(super) type LaneIndex = usize;

/// What is laid.
#[derive(Clone, Debug, Default)]
pub(super) struct Roads {
    pub(super) map: Map,
    pub(super) lanes: Vec<Lane>,
    /// Where streets meet: at nodes of the town, where driveways meet streets, and in lots.
    pub(super) junctions: Vec<Junction>,
    /// For each street its lanes by section: `streets[street].forward[slot]` lists them in driving order, with the ways across driveways
    /// between them; slot 0 is next to the middle. After those of the town come the lanes of lots.
    pub(super) streets: Vec<Laid>,
    pub(super) crossings: Vec<Crossing>,
    /// Where people walk along the streets.
    pub(super) walks: Vec<Rc<Curve>>,
    pub(super) bays: Vec<Bay>,
}

#[derive(Clone, Debug, Default)]
pub(super) struct Laid {
    pub(super) forward: Vec<Vec<LaneIndex>>,
    pub(super) backward: Vec<Vec<LaneIndex>>,
}

/// A lane that traffic moves on: a section of a street, or a way through a junction.
#[derive(Clone, Debug)]
pub(super) struct Lane {
    pub(super) id: MapId,
    pub(super) course: Curve,
    /// The course has no larger curvature (1/m).
    pub(super) sharpest: f64,
    pub(super) width: f64,
    /// m/s; what cyclists keep to on bike lanes.
    pub(super) limit: f64,
    pub(super) bike: bool,
    pub(super) exits: Vec<LaneIndex>,
    pub(super) entries: Vec<LaneIndex>,
    /// The lane beside it that goes the same way over the same section.
    pub(super) left: Option<LaneIndex>,
    pub(super) right: Option<LaneIndex>,
    /// In a junction: which, and how it turns.
    pub(super) way: Option<Way>,
    /// A junction's stop line is at its end: no lane is changed here.
    pub(super) solid: bool,
    /// In a lot, or leading into or out of one.
    pub(super) lot: bool,
    /// Where crossings cross it: the crossing, and the stations on this lane between which somebody on it is in the way.
    pub(super) crossed: Vec<(usize, f64, f64)>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Way {
    pub(super) junction: usize,
    /// The arm it comes from, and that it leads to: indices into [`Junction::arms`]. A way into or out of a roundabout has its own arm twice;
    /// a piece of the ring that passes in front of an arm has that one twice, the piece that follows has that one and the next.
    pub(super) from: usize,
    pub(super) to: usize,
    pub(super) turn: Turn,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Turn {
    Left,
    Straight,
    Right,
}

/// Streets that meet.
#[derive(Clone, Debug)]
pub(super) struct Junction {
    /// The town's node; where driveways meet streets and in lots, numbers after those.
    pub(super) node: usize,
    pub(super) control: Control,
    /// Counter-clockwise.
    pub(super) arms: Vec<Arm>,
    /// All lanes through it.
    pub(super) ways: Vec<LaneIndex>,
    /// Pairs of ways that come too close: see [`Conflict`].
    pub(super) conflicts: Vec<Conflict>,
}

#[derive(Clone, Debug)]
pub(super) struct Arm {
    pub(super) street: usize,
    /// Outward from the junction (rad).
    pub(super) heading: f64,
    pub(super) major: bool,
    /// The lanes that end at its stop line.
    pub(super) inbound: Vec<LaneIndex>,
}

/// Two ways of a junction that come from different lanes and, between these stations, lie less than a vehicle's width and a bit (2.8 m) apart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Conflict {
    pub(super) one: LaneIndex,
    pub(super) other: LaneIndex,
    pub(super) one_span: (f64, f64),
    pub(super) other_span: (f64, f64),
    /// They end in the same lane.
    pub(super) merging: bool,
}

/// Where people cross: a crosswalk.
#[derive(Clone, Debug)]
pub(super) struct Crossing {
    /// From curb to curb, and 2 m further at both ends.
    pub(super) course: Rc<Curve>,
    /// The junction and arm whose traffic it crosses, if it is at one.
    pub(super) arm: Option<(usize, usize)>,
}

/// Where a vehicle may stand parked.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bay {
    pub(super) pose: Pose,
    pub(super) length: f64,
    pub(super) width: f64,
    /// For a bay beside a street: the lane beside it, and the station there.
    pub(super) beside: Option<(LaneIndex, f64)>,
}

pub(super) fn flat(point: Point) -> Point3 {
    Point3::new(point.x, point.y, 0.0)
}
