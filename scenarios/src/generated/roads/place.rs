//! An arm of a junction, with what is laid of its street.

use world::geometry::{Point, Pose};

use super::LaneIndex;
use super::net::{Net, NetArm, NetStreet};
use super::profile::Direction;
use super::streets::Side;

/// An arm with what is laid of its street.
pub(super) struct Place<'a> {
    pub(super) arm: NetArm,
    pub(super) inbound: Vec<LaneIndex>,
    pub(super) outbound: Vec<LaneIndex>,
    pub(super) bike_in: Option<LaneIndex>,
    pub(super) bike_out: Option<LaneIndex>,
    /// Whether the first of `inbound` is a pocket.
    pub(super) pocket: bool,
    /// Where the curbs beside it end and begin: on the right of who comes, and of who leaves.
    pub(super) curb_ends: (Pose, Pose),
    pub(super) net: &'a Net,
}

impl<'a> Place<'a> {
    pub(super) fn new(net: &'a Net, arm: NetArm, sides: &[[Side; 2]]) -> Self {
        let inbound_side = &sides[arm.street][arm.end.inbound() as usize];
        let outbound_side = &sides[arm.street][arm.end.inbound().other() as usize];
        let ((inbound, bike_in), (outbound, bike_out)) = (inbound_side.inbound(), outbound_side.outbound());
        let (pocket, curb_ends) = (inbound_side.pocket.is_some(), (inbound_side.curb[1], outbound_side.curb[0]));
        Self { arm, inbound, outbound, bike_in, bike_out, pocket, curb_ends, net }
    }

    pub(super) fn street(&self) -> &'a NetStreet {
        &self.net.streets[self.arm.street]
    }

    fn curb(&self, direction: Direction) -> f64 {
        self.street().profile(direction).curb()
    }

    /// How far to the left and to the right of its middle the curbs lie, as one looks outward.
    pub(super) fn curbs(&self) -> (f64, f64) {
        let inbound = self.arm.end.inbound();
        (self.curb(inbound), self.curb(inbound.other()))
    }

    /// The pose on the middle so far (m) before the stop line, looking outward.
    pub(super) fn outward(&self, before_stop: f64) -> Pose {
        let street = self.street();
        street.outward(self.arm.end, street.setback(self.arm.end) + before_stop)
    }

    /// The point to the left of that.
    pub(super) fn at(&self, before_stop: f64, left: f64) -> Point {
        self.outward(before_stop).to_world(Point::new(0.0, left))
    }
}
