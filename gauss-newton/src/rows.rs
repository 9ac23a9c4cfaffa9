//! The residual rows: a number for each, term by term.

use super::constants::{LANE_STEPS, NEIGHBORS, STEPS, TERMS, Term};

/// The most safety rows: every neighbor at every look at the lane; there are fewer key steps.
pub const SAFETY_ROWS: usize = LANE_STEPS * NEIGHBORS;

/// A number for each residual row, term by term.
#[derive(Clone, Debug, PartialEq)]
pub struct Rows {
    /// [`Term::Speed`].
    pub speed: [f64; STEPS],
    /// [`Term::Acceleration`].
    pub acceleration: [f64; STEPS],
    /// [`Term::Jerk`]: to each step from the one before it.
    pub jerk: [f64; STEPS],
    /// [`Term::Steering`].
    pub steering: [f64; STEPS],
    /// [`Term::SteeringChange`], likewise.
    pub steering_change: [f64; STEPS],
    /// [`Term::LanePosition`], x.
    pub lane_x: [f64; LANE_STEPS],
    /// [`Term::LanePosition`], y.
    pub lane_y: [f64; LANE_STEPS],
    /// [`Term::LanePosition`], beyond the lane's edge.
    pub lane_edge: [f64; LANE_STEPS],
    /// [`Term::LaneHeading`].
    pub lane_heading: [f64; LANE_STEPS],
    /// [`Term::RedLight`].
    pub red_light: [f64; STEPS],
    /// [`Term::Safety`]: as many as [`Extent::safety`] says.
    pub safety: [f64; SAFETY_ROWS],
    /// Which of these rows there are.
    pub extent: Extent,
}

/// Which rows there are: those of jerk and steering change from one step on, and the first of the lane's edge and of safety.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Extent {
    /// The first step whose change from the control before it is costed: 0 if it is known what the vehicle does now, else 1.
    pub first_change: usize,
    /// How many rows the lane's edge has: one for each look at the lane, or none.
    pub lane_edge: usize,
    /// How many safety rows there are.
    pub safety: usize,
}

impl Rows {
    /// All zero.
    pub const ZERO: Self = Self {
        speed: [0.0; STEPS],
        acceleration: [0.0; STEPS],
        jerk: [0.0; STEPS],
        steering: [0.0; STEPS],
        steering_change: [0.0; STEPS],
        lane_x: [0.0; LANE_STEPS],
        lane_y: [0.0; LANE_STEPS],
        lane_edge: [0.0; LANE_STEPS],
        lane_heading: [0.0; LANE_STEPS],
        red_light: [0.0; STEPS],
        safety: [0.0; SAFETY_ROWS],
        extent: Extent { first_change: 1, lane_edge: 0, safety: 0 },
    };

    /// The rows of each term, in the order of the weights; lane position has three parts.
    #[must_use]
    #[inline(always)]
    pub fn parts(&self) -> [(Term, &[f64]); TERMS + 2] {
        let Extent { first_change, lane_edge, safety } = self.extent;
        [
            (Term::Speed, &self.speed),
            (Term::Acceleration, &self.acceleration),
            (Term::Jerk, &self.jerk[first_change..]),
            (Term::Steering, &self.steering),
            (Term::SteeringChange, &self.steering_change[first_change..]),
            (Term::LanePosition, &self.lane_x),
            (Term::LanePosition, &self.lane_y),
            (Term::LanePosition, &self.lane_edge[..lane_edge]),
            (Term::LaneHeading, &self.lane_heading),
            (Term::RedLight, &self.red_light),
            (Term::Safety, &self.safety[..safety]),
        ]
    }

    /// [`Rows::parts`], to be changed.
    #[inline(always)]
    fn parts_mut(&mut self) -> [(Term, &mut [f64]); TERMS + 2] {
        let Extent { first_change, lane_edge, safety } = self.extent;
        [
            (Term::Speed, &mut self.speed),
            (Term::Acceleration, &mut self.acceleration),
            (Term::Jerk, &mut self.jerk[first_change..]),
            (Term::Steering, &mut self.steering),
            (Term::SteeringChange, &mut self.steering_change[first_change..]),
            (Term::LanePosition, &mut self.lane_x),
            (Term::LanePosition, &mut self.lane_y),
            (Term::LanePosition, &mut self.lane_edge[..lane_edge]),
            (Term::LaneHeading, &mut self.lane_heading),
            (Term::RedLight, &mut self.red_light),
            (Term::Safety, &mut self.safety[..safety]),
        ]
    }

    /// The sum of squares of each of [`Rows::parts`], the first ones of jerk and steering change included: all of them side by side, for a
    /// sum waits for its last number.
    #[inline(always)]
    pub(super) fn squares(&self) -> [(Term, f64); TERMS + 2] {
        let (mut long, mut short) = ([0.0; 6], [0.0; 4]);
        let add = |sum: &mut f64, c: f64| *sum += c * c;
        for t in 0..STEPS {
            add(&mut long[0], self.speed[t]);
            add(&mut long[1], self.acceleration[t]);
            add(&mut long[2], self.jerk[t]);
            add(&mut long[3], self.steering[t]);
            add(&mut long[4], self.steering_change[t]);
            add(&mut long[5], self.red_light[t]);
        }
        for i in 0..LANE_STEPS {
            add(&mut short[0], self.lane_x[i]);
            add(&mut short[1], self.lane_y[i]);
            add(&mut short[2], self.lane_heading[i]);
            add(&mut short[3], self.lane_edge[i]);
        }
        let edge = if self.extent.lane_edge > 0 { short[3] } else { 0.0 };
        let safety = self.safety[..self.extent.safety].iter().map(|c| c * c).sum();
        [
            (Term::Speed, long[0]),
            (Term::Acceleration, long[1]),
            (Term::Jerk, long[2]),
            (Term::Steering, long[3]),
            (Term::SteeringChange, long[4]),
            (Term::LanePosition, short[0]),
            (Term::LanePosition, short[1]),
            (Term::LanePosition, edge),
            (Term::LaneHeading, short[2]),
            (Term::RedLight, long[5]),
            (Term::Safety, safety),
        ]
    }

    /// `self = weight^2 * (rows + more)`, term by term.
    #[inline(always)]
    pub(super) fn set_weighted(&mut self, weights: &[f64; TERMS], rows: &Self, more: Option<&Self>) {
        self.extent = rows.extent;
        let mores = more.map(Self::parts);
        for (i, ((term, into), (_, from))) in self.parts_mut().into_iter().zip(rows.parts()).enumerate() {
            let squared = weights[term as usize] * weights[term as usize];
            match &mores {
                None => into.iter_mut().zip(from).for_each(|(into, from)| *into = squared * from),
                Some(mores) => {
                    into.iter_mut().zip(from).zip(mores[i].1).for_each(|((into, a), b)| *into = squared * (a + b));
                }
            }
        }
    }
}
