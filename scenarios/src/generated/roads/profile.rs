//! What lies beside the middle of a street, one way: lanes, a bike lane, a strip to park, the curb.

use super::{Middle, Street};

/// From the outer side of what is driven on to the curb (m).
pub(super) const GUTTER: f64 = 0.4;
pub(super) const BIKE_LANE: f64 = 1.7;
pub(super) const PARKING: f64 = 2.3;
/// Where people walk, outside the curb.
pub(super) const WALK: f64 = 2.0;
/// The widest lane to turn left from.
const WIDEST_POCKET: f64 = 3.5;
/// A strip narrower than this (m) is taken by the pocket whole.
const REST: f64 = 0.4;

/// The two ways of a street.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Direction {
    Forward,
    Backward,
}

impl Direction {
    pub(super) const BOTH: [Self; 2] = [Self::Forward, Self::Backward];

    pub(super) fn other(self) -> Self {
        match self {
            Self::Forward => Self::Backward,
            Self::Backward => Self::Forward,
        }
    }
}

/// One way of a street; all offsets (m) are from its middle to the right as one drives.
#[derive(Clone, Copy, Debug)]
pub(super) struct Profile {
    pub(super) lanes: usize,
    pub(super) lane_width: f64,
    /// Where the first lane's left side lies.
    pub(super) inner: f64,
    bike_lane: bool,
    parking: bool,
}

impl Profile {
    pub(super) fn new(street: &Street, direction: Direction) -> Self {
        let (lanes, other) = match direction {
            Direction::Forward => (street.forward, street.backward),
            Direction::Backward => (street.backward, street.forward),
        };
        let inner = match street.middle {
            Middle::Painted(width) | Middle::Raised(width) if lanes > 0 && other > 0 => 0.5 * width,
            _ => 0.0,
        };
        Self {
            lanes,
            lane_width: street.lane_width,
            inner,
            bike_lane: street.bike_lane && lanes > 0,
            parking: street.parking && lanes > 0,
        }
    }

    /// The centre line of the lane at `slot`.
    pub(super) fn lane(&self, slot: usize) -> f64 {
        self.inner + (slot as f64 + 0.5) * self.lane_width
    }

    /// The line on the right of the lane at `slot`.
    pub(super) fn line(&self, slot: usize) -> f64 {
        self.inner + (slot as f64 + 1.0) * self.lane_width
    }

    /// The right side of the lanes for cars.
    pub(super) fn outer(&self) -> f64 {
        self.inner + self.lanes as f64 * self.lane_width
    }

    pub(super) fn bike_lane(&self) -> Option<f64> {
        self.bike_lane.then(|| self.outer() + 0.5 * BIKE_LANE)
    }

    /// Where the strip to park begins, if there is one.
    pub(super) fn parking_line(&self) -> Option<f64> {
        self.parking.then(|| self.outer() + if self.bike_lane { BIKE_LANE } else { 0.0 })
    }

    pub(super) fn curb(&self) -> f64 {
        let bikes = if self.bike_lane { BIKE_LANE } else { 0.0 };
        let parked = if self.parking { PARKING } else { GUTTER };
        self.outer() + bikes + parked
    }

    /// The lane to turn left from: its width, the offset of its centre line (to the left of the first lane), and of its left side.
    pub(super) fn pocket(&self) -> (f64, f64, f64) {
        let strip = 2.0 * self.inner;
        let width = if strip < WIDEST_POCKET + REST { strip } else { WIDEST_POCKET };
        (width, self.inner - 0.5 * width, self.inner - width)
    }
}
